//! Loads and stores of one register, of two, of several, and exclusive ones.

use crate::bus::Bus;
use crate::cpu::Cpu;
use crate::cpu::operation::{Done, Execute, Operands, Part, Rest, Trap};

/// Transfer of an access: the numbers of the narrow encodings with a register offset.
pub(in crate::cpu) const STR: u8 = 0;
pub(in crate::cpu) const STRH: u8 = 1;
pub(in crate::cpu) const STRB: u8 = 2;
pub(in crate::cpu) const LDRSB: u8 = 3;
pub(in crate::cpu) const LDR: u8 = 4;
pub(in crate::cpu) const LDRH: u8 = 5;
pub(in crate::cpu) const LDRB: u8 = 6;
pub(in crate::cpu) const LDRSH: u8 = 7;

pub(in crate::cpu) const fn loads(what: u8) -> bool {
    what >= LDRSB
}

/// Formation of the address: register n and constant; n and register m shifted left; a constant alone; n changed before
/// or after.
pub(in crate::cpu) const OFFSET: u8 = 0;
pub(in crate::cpu) const INDEXED: u8 = 1;
pub(in crate::cpu) const ABSOLUTE: u8 = 2;
pub(in crate::cpu) const BEFORE: u8 = 3;
pub(in crate::cpu) const AFTER: u8 = 4;

/// The address, and what n becomes where it changes.
#[inline(always)]
fn addressed<B: Bus, const ADDRESS: u8>(cpu: &Cpu<B>, o: Operands) -> (u32, u32) {
    match ADDRESS {
        OFFSET => (cpu.get(o.n).wrapping_add(o.immediate), 0),
        INDEXED => (cpu.get(o.n).wrapping_add(cpu.get(o.m) << (o.immediate & 3)), 0),
        ABSOLUTE => (o.immediate, 0),
        BEFORE => {
            let address = cpu.get(o.n).wrapping_add(o.immediate);
            (address, address)
        }
        _ => (cpu.get(o.n), cpu.get(o.n).wrapping_add(o.immediate)),
    }
}

/// Loads d, or stores it.
fn access<B: Bus, const WHAT: u8, const ADDRESS: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    match access_at_once::<B, WHAT, ADDRESS>(cpu, o) {
        true => cpu.next(rest),
        false => access_elsewhere::<B, WHAT, ADDRESS>(cpu, o, rest),
    }
}

/// The same where memory answers at once; false where it does not, and nothing has changed.
#[inline(always)]
pub(super) fn access_at_once<B: Bus, const WHAT: u8, const ADDRESS: u8>(cpu: &mut Cpu<B>, o: Operands) -> bool {
    let (address, changed) = addressed::<B, ADDRESS>(cpu, o);
    if loads(WHAT) {
        let loaded = match WHAT {
            LDR => cpu.load_at_once::<4>(address),
            LDRH | LDRSH => cpu.load_at_once::<2>(address),
            _ => cpu.load_at_once::<1>(address),
        };
        let Some(value) = loaded else { return false };
        set_loaded::<B, WHAT>(cpu, o.d, value);
    } else {
        let value = cpu.get(o.d);
        let stored = match WHAT {
            STR => cpu.store_at_once::<4>(address, value),
            STRH => cpu.store_at_once::<2>(address, value & 0xffff),
            _ => cpu.store_at_once::<1>(address, value & 0xff),
        };
        if !stored {
            return false;
        }
    }
    write_back::<B, ADDRESS>(cpu, o.n, changed);
    true
}

/// The same of memory that does not answer at once, and unaligned; by itself, so that the usual way saves no registers.
#[inline(never)]
pub(super) fn access_elsewhere<B: Bus, const WHAT: u8, const ADDRESS: u8>(
    cpu: &mut Cpu<B>,
    o: Operands,
    rest: Rest<B>,
) -> Done {
    cpu.at(rest);
    let (address, changed) = addressed::<B, ADDRESS>(cpu, o);
    let value = cpu.get(o.d);
    match WHAT {
        STR => cpu.store::<4>(address, value)?,
        STRH => cpu.store::<2>(address, value & 0xffff)?,
        STRB => cpu.store::<1>(address, value & 0xff)?,
        _ => {
            let value = match WHAT {
                LDR => cpu.load::<4>(address)?,
                LDRH | LDRSH => cpu.load::<2>(address)?,
                _ => cpu.load::<1>(address)?,
            };
            set_loaded::<B, WHAT>(cpu, o.d, value);
        }
    }
    write_back::<B, ADDRESS>(cpu, o.n, changed);
    cpu.go_on(rest)
}

#[inline(always)]
fn set_loaded<B: Bus, const WHAT: u8>(cpu: &mut Cpu<B>, register: u8, value: u32) {
    match WHAT {
        LDR => cpu.set_any(register, value),
        LDRSH => cpu.set(register, value as u16 as i16 as u32),
        LDRSB => cpu.set(register, value as u8 as i8 as u32),
        _ => cpu.set(register, value),
    }
}

