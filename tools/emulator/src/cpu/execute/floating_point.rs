//! The floating-point unit: arithmetic, comparison, conversion, moves, loads and stores.

use super::load_store::{BELOW, CHANGES, block};
use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::float::{self, Rounding};
use crate::cpu::operation::{Done, Execute, Operands, Rest, Trap};

impl<B: Bus> Cpu<B> {
    /// Every instruction of the unit begins with this, or with `ready_first`.
    #[inline(always)]
    fn use_floating_point(&mut self) -> Result<(), Trap> {
        if self.floating_ready { Ok(()) } else { self.check_floating_point() }
    }

    #[inline(always)]
    fn float(&self, register: u8) -> u32 {
        self.s[usize::from(register & 31)]
    }

    #[inline(always)]
    fn set_float(&mut self, register: u8, bits: u32) {
        self.s[usize::from(register & 31)] = bits;
    }
}

/// An instruction that found the unit not ready: prepares it, and executes it by itself.
#[cold]
#[inline(never)]
pub(super) fn ready_first<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>, execute: Execute<B>) -> Done {
    cpu.at(rest);
    cpu.check_floating_point()?;
    execute(cpu, o, &[])
}

/// Operations of three registers: the numbers that decoding and execution agree on.
pub(in crate::cpu) const VMLA: u8 = 0;
pub(in crate::cpu) const VMLS: u8 = 1;
pub(in crate::cpu) const VNMLS: u8 = 2;
pub(in crate::cpu) const VNMLA: u8 = 3;
pub(in crate::cpu) const VMUL: u8 = 4;
pub(in crate::cpu) const VNMUL: u8 = 5;
pub(in crate::cpu) const VADD: u8 = 6;
pub(in crate::cpu) const VSUB: u8 = 7;
pub(in crate::cpu) const VDIV: u8 = 8;
pub(in crate::cpu) const VFNMS: u8 = 10;
pub(in crate::cpu) const VFNMA: u8 = 11;
pub(in crate::cpu) const VFMA: u8 = 12;
pub(in crate::cpu) const VFMS: u8 = 13;

fn three<B: Bus, const OPERATION: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    match three_at_once::<B, OPERATION>(cpu, o) {
        true => cpu.next(rest),
        false => three_exactly::<B, OPERATION>(cpu, o, rest),
    }
}

/// The same where the host's result is the unit's; false where it may not be, and nothing has changed.
#[inline(always)]
pub(super) fn three_at_once<B: Bus, const OPERATION: u8>(cpu: &mut Cpu<B>, o: Operands) -> bool {
    let (d, n, m, status) = (cpu.float(o.d), cpu.float(o.n), cpu.float(o.m), cpu.floating);
    let result = match OPERATION {
        VMUL => float::multiply_at_once(n, m, status),
        VNMUL => float::multiply_at_once(n, m, status).map(float::negate),
        VADD => float::add_at_once(n, m, status),
        VSUB => float::subtract_at_once(n, m, status),
        VDIV => float::divide_at_once(n, m, status),
        VMLA => float::multiply_at_once(n, m, status).and_then(|product| float::add_at_once(d, product, status)),
        _ => None,
    };
    match result {
        Some(result) if cpu.floating_ready => cpu.set_float(o.d, result),
        _ => return false,
    }
    true
}

/// The same in general; by itself, so that the usual way saves no registers.
#[inline(never)]
pub(super) fn three_exactly<B: Bus, const OPERATION: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, three_exactly::<B, OPERATION>);
    }
    let (d, n, m) = (cpu.float(o.d), cpu.float(o.n), cpu.float(o.m));
    let status = &mut cpu.floating;
    let result = match OPERATION {
        VMLA | VMLS | VNMLS | VNMLA => {
            // Rounded twice, unlike VFMA and its like.
            let product = float::multiply(n, m, status);
            let product = if OPERATION == VMLS || OPERATION == VNMLA { float::negate(product) } else { product };
            let d = if OPERATION == VNMLS || OPERATION == VNMLA { float::negate(d) } else { d };
            float::add(d, product, status)
        }
        VMUL => float::multiply(n, m, status),
        VNMUL => float::negate(float::multiply(n, m, status)),
        VADD => float::add(n, m, status),
        VSUB => float::subtract(n, m, status),
        VDIV => float::divide(n, m, status),
        VFMA => float::multiply_add(d, n, m, status),
        VFMS => float::multiply_add(d, float::negate(n), m, status),
        VFNMS => float::multiply_add(float::negate(d), n, m, status),
        _ => float::multiply_add(float::negate(d), float::negate(n), m, status),
    };
    cpu.set_float(o.d, result);
    cpu.next(rest)
}

pub(in crate::cpu) fn three_of<B: Bus>(operation: u8) -> Option<Execute<B>> {
    Some(match operation {
        VMLA => three::<B, VMLA>,
        VMLS => three::<B, VMLS>,
        VNMLS => three::<B, VNMLS>,
        VNMLA => three::<B, VNMLA>,
        VMUL => three::<B, VMUL>,
        VNMUL => three::<B, VNMUL>,
        VADD => three::<B, VADD>,
        VSUB => three::<B, VSUB>,
        VDIV => three::<B, VDIV>,
        VFNMS => three::<B, VFNMS>,
        VFNMA => three::<B, VFNMA>,
        VFMA => three::<B, VFMA>,
        VFMS => three::<B, VFMS>,
        _ => return None,
    })
}

