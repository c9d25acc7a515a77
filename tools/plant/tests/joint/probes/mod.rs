//! Probes of numeric limits: a value is held just below its limit, where nothing may show, and just above, where the
//! fault has to; host.
//!
//! - `bench`: a joint whose measurements are held
//! - `table`: the limits of the joint's configuration, each with its probes
//! - `current_loop`: those of the check that compares the current loop with the motor's equations
//!
//! Limits are computed here, from the configuration and from what the documentation says, and not read back from the
//! code that is probed.

mod bench;
mod current_loop;
pub mod table;

use joint_firmware::default_configuration::BoardConfiguration;
use joint_firmware::joint::fault::{Fault, Faults};

/// A limit, and a way to bring its value about.
pub struct Probe {
    pub name: String,
    pub shows: Shows,
    /// Values on the permitted side and on the other one.
    pub below: f64,
    pub above: f64,
    /// Calls of the subject in which the value just below must show nothing.
    pub held: u32,
    /// Calls of the subject within which the value just above must show.
    pub within: u32,
    /// The value just above follows on the one just below in the same subject; otherwise each has a subject of its
    /// own.
    pub follows: bool,
    /// Faults that another limit shows at either value.
    pub beside: &'static [Fault],
    subject: Box<dyn Fn() -> Subject>,
}

/// Holds a value for a control step, or for as many steps as the value says, from one call to the next.
pub type Subject = Box<dyn FnMut(f64) -> Found>;

/// Sign by which a value beyond its limit shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shows {
    /// Fault.
    Fault(Fault),
    /// Torque that is less than asked for, or an end of braking.
    Less,
}

/// Signs that a subject shows.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    pub faults: Faults,
    /// Part of the torque asked for.
    pub part: f64,
}

impl Probe {
    fn of(name: impl Into<String>, shows: Shows, subject: impl Fn() -> Subject + 'static) -> Self {
        let name = name.into();
        let (subject, beside) = (Box::new(subject), &[]);
        Self { name, shows, below: 0.0, above: 0.0, held: 1, within: 1, follows: false, beside, subject }
    }

    /// Probes a limit this far from it on both sides; a negative distance where the permitted side lies above. Just
    /// below is held for `held` steps.
    fn around(self, limit: f64, distance: f64, held: u32) -> Self {
        let within = match self.shows {
            Shows::Fault(fault) => crate::rig::table::documented(fault).steps,
            // A call is a round of the motion loop.
            Shows::Less => 1,
        };
        Self { below: limit - distance, above: limit + distance, held, within, follows: true, ..self }
    }

    /// Probes a limit that is a whole number, of which as many as `most` are permitted, one call a value.
    fn counted(self, most: f64) -> Self {
        Self { below: most.floor(), above: most.floor() + 1.0, ..self }
    }

    /// Each side with a subject of its own.
    fn apart(self) -> Self {
        Self { follows: false, ..self }
    }

    fn beside(self, beside: &'static [Fault]) -> Self {
        Self { beside, ..self }
    }

    /// Checks that nothing shows just below the limit; just above, the fault does in its time.
    pub fn run(&self) -> Result<(), String> {
        let (name, below, above) = (&self.name, self.below, self.above);
        let mut subject = (self.subject)();
        for call in 1..=self.held {
            let found = subject(below);
            let other = found.faults.iter().find(|fault| !self.beside.contains(fault));
            if let Some(fault) = other {
                return Err(format!("{name}: {fault:?} at {below} after {call}"));
            }
            if self.shows == Shows::Less && found.part < WHOLE {
                return Err(format!("{name}: {} of it at {below} after {call}", found.part));
            }
        }
        if !self.follows {
            subject = (self.subject)();
        }
        let mut found = Found { faults: Faults::NONE, part: 1.0 };
        for _ in 1..=self.within {
            found = subject(above);
            let shows = match self.shows {
                Shows::Fault(fault) => found.faults.contains(fault),
                Shows::Less => found.part < WHOLE,
            };
            if shows {
                return Ok(());
            }
        }
        let faults: Vec<Fault> = found.faults.iter().collect();
        let (shows, within) = (self.shows, self.within);
        Err(format!("{name}: no {shows:?} at {above} within {within}, but {faults:?} and {} of it", found.part))
    }
}

/// A part of the torque from which on it counts as all of it.
const WHOLE: f64 = 0.9995;

/// All probes of a joint on a board.
pub fn probes(board: &BoardConfiguration) -> Vec<Probe> {
    let mut probes = table::probes(board);
    probes.extend(current_loop::probes(board));
    probes
}

/// The configuration that is probed: one in which no two limits fall together.
pub fn probed(board: &BoardConfiguration) -> BoardConfiguration {
    let mut board = *board;
    board.bridge.has_winding_sensor = true;
    board.joint.gear.ratio = 4.0;
    board.joint.limits.position = (-0.5, 0.4);
    board.joint.limits.command_deadline = 0.025;
    board
}
