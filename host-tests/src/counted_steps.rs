//! Cost of the parts of a control step on the board's core: the program `step` of the probe on the emulator's core,
//! every instruction told apart by the compiler's line tables.
//!
//! An instruction counts for the innermost of the functions below that it was inlined into, and what they call out of
//! line counts for the caller. Instructions are exact; cycles are the emulator's model
//! (`tools/emulator/src/cpu/timing.rs`) without wait states: the control interrupt runs from CCM SRAM.

use crate::bare_core::{Core, Cost};
use crate::control_steps::replay::{SCENARIOS, START, STEPS};
use std::collections::HashMap;
use std::path::Path;

/// Crates whose functions are told apart.
const CRATES: [&str; 2] = ["joint_firmware::", "friction_compensation::"];
/// Parts of a control step, and how their functions' names begin behind the crate's.
pub const PARTS: [(&str, &[&str]); 17] = [
    ("network's inputs", &["friction::network::InputScale::"]),
    ("network", &["friction::network::"]),
    ("physical model", &["friction::physical::"]),
    ("regimes", &["friction::regime::", "friction::FrictionModel::"]),
    ("compensation", &["compensation::", "friction::domain::"]),
    ("feedforward and guard", &["joint::friction_feedforward::"]),
    ("observer", &["motor::observer::", "joint::active::Scales::joint"]),
    ("transforms", &["motor::angle::", "motor::transform::"]),
    ("current control", &["motor::current::", "motor::field_oriented::"]),
    ("modulation", &["motor::modulation::"]),
    ("monitors", &["joint::monitor::", "joint::Joint::watch", "joint::Joint::count_stale_steps"]),
    ("state machine", &["joint::state_machine::", "joint::Joint::decide", "joint::Joint::has_stopped"]),
    ("motion law", &["joint::motion_law::", "joint::limit_law::"]),
    ("offsets, encoder", &["joint::offsets::", "joint::Joint::without_offsets", "joint::Joint::encoder_sample"]),
    ("history", &["joint::history::", "joint::Joint::note"]),
    ("mean square", &["motor::thermal::"]),
    ("step itself", &["joint::Joint::step", "joint::Joint::control_step", "joint::Joint::coupled"]),
];

/// Index of a part in [`PARTS`].
///
/// # Panics
/// Panics if no part has this name.
pub fn place(name: &str) -> usize {
    PARTS.iter().position(|(known, _)| *known == name).unwrap_or_else(|| panic!("no part {name}"))
}

/// Cost of one step.
#[derive(Clone, Copy, Default)]
pub struct Step {
    /// All of it.
    pub sum: Cost,
    /// Each of [`PARTS`].
    pub parts: [Cost; PARTS.len()],
}

impl Step {
    /// Several parts together.
    pub fn of(&self, names: &[&str]) -> Cost {
        let mut sum = Cost::default();
        names.iter().for_each(|name| sum += self.parts[place(name)]);
        sum
    }
}

/// The part that an address belongs to; none for what is called out of line.
pub fn part(loader: &addr2line::Loader, address: u32) -> Option<usize> {
    let mut frames = loader.find_frames(address.into()).ok()?;
    while let Ok(Some(frame)) = frames.next() {
        let Some(name) = frame.function.as_ref().and_then(|function| function.demangle().ok()) else { continue };
        let Some((_, path)) = CRATES.iter().find_map(|of| name.split_once(of)) else { continue };
        let found = PARTS.iter().position(|(_, names)| names.iter().any(|begin| path.starts_with(begin)));
        if found.is_some() {
            return found;
        }
    }
    None
}

/// Runs the program; the hashes that it prints, and what each step of each of [`SCENARIOS`] cost.
///
/// # Errors
/// The file is no such program, or it ends otherwise than it should.
pub fn counted(path: &Path) -> Result<(Vec<u32>, Vec<Vec<Step>>), String> {
    let loader = addr2line::Loader::new(path).map_err(|error| error.to_string())?;
    let mut parts: HashMap<u32, Option<usize>> = HashMap::new();
    let mut core = Core::start(path)?;
    let (mut hashes, mut steps) = (Vec::new(), Vec::new());
    loop {
        let (mut step, mut current) = (Step::default(), PARTS.len() - 1);
        let traced = core.trace("counted_step", |address, cycles| {
            current = parts.entry(address).or_insert_with(|| part(&loader, address)).unwrap_or(current);
            for cost in [&mut step.sum, &mut step.parts[current]] {
                *cost += Cost { instructions: 1, cycles };
            }
        })?;
        if traced.is_some() {
            steps.push(step);
            continue;
        }
        match core.printed()? {
            Some(hash) => hashes.push(hash),
            None => break,
        }
    }
    let runs = steps.get(START as usize..).unwrap_or_default();
    let runs: Vec<_> = runs.chunks(STEPS as usize).map(<[Step]>::to_vec).collect();
    match hashes.len() == SCENARIOS.len() && runs.len() == SCENARIOS.len() {
        true => Ok((hashes, runs)),
        false => Err(format!("{} hashes, {} steps", hashes.len(), steps.len())),
    }
}

/// Least, median and most of what is not zero; zeros where all is.
pub fn spread(values: impl IntoIterator<Item = u64>) -> [u64; 3] {
    let mut values: Vec<u64> = values.into_iter().filter(|value| *value > 0).collect();
    values.sort_unstable();
    let at = |place: usize| values.get(place).copied().unwrap_or(0);
    [at(0), at(values.len() / 2), at(values.len().saturating_sub(1))]
}
