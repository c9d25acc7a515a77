//! Heartbeat: producing one's own and missing those of others. CiA 301 sections 7.2.8.2 and 7.5.2.13, 7.5.2.14
//! (objects 1016h, 1017h); the task.
//!
//! Node guarding, its predecessor, is not supported: it needs remote frames.

use super::parameters::CONSUMERS;
use super::shared::Shared;
use super::time::{MILLISECOND, elapsed};

/// Heartbeat producer: time of the next heartbeat.
#[derive(Debug, Default)]
pub(super) struct Producer {
    /// 1017h, ms.
    period: u16,
    /// Time at which the last one was due; none before the first.
    last: Option<u32>,
}

impl Producer {
    pub(super) fn period(&self) -> u16 {
        self.period
    }

    /// The first heartbeat of the new period comes at once.
    pub(super) fn set_period(&mut self, period: u16) {
        *self = Self { period, last: None };
    }

    /// The boot-up message counts as the first.
    pub(super) fn booted(&mut self, now: u32) {
        self.last = Some(now);
    }

    /// Returns `true` if a heartbeat is to be sent now. Late polls do not shift the following ones, unless a whole
    /// period was missed.
    pub(super) fn is_due(&mut self, now: u32) -> bool {
        if self.period == 0 {
            self.last = None;
            return false;
        }
        let period = u32::from(self.period).saturating_mul(MILLISECOND);
        let Some(last) = self.last else {
            self.last = Some(now);
            return true;
        };
        let late = elapsed(now, last);
        if late < period {
            return false;
        }
        self.last = Some(if late < period.saturating_mul(2) { last.wrapping_add(period) } else { now });
        true
    }
}

/// A change in what is heard of a monitored node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Change {
    Lost {
        consumer: u8,
        node: u8,
    },
    Back {
        consumer: u8,
        node: u8,
    },
    /// End of monitoring of a node that was lost.
    Dismissed {
        consumer: u8,
    },
}

/// Monitored nodes that are lost.
#[derive(Debug, Default)]
pub(super) struct Consumers {
    lost: [bool; CONSUMERS],
}

impl Consumers {
    /// The next change. Monitoring begins with the first heartbeat that is heard.
    pub(super) fn poll(&mut self, shared: &Shared, now: u32) -> Option<Change> {
        for ((consumer, lost), number) in shared.consumers.iter().zip(&mut self.lost).zip(0..) {
            let Some(node) = consumer.node() else {
                if core::mem::take(lost) {
                    return Some(Change::Dismissed { consumer: number });
                }
                continue;
            };
            let limit = u32::from(consumer.limit()).saturating_mul(MILLISECOND);
            match consumer.heard().get() {
                Some(heard) if elapsed(now, heard) > limit => {
                    // Forgotten, so that the instant does not grow older than time reaches back; the next one brings
                    // the node back.
                    consumer.heard().forget();
                    if !core::mem::replace(lost, true) {
                        return Some(Change::Lost { consumer: number, node });
                    }
                }
                Some(_) if core::mem::take(lost) => return Some(Change::Back { consumer: number, node }),
                _ => {}
            }
        }
        None
    }

    pub(super) fn restart(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heartbeats_keep_their_period_when_polls_are_late() {
        let mut producer = Producer::default();
        producer.set_period(100);
        let start = u32::MAX - 50_000;
        let at = |offset: u32| start.wrapping_add(offset);
        assert!(producer.is_due(at(0)));
        assert!(!producer.is_due(at(99_999)));
        assert!(producer.is_due(at(130_000)));
        assert!(!producer.is_due(at(199_999)));
        assert!(producer.is_due(at(200_000)));
        // Two were missed: one is sent, not a burst.
        assert!(producer.is_due(at(550_000)));
        assert!(!producer.is_due(at(550_001)));
        assert!(producer.is_due(at(650_000)));
    }

    #[test]
    fn a_monitored_node_is_lost_once_and_comes_back_once() {
        let shared = Shared::new();
        let mut consumers = Consumers::default();
        let [_, monitored, ..] = &shared.consumers;
        monitored.set(7 << 16 | 50);
        assert_eq!(consumers.poll(&shared, 1_000_000), None);
        monitored.heard().note(1_000_000);
        assert_eq!(consumers.poll(&shared, 1_050_000), None);
        assert_eq!(consumers.poll(&shared, 1_050_001), Some(Change::Lost { consumer: 1, node: 7 }));
        assert_eq!(consumers.poll(&shared, 9_000_000), None);
        monitored.heard().note(9_000_000);
        assert_eq!(consumers.poll(&shared, 9_000_000), Some(Change::Back { consumer: 1, node: 7 }));
        assert_eq!(consumers.poll(&shared, 9_050_000), None);
    }
}
