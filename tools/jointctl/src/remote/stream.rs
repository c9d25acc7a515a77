//! Set-points at a rate, into an enabled joint; host, a thread of its own.
//!
//! The thread renews the command, so that the joint's command deadline holds as long as this program runs and the bus
//! works. Where it ends, by [`Stream::end`], an error or a panic, the joint brakes along its quick-stop ramp and is
//! left disabled, in PRE-OPERATIONAL; where this program is killed or the bus is cut, the joint brakes by itself once
//! its command deadline is over.

use super::configured;
use super::drive::{BRAKING, LOOK};
use super::entry::Entry;
use super::error::RemoteError;
use super::interpolation::Interpolation;
use super::joint::RemoteJoint;
use super::pdo::{Change, Direction, Pdo, pack};
use bus::Frame;
use bus::client::{ClientError, Command as Nmt, NmtState, Subscription, Target};
use canopen_node::{MappedObject, PdoParameters};
use joint_firmware::joint::state_machine::{Controlword, State};
use joint_firmware::joint::{Command, Mode};
use joint_firmware::objects::field::{Actual, Field, RANGES, Range, SetPoint};
use joint_firmware::objects::settings::Setting;
use joint_firmware::objects::{Operation, default_communication, impedance_frame};
use std::sync::atomic::{AtomicU16, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest time for which other clients are listened for, s.
const LISTENED: f64 = 0.2;
/// Set-points a second: least and most.
pub const RATES: [f64; 2] = [1.0, 1_000.0];
/// RPDOs of the joint: drive and torque and position; velocity; impedance frame.
const DRIVE: u8 = 0;
const VELOCITY: u8 = 1;
const IMPEDANCE: u8 = 2;

/// The mode of operation in which a master streams a mode's set-points.
fn operation(mode: Mode) -> Operation {
    match mode {
        Mode::Position => Operation::Position,
        Mode::Profile => Operation::ProfilePosition,
        Mode::Velocity => Operation::Velocity,
        Mode::Torque => Operation::Torque,
        Mode::Impedance => Operation::Impedance,
        Mode::OpenLoop => Operation::OpenLoop,
        Mode::Hold => Operation::None,
    }
}

/// The open loop is a bench's, not a master's; a joint that holds is asked for nothing.
pub(super) fn no_set_points() -> RemoteError {
    let object = Entry::of(Field::SetPoint(SetPoint::Mode)).described();
    RemoteError::Value { object, problem: "the open loop has no set-points; `jointctl commission` uses it".into() }
}

/// Command that is sent, as a function of the time since it began.
type Source = Box<dyn FnMut(Duration) -> Command + Send>;

/// State that the thread and everyone else share.
#[derive(Debug)]
struct Shared {
    controlword: AtomicU16,
    /// Reason for the thread's end.
    failure: Mutex<Option<RemoteError>>,
}

/// Encoder of a command into frames.
struct Encoder {
    pdos: Vec<(u16, PdoParameters)>,
    mode: Mode,
    rated_torque: f64,
    ranges: [f32; RANGES],
    counter: u8,
}

impl Encoder {
    fn frames(&mut self, controlword: Controlword, command: &Command) -> Vec<Frame> {
        self.counter = self.counter.wrapping_add(1);
        let value = |object: MappedObject| {
            let Some(entry) = Entry::at(object.index(), object.sub_index()) else { return 0 };
            match entry.object.field {
                Field::SetPoint(SetPoint::Controlword) => controlword.0.into(),
                Field::SetPoint(SetPoint::Mode) => u64::from(operation(self.mode).number() as u8),
                Field::SetPoint(SetPoint::Counter) => self.counter.into(),
                Field::SetPoint(SetPoint::TargetTorque) => {
                    entry.saturate(f64::from(command.torque) / self.rated_torque)
                }
                Field::SetPoint(SetPoint::TargetPosition) => entry.saturate(command.position.into()),
                Field::SetPoint(SetPoint::TargetVelocity) => entry.saturate(command.velocity.into()),
                Field::SetPoint(SetPoint::ImpedanceFrame) => impedance_frame(command, self.ranges),
                _ => 0,
            }
        };
        let frame = |(identifier, parameters): &(u16, PdoParameters)| Frame::new(*identifier, &pack(parameters, value));
        self.pdos.iter().filter_map(frame).collect()
    }
}

/// Set-points of other clients for a joint, from now on.
struct Others {
    node: u8,
    began: Instant,
    frames: Subscription,
}

impl Others {
    /// On the identifiers of a joint's RPDOs as they are at first; its own client's are not heard.
    fn of(joint: &RemoteJoint) -> Self {
        let node = joint.id();
        let identifiers = default_communication(node).receive.map(|pdo| pdo.cob_id as u16 & 0x7FF);
        let frames = joint.network().subscribe(move |frame| identifiers.contains(&frame.id()));
        Self { node, began: Instant::now(), frames }
    }

    /// Listens until so much time is over.
    fn none_within(&self, time: Duration) -> Result<(), RemoteError> {
        match self.frames.next(time.saturating_sub(self.began.elapsed()))? {
            Some(received) => Err(RemoteError::Commanded { node: self.node, identifier: received.frame.id() }),
            None => Ok(()),
        }
    }
}

/// Set-points on their way to a joint.
pub struct Stream {
    joint: RemoteJoint,
    shared: Arc<Shared>,
    changes: Vec<Change>,
    /// Presence of a date of the configuration at the beginning.
    dated: bool,
    interpolation: Option<Interpolation>,
    /// Channel to the thread, which ends when it is dropped.
    sources: Option<Sender<Source>>,
    thread: Option<JoinHandle<()>>,
    /// `true` if the joint may follow this program. One that does not is not this one's to disable.
    commanding: bool,
    ended: bool,
}

impl std::fmt::Debug for Stream {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Stream").field("joint", &self.joint).finish_non_exhaustive()
    }
}

