//! Services that the objects need at once of the program around them; the task.

use crate::hardware::Hardware;
use crate::joint::configuration::{BridgeConfiguration, Configuration, ConfigurationError};
use crate::joint::history::History;
use crate::motor::open_loop::Window;
use crate::reset_record::LastReset;
use canopen_node::Event;
use friction_compensation::parameters::authentication::CHALLENGE;
use friction_compensation::parameters::fault_log::LoggedFault;
use friction_compensation::parameters::guard::Guard;
use friction_compensation::parameters::slots::SlotError;

/// Reason for which a configuration is not in use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum NotConfigured {
    /// Refusal of it.
    Refused(ConfigurationError),
    /// The control step has not taken the one before.
    Busy,
}

/// Services of a board, or of a simulation of one, for the objects.
pub trait Program {
    /// Prepares a configuration, with the friction model in use, and has the control step swap it in.
    fn configure(&mut self, configuration: &Configuration) -> Result<(), NotConfigured>;

    /// The open loop's last window.
    fn window(&self) -> Window;

    /// The board's part of a configuration.
    fn bridge(&self) -> &BridgeConfiguration;

    /// Reads the record that is stored, or none.
    fn record<R>(&self, read: impl FnOnce(Option<&[u8]>) -> R) -> R;

    /// Makes a record outlast a loss of power. At start it goes to [`Stored::decode`](super::Stored::decode).
    fn store(&mut self, record: &[u8]) -> Result<(), SlotError>;

    /// Damaged ones of images and key: bits as of EMCY [`LOST`](super::emergency::LOST). Whether a configuration was,
    /// [`Start`](super::Start) says.
    fn damaged(&self) -> u8 {
        0
    }

    /// Notes how many times a record may still be written: to be kept over a reset that is no power-up.
    fn note_stores_left(&mut self, left: u8);

    /// Keeps what guards the joint. The client is answered after that.
    fn keep(&mut self, guard: &Guard) -> Result<(), SlotError>;

    /// Random bytes that nobody can tell in advance; none where there are none, and then no challenge.
    fn random(&mut self) -> Option<[u8; CHALLENGE]>;

    /// State of the board's button, `true` while pressed; none where it has none.
    fn button(&self) -> Option<bool> {
        None
    }

    /// Fills `out` with bytes of the stored image in use, from `offset` on; false where they cannot be read.
    fn read_image(&mut self, offset: u32, out: &mut [u8]) -> bool;

    /// Reads the steps before a fault, while one is latched; none otherwise. `read` is short: it may hold the control
    /// step up, which then keeps the bridge off.
    fn history<R>(&self, read: impl FnOnce(&History) -> R) -> Option<R>;

    /// Reason for the program's start; the same until the next start, but for the stops in a row.
    fn last_reset(&self) -> LastReset;

    /// Appends a fault to the log that outlives the power: error code, number of the fault, time since the start, s.
    /// False where it cannot.
    fn log_fault(&mut self, _code: u16, _fault: u8, _time: u32) -> bool {
        false
    }

    /// Has the log count this power-up, unless it has.
    fn count_power_up(&mut self) {}

    /// The log's newest faults, the newest first.
    fn logged_faults(&self) -> impl Iterator<Item = LoggedFault> {
        core::iter::empty()
    }

    /// Number of power-ups, this one included; 0 where nobody counts them.
    fn power_ups(&self) -> u32 {
        0
    }

    /// Report of the board on its hardware. Where there is none, all zero.
    fn hardware(&self) -> Hardware {
        Hardware::default()
    }

    /// Sets the chip's option bytes as they are needed, once the client has been answered, and resets the chip; the
    /// joint is off. False where there are none.
    fn set_options(&mut self) -> bool {
        false
    }

    /// The network tells something. Of a transition the objects know already.
    fn event(&mut self, event: Event);
}
