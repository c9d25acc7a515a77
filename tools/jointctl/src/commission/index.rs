//! The index of an incremental encoder: the field turns the rotor until it is met, one way, and where it is not met,
//! the other.

use super::alignment::MOST_POLE_PAIRS;
use super::bench::{Bench, Frame, Stopped};
use super::drive::Drive;
use super::failure::Failure;
use super::sweep::{Taken, Track};

/// Mechanical turns to each side within which the index must be met: a turn, and what the rotor may lag.
const LONGEST: f64 = 1.1;
/// Electrical turns of the field after which a rotor that has not followed by half stands at a stop.
const STALLED: f64 = 1.5;

/// Encounter with the index.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Index {
    /// Mechanical turns that the rotor made until then, by the encoder's counts; 0 where it had been met before.
    pub turns: f64,
    /// `true` if it was met on the way back.
    pub back: bool,
}

/// Turns the rotor until the index is met, with a voltage, V, at a speed, electrical turns/s; `ratio`: electrical turns
/// in a mechanical one, about. At most `travel` mechanical turns to each side.
pub(super) fn find<B: Bench>(
    drive: &mut Drive<'_, B>,
    voltage: f64,
    speed: f64,
    ratio: f64,
    travel: f64,
) -> Result<Index, Failure> {
    let still = Frame { voltage, ..Frame::default() };
    drive.set(still)?;
    let first = drive.look(false)?;
    if first.referenced {
        return Ok(Index { turns: 0.0, back: false });
    }
    let window = drive.window_time();
    let mut track = Track::new(first, window);
    let limit = if travel < 1.0 { travel } else { LONGEST };
    let mut farthest = [0.0f64; 2];
    // However wrong the counts are, the field stops.
    let most = (limit + 1.0) * ratio.clamp(1.0, f64::from(MOST_POLE_PAIRS)) + STALLED;
    for (side, speed) in [speed, -speed].into_iter().enumerate() {
        drive.set(Frame { speed, ..still })?;
        track.turns_at(speed);
        let (begun, mut checked) = (track.field, (track.field, track.encoder));
        let mut number = drive.look(false)?.number;
        loop {
            let window = drive.after(number, false)?;
            number = window.number;
            match track.take(window) {
                Taken::Followed => {}
                Taken::Index => {
                    drive.set(still)?;
                    return Ok(Index { turns: track.encoder.abs(), back: side == 1 });
                }
                Taken::Lost => return Err(Stopped::Late.into()),
            }
            // Back again it first comes by where it began.
            if side == 0 || track.field < 0.0 {
                farthest[side] = farthest[side].max(track.encoder.abs());
            }
            let turned = (track.field - checked.0).abs();
            let stalled = turned > STALLED && (track.encoder - checked.1).abs() < 0.5 * turned / ratio;
            if turned > STALLED {
                checked = (track.field, track.encoder);
            }
            let longest = if side == 0 { most } else { 2.0 * most };
            if stalled || farthest[side] > limit || (track.field - begun).abs() > longest {
                break;
            }
        }
    }
    drive.set(still)?;
    Err(Failure::IndexNotMet { turns: farthest, limit })
}