impl Stream {
    /// Enables the joint in a mode and holds it: no torque, no velocity, or the position where it is. `rate` set-points
    /// a second, at least two within the joint's command deadline; where it can, the joint goes from one position or
    /// velocity to the next in a straight line. `acknowledge` resets a fault whose cause is
    /// gone; without it a fault is an error. Another client's set-points are listened for first, for as long as the
    /// joint's command deadline, 0.2 s at most, and refused: the joint would follow whoever came last.
    pub fn begin(joint: &RemoteJoint, mode: Mode, rate: f64, acknowledge: bool) -> Result<Self, RemoteError> {
        let position = joint.number(Field::Actual(Actual::Position))? as f32;
        Self::begin_with(joint, Command { mode, position, ..Command::default() }, rate, acknowledge)
    }

    /// As [`Stream::begin`], in the mode of `hold`, which is what is asked of the joint at first.
    pub fn begin_with(joint: &RemoteJoint, hold: Command, rate: f64, acknowledge: bool) -> Result<Self, RemoteError> {
        let mode = hold.mode;
        let others = Others::of(joint);
        let deadline = joint.number(Field::Setting(Setting::CommandDeadline))?;
        let [low, high] = RATES;
        // Upwards, and a REAL32's 0.1 s as the 0.1 s that it means.
        let low = low.max((2.0 / deadline - 1e-3).ceil());
        if !(low..=high).contains(&rate) {
            return Err(RemoteError::Range { what: "the rate of set-points", value: rate, low, high, unit: "Hz" });
        }
        let faults = joint.faults()?;
        if joint.state()? == State::Fault && !acknowledge {
            return Err(RemoteError::Fault { node: joint.id(), faults });
        }
        others.none_within(Duration::from_secs_f64(deadline.clamp(0.0, LISTENED)))?;
        let encoder_of = |changes: &[Change]| -> Result<Encoder, RemoteError> {
            let mut ranges = [0.0; RANGES];
            for (value, range) in ranges.iter_mut().zip(Range::ALL) {
                *value = joint.number(Field::Range(range))? as f32;
            }
            Ok(Encoder {
                pdos: changes.iter().map(|change| (change.identifier(), *change.parameters())).collect(),
                mode,
                rated_torque: joint.number(Field::Actual(Actual::RatedTorque))?,
                ranges,
                counter: joint.raw(Field::SetPoint(SetPoint::Counter))? as u8,
            })
        };
        let shared = Shared { controlword: AtomicU16::new(Controlword::DISABLE_VOLTAGE.0), failure: Mutex::default() };
        let mut stream = Self {
            joint: joint.clone(),
            shared: Arc::new(shared),
            changes: Vec::new(),
            dated: false,
            interpolation: None,
            sources: None,
            thread: None,
            commanding: false,
            ended: false,
        };
        // From here on a failure puts back what was changed, and leaves the joint disabled.
        let defaults = default_communication(joint.id()).receive;
        let needed: &[u8] = match mode {
            Mode::Torque | Mode::Position => &[DRIVE],
            Mode::Velocity => &[VELOCITY],
            Mode::Impedance => &[DRIVE, IMPEDANCE],
            Mode::OpenLoop | Mode::Hold | Mode::Profile => return Err(no_set_points()),
        };
        let period = Duration::from_secs_f64(1.0 / rate);
        stream.dated = configured::keep(joint, || {
            for pdo in Pdo::all(Direction::Receive).into_iter().filter(|pdo| needed.contains(&pdo.number)) {
                if let Some(wanted) = defaults.get(usize::from(pdo.number)) {
                    stream.changes.push(pdo.ensure(joint, wanted)?);
                }
            }
            if matches!(mode, Mode::Position | Mode::Velocity) {
                stream.interpolation = Interpolation::begin(joint, period)?;
            }
            Ok(())
        })?;
        joint.write_raw(Field::SetPoint(SetPoint::Mode), u64::from(operation(mode).number() as u8))?;
        stream.commanding = true;
        joint.nmt(Nmt::Start, NmtState::Operational)?;
        let encoder = encoder_of(&stream.changes)?;
        stream.start(encoder, hold, period);
        stream.enable(acknowledge)?;
        Ok(stream)
    }

