//! A joint as a bench, by its objects: whoever carries them, a bus or an emulated one in its own time.

use super::bench::{Bench, Condition, Frame, Motion, Stopped, Window};
use crate::remote::{Entry, Value, condition};
use bus::client::Command;
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::motor::setting::Name;
use joint_firmware::objects::field::{Actual, ConfigurationField, Field, OpenLoopField, SetPoint};
use joint_firmware::objects::settings::Setting;

/// Longest time of a change of state, and the interval at which it is looked for, s.
const STATE: f64 = 1.0;
const LOOK: f64 = 0.002;
/// Longest time that braking may take, s: the longest of a configuration.
const BRAKING: f64 = 11.0;
/// Number of requests to store, and the waiting time between them, s: a board with one bank of flash writes at rest
/// only.
const STORES: usize = 20;
const REST: f64 = 0.1;
/// Number of times that a joint is asked whether it has started, and the waiting time before each, s.
const STARTS: usize = 5;
const START: f64 = 0.2;
/// Number of times that a configuration is offered to a control step that has not taken the one before, and the waiting
/// time for that, s.
const OFFERS: usize = 20;
const TAKEN: f64 = 0.05;
/// Object 2100h:1 and 2.
const TAKE: u64 = 1;
const FORGET: u64 = 2;
const BUSY: u64 = 2;
/// Object 1010h:1, all parameters, and its signature.
const STORE: (u16, u8, &[u8]) = (0x1010, 1, b"save");
/// Modes of object 6060h.
const OPEN_LOOP: i8 = -2;
const POSITION: i8 = 8;
const VELOCITY: i8 = 9;

/// Objects of a joint, and time.
pub trait Objects {
    /// Reads an object.
    ///
    /// # Errors
    /// [`Stopped::Refused`] or [`Stopped::Bus`].
    fn upload(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, Stopped>;

    /// Writes an object.
    ///
    /// # Errors
    /// [`Stopped::Refused`] or [`Stopped::Bus`].
    fn download(&mut self, index: u16, sub_index: u8, data: &[u8]) -> Result<(), Stopped>;

    /// Sends an NMT command to the joint. After a reset it waits for the boot-up message.
    ///
    /// # Errors
    /// [`Stopped::Bus`].
    fn network(&mut self, command: Command) -> Result<(), Stopped>;

    /// Asks the joint once to store what is in use.
    ///
    /// # Errors
    /// [`Stopped::Refused`] or [`Stopped::Bus`].
    fn store(&mut self) -> Result<(), Stopped> {
        let (index, sub_index, signature) = STORE;
        self.download(index, sub_index, signature)
    }

    /// Lets time pass, s.
    ///
    /// # Errors
    /// [`Stopped::Interrupted`] or [`Stopped::Bus`].
    fn pass(&mut self, seconds: f64) -> Result<(), Stopped>;
}

/// Instruction that the joint has been given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Told {
    Nothing,
    Apply,
    Move(Motion),
}

/// A joint.
#[derive(Debug)]
pub struct Joint<O> {
    objects: O,
    told: Told,
}

impl<O: Objects> Joint<O> {
    /// A joint that is reached by its objects.
    pub const fn new(objects: O) -> Self {
        Self { objects, told: Told::Nothing }
    }

    /// Carrier of its objects.
    pub const fn objects(&mut self) -> &mut O {
        &mut self.objects
    }

    fn raw(&mut self, field: Field) -> Result<u64, Stopped> {
        let Entry { object, .. } = Entry::of(field);
        let bytes = self.objects.upload(object.index, object.sub_index)?;
        Ok(bytes.iter().take(8).rev().fold(0, |raw, byte| raw << 8 | u64::from(*byte)))
    }

    fn number(&mut self, field: Field) -> Result<f64, Stopped> {
        let entry = Entry::of(field);
        let bytes = self.objects.upload(entry.object.index, entry.object.sub_index)?;
        Ok(entry.decode(&bytes).and_then(|value| value.number()).unwrap_or(f64::NAN))
    }

