//! Reason for the program's start, as objects and EMCY say it; the task.

use super::emergency::{Emergency, STOPPED, WATCHDOG};
use super::field::ResetField;
use crate::reset_record::LastReset;

/// Object 2301h; its text has no number.
pub(super) fn get(reset: &LastReset, part: ResetField) -> u32 {
    let stop = |read: fn(&crate::reset_record::Record) -> u32| reset.stop.as_ref().map_or(0, read);
    match part {
        ResetField::Causes => reset.causes.into(),
        ResetField::Stop => stop(|stop| stop.cause.code()),
        ResetField::Address => stop(|stop| stop.address),
        ResetField::Detail => stop(|stop| stop.detail),
        ResetField::Repeats => stop(|stop| stop.repeats),
        ResetField::Place => 0,
    }
}

/// Name of the source file; empty where there is none.
pub(super) fn place(reset: &LastReset) -> &[u8] {
    reset.stop.as_ref().map_or(&[], |stop| stop.place_bytes())
}

/// EMCY that is sent behind the boot-up message; none where the start was wanted.
pub(super) fn emergency(reset: &LastReset) -> Option<Emergency> {
    let code = match reset.stop {
        Some(_) => STOPPED,
        None if reset.causes & LastReset::WATCHDOG != 0 => WATCHDOG,
        None => return None,
    };
    let information = [reset.causes, get(reset, ResetField::Stop) as u8, 0, 0, 0];
    // It is over: nothing is left in the error register.
    Some(Emergency { code, register: 0, information })
}
