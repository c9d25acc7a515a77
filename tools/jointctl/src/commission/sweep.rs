//! A sweep: the field turns there and back, and takes the rotor along.
//!
//! Field and encoder are sampled at the same instants. The half turn before and after what is evaluated is for the
//! rotor to catch up with the field. Means are taken over the field's angle, so that it does not matter how evenly a
//! bus delivers samples.

use super::bench::{Bench, Frame, Window};
use super::drive::Drive;
use super::estimate::{turns_between, wrapped};
use super::failure::Failure;

/// A part of an electrical turn before and after what is evaluated.
const CATCH_UP: f64 = 0.5;

/// Field and encoder at one instant, in turns since the sweep began.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample {
    /// Electrical turns.
    pub field: f64,
    /// Mechanical turns.
    pub encoder: f64,
    /// Mean current of the window before it, along and across the field, A.
    pub current: [f64; 2],
    /// Mean voltage along and across, V.
    pub voltage: [f64; 2],
}

/// One way of a sweep.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Way(pub Vec<Sample>);

/// A sweep there and back.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sweep {
    /// Encoder when the field's turns are zero, 2^32 a turn.
    pub encoder: u32,
    /// Field when its turns are zero, 2^32 an electrical turn.
    pub field: u32,
    /// Electrical turns that are evaluated, from half a turn on.
    pub turns: u32,
    pub forward: Way,
    pub backward: Way,
}

/// How a sweep ends.
pub(super) enum Swept {
    /// As planned.
    Whole(Sweep),
    /// The encoder has met its index: its angle has jumped, and the field has been stopped where it is.
    Index,
}

/// Follows field and encoder over all turns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Track {
    last: Window,
    /// Electrical turns.
    pub field: f64,
    /// Mechanical turns.
    pub encoder: f64,
    /// s.
    window: f64,
}

impl Track {
    /// Begins with a window.
    pub const fn new(first: Window, window: f64) -> Self {
        Self { last: first, field: 0.0, encoder: 0.0, window }
    }

    /// Takes a window, while the field turned at `speed`, turns/s; false where the encoder has met its index meanwhile.
    pub fn take(&mut self, next: Window, speed: f64) -> bool {
        // Between two looks the field may have made more than half a turn: the windows' numbers tell the time.
        let expected = speed * f64::from(next.number.wrapping_sub(self.last.number)) * self.window;
        let seen = turns_between(self.last.field, next.field);
        self.field += expected + wrapped(seen - expected);
        let index = next.referenced && !self.last.referenced;
        if !index {
            self.encoder += turns_between(self.last.encoder, next.encoder);
        }
        self.last = next;
        !index
    }

    fn sample(&self) -> Sample {
        Sample { field: self.field, encoder: self.encoder, current: self.last.current, voltage: self.last.voltage }
    }
}

/// Turns the field by `turns` and one more there and back at `speed`, turns/s, with `voltage`, V.
pub(super) fn sweep<B: Bench>(
    drive: &mut Drive<'_, B>,
    voltage: f64,
    speed: f64,
    turns: u32,
) -> Result<Swept, Failure> {
    let still = Frame { voltage, ..Frame::default() };
    drive.set(still)?;
    let first = drive.look(false)?;
    let mut track = Track::new(first, drive.window_time());
    let whole = f64::from(turns) + 2.0 * CATCH_UP;
    let mut ways = [Way::default(), Way::default()];
    for (way, speed) in ways.iter_mut().zip([speed, -speed]) {
        drive.set(Frame { speed, ..still })?;
        loop {
            let before = track.last.number;
            let window = drive.after(before, false)?;
            if !track.take(window, speed) {
                drive.set(still)?;
                return Ok(Swept::Index);
            }
            way.0.push(track.sample());
            let there = if speed > 0.0 { track.field >= whole } else { track.field <= 0.0 };
            if there {
                break;
            }
        }
    }
    drive.set(still)?;
    let [forward, backward] = ways;
    Ok(Swept::Whole(Sweep { encoder: first.encoder, field: first.field, turns, forward, backward }))
}

impl Sweep {
    /// Where what is evaluated begins and ends, electrical turns.
    fn ends(&self) -> [f64; 2] {
        [CATCH_UP, CATCH_UP + f64::from(self.turns)]
    }