#[inline(always)]
fn write_back<B: Bus, const ADDRESS: u8>(cpu: &mut Cpu<B>, base: u8, value: u32) {
    if ADDRESS == BEFORE || ADDRESS == AFTER {
        cpu.set_any(base, value);
    }
}

/// Loads the program counter.
pub(in crate::cpu) fn load_branch<B: Bus, const ADDRESS: u8>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let base = if ADDRESS == ABSOLUTE { 0 } else { cpu.get(o.n) };
    let offset = if ADDRESS == INDEXED { cpu.get(o.m) << (o.immediate & 3) } else { o.immediate };
    let changed = base.wrapping_add(offset);
    let target = cpu.load_aligned::<4>(if ADDRESS == AFTER { base } else { changed })?;
    write_back::<B, ADDRESS>(cpu, o.n, changed);
    cpu.branch_exchange(target)?;
    cpu.jumped(rest)
}

pub(in crate::cpu) fn load_branch_of<B: Bus>(address: u8) -> Execute<B> {
    match address {
        OFFSET => load_branch::<B, OFFSET>,
        INDEXED => load_branch::<B, INDEXED>,
        ABSOLUTE => load_branch::<B, ABSOLUTE>,
        BEFORE => load_branch::<B, BEFORE>,
        _ => load_branch::<B, AFTER>,
    }
}

/// Part that an access can be in a pair.
pub(in crate::cpu) const fn access_part(what: u8, address: u8) -> Part {
    match (what, address) {
        (LDR, OFFSET) => Part::Load,
        (STR, OFFSET) => Part::Store,
        _ => Part::None,
    }
}

/// The function of an access that only decoding knows.
pub(in crate::cpu) fn access_of<B: Bus>(what: u8, address: u8) -> Execute<B> {
    macro_rules! address {
        ($what:ident) => {
            match address {
                OFFSET => access::<B, $what, OFFSET>,
                INDEXED => access::<B, $what, INDEXED>,
                ABSOLUTE => access::<B, $what, ABSOLUTE>,
                BEFORE => access::<B, $what, BEFORE>,
                _ => access::<B, $what, AFTER>,
            }
        };
    }
    match what {
        STR => address!(STR),
        STRH => address!(STRH),
        STRB => address!(STRB),
        LDRSB => address!(LDRSB),
        LDR => address!(LDR),
        LDRH => address!(LDRH),
        LDRB => address!(LDRB),
        _ => address!(LDRSH),
    }
}

/// x of the functions for several registers: the base changes; the block lies below it.
pub(in crate::cpu) const CHANGES: u32 = 1;
pub(in crate::cpu) const BELOW: u32 = 2;

/// Lowest address of a block of `bytes`, and what the base becomes.
#[inline(always)]
pub(super) fn block(base: u32, bytes: u32, below: bool) -> (u32, u32) {
    let end = base.wrapping_sub(bytes);
    if below { (end, end) } else { (base, base.wrapping_add(bytes)) }
}

/// LDM, POP.
pub(in crate::cpu) fn load_several<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    let bytes = 4 * o.immediate.count_ones();
    let (address, changed) = block(cpu.get(o.n), bytes, u32::from(o.x) & BELOW != 0);
    let at_once = if address & 3 == 0 { cpu.bus.block(address, bytes) } else { None };
    let Some(memory) = at_once else { return load_several_elsewhere(cpu, o, rest) };
    let mut words = memory.chunks_exact(4).filter_map(|word| word.first_chunk()).map(|word| u32::from_le_bytes(*word));
    // A multiple of 4, whichever register it is. Where the base is loaded as well, that is what it becomes.
    if u32::from(o.x) & CHANGES != 0 {
        cpu.r[usize::from(o.n & 15)] = changed;
    }
    let mut list = o.immediate & 0x7fff;
    while list != 0
        && let Some(word) = words.next()
    {
        cpu.r[(list.trailing_zeros() & 15) as usize] = word;
        list &= list - 1;
    }
    match words.next() {
        Some(target) => {
            cpu.at(rest);
            cpu.branch_exchange(target)?;
            cpu.jumped(rest)
        }
        None => cpu.next(rest),
    }
}

/// The same of other memory. Registers are loaded as they come; the base keeps its value where a load faults.
#[inline(never)]
fn load_several_elsewhere<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let base = cpu.get(o.n);
    let (mut address, changed) = block(base, 4 * o.immediate.count_ones(), u32::from(o.x) & BELOW != 0);
    let mut list = o.immediate & 0x7fff;
    let mut of_base = None;
    while list != 0 {
        let register = list.trailing_zeros() as u8;
        list &= list - 1;
        let value = cpu.load_aligned::<4>(address)?;
        address = address.wrapping_add(4);
        if register == o.n {
            of_base = Some(value);
        } else {
            cpu.set(register, value);
        }
    }
    let target = if o.immediate >> 15 != 0 { Some(cpu.load_aligned::<4>(address)?) } else { None };
    if let Some(value) = of_base {
        cpu.set_any(o.n, value);
    } else if u32::from(o.x) & CHANGES != 0 {
        cpu.set_any(o.n, changed);
    }
    let Some(target) = target else { return cpu.go_on(rest) };
    cpu.branch_exchange(target)?;
    cpu.jumped(rest)
}

