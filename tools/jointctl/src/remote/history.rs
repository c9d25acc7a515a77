//! The control steps before a joint's last fault, object 2300h; host.

use super::condition;
use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::STEP;
use joint_firmware::objects::field::Field;

/// Names and units of [`Step::signals`], in their order.
pub const SIGNALS: [(&str, &str); 7] = [
    ("position", "rad"),
    ("velocity", "rad/s"),
    ("commanded torque", "Nm"),
    ("compensation", "Nm"),
    ("current d", "A"),
    ("current q", "A"),
    ("supply", "V"),
];

/// A control step.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// State after it; none where this program does not know it.
    pub state: Option<State>,
    /// Faults present in it.
    pub faults: Vec<Fault>,
    /// [`SIGNALS`]; all but the position are up to 0.8 % too small in magnitude.
    pub signals: [f32; SIGNALS.len()],
}

fn decode(bytes: &[u8]) -> Vec<Step> {
    let step = |bytes: &[u8; STEP]| {
        let (words, _) = bytes.as_chunks::<4>();
        let word = |at: usize| words.get(at).map_or(0, |word| u32::from_le_bytes(*word));
        let mut signals = [0.0; SIGNALS.len()];
        signals.iter_mut().zip(2..).for_each(|(signal, at)| *signal = f32::from_bits(word(at)));
        Step { state: condition::state_at(word(0)), faults: condition::faults_of(word(1) as u16), signals }
    };
    bytes.as_chunks::<STEP>().0.iter().map(step).collect()
}

impl RemoteJoint {
    /// The steps before the fault that is latched, the oldest first; none while there is no fault.
    ///
    /// # Errors
    /// The bus, no answer, or a fault that was acknowledged meanwhile.
    pub fn history(&self) -> Result<Vec<Step>, RemoteError> {
        let object = Entry::of(Field::History).object;
        Ok(decode(&self.node().upload(object.index, object.sub_index)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_read_as_docs_objects_md_has_it() {
        let numbers = [1.5f32, -0.25, 3.0, 0.5, 0.0, -2.0, 24.0];
        let words = [u32::from(State::Fault as u8), 1 << (Fault::StaleCommand as u32 - 1)];
        let words = words.into_iter().chain(numbers.map(f32::to_bits));
        let mut bytes = words.flat_map(u32::to_le_bytes).collect::<Vec<_>>();
        let step = Step { state: Some(State::Fault), faults: vec![Fault::StaleCommand], signals: numbers };
        assert_eq!(decode(&bytes), [step]);
        // A number that stands for no state.
        bytes[0] = 99;
        assert_eq!(decode(&bytes)[0].state, None);
        assert!(decode(&bytes[..STEP - 1]).is_empty());
    }
}