    fn start(&mut self, mut encoder: Encoder, hold: Command, period: Duration) {
        let (sources, inbox) = channel::<Source>();
        let identifiers = encoder.pdos.iter().map(|(identifier, _)| *identifier).collect::<Vec<_>>();
        // One's own frames are not heard: these are somebody else's.
        let foreign = self.joint.network().subscribe(move |frame| identifiers.contains(&frame.id()));
        let (joint, shared) = (self.joint.clone(), Arc::clone(&self.shared));
        self.thread = Some(std::thread::spawn(move || {
            let mut source: Source = Box::new(move |_| hold);
            let mut began = Instant::now();
            let mut due = began;
            loop {
                match inbox.recv_timeout(due.saturating_duration_since(Instant::now())) {
                    Ok(next) => (source, began) = (next, Instant::now()),
                    Err(RecvTimeoutError::Disconnected) => return,
                    Err(RecvTimeoutError::Timeout) => {
                        let command = source(began.elapsed());
                        let controlword = Controlword(shared.controlword.load(Ordering::Relaxed));
                        if let Err(error) = send(&joint, &encoder.frames(controlword, &command), &foreign) {
                            *shared.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                            return;
                        }
                        // A host that comes late leaves set-points out.
                        due = (due + period).max(Instant::now());
                    }
                }
            }
        }));
        self.sources = Some(sources);
    }

    fn enable(&self, acknowledge: bool) -> Result<(), RemoteError> {
        self.joint.require_configuration()?;
        if acknowledge && self.joint.state()? == State::Fault {
            self.command_state(Controlword::FAULT_RESET, State::SwitchOnDisabled)?;
        }
        // From wherever somebody left it.
        self.command_state(Controlword::DISABLE_VOLTAGE, State::SwitchOnDisabled)?;
        for (word, state) in [
            (Controlword::SHUTDOWN, State::ReadyToSwitchOn),
            (Controlword::SWITCH_ON, State::SwitchedOn),
            (Controlword::ENABLE_OPERATION, State::OperationEnabled),
        ] {
            self.command_state(word, state)?;
        }
        Ok(())
    }

