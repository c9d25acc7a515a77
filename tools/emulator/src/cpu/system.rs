//! The core's own registers: system control block, floating-point context, identification, and the way to NVIC, SysTick
//! and DWT.
//!
//! ARM DDI 0403, B3.2 to B3.5. MPU, ITM, breakpoints and debug control are not modelled: using them ends the run.

use super::interrupts::{BUS_FAULT, MEMORY_FAULT, NMI, PENDING_SERVICE, SYSTICK, USAGE_FAULT};
use super::operation::Trap;
use super::{Cpu, End, Origin};
use crate::bus::{Bus, Width};

/// Offsets from 0xe000_e000.
const CONTROL_BLOCK: u32 = 0xe000_e000;
/// Bits of CCR, SCR, FPCCR.
const UNALIGNED_TRAP: u32 = 1 << 3;
const DIVISION_TRAP: u32 = 1 << 4;
const STACK_ALIGN: u32 = 1 << 9;
const SLEEP_ON_EXIT: u32 = 1 << 1;
const EVENT_ON_PENDING: u32 = 1 << 4;
const AUTOMATIC: u32 = 1 << 31;
const LAZY: u32 = 1 << 30;
const DEFERRED: u32 = 1;

#[derive(Clone)]
pub(super) struct System {
    /// VTOR.
    pub vectors: u32,
    /// CFSR, HFSR, BFAR.
    pub faults: u32,
    pub hard_fault: u32,
    pub bus_fault_address: u32,
    memory_fault_address: u32,
    auxiliary_control: u32,
    sleep: u32,
    configuration: u32,
    /// SHCSR's enable bits.
    handlers: u32,
    coprocessors: u32,
    floating_context: u32,
    floating_place: u32,
    /// FPDSCR.
    pub default_modes: u32,
}

impl Default for System {
    fn default() -> Self {
        Self {
            vectors: 0,
            faults: 0,
            hard_fault: 0,
            bus_fault_address: 0,
            memory_fault_address: 0,
            auxiliary_control: 0,
            sleep: 0,
            // Reset values of the Cortex-M4: stacks aligned to 8 bytes, lazy stacking on.
            configuration: STACK_ALIGN,
            handlers: 0,
            coprocessors: 0,
            floating_context: AUTOMATIC | LAZY,
            floating_place: 0,
            default_modes: 0,
        }
    }
}

impl System {
    pub fn traps_unaligned(&self) -> bool {
        self.configuration & UNALIGNED_TRAP != 0
    }

    pub fn traps_division(&self) -> bool {
        self.configuration & DIVISION_TRAP != 0
    }

    pub fn aligns_stack(&self) -> bool {
        self.configuration & STACK_ALIGN != 0
    }

    /// CCR.NONBASETHRDENA.
    pub fn allows_early_return(&self) -> bool {
        self.configuration & 1 != 0
    }

    pub fn sleeps_on_exit(&self) -> bool {
        self.sleep & SLEEP_ON_EXIT != 0
    }

    pub fn event_on_pending(&self) -> bool {
        self.sleep & EVENT_ON_PENDING != 0
    }

    /// Returns `true` if a fault has a handler of its own.
    pub fn handles(&self, fault: u16) -> bool {
        let bit = match fault {
            MEMORY_FAULT => 16,
            BUS_FAULT => 17,
            USAGE_FAULT => 18,
            _ => return false,
        };
        self.handlers >> bit & 1 != 0
    }

    /// CPACR for both halves of the unit: 1 is privileged only, 3 full access.
    pub fn floating_point_allowed(&self, privileged: bool) -> bool {
        match self.coprocessors >> 20 & 0xf {
            0xf => true,
            0x5 => privileged,
            _ => false,
        }
    }

    pub fn lazy(&self) -> bool {
        self.floating_context & LAZY != 0
    }

    /// FPCCR.ASPEN: using the unit marks the context.
    pub fn marks_use(&self) -> bool {
        self.floating_context & AUTOMATIC != 0
    }

    pub fn is_deferred(&self) -> bool {
        self.floating_context & DEFERRED != 0
    }

    /// Leaves floating-point registers where they are until the unit is used; what ran is noted as FPCCR has it.
    pub fn defer_floating_point(&mut self, place: u32, priority: i16, handler: bool, unprivileged: bool) {
        self.floating_place = place;
        let hard_fault_ready = u32::from(priority > -1) << 4;
        let kept = self.floating_context & (AUTOMATIC | LAZY);
        self.floating_context =
            kept | hard_fault_ready | u32::from(!handler) << 3 | u32::from(unprivileged) << 1 | DEFERRED;
    }

    /// Place to which deferred registers belong, once.
    pub fn take_deferred(&mut self) -> Option<u32> {
        let place = self.is_deferred().then_some(self.floating_place);
        self.floating_context &= !DEFERRED;
        place
    }
}

