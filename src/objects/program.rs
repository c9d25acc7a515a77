//! What the objects need done at once by the program around them; the task.

use crate::canopen::Event;
use crate::joint::configuration::{Configuration, ConfigurationError};
use crate::joint::history::History;
use crate::motor::calibration::Progress;
use crate::motor::setting::SettingError;
use crate::parameters::authentication::Key;
use crate::parameters::slots::SlotError;
use crate::reset_record::LastReset;

/// Why a configuration is not in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotConfigured {
    /// It is refused.
    Refused(ConfigurationError),
    /// The control step has not taken the one before.
    Busy,
}

/// What a board, or a simulation of one, does for the objects.
pub trait Program {
    /// Prepares a configuration, with the friction model in use, and has the control step swap it in.
    fn configure(&mut self, configuration: &Configuration) -> Result<(), NotConfigured>;

    /// Begins a calibration of the motor by a current, A, in the control step, which gives it up unless the joint is off.
    fn calibrate(&mut self, configuration: &Configuration, current: f32) -> Result<(), SettingError>;

    /// Gives up the calibration that runs, if one does.
    fn abort_calibration(&mut self);

    /// Where the calibration is that runs or ran last: from [`Program::calibrate`] on, never where the one before had ended.
    fn calibration(&self) -> Option<Progress>;

    /// Makes a record outlast a loss of power. At start it goes to [`Stored::decode`](super::Stored::decode).
    fn store(&mut self, record: &[u8]) -> Result<(), SlotError>;

    /// Keeps the lowest version that is taken and the number of wrong tags. The client is answered after that.
    fn keep(&mut self, floor: u32, failures: u16) -> Result<(), SlotError>;

    /// Keeps the key, for good.
    fn provision(&mut self, key: &Key) -> Result<(), SlotError>;

    /// Fills `out` with bytes of the stored image in use, from `offset` on; false where they cannot be read.
    fn read_image(&mut self, offset: u32, out: &mut [u8]) -> bool;

    /// Reads the steps before a fault, while one is latched; none otherwise. `read` is short: it may hold the control step up, which
    /// then keeps the bridge off.
    fn history<R>(&self, read: impl FnOnce(&History) -> R) -> Option<R>;

    /// Why the program started; the same until the next start, but for the stops in a row.
    fn last_reset(&self) -> LastReset;

    /// The network tells something. Of a transition the objects know already.
    fn event(&mut self, event: Event);
}