    fn write_raw(&mut self, field: Field, raw: u64) -> Result<(), Stopped> {
        let Entry { object, .. } = Entry::of(field);
        let length = usize::from(object.data_type.bytes().unwrap_or(0)).min(8);
        self.objects.download(object.index, object.sub_index, raw.to_le_bytes().get(..length).unwrap_or(&[]))
    }

    fn state(&mut self) -> Result<State, Stopped> {
        Ok(condition::state_of(self.raw(Field::Actual(Actual::Statusword))? as u16))
    }

    fn faults(&mut self) -> Result<Vec<Fault>, Stopped> {
        Ok(condition::faults_of(self.raw(Field::Actual(Actual::LatchedFaults))? as u16))
    }

    /// Reason for which the joint is not in the state that it should be in.
    fn stopped(&mut self, state: State) -> Stopped {
        match self.faults() {
            Ok(faults) if faults == [Fault::StaleCommand] => Stopped::Late,
            Ok(faults) if faults.is_empty() => Stopped::Joint(format!("it is {}", condition::name(state))),
            Ok(faults) => Stopped::Joint(format!("it is {}: {}", condition::name(state), condition::list(&faults))),
            Err(stopped) => stopped,
        }
    }

    fn controlword(&mut self, word: Controlword) -> Result<(), Stopped> {
        self.write_raw(Field::SetPoint(SetPoint::Controlword), word.0.into())
    }

    fn command_state(&mut self, word: Controlword, wanted: State) -> Result<(), Stopped> {
        self.controlword(word)?;
        let mut waited = 0.0;
        loop {
            let state = self.state()?;
            if state == wanted {
                return Ok(());
            }
            if state == State::Fault || waited > STATE {
                return Err(self.stopped(state));
            }
            self.objects.pass(LOOK)?;
            waited += LOOK;
        }
    }

    /// Brings the joint from wherever it is to the last state; `last` is renewed before it is entered.
    fn begin(&mut self, mode: i8, set_point: (SetPoint, u64), last: State) -> Result<(), Stopped> {
        self.write_raw(Field::SetPoint(SetPoint::Mode), u64::from(mode as u8))?;
        self.objects.network(Command::Start)?;
        self.command_state(Controlword::DISABLE_VOLTAGE, State::SwitchOnDisabled)?;
        self.command_state(Controlword::SHUTDOWN, State::ReadyToSwitchOn)?;
        self.command_state(Controlword::SWITCH_ON, State::SwitchedOn)?;
        let (field, raw) = set_point;
        self.write_raw(Field::SetPoint(field), raw)?;
        self.command_state(Controlword::ENABLE_OPERATION, last)
    }

    fn begin_or_off(&mut self, mode: i8, set_point: (SetPoint, u64), last: State) -> Result<(), Stopped> {
        let begun = self.begin(mode, set_point, last);
        if begun.is_err() {
            // The first error is the one that is told.
            let _ = self.off();
        }
        begun
    }

    fn write_setting(&mut self, entry: Entry, value: f64) -> Result<(), Stopped> {
        let refused = |error: crate::remote::RemoteError| Stopped::Refused(error.to_string());
        let whole = entry.text.scale == 1.0 && crate::remote::value::integer(entry.object.data_type).is_some();
        let value = if whole { Value::Integer(value.round() as i128) } else { Value::Real(value) };
        let bytes = entry.encode(&value).map_err(refused)?;
        self.objects.download(entry.object.index, entry.object.sub_index, &bytes)
    }

    /// Settings that act at once come last: the others have to permit them.
    fn offer(&mut self, settings: &[(Setting, f64)]) -> Result<(), Stopped> {
        let entries = settings.iter().map(|(setting, value)| (Entry::of_setting(*setting), *value));
        let (at_once, staged): (Vec<_>, Vec<_>) =
            entries.partition(|(entry, _)| matches!(entry.object.field, Field::AtOnce(_)));
        for (entry, value) in staged {
            self.write_setting(entry, value)?;
        }
        self.take_staged()?;
        for (entry, value) in at_once {
            self.write_setting(entry, value)?;
        }
        Ok(())
    }

