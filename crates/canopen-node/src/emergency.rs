//! EMCY, error register and error history: CiA 301 sections 7.2.7 and 7.5.2.2 to 7.5.2.4 (objects 1001h, 1003h, 1014h,
//! 1015h); the task.

use super::frame::Frame;
use super::parameters::INVALID;
use super::time::elapsed;
use heapless::Deque;

/// Errors that object 1003h remembers.
pub const HISTORY: usize = 8;
/// EMCYs that wait for their inhibit time or for a state that may send them. When they are more, the oldest are
/// dropped and counted.
const PENDING: usize = 8;

/// Codes that the server itself sends.
pub mod code {
    /// The last error is gone.
    pub const RESET: u16 = 0x0000;
    /// The controller is error passive: so many errors that it may not disturb others any more.
    pub const ERROR_PASSIVE: u16 = 0x8120;
    /// A node that is monitored fell silent; the first byte of the manufacturer's field is its node id.
    pub const HEARTBEAT: u16 = 0x8130;
    /// Communication resumed after bus-off.
    pub const BUS_OFF: u16 = 0x8140;
    /// An RPDO was too short and not processed; the first byte is its number, from 1.
    pub const PDO_SHORT: u16 = 0x8210;
    /// An RPDO was too long; its first bytes were processed.
    pub const PDO_LONG: u16 = 0x8220;
    /// SYNC has a counter that object 1019h does not announce, or lacks one. It counts all the same; reported once in
    /// an NMT state, and with each value of 1019h.
    pub const SYNC_LENGTH: u16 = 0x8240;
    /// An RPDO did not arrive within its event timer.
    pub const PDO_DEADLINE: u16 = 0x8250;
}

/// Bits of the error register.
const GENERIC: u8 = 1 << 0;
const COMMUNICATION: u8 = 1 << 4;

/// EMCY producer.
#[derive(Debug, Default)]
pub(super) struct Emergencies {
    /// 1014h.
    pub(super) cob_id: u32,
    /// 1015h, 100 us.
    pub(super) inhibit: u16,
    /// The application's bits of the error register.
    application: u8,
    /// The server's own errors that last, a bit for each: monitored nodes in 0 to 6, error passive in 7, RPDO
    /// deadlines from 8 on, SYNC of another length in 15.
    lasting: u16,
    history: Deque<u32, HISTORY>,
    pending: Deque<[u8; 8], PENDING>,
    dropped: u32,
    inhibited: Option<u32>,
}

/// An error of the server that lasts until its cause is gone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Lasting {
    /// Sub-index of object 1016h less one.
    Heartbeat(u8),
    /// Number of the RPDO, 0 to 3.
    Deadline(u8),
    /// Error passive state of the controller.
    ErrorPassive,
    /// SYNC of another length than object 1019h says.
    SyncLength,
}

impl Lasting {
    const fn bit(self) -> u16 {
        match self {
            Self::Heartbeat(consumer) => 1 << (consumer & 7),
            Self::Deadline(pdo) => 0x100 << (pdo & 7),
            Self::ErrorPassive => 1 << 7,
            Self::SyncLength => 1 << 15,
        }
    }
}

impl Emergencies {
    /// 1001h: the application's bits and the server's, with the generic bit wherever there is any.
    pub(super) fn register(&self) -> u8 {
        let own = if self.lasting != 0 { COMMUNICATION } else { 0 };
        match self.application | own {
            0 => 0,
            errors => errors | GENERIC,
        }
    }

    /// Reports an error, or with [`code::RESET`] the end of one; `application` are the bits of the error register that
    /// the application knows of.
    pub(super) fn report(&mut self, code: u16, application: u8, information: [u8; 5]) {
        self.application = application;
        self.push(code, information);
    }

    /// Reports an error of communication that is over as soon as it is reported.
    pub(super) fn report_once(&mut self, code: u16, first: u8) {
        self.push(code, [first, 0, 0, 0, 0]);
    }

    /// Reports an error of the server that begins; nothing where it lasts already.
    pub(super) fn begin(&mut self, lasting: Lasting, code: u16, first: u8) {
        if self.lasting & lasting.bit() == 0 {
            self.lasting |= lasting.bit();
            self.push(code, [first, 0, 0, 0, 0]);
        }
    }

    /// An error of the server is over; nothing where there was none.
    pub(super) fn end(&mut self, lasting: Lasting) {
        if self.lasting & lasting.bit() != 0 {
            self.lasting &= !lasting.bit();
            self.push(code::RESET, [0; 5]);
        }
    }