impl<B: Bus> Cpu<B> {
    /// A load from the core's own registers.
    pub(super) fn read_private(&mut self, address: u32, width: Width) -> Result<u32, Trap> {
        if !self.privileged() {
            self.trapped_address = address;
            return Err(Trap::Data);
        }
        let word = self.private_register(address & !3)?;
        let shift = 8 * (address & 3);
        Ok(match width {
            Width::Byte => word >> shift & 0xff,
            Width::Half => word >> shift & 0xffff,
            Width::Word => word,
        })
    }

    fn private_register(&mut self, address: u32) -> Result<u32, Trap> {
        let awake = self.now - self.slept;
        let offset = address.wrapping_sub(CONTROL_BLOCK);
        let known = match address {
            0xe000_1000..0xe000_2000 => self.counter.read(awake, address & 0xfff),
            0xe000_e010..0xe000_e020 => {
                let read = self.timer.read(self.now, address & 0xf);
                self.schedule();
                read
            }
            0xe000_e100..0xe000_e600 => self.interrupts.read(offset),
            0xe000_e000..0xe000_f000 => self.control_register(offset),
            _ => None,
        };
        known.ok_or_else(|| self.unmodelled(format!("a load from {}", name(address))))
    }

    fn control_register(&self, offset: u32) -> Option<u32> {
        let (system, interrupts) = (&self.system, &self.interrupts);
        let bit = |set: bool, bit: u32| u32::from(set) << bit;
        let pending = |number: u16| interrupts.system_pending >> number & 1 != 0;
        Some(match offset {
            // Four times 32 interrupt lines.
            0x004 => 3,
            0x008 => system.auxiliary_control,
            // Cortex-M4 r0p1.
            0xd00 => 0x410f_c241,
            0xd04 => {
                let (next, external) = interrupts.next();
                let base = interrupts.active_count() <= 1;
                bit(pending(NMI), 31)
                    | bit(pending(PENDING_SERVICE), 28)
                    | bit(pending(SYSTICK), 26)
                    | bit(external, 22)
                    | u32::from(next) << 12
                    | bit(base, 11)
                    | u32::from(self.exception)
            }
            0xd08 => system.vectors,
            0xd0c => 0xfa05_0000 | interrupts.group() << 8,
            0xd10 => system.sleep,
            0xd14 => system.configuration,
            0xd18 => interrupts.system_priority_word(0),
            0xd1c => interrupts.system_priority_word(1),
            0xd20 => interrupts.system_priority_word(2),
            0xd24 => {
                let active = |number: u16, at: u32| bit(interrupts.is_active(number), at);
                system.handlers
                    | active(MEMORY_FAULT, 0)
                    | active(BUS_FAULT, 1)
                    | active(USAGE_FAULT, 3)
                    | active(11, 7)
                    | active(12, 8)
                    | active(PENDING_SERVICE, 10)
                    | active(SYSTICK, 11)
                    | bit(pending(USAGE_FAULT), 12)
                    | bit(pending(MEMORY_FAULT), 13)
                    | bit(pending(BUS_FAULT), 14)
                    | bit(pending(11), 15)
            }
            0xd28 => system.faults,
            0xd2c => system.hard_fault,
            // No debug event.
            0xd30 => 0,
            0xd34 => system.memory_fault_address,
            0xd38 => system.bus_fault_address,
            // Auxiliary faults: none.
            0xd3c => 0,
            // ID_PFR0, ID_PFR1, ID_DFR0 of the Cortex-M4.
            0xd40 => 0x30,
            0xd44 => 0x200,
            0xd48 => 0x10_0000,
            0xd88 => system.coprocessors,
            // An MPU of eight regions, switched off.
            0xd90 => 0x800,
            0xd94 => 0,
            // DHCSR: no debugger is attached.
            0xdf0 => 0,
            0xdfc => bit(self.counter.tracing(), 24),
            0xf34 => system.floating_context,
            0xf38 => system.floating_place,
            0xf3c => system.default_modes,
            // MVFR0, MVFR1: single precision, fused multiply-accumulate, half-precision conversion.
            0xf40 => 0x1011_0021,
            0xf44 => 0x1100_0011,
            _ => return None,
        })
    }

