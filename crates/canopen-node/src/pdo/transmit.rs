//! TPDOs: assembling one, in either context, and when it is sent: with SYNC, on a change, by its timer.

use super::MappedObject;
use crate::COUNTER_AND_DATE;
use crate::frame::Frame;
use crate::shared::{PdoRegisters, Shared};
use crate::time::{MILLISECOND, elapsed};

/// The frame of a TPDO that exists and carries anything. `value` gives the actual value of each object; none leaves
/// the frame out.
pub(crate) fn assemble(registers: &PdoRegisters, mut value: impl FnMut(MappedObject) -> Option<u64>) -> Option<Frame> {
    let id = registers.id()?;
    if registers.count() == 0 {
        return None;
    }
    let (mut data, mut bits) = (0u64, 0u32);
    for object in registers.mapping() {
        let value = value(object)? & object.mask();
        data |= value.checked_shl(bits).unwrap_or(0);
        bits = bits.saturating_add(object.bits());
    }
    Some(Frame::cut(id, data.to_le_bytes(), bits.div_ceil(8).min(8) as u8))
}

/// SYNCs that a synchronous TPDO follows; the receive interrupt.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Synchronous {
    syncs: u8,
    /// The SYNC that its start value names has come.
    begun: bool,
    generation: u8,
    /// Last frame of type 0.
    sent: Option<Frame>,
}

impl Synchronous {
    /// The frame that TPDO `pdo` sends with this SYNC, whose `counter` is 0 where it has none; `frame` assembles it.
    pub(crate) fn next(
        &mut self,
        shared: &Shared,
        registers: &PdoRegisters,
        pdo: u8,
        counter: u8,
        frame: impl FnOnce() -> Option<Frame>,
    ) -> Option<Frame> {
        if COUNTER_AND_DATE && self.generation != registers.generation() {
            *self = Self { generation: registers.generation(), ..Self::default() };
        }
        match registers.transmission() {
            0 => {
                let frame = frame()?;
                let due = shared.take_event(pdo) || self.sent != Some(frame);
                self.sent = Some(frame);
                due.then_some(frame)
            }
            every @ 1..=240 => {
                let start = if shared.sync_overflow() == 0 { 0 } else { registers.sync_start() };
                if COUNTER_AND_DATE && start != 0 && !self.begun {
                    if counter != start {
                        return None;
                    }
                    (self.begun, self.syncs) = (true, 0);
                }
                self.syncs = self.syncs.saturating_add(1);
                let due = self.syncs >= every;
                if !due {
                    return None;
                }
                self.syncs = 0;
                frame()
            }
            _ => None,
        }
    }
}

/// Inhibit time, event timer and last content of one TPDO of type 254 or 255; the task.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Timers {
    /// Instant of the last transmission, while the inhibit time is not over.
    inhibited: Option<u32>,
    /// Instant from which the event timer counts.
    counting: Option<u32>,
    sent: Option<Frame>,
    generation: u8,
}

impl Timers {
    /// Frame that TPDO `pdo` sends now: `frame`, which is assembled where the inhibit time is over, if it is another
    /// one than the last, an event has happened or the timer has expired. Called in every poll in OPERATIONAL.
    pub(crate) fn next(
        &mut self,
        shared: &Shared,
        registers: &PdoRegisters,
        pdo: u8,
        now: u32,
        frame: impl FnOnce() -> Option<Frame>,
    ) -> Option<Frame> {
        if registers.transmission() < 254 || registers.id().is_none() {
            *self = Self::default();
            return None;
        }
        if self.generation != registers.generation() {
            *self = Self { generation: registers.generation(), ..Self::default() };
        }
        let inhibit = u32::from(registers.inhibit()).saturating_mul(100);
        if self.inhibited.is_some_and(|since| elapsed(now, since) >= inhibit) {
            self.inhibited = None;
        }
        let period = u32::from(registers.event_timer()).saturating_mul(MILLISECOND);
        let since = *self.counting.get_or_insert(now);
        let expired = period != 0 && elapsed(now, since) >= period;
        if period == 0 {
            // Without a timer the instant would grow older than time reaches back.
            self.counting = None;
        }
        if self.inhibited.is_some() {
            return None;
        }
        let frame = frame()?;
        if !(expired || shared.has_event(pdo) || self.sent != Some(frame)) {
            return None;
        }
        shared.take_event(pdo);
        self.sent = Some(frame);
        self.inhibited = (inhibit != 0).then_some(now);
        // The timer runs from the last transmission, whatever caused it.
        self.counting = Some(now);
        Some(frame)
    }

    /// Outside OPERATIONAL nothing is counted.
    pub(crate) fn stop(&mut self) {
        *self = Self { generation: self.generation, ..Self::default() };
    }
}