    fn push(&mut self, code: u16, information: [u8; 5]) {
        let [low, high] = code.to_le_bytes();
        let [a, b, c, d, e] = information;
        if code != code::RESET {
            if self.history.is_full() {
                self.history.pop_back();
            }
            // It was made room for above.
            let _ = self.history.push_front(u32::from_le_bytes([low, high, a, b]));
        }
        if self.pending.is_full() {
            self.pending.pop_front();
            self.dropped = self.dropped.saturating_add(1);
        }
        let _ = self.pending.push_back([low, high, self.register(), a, b, c, d, e]);
    }

    /// 1003h:0.
    pub(super) fn history_length(&self) -> u8 {
        self.history.len() as u8
    }

    /// 1003h:1 to 8, `entry` 0 to 7, newest first: code, and the first two bytes of the manufacturer's field.
    pub(super) fn history(&self, entry: u8) -> Option<u32> {
        self.history.iter().nth(entry.into()).copied()
    }

    pub(super) fn clear_history(&mut self) {
        self.history.clear();
    }

    /// EMCYs that were dropped because too many waited.
    pub(super) fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Starts anew after a reset of communication: the server's errors are forgotten, the application's and the history
    /// stay.
    pub(super) fn restart(&mut self, cob_id: u32, inhibit: u16) {
        self.lasting = 0;
        self.pending.clear();
        self.inhibited = None;
        self.cob_id = cob_id;
        self.inhibit = inhibit;
    }

    /// The next EMCY, if its time has come.
    pub(super) fn poll(&mut self, now: u32) -> Option<Frame> {
        let inhibit = u32::from(self.inhibit).saturating_mul(100);
        if self.inhibited.is_some_and(|since| elapsed(now, since) >= inhibit) {
            self.inhibited = None;
        }
        if self.inhibited.is_some() {
            return None;
        }
        let data = self.pending.pop_front()?;
        if self.cob_id & INVALID != 0 {
            return None;
        }
        self.inhibited = (inhibit != 0).then_some(now);
        Some(Frame::full((self.cob_id & 0x7FF) as u16, data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_error_is_first_and_the_ninth_is_forgotten() {
        let mut emergencies = Emergencies::default();
        for number in 1..=9u8 {
            emergencies.report(0x5530, 0, [number, 0xAB, 1, 2, 3]);
        }
        assert_eq!(emergencies.history_length(), 8);
        assert_eq!(emergencies.history(0), Some(0xAB09_5530));
        assert_eq!(emergencies.history(7), Some(0xAB02_5530));
        assert_eq!(emergencies.history(8), None);
        assert_eq!(emergencies.dropped(), 1);
    }

    #[test]
    fn the_register_has_the_generic_bit_with_any_error_and_clears_with_the_last() {
        let mut emergencies = Emergencies { cob_id: 0x85, ..Default::default() };
        emergencies.begin(Lasting::Heartbeat(1), code::HEARTBEAT, 3);
        emergencies.begin(Lasting::Heartbeat(1), code::HEARTBEAT, 3);
        emergencies.report(0x6320, 0x20, [0; 5]);
        emergencies.end(Lasting::Heartbeat(1));
        emergencies.report(code::RESET, 0, [0; 5]);
        let sent = core::array::from_fn(|_| *emergencies.poll(0).unwrap().eight().unwrap());
        assert_eq!(
            sent,
            [[0x30, 0x81, 0x11, 3, 0, 0, 0, 0], [0x20, 0x63, 0x31, 0, 0, 0, 0, 0], [0, 0, 0x21, 0, 0, 0, 0, 0], [0; 8]]
        );
        assert_eq!((emergencies.poll(0), emergencies.register()), (None, 0));
        // Ends of errors are not errors.
        assert_eq!(emergencies.history_length(), 2);
    }

    #[test]
    fn the_inhibit_time_delays_and_loses_nothing() {
        let mut emergencies = Emergencies { cob_id: 0x85, inhibit: 10, ..Default::default() };
        emergencies.report(0x1000, 1, [0; 5]);
        emergencies.report(0x2000, 1, [0; 5]);
        assert!(emergencies.poll(u32::MAX - 100).is_some());
        assert!(emergencies.poll(898).is_none());
        assert!(emergencies.poll(899).is_some());
    }
}
