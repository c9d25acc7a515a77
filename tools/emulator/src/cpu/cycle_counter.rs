//! DWT's cycle counter (ARM DDI 0403, C1.8). Its comparators and its other counters are not modelled.
//!
//! It stands still while the core sleeps, as the core's clock does (RM0440, 6.3.8: sleep stops the CPU clock; no
//! debugger is attached).

#[derive(Clone, Default)]
pub(super) struct CycleCounter {
    /// DEMCR.TRCENA, which switches the whole unit on.
    tracing: bool,
    enabled: bool,
    /// The counter when it stands still; otherwise what to add to the cycles awake.
    held: u32,
}

/// DWT_CTRL: four comparators, cycle counter.
const COMPARATORS: u32 = 4 << 28;

impl CycleCounter {
    fn counts(&self) -> bool {
        self.tracing && self.enabled
    }

    /// `awake`: the core's cycles without those asleep, here and below.
    fn value(&self, awake: u64) -> u32 {
        if self.counts() { self.held.wrapping_add(awake as u32) } else { self.held }
    }

    fn change(&mut self, awake: u64, change: impl FnOnce(&mut Self)) {
        let value = self.value(awake);
        change(self);
        self.held = if self.counts() { value.wrapping_sub(awake as u32) } else { value };
    }

    /// DEMCR.TRCENA.
    pub fn tracing(&self) -> bool {
        self.tracing
    }

    /// Sets DEMCR.TRCENA.
    pub fn trace(&mut self, awake: u64, on: bool) {
        self.change(awake, |counter| counter.tracing = on);
    }

    /// A register, by its offset from 0xe000_1000.
    pub fn read(&self, awake: u64, offset: u32) -> Option<u32> {
        match offset {
            0x0 => Some(COMPARATORS | u32::from(self.enabled)),
            0x4 => Some(self.value(awake)),
            _ => None,
        }
    }

    /// Sets a register; false where there is none, or what it would switch on is not modelled.
    pub fn write(&mut self, awake: u64, offset: u32, value: u32) -> bool {
        match offset {
            0x0 if value & !(1 | COMPARATORS) == 0 => {
                self.change(awake, |counter| counter.enabled = value & 1 != 0);
                true
            }
            0x4 => {
                self.held = if self.counts() { value.wrapping_sub(awake as u32) } else { value };
                true
            }
            // The lock that other cores have; this one ignores it.
            0xfb0 => true,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_cycles_only_while_it_is_switched_on() {
        let mut counter = CycleCounter::default();
        assert!(counter.write(10, 0, 1));
        assert_eq!(counter.read(20, 4), Some(0), "tracing is off");
        counter.trace(30, true);
        assert_eq!(counter.read(37, 4), Some(7));
        assert!(counter.write(40, 4, 100));
        assert_eq!(counter.read(45, 4), Some(105));
        assert!(counter.write(50, 0, 0));
        assert_eq!(counter.read(90, 4), Some(110), "held");
        assert!(!counter.write(0, 0, 1 << 16), "exception tracing is not modelled");
    }
}