/// VMOV of a constant.
pub(in crate::cpu) fn vmov_constant<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vmov_constant);
    }
    cpu.set_float(o.d, o.immediate);
    cpu.next(rest)
}

/// VMOV, VABS, VNEG: bits of m, of which `immediate` are cleared and x of the sign exchanged.
pub(in crate::cpu) fn vmov<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !vmov_at_once(cpu, o) {
        return ready_first(cpu, o, rest, vmov);
    }
    cpu.next(rest)
}

/// The same if the unit is ready; false if it is not, and nothing has changed.
#[inline(always)]
pub(super) fn vmov_at_once<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> bool {
    if cpu.floating_ready {
        let bits = cpu.float(o.m) & !o.immediate ^ u32::from(o.x) << 31;
        cpu.set_float(o.d, bits);
    }
    cpu.floating_ready
}

pub(in crate::cpu) fn vsqrt<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vsqrt);
    }
    let root = float::square_root(cpu.float(o.m), &mut cpu.floating);
    cpu.set_float(o.d, root);
    cpu.next(rest)
}

/// VCMP, with zero where `immediate` says so; VCMPE with x.
pub(in crate::cpu) fn vcmp<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vcmp);
    }
    compare(cpu, o);
    cpu.next(rest)
}

/// The comparison alone.
#[inline(always)]
pub(super) fn compare<B: Bus>(cpu: &mut Cpu<B>, o: Operands) {
    let second = if o.immediate != 0 { 0 } else { cpu.float(o.m) };
    float::compare(cpu.float(o.d), second, o.x != 0, &mut cpu.floating);
}

/// x of the conversions: without sign; 16 bits; towards zero; the upper half-word; from single precision.
pub(in crate::cpu) const UNSIGNED: u32 = 1;
pub(in crate::cpu) const NARROW: u32 = 2;
pub(in crate::cpu) const TOWARDS_ZERO: u32 = 4;
pub(in crate::cpu) const TOP: u32 = 1;
pub(in crate::cpu) const TO_HALF: u32 = 2;

/// VCVT, VCVTR to integers and fixed point of `immediate` bits behind the point.
pub(in crate::cpu) fn vcvt_to_fixed<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vcvt_to_fixed);
    }
    let x = u32::from(o.x);
    let bits = if x & NARROW != 0 { 16 } else { 32 };
    let rounding = (x & TOWARDS_ZERO != 0).then_some(Rounding::Zero);
    let value = cpu.float(o.m);
    let result = float::to_fixed(value, bits, o.immediate, x & UNSIGNED != 0, rounding, &mut cpu.floating);
    cpu.set_float(o.d, result);
    cpu.next(rest)
}

/// VCVT from integers, by the mode, and from fixed point, to nearest.
pub(in crate::cpu) fn vcvt_from_fixed<B: Bus, const INTEGER: bool>(
    cpu: &mut Cpu<B>,
    o: Operands,
    rest: Rest<B>,
) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vcvt_from_fixed::<B, INTEGER>);
    }
    let x = u32::from(o.x);
    let bits = if x & NARROW != 0 { 16 } else { 32 };
    let rounding = (!INTEGER).then_some(Rounding::Nearest);
    let value = cpu.float(o.m);
    let result = float::from_fixed(value, bits, o.immediate, x & UNSIGNED != 0, rounding, &mut cpu.floating);
    cpu.set_float(o.d, result);
    cpu.next(rest)
}

/// VCVTB, VCVTT.
pub(in crate::cpu) fn vcvt_half<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vcvt_half);
    }
    let x = u32::from(o.x);
    let at = if x & TOP != 0 { 16 } else { 0 };
    let value = cpu.float(o.m);
    let result = match x & TO_HALF {
        0 => float::from_half(value >> at & 0xffff, &mut cpu.floating),
        _ => {
            let half = float::to_half(value, &mut cpu.floating);
            cpu.float(o.d) & !(0xffff << at) | half << at
        }
    };
    cpu.set_float(o.d, result);
    cpu.next(rest)
}

/// VMOV to core register d from n.
pub(in crate::cpu) fn to_core<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, to_core);
    }
    let bits = cpu.float(o.n);
    cpu.set(o.d, bits);
    cpu.next(rest)
}

/// VMOV to n from core register d.
pub(in crate::cpu) fn from_core<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, from_core);
    }
    let bits = cpu.get(o.d);
    cpu.set_float(o.n, bits);
    cpu.next(rest)
}

/// VMOV to core registers d and x from m and the next.
pub(in crate::cpu) fn two_to_core<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, two_to_core);
    }
    let (low, high) = (cpu.float(o.m), cpu.float(o.m + 1));
    cpu.set(o.d, low);
    cpu.set(o.x, high);
    cpu.next(rest)
}