    fn take_staged(&mut self) -> Result<(), Stopped> {
        for _ in 0..OFFERS {
            let taken = self.write_raw(Field::Configuration(ConfigurationField::Command), TAKE);
            let Err(Stopped::Refused(words)) = taken else { return taken };
            if self.raw(Field::Configuration(ConfigurationField::Result))? != BUSY {
                return Err(self.explained(words));
            }
            self.objects.pass(TAKEN)?;
        }
        Err(Stopped::Joint("its control step does not take a configuration".into()))
    }

    /// The setting that was refused, and what would be possible; where the joint does not say, the words of the
    /// refusal.
    fn explained(&mut self, words: String) -> Stopped {
        let mut details = || -> Result<Option<String>, Stopped> {
            let code = self.raw(Field::Configuration(ConfigurationField::RefusedSetting))?;
            let name = Name::from_code(code as u32).text();
            if name.is_empty() {
                return Ok(None);
            }
            let mut number = |part| self.number(Field::Configuration(part));
            let value = number(ConfigurationField::RefusedValue)?;
            let (low, high) = (number(ConfigurationField::Lowest)?, number(ConfigurationField::Highest)?);
            Ok(Some(format!(
                "the joint refuses its {name} of {value}: {low} to {high} is possible with the other settings; nothing was changed"
            )))
        };
        Stopped::Refused(details().ok().flatten().unwrap_or(words))
    }

    fn window_part(&mut self, part: OpenLoopField) -> Result<f64, Stopped> {
        self.number(Field::OpenLoop(part))
    }

    fn window_raw(&mut self, part: OpenLoopField) -> Result<u32, Stopped> {
        Ok(self.raw(Field::OpenLoop(part))? as u32)
    }
}

impl<O: Objects> Bench for Joint<O> {
    fn enable(&mut self) -> Result<(), Stopped> {
        self.begin_or_off(OPEN_LOOP, (SetPoint::OpenLoop, 0), State::OpenLoop)?;
        self.told = Told::Apply;
        Ok(())
    }

    fn apply(&mut self, frame: &Frame) -> Result<(), Stopped> {
        self.write_raw(Field::SetPoint(SetPoint::OpenLoop), frame.raw())
    }

    fn window(&mut self, ripple: bool) -> Result<Window, Stopped> {
        use OpenLoopField as Part;
        let number = self.window_raw(Part::Number)?;
        let mut window = Window {
            number,
            current: [self.window_part(Part::CurrentAlong)?, self.window_part(Part::CurrentAcross)?],
            voltage: [self.window_part(Part::VoltageAlong)?, self.window_part(Part::VoltageAcross)?],
            ripple_along: f64::NAN,
            ripple_across: f64::NAN,
            alternating: [f64::NAN; 2],
            encoder: self.window_raw(Part::Encoder)?,
            field: self.window_raw(Part::Field)?,
            referenced: self.window_raw(Part::Referenced)? != 0,
        };
        if ripple {
            let mut amplitude = |sine, cosine| Ok(self.window_part(sine)?.hypot(self.window_part(cosine)?));
            window.ripple_along = amplitude(Part::InPhaseAlong, Part::QuadratureAlong)?;
            window.ripple_across = amplitude(Part::InPhaseAcross, Part::QuadratureAcross)?;
            window.alternating =
                [self.window_part(Part::AlternatingAlong)?, self.window_part(Part::AlternatingAcross)?];
        }
        match self.state()? {
            State::OpenLoop => Ok(window),
            state => Err(self.stopped(state)),
        }
    }

    fn pass(&mut self, seconds: f64) -> Result<(), Stopped> {
        self.objects.pass(seconds)
    }

