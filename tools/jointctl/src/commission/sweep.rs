//! A sweep: the field turns there and back, and takes the rotor along.
//!
//! Field and encoder are sampled at the same instants. The half turn before and after what is evaluated is for the
//! rotor to catch up with the field. Means are taken over the field's angle, so that it does not matter how evenly a
//! bus delivers samples.

use super::bench::{Bench, Frame, Stopped, Window};
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

/// End of a sweep.
pub(super) enum Swept {
    /// Complete sweep, as planned.
    Whole(Sweep),
    /// The encoder has met its index: its angle has jumped, and the field has been stopped where it is.
    Index,
}

/// Part of an electrical turn that the field may have made more or less than what is reckoned with: with more than half
/// a turn it could not be told which turn it is.
const UNSURE: f64 = 0.45;
/// Windows after a change of speed until all of a window is after it: the last one when it was asked for, and the next.
const CHANGING: u8 = 2;

/// Outcome of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Taken {
    /// Field and encoder have been followed.
    Followed,
    /// The encoder has met its index meanwhile: its angle has jumped.
    Index,
    /// Lost window: it came so late after the field's speed was changed that the field may have made a turn more or
    /// less.
    Lost,
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
    /// Speed of the field before and since the last change, turns/s.
    speeds: [f64; 2],
    /// Windows to come in which both may have been.
    changing: u8,
}

impl Track {
    /// Begins with a window in which the field stands.
    pub const fn new(first: Window, window: f64) -> Self {
        Self { last: first, field: 0.0, encoder: 0.0, window, speeds: [0.0; 2], changing: 0 }
    }

    /// The field has been told another speed, turns/s.
    pub const fn turns_at(&mut self, speed: f64) {
        self.speeds = [self.speeds[1], speed];
        self.changing = CHANGING;
    }

    /// Takes a window.
    pub fn take(&mut self, next: Window) -> Taken {
        // Between two looks the field may have made more than half a turn: the windows' numbers tell the time.
        let time = f64::from(next.number.wrapping_sub(self.last.number)) * self.window;
        let [before, since] = self.speeds;
        let before = if self.changing > 0 { before } else { since };
        self.changing = self.changing.saturating_sub(1);
        if 0.5 * (since - before).abs() * time > UNSURE {
            return Taken::Lost;
        }
        let expected = 0.5 * (before + since) * time;
        let seen = turns_between(self.last.field, next.field);
        self.field += expected + wrapped(seen - expected);
        let index = next.referenced && !self.last.referenced;
        if !index {
            self.encoder += turns_between(self.last.encoder, next.encoder);
        }
        self.last = next;
        if index { Taken::Index } else { Taken::Followed }
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
        track.turns_at(speed);
        loop {
            let before = track.last.number;
            let window = drive.after(before, false)?;
            match track.take(window) {
                Taken::Followed => {}
                Taken::Index => {
                    drive.set(still)?;
                    return Ok(Swept::Index);
                }
                Taken::Lost => {
                    // About to where it began, so that what is repeated goes no farther.
                    drive.wait(if speed < 0.0 { whole / -speed } else { 0.0 })?;
                    return Err(Stopped::Late.into());
                }
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
    /// Begin and end of what is evaluated, electrical turns.
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

    /// Most electrical turns between two samples that lie beside each other.
    pub fn widest(&self) -> f64 {
        let pairs = [&self.forward, &self.backward].into_iter().flat_map(|way| way.0.windows(2));
        let wide = |pair: &[Sample]| match pair {
            [a, b] => (b.field - a.field).abs(),
            _ => 0.0,
        };
        pairs.map(wide).fold(0.0, f64::max)
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
        // 10 turns/s from the start, then 8 windows in which it is known to have turned for all of the time.
        track.turns_at(10.0);
        assert_eq!(track.take(window(11, 0x1000_0000, 0, false)), Taken::Followed);
        assert_eq!(track.take(window(12, 0x2999_999A, 0, false)), Taken::Followed);
        let from = track.field;
        assert_eq!(track.take(window(20, 0xF666_6667, 0x1000_0000, false)), Taken::Followed);
        assert!((track.field - from - 0.8).abs() < 1e-6 && (track.encoder - 0.0625).abs() < 1e-9);
        assert_eq!(track.take(window(21, 0x1000_0001, 0x9000_0000, true)), Taken::Index);
        assert!((track.field - from - 0.9).abs() < 1e-6 && (track.encoder - 0.0625).abs() < 1e-9);
    }

    #[test]
    fn a_window_that_is_late_after_a_change_of_speed_is_not_counted_as_a_turn() {
        let window = |number, field| Window { number, field, ..Window::default() };
        // From rest to 10 turns/s: 0.09 s is the most after which the turn is known.
        for (late, taken) in [(9, Taken::Followed), (10, Taken::Lost)] {
            for known in 1..=CHANGING {
                let mut track = Track::new(window(0, 0), 0.01);
                track.turns_at(10.0);
                for number in 1..known {
                    assert_eq!(track.take(window(number.into(), 0)), Taken::Followed);
                }
                // The field began to turn half of the time ago.
                let field = (f64::from(late) * 0.05 * 2f64.powi(32)) as u32;
                assert_eq!(track.take(window(u32::from(known) - 1 + late, field)), taken);
                assert!(taken == Taken::Lost || (track.field - f64::from(late) * 0.05).abs() < 1e-6);
            }
        }
        // The other way round the speed changes by twice as much.
        for (late, taken) in [(4, Taken::Followed), (5, Taken::Lost)] {
            let mut track = Track::new(window(0, 0), 0.01);
            track.turns_at(10.0);
            track.changing = 0;
            track.turns_at(-10.0);
            assert_eq!(track.take(window(late, 0)), taken);
        }
    }
}
