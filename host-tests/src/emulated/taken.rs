//! Cycles of a flashed program's control interrupt while its joint moves and the friction model's network acts.

use super::motion::Moving;
use super::observed::Observed;
use crate::bare_core::Cost;
use crate::counted_steps::{part, place, spread};
use emulator::chip::Waiting;
use emulator::cpu::ExceptionTimes;
use emulator::program::Program;
use emulator::variables::Variables;
use joint_firmware::joint::configuration::MOTION_STEPS;
use libtest_mimic::Failed;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Exception of the control interrupt, ADC1_2: interrupt 18 of both chips.
pub const CONTROL: u16 = 16 + 18;
/// Control interrupts that are taken apart for the network.
const TAKEN_APART: u32 = 20 * MOTION_STEPS;

/// Statistics taken of a run.
#[derive(Clone, Debug, Default)]
pub struct Taken {
    /// Rounds of the motion loop.
    pub rounds: u64,
    /// Rounds by what acted and why.
    pub acted: BTreeMap<String, u64>,
    /// Times of the control interrupt.
    pub interrupt: ExceptionTimes,
    /// Cycles of the network from its inputs in Q31, and of clamping and scaling those: least, median, most.
    pub network: [[u64; 3]; 2],
}

impl Taken {
    /// Rounds in which physical model and network acted.
    pub fn acting(&self) -> u64 {
        let acting = self.acted.iter().filter(|(what, _)| what.starts_with("PhysicalAndNetwork "));
        acting.map(|(_, rounds)| rounds).sum()
    }

    /// Checks that the network acted in 99 of 100 rounds.
    ///
    /// # Errors
    /// It did not.
    pub fn check(&self) -> Result<(), Failed> {
        match self.rounds > 0 && 100 * self.acting() >= 99 * self.rounds {
            true => Ok(()),
            false => {
                Err(format!("the network acted in {} of {} rounds: {:?}", self.acting(), self.rounds, self.acted)
                    .into())
            }
        }
    }
}

/// Moves a joint on for so many seconds, with wait states as chosen. Where the network is in the program is told by
/// line tables, which its file has.
///
/// # Errors
/// The run ended, a fault was reported, or the bridge is off at its end.
pub fn taken<W: Observed>(
    mut moving: Moving<W>,
    (path, program): (&Path, &Program),
    variables: &Variables,
    waiting: Waiting,
    seconds: f64,
) -> Result<Taken, Failed> {
    let output = |name: &str| variables.get(&format!("control::CONTROL.joint.motion_loop.compensated.output.{name}"));
    let (acting, reason) = (output("acting")?, output("reason")?);
    let reported = moving.emergencies().len();
    let mut taken = Taken::default();
    moving.bench.emulation.cpu.bus.set_waiting(waiting);
    // Past what still runs with the wait states of before.
    moving.run(0.01)?;
    moving.bench.stop_at_control_steps(program)?;
    moving.bench.emulation.cpu.clear_exception_times();
    let mut steps = 0u64;
    moving.run_with(seconds, |emulation| {
        steps += 1;
        if steps.is_multiple_of(u64::from(MOTION_STEPS)) {
            let now = emulation.cpu.now();
            let bus = &mut emulation.cpu.bus;
            let what = format!("{} {}", acting.variant(bus, now)?.0, reason.variant(bus, now)?.0);
            *taken.acted.entry(what).or_default() += 1;
            taken.rounds += 1;
        }
        Ok(())
    })?;
    let cpu = &mut moving.bench.emulation.cpu;
    cpu.set_watch(None);
    taken.interrupt = *cpu.exception_times().get(&CONTROL).ok_or("no control interrupt")?;
    if moving.emergencies().len() != reported || !moving.bench.board().drivetrain().is_switching() {
        return Err(format!("a fault:\n{}", moving.bench.log()).into());
    }
    taken.network = network(&mut moving, path)?;
    Ok(taken)
}

/// Cycles of the network and of its inputs, control interrupt by control interrupt.
fn network<W: Observed>(moving: &mut Moving<W>, path: &Path) -> Result<[[u64; 3]; 2], Failed> {
    let loader = addr2line::Loader::new(path).map_err(|error| error.to_string())?;
    let parts = [place("network"), place("network's inputs")];
    let mut known: HashMap<u32, Option<usize>> = HashMap::new();
    let cpu = &mut moving.bench.emulation.cpu;
    let mut costs = [Vec::new(), Vec::new()];
    let mut interrupts = 0;
    while interrupts < TAKEN_APART {
        cpu.clear_exception_times();
        let (mut current, mut sums) = (None, [Cost::default(); 2]);
        while !cpu.exception_times().contains_key(&CONTROL) {
            let (at, inside, before) = (cpu.register(15), cpu.exception() == CONTROL, cpu.now());
            if let Some(end) = cpu.step() {
                return Err(end.to_string().into());
            }
            if inside {
                current = known.entry(at).or_insert_with(|| part(&loader, at)).or(current);
                if let Some(sum) = parts.iter().position(|part| current == Some(*part)) {
                    sums[sum] += Cost { instructions: 1, cycles: cpu.now() - before };
                }
            }
        }
        // The first may have been under way.
        if interrupts > 0 {
            costs.iter_mut().zip(sums).for_each(|(costs, sum)| costs.push(sum.cycles));
        }
        interrupts += 1;
    }
    Ok(costs.map(spread))
}