    fn off(&mut self) -> Result<(), Stopped> {
        self.told = Told::Nothing;
        // One frame without an answer: outside of OPERATIONAL no set-point counts, and the open loop ends in the same
        // control step.
        self.objects.network(Command::EnterPreOperational)?;
        let mut waited = 0.0;
        loop {
            let state = self.state()?;
            if matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault) {
                return Ok(());
            }
            if waited > BRAKING {
                return Err(self.stopped(state));
            }
            // A user who has asked to stop is not kept waiting: it ends by itself.
            if self.objects.pass(LOOK).is_err() {
                return Ok(());
            }
            waited += LOOK;
        }
    }

    fn acknowledge(&mut self) -> Result<(), Stopped> {
        self.objects.network(Command::Start)?;
        let done = self
            .controlword(Controlword::DISABLE_VOLTAGE)
            .and_then(|()| self.controlword(Controlword::FAULT_RESET))
            .and_then(|()| self.objects.pass(TAKEN));
        self.objects.network(Command::EnterPreOperational)?;
        done?;
        match self.faults()? {
            faults if faults.is_empty() => Ok(()),
            faults => Err(Stopped::Joint(format!("the fault stays: {}", condition::list(&faults)))),
        }
    }

    fn condition(&mut self) -> Result<Condition, Stopped> {
        let state = self.state()?;
        let faults = self.faults()?;
        Ok(Condition {
            state: condition::name(state).into(),
            faults: if faults.is_empty() { String::new() } else { condition::list(&faults) },
            armed: !matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault),
            staged: self.raw(Field::Configuration(ConfigurationField::Changed))? != 0,
            supply: self.number(Field::Actual(Actual::BusVoltage))?,
            winding: self.number(Field::Actual(Actual::WindingTemperature))?,
            bridge: self.number(Field::Actual(Actual::BridgeTemperature))?,
        })
    }

    fn rate(&mut self) -> Result<f64, Stopped> {
        self.number(Field::OpenLoop(OpenLoopField::ControlRate))
    }

    fn setting(&mut self, setting: Setting) -> Result<f64, Stopped> {
        self.number(Entry::of_setting(setting).object.field)
    }

    fn set(&mut self, settings: &[(Setting, f64)]) -> Result<(), Stopped> {
        let taken = self.offer(settings);
        if taken.is_err() {
            // If this fails too, the first error is the one that says why.
            let _ = self.write_raw(Field::Configuration(ConfigurationField::Command), FORGET);
        }
        taken
    }

    fn store(&mut self, restart: bool) -> Result<(), Stopped> {
        for attempt in 1.. {
            match self.objects.store() {
                Err(Stopped::Refused(_)) if attempt < STORES => self.objects.pass(REST)?,
                stored => {
                    stored?;
                    break;
                }
            }
        }
        if !restart {
            return Ok(());
        }
        self.objects.network(Command::ResetNode)?;
        // It measures its currents' zeros; what was asked of it before it was ready is asked again.
        for _ in 0..STARTS {
            self.objects.pass(START)?;
            match self.state() {
                Err(Stopped::Bus(_)) => {}
                ready => return ready.map(drop),
            }
        }
        self.state().map(drop)
    }

    fn begin_motion(&mut self, mode: Motion) -> Result<(), Stopped> {
        let (number, set_point, at) = match mode {
            Motion::Velocity => (VELOCITY, SetPoint::TargetVelocity, 0.0),
            Motion::Position => (POSITION, SetPoint::TargetPosition, self.number(Field::Actual(Actual::Position))?),
        };
        let raw = Entry::of(Field::SetPoint(set_point)).saturate(at);
        self.begin_or_off(number, (set_point, raw), State::OperationEnabled)?;
        self.told = Told::Move(mode);
        Ok(())
    }

    fn move_to(&mut self, set_point: f64) -> Result<(), Stopped> {
        let field = match self.told {
            Told::Move(Motion::Velocity) => SetPoint::TargetVelocity,
            Told::Move(Motion::Position) => SetPoint::TargetPosition,
            Told::Nothing | Told::Apply => return Err(Stopped::Joint("it was not told to move".into())),
        };
        let raw = Entry::of(Field::SetPoint(field)).saturate(set_point);
        self.write_raw(Field::SetPoint(field), raw)
    }

    fn motion(&mut self) -> Result<[f64; 3], Stopped> {
        if let Told::Move(_) = self.told {
            let state = self.state()?;
            if state != State::OperationEnabled {
                // It stopped before it was told to.
                self.told = Told::Nothing;
                return Err(self.stopped(state));
            }
        }
        let rated = self.number(Field::Actual(Actual::RatedTorque))?;
        Ok([
            self.number(Field::Actual(Actual::Position))?,
            self.number(Field::Actual(Actual::Velocity))?,
            self.number(Field::Actual(Actual::Torque))? * rated,
        ])
    }
}
