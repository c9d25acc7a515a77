//! `jointctl calibrate`: a joint measures its motor.

use super::CommandError;
use super::remote::{Where, catch_interrupts, running};
use crate::progress::{Progress, Terminal};
use crate::remote::calibration;
use clap::Args;

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
pub struct Calibrate {
    /// Which joint.
    #[command(flatten)]
    on: Where,
    /// Current that the rotor is held and turned with, A: enough to overcome friction and load with ease
    #[arg(long, value_name = "A")]
    current: f64,
}

impl Calibrate {
    /// Runs the command.
    pub fn run(&self) -> Result<(), CommandError> {
        let joint = self.on.joint()?;
        catch_interrupts()?;
        let progress = Terminal::new();
        let found = calibration::calibrate(&joint, self.current, &running, &mut |stage| progress.stage(stage))?;
        progress.finish();
        println!("{found}");
        println!("node {}: in use until the next reset; `jointctl store` keeps it", joint.id());
        Ok(())
    }
}