    /// A store to the core's own registers.
    pub(super) fn write_private(&mut self, address: u32, width: Width, value: u32) -> Result<(), Trap> {
        if !self.privileged() {
            self.trapped_address = address;
            return Err(Trap::Data);
        }
        let offset = address.wrapping_sub(CONTROL_BLOCK);
        let bytes = match width {
            Width::Byte => 1,
            Width::Half => 2,
            Width::Word => 4,
        };
        let awake = self.now - self.slept;
        let known = match offset {
            // Priorities may be stored in parts, fault status cleared in parts.
            0x400..0x600 => {
                let each = (0..bytes).zip(value.to_le_bytes());
                each.for_each(|(i, byte)| self.interrupts.set_priority((offset - 0x400 + i) as usize, byte));
                true
            }
            0xd18..0xd24 => {
                let each = (0..bytes).zip(value.to_le_bytes());
                each.for_each(|(i, byte)| self.interrupts.set_system_priority((offset - 0xd14 + i) as usize, byte));
                true
            }
            0xd28..0xd2c => {
                self.system.faults &= !(value << (8 * (offset & 3)));
                true
            }
            _ if width != Width::Word => false,
            0x010..0x020 => self.timer.write(self.now, offset & 0xf, value),
            0x100..0x400 => self.interrupts.write(offset, value),
            _ if address & !0xfff == 0xe000_1000 => self.counter.write(awake, address & 0xfff, value),
            _ => self.set_control_register(offset, value)?,
        };
        if !known {
            return Err(self.unmodelled(format!("a store of {value:#x} to {}", name(address))));
        }
        self.interrupts.update();
        self.prepare_floating_point();
        self.schedule();
        Ok(())
    }

    /// False where there is no such register, or what it would switch on is not modelled.
    fn set_control_register(&mut self, offset: u32, value: u32) -> Result<bool, Trap> {
        let awake = self.now - self.slept;
        let system = &mut self.system;
        match offset {
            // ACTLR: interruption of long instructions, write buffer and folding; none of them is in this model's
            // timing.
            0x008 if value & !7 == 0 => system.auxiliary_control = value,
            0xd04 => self.set_interrupt_control(value),
            0xd08 => system.vectors = value & !0x7f,
            0xd0c => return self.set_application_interrupt(value),
            0xd10 => system.sleep = value & 0x16,
            0xd14 => system.configuration = value & 0x31b,
            // Only the enable bits: setting an exception active or pending here is for operating systems that switch
            // contexts by it.
            0xd24 if value & !0x7_0000 == 0 => system.handlers = value,
            0xd2c => system.hard_fault &= !value,
            0xd30 => {}
            0xd34 => system.memory_fault_address = value,
            0xd38 => system.bus_fault_address = value,
            0xd88 => system.coprocessors = value & 0xf0_0000,
            0xd94 if value & 1 == 0 => {}
            0xdfc if value & !(1 << 24) == 0 => self.counter.trace(awake, value != 0),
            0xf00 => self.interrupts.pend(super::interrupts::EXTERNAL + (value & 0x7f) as u16),
            0xf34 => system.floating_context = system.floating_context & 0x15a | value & (AUTOMATIC | LAZY | DEFERRED),
            0xf38 => system.floating_place = value & !7,
            0xf3c => system.default_modes = value & super::float::MODES,
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// ICSR: sets and clears what is pending.
    fn set_interrupt_control(&mut self, value: u32) {
        let bit = |bit: u32| value >> bit & 1 != 0;
        for (set, clear, number) in [(31, 32, NMI), (28, 27, PENDING_SERVICE), (26, 25, SYSTICK)] {
            if bit(set) {
                self.interrupts.pend(number);
                self.pended();
            } else if clear < 32 && bit(clear) {
                self.interrupts.system_pending &= !(1 << number);
            }
        }
    }

    /// AIRCR: needs its key; without it nothing happens.
    fn set_application_interrupt(&mut self, value: u32) -> Result<bool, Trap> {
        if value >> 16 != 0x05fa {
            return Ok(true);
        }
        self.interrupts.set_group(value >> 8);
        if value & 4 != 0 {
            self.end = Some(End::Reset(Origin::Program));
            self.attention = 0;
        }
        // VECTRESET and VECTCLRACTIVE belong to debuggers.
        Ok(value & 3 == 0)
    }
}

/// Name of a register of the core.
fn name(address: u32) -> String {
    let name = match address {
        0xe000_0000..0xe000_1000 => "ITM",
        0xe000_1000..0xe000_2000 => "DWT (but for CYCCNT)",
        0xe000_2000..0xe000_3000 => "FPB",
        0xe000_e010..0xe000_e020 => "SysTick",
        0xe000_e100..0xe000_e500 => "NVIC",
        0xe000_e008 => "ACTLR",
        0xe000_ed0c => "AIRCR",
        0xe000_ed24 => "SHCSR",
        0xe000_ed40..0xe000_ed80 => "an identification register",
        0xe000_ed90..0xe000_edf0 => "MPU",
        0xe000_edf0..0xe000_ee00 => "debug control",
        0xe004_0000..0xe004_1000 => "TPIU",
        0xe004_1000..0xe004_2000 => "ETM",
        0xe00f_f000..0xe010_0000 => "the ROM table",
        _ => "the private peripheral bus",
    };
    format!("{name} at {address:#010x}")
}
