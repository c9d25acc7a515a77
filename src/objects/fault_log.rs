//! Faults on their way to the log that outlives the power, and object 2305h; the task.
//!
//! Two after power-up, one more a minute, eight at a time; none that a reset would give back. Those that come sooner
//! wait, as many as there is room for, and are counted beyond that. A joint that does nothing but fail needs nine years
//! to wear the log's pages out, a supply that comes and goes once a second nineteen days, and with the log nothing else
//! is lost.

use super::program::Program;
use crate::joint::fault::Faults;
use friction_compensation::parameters::fault_log::{LOGGED, LoggedFault};
use heapless::Deque;

/// `true` if this program has the log.
pub const LOGS: bool = !cfg!(all(feature = "little-room", target_os = "none"));

/// Faults that may be written at once.
const MOST: u8 = 8;
/// The same after power-up.
const FIRST: u8 = 2;
/// Time after which one more may be, ms.
const REFILL: u32 = 60_000;
/// A program that has run for so long has its power-up counted, ms.
const COUNTED: u64 = 10_000;
/// Faults that wait.
const WAITING: usize = 8;
/// Bytes of a fault in 2305h:3.
const BYTES: usize = 12;

/// Faults that wait to be written, and how many may be.
#[derive(Debug)]
pub(super) struct FaultLogging {
    left: u8,
    /// Time since which time counts towards the next one, ms; wraps.
    since: u32,
    /// Code, number of the fault, and when it came, s.
    waiting: Deque<(u16, u8, u32), WAITING>,
    missed: u16,
    /// Faults of the last look: what is latched anew is logged, whether or not the bus takes an EMCY of it.
    seen: Faults,
    /// The power-up has been counted, or there was none.
    counted: bool,
}

impl FaultLogging {
    /// Initial state: nothing waits, and nothing may be written yet.
    pub(super) const fn new() -> Self {
        Self { left: 0, since: 0, waiting: Deque::new(), missed: 0, seen: Faults::NONE, counted: true }
    }

    /// State after a start: `powered_up` where the supply came.
    pub(super) fn started(self, powered_up: bool) -> Self {
        Self { left: if powered_up { FIRST } else { 0 }, counted: !powered_up, ..self }
    }

    /// The latched faults at `now` ms: those that were not there before have come.
    pub(super) fn observe(&mut self, latched: Faults, now: u64) {
        let seen = core::mem::replace(&mut self.seen, latched);
        for fault in latched.iter().filter(|fault| !seen.contains(*fault)) {
            self.note(fault.error_code(), fault as u8, now);
        }
    }

    /// A fault has come, at `now` ms; `fault` is its number, 0 for what is none of the joint's.
    pub(super) fn note(&mut self, code: u16, fault: u8, now: u64) {
        if self.waiting.push_back((code, fault, (now / 1_000) as u32)).is_err() {
            self.missed = self.missed.saturating_add(1);
        }
    }

    /// Every millisecond or so: writes one of those that wait, where it may.
    pub(super) fn poll(&mut self, now: u64, program: &mut impl Program) {
        let whole = self.left >= MOST;
        let due = !whole && (now as u32).wrapping_sub(self.since) >= REFILL;
        if whole || due {
            self.since = now as u32;
            self.left += u8::from(due);
        }
        if self.left > 0
            && let Some((code, fault, time)) = self.waiting.pop_front()
        {
            self.left -= 1;
            if !program.log_fault(code, fault, time) {
                self.missed = self.missed.saturating_add(1);
            }
        }
        if !self.counted && now >= COUNTED {
            self.counted = true;
            program.count_power_up();
        }
    }

    /// Faults that are not in the log.
    pub(super) const fn missed(&self) -> u16 {
        self.missed
    }
}

/// Bytes of 2305h:3.
pub(super) fn length(program: &impl Program) -> u32 {
    (program.logged_faults().take(LOGGED).count() * BYTES) as u32
}

/// Fills `out` with bytes of 2305h:3 from `offset` on; false where there are not so many.
pub(super) fn read(program: &impl Program, offset: u32, out: &mut [u8]) -> bool {
    let mut bytes = program.logged_faults().flat_map(|fault| encode(&fault)).skip(offset as usize);
    out.iter_mut().all(|place| bytes.next().map(|byte| *place = byte).is_some())
}

fn encode(fault: &LoggedFault) -> [u8; BYTES] {
    let [a, b] = fault.code.to_le_bytes();
    let [c, d, e, f] = fault.power_up.to_le_bytes();
    let [g, h, i, j] = fault.time.to_le_bytes();
    [a, b, fault.fault, 0, c, d, e, f, g, h, i, j]
}

/// The faults of 2305h:3, the newest first; host.
pub fn decode(bytes: &[u8]) -> impl Iterator<Item = LoggedFault> {
    bytes.as_chunks().0.iter().map(|&[a, b, fault, _, c, d, e, f, g, h, i, j]| LoggedFault {
        code: u16::from_le_bytes([a, b]),
        fault,
        power_up: u32::from_le_bytes([c, d, e, f]),
        time: u32::from_le_bytes([g, h, i, j]),
    })
}