    /// Mechanical turns of the rotor while the field turns forward, there, and the same of the way back: equal where it
    /// came back as it went.
    pub fn turned(&self) -> [f64; 2] {
        let [from, to] = self.ends();
        let by = |way: &Way| way.encoder_at(to) - way.encoder_at(from);
        [by(&self.forward), by(&self.backward)]
    }

    /// Means of the encoder, mechanical turns, over the electrical turns between two places of the field, there and
    /// back.
    pub fn means(&self, from: f64, to: f64) -> [f64; 2] {
        [self.forward.mean(from, to), self.backward.mean(from, to)]
    }

    /// Whole electrical turns that are evaluated: where each begins.
    pub fn starts(&self) -> impl Iterator<Item = f64> {
        (0..self.turns).map(|turn| CATCH_UP + f64::from(turn))
    }

    /// Electrical turns between two samples, the mean of both ways.
    pub fn spacing(&self) -> f64 {
        let samples = self.forward.0.len() + self.backward.0.len();
        2.0 * (f64::from(self.turns) + 2.0 * CATCH_UP) / samples.max(1) as f64
    }

    /// Samples of what is evaluated, there or back.
    pub fn evaluated<'s>(&self, way: &'s Way) -> impl Iterator<Item = &'s Sample> {
        let [from, to] = self.ends();
        way.0.iter().filter(move |sample| (from..=to).contains(&sample.field))
    }
}

impl Way {
    /// The encoder at a place of the field, between the samples beside it.
    fn encoder_at(&self, field: f64) -> f64 {
        let between = self.0.windows(2).find_map(|pair| {
            let [a, b] = pair else { return None };
            let part = (field - a.field) / (b.field - a.field);
            (0.0..=1.0).contains(&part).then_some(a.encoder + part * (b.encoder - a.encoder))
        });
        // Before the first and after the last sample.
        let nearest = || {
            let distance = |sample: &&Sample| (sample.field - field).abs();
            self.0.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(f64::NAN, |sample| sample.encoder)
        };
        between.unwrap_or_else(nearest)
    }

    /// Mean of the encoder over a part of the field, by trapezia.
    fn mean(&self, from: f64, to: f64) -> f64 {
        let inside = self.0.iter().filter(|sample| sample.field > from && sample.field < to);
        let mut points = inside.map(|sample| (sample.field, sample.encoder)).collect::<Vec<_>>();
        points.extend([(from, self.encoder_at(from)), (to, self.encoder_at(to))]);
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let area = |pair: &[(f64, f64)]| match pair {
            [a, b] => 0.5 * (b.0 - a.0) * (a.1 + b.1),
            _ => 0.0,
        };
        points.windows(2).map(area).sum::<f64>() / (to - from)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_do_not_depend_on_how_evenly_samples_come() {
        let sample = |field: f64| Sample { field, encoder: 0.1 * field, current: [0.0; 2], voltage: [0.0; 2] };
        let uneven = [0.0, 0.1, 0.4, 0.45, 1.1, 1.2, 1.9, 2.3].map(sample);
        let way = Way(uneven.into());
        assert!((way.mean(0.5, 1.5) - 0.1).abs() < 1e-12);
        assert!((way.encoder_at(1.5) - 0.15).abs() < 1e-12);
        let back = Way(way.0.iter().rev().copied().collect());
        assert!((back.mean(0.5, 1.5) - 0.1).abs() < 1e-12);
    }

    #[test]
    fn a_field_that_makes_more_than_half_a_turn_between_two_looks_is_followed() {
        let window =
            |number, field, encoder, referenced| Window { number, field, encoder, referenced, ..Window::default() };
        let mut track = Track::new(window(10, 0, 0, false), 0.01);
        // 10 turns/s for 8 windows: 0.8 turns.
        assert!(track.take(window(18, 0xCCCC_CCCD, 0x1000_0000, false), 10.0));
        assert!((track.field - 0.8).abs() < 1e-6 && (track.encoder - 0.0625).abs() < 1e-9);
        assert!(!track.take(window(19, 0xE666_6666, 0x9000_0000, true), 10.0));
        assert!((track.field - 0.9).abs() < 1e-6 && (track.encoder - 0.0625).abs() < 1e-9);
    }
}
