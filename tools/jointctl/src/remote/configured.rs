//! Date of a joint's configuration (CiA 301, object 1020h): written as it is stored, and lost with the first value that
//! becomes another one. Where it is there, what is in use is what was stored; host.

use super::error::RemoteError;
use super::joint::RemoteJoint;
use time::UtcDateTime;

const DATE: u16 = 0x1020;
/// Object that stores all parameters.
const STORE: (u16, u8) = (0x1010, 1);
/// Sub-indices: days since 1984, milliseconds since midnight.
const DAYS: u8 = 1;
const MILLISECONDS: u8 = 2;
/// Begin of CANopen's dates, 1984-01-01, ms after 1970.
const BEGIN: i128 = 441_763_200_000;
/// A day, ms.
const DAY: i128 = 86_400_000;
/// A millisecond, ns.
const MILLISECOND: i128 = 1_000_000;

/// Knowledge of a joint's configuration against what it has stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Configured {
    /// The joint's program has no such object.
    Untold,
    /// Some value is another one, or no client that writes the date has stored it.
    Differs,
    /// It is as it was stored then.
    Since(UtcDateTime),
}

impl std::fmt::Display for Configured {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Untold => f.write_str("not told whether it is as it was stored, for want of room"),
            Self::Differs => f.write_str("changed since it was stored, or never stored with a date"),
            Self::Since(at) => {
                write!(f, "as stored {} {:02}:{:02}:{:02} UTC", at.date(), at.hour(), at.minute(), at.second())
            }
        }
    }
}

/// A date as the object has it. A clock that is wrong by decades gives the first day, for 0 is none.
fn encode(now: UtcDateTime) -> [u32; 2] {
    let since = (now.unix_timestamp_nanos() / MILLISECOND - BEGIN).max(DAY);
    [since / DAY, since % DAY].map(|part| u32::try_from(part).unwrap_or(u32::MAX))
}

fn decode([days, milliseconds]: [u32; 2]) -> Configured {
    if days == 0 {
        return Configured::Differs;
    }
    let since = BEGIN + i128::from(days) * DAY + i128::from(milliseconds);
    UtcDateTime::from_unix_timestamp_nanos(since * MILLISECOND).map_or(Configured::Differs, Configured::Since)
}

fn write(joint: &RemoteJoint, [days, milliseconds]: [u32; 2]) -> Result<(), RemoteError> {
    joint.download(DATE, DAYS, &days.to_le_bytes())?;
    joint.download(DATE, MILLISECONDS, &milliseconds.to_le_bytes())
}

/// Stores all that is in use (1010h:1), with a date where the joint has an object for that. What has one is what was
/// stored and keeps it, so that the joint writes nothing anew; where the joint refuses to store it has none.
///
/// # Errors
/// The bus, or the joint's refusal.
pub fn store(joint: &RemoteJoint, now: UtcDateTime) -> Result<(), RemoteError> {
    let undated = read(joint)? == Configured::Differs;
    if undated {
        write(joint, encode(now))?;
    }
    let stored = joint.download(STORE.0, STORE.1, b"save");
    if undated && stored.is_err() {
        // The refusal is what is told.
        let _ = write(joint, [0; 2]);
    }
    stored
}

/// Does what will be undone, or undoes it: a client's own PDOs for the time of its work are no other configuration, and
/// a date stays. Whether there is one.
///
/// # Errors
/// Those of `work`. Where the date cannot be written again there is none, which is no failure of the work.
pub(super) fn keep(joint: &RemoteJoint, work: impl FnOnce() -> Result<(), RemoteError>) -> Result<bool, RemoteError> {
    let before = raw(joint).ok().flatten().filter(|[days, _]| *days > 0);
    work()?;
    Ok(before.is_some_and(|before| write(joint, before).is_ok()))
}

/// Comparison of what is in use with what is stored.
///
/// # Errors
/// The bus.
pub fn read(joint: &RemoteJoint) -> Result<Configured, RemoteError> {
    Ok(raw(joint)?.map_or(Configured::Untold, decode))
}

/// The date as the joint has it; none without the object.
fn raw(joint: &RemoteJoint) -> Result<Option<[u32; 2]>, RemoteError> {
    let part = |sub_index| joint.node().number(DATE, sub_index).map(u32::from_le_bytes).map_err(RemoteError::from);
    match part(DAYS) {
        Err(error) if error.is_absent() => Ok(None),
        days => Ok(Some([days?, part(MILLISECONDS)?])),
    }
}

#[cfg(test)]
mod tests {
    use super::{Configured, decode, encode};
    use time::{Date, Month, Time, UtcDateTime};

    fn at(year: i32, month: Month, day: u8, [hour, minute, second]: [u8; 3], millisecond: u16) -> UtcDateTime {
        let date = Date::from_calendar_date(year, month, day).unwrap();
        UtcDateTime::new(date, Time::from_hms_milli(hour, minute, second, millisecond).unwrap())
    }

    #[test]
    fn dates_count_from_1984() {
        assert_eq!(encode(at(1984, Month::January, 2, [0; 3], 1)), [1, 1]);
        assert_eq!(encode(at(2000, Month::March, 1, [12, 0, 0], 0)), [5_904, 43_200_000]);
        for date in [
            at(1984, Month::January, 2, [0; 3], 0),
            at(2026, Month::November, 29, [23, 59, 59], 999),
            at(2103, Month::December, 31, [7, 8, 9], 10),
        ] {
            assert_eq!(decode(encode(date)), Configured::Since(date));
        }
    }

    #[test]
    fn no_date_is_none_and_a_clock_that_is_wrong_gives_the_first() {
        assert_eq!(decode([0, 5]), Configured::Differs);
        for date in [at(1970, Month::January, 1, [0; 3], 0), at(1984, Month::January, 1, [23, 59, 59], 999)] {
            assert_eq!(encode(date), [1, 0], "{date}");
        }
        // No time in years that there is a day for.
        assert_eq!(decode([u32::MAX; 2]), Configured::Differs);
    }

    #[test]
    fn words_have_the_second() {
        let told = Configured::Since(at(2026, Month::November, 29, [2, 3, 4], 999)).to_string();
        assert_eq!(told, "as stored 2026-11-29 02:03:04 UTC");
    }
}