/// STM, PUSH.
pub(in crate::cpu) fn store_several<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    match store_several_at_once(cpu, o) {
        true => cpu.next(rest),
        false => store_several_elsewhere(cpu, o, rest),
    }
}

/// The same where memory takes it at once; false where it does not, and nothing has changed.
#[inline(always)]
pub(super) fn store_several_at_once<B: Bus>(cpu: &mut Cpu<B>, o: Operands) -> bool {
    let bytes = 4 * o.immediate.count_ones();
    let (address, changed) = block(cpu.get(o.n), bytes, u32::from(o.x) & BELOW != 0);
    let unusual = address & 3 != 0 || cpu.code.changes_block(address, bytes);
    let at_once = if unusual { None } else { cpu.bus.block_mut(address, bytes) };
    let Some(memory) = at_once else { return false };
    let mut list = o.immediate;
    for word in memory.chunks_exact_mut(4) {
        word.copy_from_slice(&cpu.r[(list.trailing_zeros() & 15) as usize].to_le_bytes());
        list &= list.wrapping_sub(1);
    }
    if u32::from(o.x) & CHANGES != 0 {
        cpu.set_any(o.n, changed);
    }
    true
}

/// The same of other memory.
#[inline(never)]
pub(super) fn store_several_elsewhere<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let (mut address, changed) = block(cpu.get(o.n), 4 * o.immediate.count_ones(), u32::from(o.x) & BELOW != 0);
    let mut list = o.immediate;
    while list != 0 {
        let register = list.trailing_zeros() as u8;
        list &= list - 1;
        cpu.store_aligned::<4>(address, cpu.get(register))?;
        address = address.wrapping_add(4);
    }
    if u32::from(o.x) & CHANGES != 0 {
        cpu.set_any(o.n, changed);
    }
    cpu.go_on(rest)
}

/// x of the functions for two registers: the base changes; the offset counts before.
pub(in crate::cpu) const PRE: u32 = 2;

fn pair_address<B: Bus>(cpu: &Cpu<B>, o: Operands) -> (u32, u32) {
    let base = cpu.get(o.n);
    let changed = base.wrapping_add(o.immediate);
    (if u32::from(o.x) & PRE != 0 { changed } else { base }, changed)
}

/// LDRD to d and m.
pub(in crate::cpu) fn ldrd<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let (address, changed) = pair_address(cpu, o);
    let first = cpu.load_aligned::<4>(address)?;
    let second = cpu.load_aligned::<4>(address.wrapping_add(4))?;
    if u32::from(o.x) & CHANGES != 0 {
        cpu.set_any(o.n, changed);
    }
    cpu.set(o.d, first);
    cpu.set(o.m, second);
    cpu.go_on(rest)
}

/// LDRD from an address that decoding knows.
pub(in crate::cpu) fn ldrd_absolute<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let first = cpu.load_aligned::<4>(o.immediate)?;
    let second = cpu.load_aligned::<4>(o.immediate.wrapping_add(4))?;
    cpu.set(o.d, first);
    cpu.set(o.m, second);
    cpu.go_on(rest)
}

/// STRD from d and m.
pub(in crate::cpu) fn strd<B: Bus>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let (address, changed) = pair_address(cpu, o);
    cpu.store_aligned::<4>(address, cpu.get(o.d))?;
    cpu.store_aligned::<4>(address.wrapping_add(4), cpu.get(o.m))?;
    if u32::from(o.x) & CHANGES != 0 {
        cpu.set_any(o.n, changed);
    }
    cpu.go_on(rest)
}

/// LDREX: loads, and marks the address as its own. With a single core the monitor has no address (B.3.4.5 leaves its
/// size open).
pub(in crate::cpu) fn load_exclusive<B: Bus, const BYTES: u32>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let address = cpu.get(o.n).wrapping_add(o.immediate);
    let value = cpu.load_aligned::<BYTES>(address)?;
    cpu.exclusive = true;
    cpu.set(o.d, value);
    cpu.go_on(rest)
}

/// STREX: stores m if the mark is still there; d becomes 0 then, 1 otherwise.
pub(in crate::cpu) fn store_exclusive<B: Bus, const BYTES: u32>(cpu: &mut Cpu<B>, o: Operands, rest: Rest<B>) -> Done {
    cpu.at(rest);
    let address = cpu.get(o.n).wrapping_add(o.immediate);
    if address & (BYTES - 1) != 0 {
        return cpu.trap(rest, Trap::Unaligned);
    }
    let own = std::mem::take(&mut cpu.exclusive);
    if own {
        let value = cpu.get(o.m) & (u32::MAX >> (32 - 8 * BYTES));
        cpu.store_aligned::<BYTES>(address, value)?;
    }
    cpu.set(o.d, u32::from(!own));
    cpu.go_on(rest)
}

pub(in crate::cpu) fn clear_exclusive<B: Bus>(cpu: &mut Cpu<B>, _: Operands, rest: Rest<B>) -> Done {
    cpu.exclusive = false;
    cpu.next(rest)
}