/// VMOV to m and the next from core registers d and x.
pub(in crate::cpu) fn two_from_core<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, two_from_core);
    }
    let (low, high) = (cpu.get(o.d), cpu.get(o.x));
    cpu.set_float(o.m, low);
    cpu.set_float(o.m + 1, high);
    cpu.next(rest)
}

/// VMRS.
pub(in crate::cpu) fn vmrs<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vmrs);
    }
    let bits = cpu.floating.bits();
    cpu.set(o.d, bits);
    cpu.next(rest)
}

/// VMRS of the flags, to the core's.
pub(in crate::cpu) fn vmrs_flags<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vmrs_flags);
    }
    take_flags(cpu);
    cpu.next(rest)
}

/// The flags alone.
#[inline(always)]
pub(super) fn take_flags<B: Bus>(cpu: &mut Cpu<B>) {
    let bits = cpu.floating.bits();
    (cpu.negative, cpu.zero) = (bits >> 31 & 1 != 0, bits >> 30 & 1 != 0);
    (cpu.carry, cpu.overflow) = (bits >> 29 & 1 != 0, bits >> 28 & 1 != 0);
}

pub(in crate::cpu) fn vmsr<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if !cpu.floating_ready {
        return ready_first(cpu, o, rest, vmsr);
    }
    cpu.floating = float::Status::from_bits(cpu.get(o.d));
    cpu.next(rest)
}

/// Address of VLDR and VSTR: n and `immediate`; with 15 the latter alone.
fn address<B: Bus>(cpu: &Cpu<B>, o: Operands) -> u32 {
    if o.n == 15 { o.immediate } else { cpu.get(o.n).wrapping_add(o.immediate) }
}

/// VLDR of x registers.
pub(in crate::cpu) fn vldr<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if vldr_at_once(cpu, o) { cpu.next(rest) } else { vldr_elsewhere(cpu, o, rest) }
}

/// The same of one register where memory answers at once; false where it does not, and nothing has changed.
#[inline(always)]
pub(super) fn vldr_at_once<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> bool {
    if o.x == 1
        && cpu.floating_ready
        && let Some(bits) = cpu.load_at_once::<4>(address(cpu, o))
    {
        cpu.set_float(o.d, bits);
        return true;
    }
    false
}

/// The same in general; by itself, so that the usual way saves no registers.
#[inline(never)]
pub(super) fn vldr_elsewhere<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    cpu.use_floating_point()?;
    let at = address(cpu, o);
    if o.x == 2 {
        let low = cpu.load_aligned::<4>(at)?;
        let high = cpu.load_aligned::<4>(at.wrapping_add(4))?;
        cpu.set_float(o.d, low);
        cpu.set_float(o.d + 1, high);
        return cpu.go_on(rest);
    }
    let bits = cpu.load_aligned::<4>(at)?;
    cpu.set_float(o.d, bits);
    cpu.go_on(rest)
}

/// VSTR of x registers.
pub(in crate::cpu) fn vstr<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    if vstr_at_once(cpu, o) { cpu.next(rest) } else { vstr_elsewhere(cpu, o, rest) }
}

/// The same of one register where memory takes it at once; false where it does not, and nothing has changed.
#[inline(always)]
pub(super) fn vstr_at_once<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> bool {
    o.x == 1 && cpu.floating_ready && cpu.store_at_once::<4>(address(cpu, o), cpu.float(o.d))
}

/// The same in general; by itself, so that the usual way saves no registers.
#[inline(never)]
pub(super) fn vstr_elsewhere<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    cpu.use_floating_point()?;
    let at = address(cpu, o);
    for i in 0..o.x {
        cpu.store_aligned::<4>(at.wrapping_add(4 * u32::from(i)), cpu.float(o.d + i))?;
    }
    cpu.go_on(rest)
}

/// VLDM, VPOP: m registers from d on; x as for LDM.
pub(in crate::cpu) fn vldm<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    cpu.use_floating_point()?;
    let (start, changed) = block(cpu.get(o.n), o.immediate, u32::from(o.x) & BELOW != 0);
    let mut words = [0; 32];
    let words = words.get_mut(..usize::from(o.m)).unwrap_or_default();
    cpu.load_words(start, words)?;
    for (register, word) in cpu.s.iter_mut().skip(usize::from(o.d & 31)).zip(words) {
        *register = *word;
    }
    if u32::from(o.x) & CHANGES != 0 {
        cpu.set_any(o.n, changed);
    }
    cpu.go_on(rest)
}

/// VSTM, VPUSH.
pub(in crate::cpu) fn vstm<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    cpu.use_floating_point()?;
    let (start, changed) = block(cpu.get(o.n), o.immediate, u32::from(o.x) & BELOW != 0);
    let (words, first) = (cpu.s, usize::from(o.d & 31));
    cpu.store_words(start, words.get(first..first + usize::from(o.m)).unwrap_or_default())?;
    if u32::from(o.x) & CHANGES != 0 {
        cpu.set_any(o.n, changed);
    }
    cpu.go_on(rest)
}
