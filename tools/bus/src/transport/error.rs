//! Errors of a bus, said so that the person at the keyboard knows what to do; host.

use std::io;
use std::sync::Arc;

/// Reason for which a bus cannot be opened or used. Every message names the bus as it was asked for, and what to do.
#[derive(Clone, Debug, thiserror::Error)]
pub enum BusError {
    /// The string is not one that [`super::open`] takes.
    #[error("bus '{bus}': {problem}. Buses are {forms}", forms = super::FORMS)]
    Malformed {
        /// The string.
        bus: String,
        /// Defect of it.
        problem: String,
    },
    /// The interface is not there, is not ours, or does not work.
    #[error("bus '{bus}' cannot be opened: {source}. {advice}")]
    Open {
        /// The string that was opened.
        bus: String,
        /// Error of the operating system.
        source: Arc<io::Error>,
        /// Advice.
        advice: String,
    },
    /// The interface answers, and refuses.
    #[error("bus '{bus}': {problem}. {advice}")]
    Refused {
        /// The string that was opened.
        bus: String,
        /// Request that it refused.
        problem: String,
        /// Advice.
        advice: &'static str,
    },
    /// The bus worked and is gone: unplugged, set down, connection closed. It does not come back; open it again.
    #[error("bus '{bus}' is gone: {problem}. {advice}")]
    Gone {
        /// The string that was opened.
        bus: String,
        /// Observation of it.
        problem: String,
        /// Advice.
        advice: &'static str,
    },
    /// Frames are not taken as fast as they come.
    #[error(
        "bus '{bus}': a frame could not be sent within {within_ms} ms, the bus is saturated or nobody acknowledges. Send less, or look for a missing node or terminator"
    )]
    Saturated {
        /// The string that was opened.
        bus: String,
        /// Time for which it was tried, ms.
        within_ms: u64,
    },
}

impl BusError {
    pub(super) fn malformed(bus: &str, problem: impl Into<String>) -> Self {
        Self::Malformed { bus: bus.into(), problem: problem.into() }
    }

    /// `advice` is for errors that are the interface's own; permission is explained here.
    pub(super) fn open(bus: &str, source: io::Error, advice: impl Into<String>) -> Self {
        let advice = match source.kind() {
            io::ErrorKind::PermissionDenied => {
                "The user has no right to it: join the group that owns it (`ls -l`; often dialout: `sudo usermod -aG dialout $USER`, then log in anew)".into()
            }
            _ => advice.into(),
        };
        Self::Open { bus: bus.into(), source: Arc::new(source), advice }
    }

    pub(super) fn gone(bus: &str, problem: impl ToString, advice: &'static str) -> Self {
        Self::Gone { bus: bus.into(), problem: problem.to_string(), advice }
    }
}

/// Returns `true` if reading or writing may simply go on after this: nothing came, or not all went yet.
pub(super) fn is_timeout(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut | io::ErrorKind::Interrupted)
}
