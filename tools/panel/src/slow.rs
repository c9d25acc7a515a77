//! Values that change slowly, read one by one beside the live ones; host.

use bus::client::{ClientError, Network};
use joint_firmware::objects::field::{Actual, Field};
use joint_firmware::objects::settings::Setting;
use jointctl::remote::words::words;
use jointctl::remote::{Entry, RemoteError, RemoteJoint};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Bits a second of the bus that its load is told of: that of both boards.
const BIT_RATE: f64 = 1e6;
/// Least time over which the load is a mean.
const LOOK: Duration = Duration::from_secs(1);

/// Load of the bus, as far as this program hears and sends it.
#[derive(Debug)]
pub struct Load {
    since: Instant,
    bits: u64,
}

impl Load {
    /// The load from now on.
    #[must_use]
    pub fn of(network: &Network) -> Self {
        Self { since: Instant::now(), bits: network.bits() }
    }

    /// The mean since it was told last, for a page; none within a second of that.
    pub fn next(&mut self, network: &Network) -> Option<Value> {
        let passed = self.since.elapsed();
        if passed < LOOK {
            return None;
        }
        let bits = network.bits();
        let percent = percent(bits - self.bits, passed);
        *self = Self { since: self.since + passed, bits };
        let shown = format!("{percent:.1} % of 1 Mbit/s");
        Some(json!({ "title": "bus load", "name": "bus-load", "value": percent, "shown": shown }))
    }
}

fn percent(bits: u64, time: Duration) -> f64 {
    100.0 * bits as f64 / (BIT_RATE * time.as_secs_f64())
}

/// Values that are read in turn, each with its title.
const FIELDS: [(&str, Field); 15] = [
    ("winding", Field::Actual(Actual::WindingTemperature)),
    ("bridge", Field::Actual(Actual::BridgeTemperature)),
    ("gear", Field::Actual(Actual::GearTemperature)),
    ("supply", Field::Actual(Actual::BusVoltage)),
    ("requested model", Field::AtOnce(Setting::Request)),
    ("acting model", Field::Actual(Actual::ActingModel)),
    ("reason", Field::Actual(Actual::Reason)),
    ("left trained range", Field::Actual(Actual::Violations)),
    ("shadow RMS", Field::Actual(Actual::ShadowRms)),
    ("learning", Field::Actual(Actual::Learning)),
    ("friction factor", Field::Actual(Actual::AdaptedFactor)),
    ("added viscous friction", Field::Actual(Actual::AdaptedViscous)),
    ("collisions", Field::Actual(Actual::Collisions)),
    ("staged image", Field::Actual(Actual::ImageState)),
    ("image version", Field::Actual(Actual::ImageVersion)),
];

/// Reads one value at a time.
#[derive(Debug)]
pub struct Slow {
    entries: Vec<(&'static str, Entry)>,
    next: usize,
}

impl Default for Slow {
    fn default() -> Self {
        Self { entries: FIELDS.map(|(title, field)| (title, Entry::of(field))).to_vec(), next: 0 }
    }
}

impl Slow {
    /// The next value, for a page; none where the joint has no such object, which is not asked for again.
    ///
    /// # Errors
    /// The bus, or no answer.
    pub fn next(&mut self, joint: &RemoteJoint) -> Result<Option<Value>, RemoteError> {
        let Some(&(title, entry)) = self.entries.get(self.next) else {
            self.next = 0;
            return Ok(None);
        };
        match joint.read(entry) {
            Ok(value) => {
                self.next += 1;
                let known = (!entry.is_unknown(&value)).then(|| value.json());
                let worded = value.number().and_then(|number| words(entry.object.field, number as u64));
                let shown = worded.unwrap_or_else(|| entry.show(&value));
                Ok(Some(json!({ "title": title, "name": entry.name(), "value": known, "shown": shown })))
            }
            Err(error) if error.is_absent() => {
                self.entries.remove(self.next);
                Ok(None)
            }
            // Asked again at its next turn.
            Err(RemoteError::Client(ClientError::OtherClient { .. })) => {
                self.next += 1;
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::percent;
    use std::time::Duration;

    #[test]
    fn half_a_million_bits_a_second_are_half_of_a_bus() {
        assert_eq!(percent(500_000, Duration::from_secs(1)), 50.0);
        assert_eq!(percent(500_000, Duration::from_secs(2)), 25.0);
    }
}