    fn command_state(&self, controlword: Controlword, wanted: State) -> Result<(), RemoteError> {
        self.shared.controlword.store(controlword.0, Ordering::Relaxed);
        // Each step to "operation enabled" may take as long as an answer.
        let patience = self.joint.network().patience();
        let deadline = Instant::now() + patience;
        loop {
            self.failure()?;
            let state = self.joint.state()?;
            if state == wanted {
                return Ok(());
            }
            if Instant::now() > deadline {
                let node = self.joint.id();
                return Err(match state {
                    State::Fault => RemoteError::Fault { node, faults: self.joint.faults()? },
                    _ => RemoteError::State { node, state, wanted, within_ms: patience.as_millis() as u64 },
                });
            }
            std::thread::sleep(LOOK);
        }
    }

    fn failure(&self) -> Result<(), RemoteError> {
        match &*self.shared.failure.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error.clone()),
            None => Ok(()),
        }
    }

    /// Sets what is asked of the joint from now on. Its mode is that of [`Stream::begin`].
    pub fn set(&self, command: Command) {
        self.play(move |_| command);
    }

    /// Sets what is asked of the joint from now on, as a function of the time since now. It runs in the sending thread,
    /// once a period, and has to be quick.
    pub fn play(&self, source: impl FnMut(Duration) -> Command + Send + 'static) {
        if let Some(sources) = &self.sources {
            // A thread that has ended has said why.
            let _ = sources.send(Box::new(source));
        }
    }

    /// Checks that set-points still go out and the joint follows them; asks the joint.
    pub fn check(&self) -> Result<(), RemoteError> {
        self.failure()?;
        match self.joint.state()? {
            State::OperationEnabled => Ok(()),
            state => Err(RemoteError::Stopped { node: self.joint.id(), state, faults: self.joint.faults()? }),
        }
    }

    /// Brakes, switches off and puts RPDOs and 60C2h back as they were; the state that the joint is left in.
    pub fn end(mut self) -> Result<State, RemoteError> {
        self.finish()
    }

    fn finish(&mut self) -> Result<State, RemoteError> {
        self.ended = true;
        if !self.commanding {
            self.put_back()?;
            return self.joint.state();
        }
        self.shared.controlword.store(Controlword::QUICK_STOP.0, Ordering::Relaxed);
        // With set-points that go on: outside OPERATIONAL a joint that brakes for longer than its command deadline has
        // a fault.
        let began = Instant::now();
        while self.thread.is_some() && self.failure().is_ok() && began.elapsed() < BRAKING {
            match self.joint.state() {
                Ok(State::OperationEnabled | State::QuickStopActive) => std::thread::sleep(LOOK),
                // Another client's question is in the way, and over soon.
                Err(RemoteError::Client(ClientError::OtherClient { .. })) => std::thread::sleep(LOOK),
                _ => break,
            }
        }
        let disabled = self.joint.disable();
        self.sources.take();
        if let Some(thread) = self.thread.take() {
            // It panics only where a source does, which has been reported.
            let _ = thread.join();
        }
        if disabled.is_err() {
            // The one frame that may still arrive where answers do not.
            let _ = self.joint.network().command(Nmt::EnterPreOperational, Target::Node(self.joint.id()));
        }
        let state = disabled?;
        self.put_back()?;
        Ok(state)
    }

    fn put_back(&self) -> Result<(), RemoteError> {
        let undo = || {
            self.interpolation.iter().try_for_each(|interpolation| interpolation.undo(&self.joint))?;
            self.changes.iter().try_for_each(|change| change.undo(&self.joint))
        };
        if self.dated { configured::keep(&self.joint, undo).map(drop) } else { undo() }
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        if !self.ended {
            // The error that brought us here is what is reported.
            let _ = self.finish();
        }
    }
}

fn send(joint: &RemoteJoint, frames: &[Frame], foreign: &Subscription) -> Result<(), RemoteError> {
    if let Some(received) = foreign.try_next()? {
        return Err(RemoteError::OtherMaster { node: joint.id(), identifier: received.frame.id() });
    }
    frames.iter().try_for_each(|frame| joint.network().send(frame)).map_err(|error: ClientError| error.into())
}
