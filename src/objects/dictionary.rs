//! The joint's objects as [`canopen`](canopen_node) asks for them; the task.

mod configured;
mod guarded;

use super::emergency::{Emergency, LOST, LOST_BIT, Reports, of_refusal};
use super::fault_log::{self, FaultLogging, LOGS};
use super::field::{
    ConfigurationField, Field, HardwareField, ImageField, LogField, OpenLoopField, OwnerField, ProfileParameter, Range,
    ResetField, SetPoint, StorageField,
};
use super::images::{Circumstances, Failure, Images, StoredImages, abort};
use super::number::to_i32;
use super::observed::{Observed, signed};
use super::operation::Operation;
use super::ownership::{SESSIONS, UPLOAD};
use super::profile_modes::{PROFILE_MODES, ProfileModes, Wish};
use super::program::Program;
use super::refused::Refused;
use super::settings::Setting;
use super::shared::Shared;
use super::start::Start;
use super::store_budget::StoreBudget;
use super::stored::{Part, Update, communication_parameters, is_range};
use super::{hardware, history, last_reset, open_loop, table};
use crate::hardware::chip_options::COMMAND;
use crate::joint::PROFILES;
use crate::joint::configuration::Configuration;
use crate::joint::state_machine::State;
use crate::motor::number::exceeds;
use crate::motor::open_loop::Window;
use crate::reset_record::LastReset;
use canopen_node::{
    Abort, Access, COUNTER_AND_DATE, CommunicationParameters, Entry, Event, Group, Length, NmtState, ObjectDictionary,
};
use core::cell::Cell;
use friction_compensation::parameters::authentication::{CHALLENGE, STAGING, TAG};
use friction_compensation::parameters::life_cycle::{Action, LifeCycle, Refusal};
use friction_compensation::parameters::slots::SlotError;
use heapless::Deque;

/// EMCYs that wait for the task; when they are more, the newest are dropped.
const WAITING: usize = 8;
/// Longest time that the erasing of a page takes, s (from memory, not measured: some 22 ms).
const ERASING: f32 = 0.03;
/// rad.
const QUARTER_TURN: f32 = core::f32::consts::FRAC_PI_2;

/// The task's part of the objects.
#[derive(Debug)]
pub struct Objects<'a, P> {
    shared: &'a Shared,
    program: P,
    images: Images<'a>,
    observed: Observed,
    state: NmtState,
    configuration: Configuration,
    staged: Configuration,
    refused: Refused,
    /// Window as it was when its number was read.
    window: Cell<Window>,
    single_bank: bool,
    stores: StoreBudget,
    now: u64,
    heartbeat_lost: bool,
    /// `true` once the start has been reported.
    told_reset: bool,
    /// A stored object has another value than when it was asked for last.
    changed: bool,
    /// `true` if a master has started the node since the program began.
    was_started: bool,
    /// Node id as it was when communication began; what is stored holds for it.
    node_id: Cell<u8>,
    reports: Reports,
    profile_modes: [ProfileModes; PROFILE_MODES],
    emergencies: Deque<Emergency, WAITING>,
    logging: [FaultLogging; LOGS as usize],
}

impl<'a, P: Program> Objects<'a, P> {
    /// One for each [`Shared`].
    pub fn new(shared: &'a Shared, program: P, mut images: Images<'a>, start: &Start) -> Self {
        let Start { configuration, ranges, lost, single_bank, stores_left } = *start;
        images.owner.note(&configuration);
        for (range, value) in Range::ALL.into_iter().zip(ranges) {
            shared.set_range(range, value);
        }
        shared.rate(&configuration);
        shared.lock(lost);
        let powered_up = LOGS && program.last_reset().causes & LastReset::POWER != 0;
        let objects = Self {
            shared,
            program,
            images,
            observed: Observed::default(),
            state: NmtState::Initialising,
            configuration,
            staged: configuration,
            refused: Refused::default(),
            window: Cell::new(Window::NOTHING),
            single_bank,
            stores: StoreBudget::new(stores_left),
            now: 0,
            heartbeat_lost: false,
            told_reset: false,
            changed: false,
            was_started: false,
            node_id: Cell::new(0),
            reports: Reports::default(),
            profile_modes: [ProfileModes::NOTHING; PROFILE_MODES],
            emergencies: Deque::new(),
            logging: [const { FaultLogging::new() }; LOGS as usize].map(|logging| logging.started(powered_up)),
        };
        objects.publish();
        objects
    }

    /// Begins anew, as at power-on: for a program that goes on running when the node is reset
    /// ([`Event::Reset`](canopen_node::Event::Reset)). What is staged, tried, or waits to be reported is forgotten;
    /// how often a record may be written is not.
    pub fn restart(&mut self, life: LifeCycle, stored_images: StoredImages, start: &Start) {
        let Start { configuration, ranges, lost, single_bank, .. } = *start;
        self.images.restart(life, stored_images);
        self.images.owner.note(&configuration);
        (self.configuration, self.staged, self.refused) = (configuration, configuration, Refused::default());
        self.single_bank = single_bank;
        (self.heartbeat_lost, self.told_reset, self.changed) = (false, false, false);
        for (range, value) in Range::ALL.into_iter().zip(ranges) {
            self.shared.set_range(range, value);
        }
        self.shared.rate(&configuration);
        self.shared.lock(lost);
        self.window.set(Window::NOTHING);
        self.reports = Reports::default();
        self.emergencies.clear();
        self.publish();
    }

    /// The program around the objects.
    pub fn program(&mut self) -> &mut P {
        &mut self.program
    }

    /// Configuration in use.
    pub fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// Every millisecond or so: what is known of the joint, and the time, ms, that does not wrap. Ends trials.
    pub fn poll(&mut self, now: u64, observed: &Observed) {
        self.now = now;
        self.observed = *observed;
        if self.stores.refill(now as u32) {
            self.program.note_stores_left(self.stores.left());
        }
        self.images.tick(now, self.heartbeat_lost);
        while !self.emergencies.is_full()
            && let Some(emergency) = self.reports.next(observed, &self.program.hardware().driver, now)
        {
            self.report(emergency);
        }
        for logging in &mut self.logging {
            logging.observe(observed.latched, now);
            logging.poll(now, &mut self.program);
        }
        self.follow_profile();
        self.publish();
    }

    /// Looks after the profile modes, where the program has them. What the joint calls its zero it may be told anew
    /// while it is enabled: the control step moves its references with it.
    #[inline(never)]
    fn follow_profile(&mut self) {
        let permitted = self.images.owner.is_open(self.now);
        let wishes = self
            .profile_modes
            .each_mut()
            .map(|modes| modes.poll(self.now, &self.observed, &self.configuration, self.shared, permitted));
        for wish in wishes {
            let Wish::Zero(zero) = wish else { continue };
            let mut configuration = self.configuration;
            let possible = Setting::JointZero.set(&mut configuration, zero.to_bits());
            let taken = if possible { self.configure(&configuration) } else { Err(Abort::VALUE) };
            if taken.is_ok() {
                self.staged.gear.zero = configuration.gear.zero;
            }
            self.profile_modes.iter_mut().for_each(|modes| modes.answer(taken));
        }
    }

    /// Takes the next EMCY that [`Server::emergency`](canopen_node::Server::emergency) is to send, one at a time.
    pub fn take_emergency(&mut self) -> Option<Emergency> {
        self.emergencies.pop_front()
    }

    /// Takes the next action of the program on an image; how that went it tells by [`Objects::finished`].
    pub fn take_action(&mut self) -> Action {
        self.images.take_action()
    }

    /// The staging buffer, for an action.
    pub fn staging(&mut self) -> &mut [u8; STAGING] {
        self.images.staging()
    }

    /// The staging buffer and the program, for an action that needs both.
    pub fn staging_and_program(&mut self) -> (&mut [u8; STAGING], &mut P) {
        (self.images.staging(), &mut self.program)
    }

    /// Takes the outcome of an action, and what the slots hold now. The next action is there to be taken.
    pub fn finished(&mut self, outcome: Result<(), SlotError>, stored: StoredImages) {
        self.images.set_stored(stored);
        if let Some(emergency) = self.images.finished(outcome, self.observed.latched) {
            self.report(emergency);
        }
        self.publish();
    }

    fn publish(&self) {
        self.shared.set_image(self.images.version(), self.images.state());
    }

    fn report(&mut self, mut emergency: Emergency) {
        if self.damaged() != 0 {
            emergency.register |= LOST_BIT;
        }
        // An EMCY that does not fit is in the objects all the same.
        let _ = self.emergencies.push_back(emergency);
    }

    /// Has the log that outlives the power tell of it.
    fn log(&mut self, code: u16, fault: u8) {
        for logging in &mut self.logging {
            logging.note(code, fault, self.now);
        }
    }

    /// Damaged parts of the storage: bits as of EMCY [`LOST`].
    fn damaged(&self) -> u8 {
        self.program.damaged() | u8::from(self.shared.is_locked()) << 1
    }

    /// Under current, or one command away from it.
    fn armed(&self) -> bool {
        let state = self.observed.telemetry.state;
        !matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault)
    }

    /// Returns `true` if the joint cannot do without its control steps for as long as the erasing of a page takes them
    /// on one bank: it is armed, or turns so fast that the encoder would lose count of the turns.
    fn needs_control(&self) -> bool {
        let rotor = self.observed.telemetry.motion.velocity * self.configuration.gear.ratio;
        self.armed() || exceeds(rotor, QUARTER_TURN / ERASING)
    }

    fn circumstances(&self) -> Circumstances {
        let torque = (self.configuration.limits.torque * 65_536.0) as u32;
        Circumstances { now: self.now, armed: self.needs_control(), single_bank: self.single_bank, torque }
    }

    /// Reports a refusal of the life cycle.
    fn refuse(&mut self, refusal: Refusal) -> Abort {
        self.report(of_refusal(refusal, self.observed.latched));
        abort(refusal)
    }

    fn fail(&mut self, failure: Failure) -> Abort {
        match failure {
            Failure::Refused(refusal) => self.refuse(refusal),
            Failure::Abort(abort) => abort,
        }
    }

    /// Returns `true` if what is staged differs in any object: a loop over the table is a tenth of the code of
    /// comparing the records.
    fn is_changed(&self) -> bool {
        table::OBJECTS.iter().any(|object| match object.field {
            Field::Setting(setting) | Field::AtOnce(setting) => {
                setting.get(&self.staged) != setting.get(&self.configuration)
            }
            _ => false,
        })
    }

    fn readable(&self, field: Field) -> u32 {
        match field {
            Field::Image(ImageField::Active) => self.images.active_length(),
            Field::Image(ImageField::Staging) => self.images.life().length() as u32,
            Field::Owner(OwnerField::Challenge) => CHALLENGE as u32,
            Field::History => self.program.history(history::length).unwrap_or(0),
            Field::Log(_) if LOGS => fault_log::length(&self.program),
            Field::Reset(_) => last_reset::place(&self.program.last_reset()).len() as u32,
            _ => 0,
        }
    }

    fn value(&self, field: Field) -> u64 {
        match field {
            Field::Highest(number) => number.into(),
            Field::Constant(constant) => signed(constant.number()),
            Field::SetPoint(set_point) => self.shared.set_point(set_point),
            Field::Range(range) => self.shared.range(range).to_bits().into(),
            Field::Profile(_) | Field::Milli(_) | Field::Micro(_) if !PROFILES => 0,
            Field::Profile(parameter) => self.shared.parameter(parameter).into(),
            Field::Milli(setting) => signed(to_i32(1e3 * f32::from_bits(setting.get(&self.configuration)))),
            Field::Micro(setting) => signed(to_i32(1e6 * f32::from_bits(setting.get(&self.configuration)))),
            Field::Actual(actual) => self.observed.actual(actual, self.shared),
            Field::Setting(setting) => setting.get(&self.staged).into(),
            Field::AtOnce(setting) => setting.get(&self.configuration).into(),
            Field::Configuration(ConfigurationField::Changed) => self.is_changed().into(),
            Field::Configuration(part) => self.refused.get(part).into(),
            Field::OpenLoop(part) => {
                if part == OpenLoopField::Number {
                    self.window.set(self.program.window());
                }
                open_loop::get(&self.window.get(), self.program.bridge(), part)
            }
            Field::Image(part) => self.images.get(part, self.now).into(),
            Field::Owner(part) => self.images.owner.get(part, self.is_present(), self.now).into(),
            Field::Reset(part) => last_reset::get(&self.program.last_reset(), part).into(),
            Field::Hardware(part) => hardware::get(&self.program.hardware(), part).into(),
            Field::Storage(StorageField::Damaged) => self.damaged().into(),
            Field::Storage(StorageField::StoresLeft) => self.stores.left().into(),
            Field::Log(LogField::PowerUps) if LOGS => self.program.power_ups().into(),
            Field::Log(LogField::Missed) => self.logging.first().map_or(0, FaultLogging::missed).into(),
            Field::Server | Field::History | Field::Log(_) => 0,
        }
    }

    fn write_set_point(&mut self, set_point: SetPoint, value: u64) -> Result<(), Abort> {
        match set_point {
            SetPoint::Mode if Operation::of(value as i8).is_none() => return Err(Abort::VALUE),
            // With none a joint that moves would never stop.
            SetPoint::ProfileAcceleration | SetPoint::ProfileDeceleration if PROFILES && value == 0 => {
                return Err(Abort::VALUE);
            }
            choice if choice.is_choice() => {}
            _ if self.state != NmtState::Operational => return Err(Abort::DEVICE_STATE),
            _ => {}
        }
        if self.shared.write(set_point, value) { Ok(()) } else { Err(Abort::LOCAL_CONTROL) }
    }

    fn write_range(&mut self, range: Range, value: f32) -> Result<(), Abort> {
        if !is_range(range, value) {
            return Err(Abort::VALUE);
        }
        // A frame must not change its meaning under a moving joint.
        if self.armed() {
            return Err(Abort::DEVICE_STATE);
        }
        self.changed |= COUNTER_AND_DATE && value != self.shared.range(range);
        self.shared.set_range(range, value);
        Ok(())
    }

    /// Sets the chip's option bytes, where `command` is the one that does.
    fn set_options(&mut self, command: u32) -> Result<(), Abort> {
        if command != COMMAND {
            return Err(Abort::VALUE);
        }
        self.authorise()?;
        if self.needs_control() || !self.program.set_options() {
            return Err(Abort::DEVICE_STATE);
        }
        Ok(())
    }
}

/// A part that belongs to `own` where `group` is to be changed, otherwise as it was.
fn part<T>(group: Group, own: Group, changed: Part<T>) -> Part<T> {
    if group == Group::All || group == own { changed } else { Part::Kept }
}

impl<P: Program> ObjectDictionary for Objects<'_, P> {
    fn entry(&self, index: u16, sub_index: u8) -> Result<Entry, Abort> {
        let Some(object) = table::find(index, sub_index) else {
            return Err(if table::exists(index) { Abort::NO_SUB_INDEX } else { Abort::NO_OBJECT });
        };
        let length = match object.data_type.bytes() {
            Some(bytes) => Length::Value(bytes),
            None => Length::Stream {
                readable: self.readable(object.field),
                writable: match object.field {
                    Field::Image(ImageField::Staging) => STAGING as u32,
                    Field::Owner(OwnerField::Key) => UPLOAD as u32,
                    Field::Owner(OwnerField::Response) => TAG as u32,
                    _ => 0,
                },
            },
        };
        Ok(Entry { length, access: object.access, mappable: object.mappable })
    }

    fn read(&mut self, index: u16, sub_index: u8, offset: u32, out: &mut [u8]) -> Result<(), Abort> {
        let object = table::find(index, sub_index).ok_or(Abort::NO_OBJECT)?;
        if object.access == Access::WriteOnly {
            return Err(Abort::WRITE_ONLY);
        }
        let done = match object.field {
            Field::Image(ImageField::Active) => {
                self.images.is_same_image(offset) && self.program.read_image(offset, out)
            }
            Field::Image(ImageField::Staging) => self.images.read_staged(offset, out),
            Field::Owner(OwnerField::Challenge) => {
                let draw = || if SESSIONS { self.program.random() } else { None };
                let challenge = self.images.owner.challenge(draw);
                challenge.is_some_and(|bytes| history::copy(&bytes, offset, out))
            }
            Field::History => self.program.history(|steps| history::read(steps, offset, out)).unwrap_or(false),
            Field::Log(LogField::Faults) if LOGS => fault_log::read(&self.program, offset, out),
            Field::Reset(ResetField::Place) => {
                history::copy(last_reset::place(&self.program.last_reset()), offset, out)
            }
            field => history::copy(&self.value(field).to_le_bytes(), offset, out),
        };
        if done { Ok(()) } else { Err(Abort::DEVICE_STATE) }
    }

    fn write(&mut self, index: u16, sub_index: u8, value: &[u8]) -> Result<(), Abort> {
        let object = table::find(index, sub_index).ok_or(Abort::NO_OBJECT)?;
        if object.access == Access::ReadOnly {
            return Err(Abort::READ_ONLY);
        }
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(value).for_each(|(byte, given)| *byte = *given);
        let number = u64::from_le_bytes(bytes);
        let word = number as u32;
        match object.field {
            Field::SetPoint(set_point) => self.write_set_point(set_point, number),
            Field::Range(range) => self.write_range(range, f32::from_bits(word)),
            Field::Setting(setting) => {
                self.authorise()?;
                let before = if COUNTER_AND_DATE { setting.get(&self.staged) } else { 0 };
                if !setting.set(&mut self.staged, word) {
                    return Err(Abort::VALUE);
                }
                self.changed |= COUNTER_AND_DATE && setting.get(&self.staged) != before;
                Ok(())
            }
            Field::AtOnce(setting) => self.write_at_once(setting, word),
            Field::Profile(parameter) if PROFILES => {
                if !parameter.permits(word) {
                    return Err(Abort::VALUE);
                }
                // These move the joint's zero, and its limits with it.
                if matches!(parameter, ProfileParameter::HomingMethod | ProfileParameter::HomeOffset) {
                    self.authorise()?;
                }
                self.shared.set_parameter(parameter, word);
                Ok(())
            }
            Field::Micro(setting) if PROFILES => self.write_limit(setting, word as i32),
            Field::Configuration(ConfigurationField::Command) => self.command_configuration(word),
            Field::Image(field) => self.write_image(field, word),
            Field::Owner(field) => self.write_owner(field, word),
            Field::Hardware(HardwareField::SetOptions) => self.set_options(word),
            _ => Err(Abort::READ_ONLY),
        }
    }

    fn open(&mut self, index: u16, sub_index: u8, length: Option<u32>) -> Result<(), Abort> {
        let object = table::find(index, sub_index).ok_or(Abort::NO_OBJECT)?;
        let result = match object.field {
            Field::Image(ImageField::Staging) => {
                self.images.owner.abandon();
                self.images.open(length).map_err(Failure::Refused)
            }
            Field::Owner(field) => {
                self.images.end();
                self.images.owner.open(field).map_err(Failure::Abort)
            }
            _ => Err(Failure::Abort(Abort::READ_ONLY)),
        };
        self.publish();
        result.map_err(|failure| self.fail(failure))
    }

    fn append(&mut self, _offset: u32, bytes: &[u8]) -> Result<(), Abort> {
        if self.images.owner.is_receiving() {
            return self.images.owner.append(bytes);
        }
        let result = self.images.append(bytes);
        self.publish();
        result.map_err(|failure| self.fail(failure))
    }

    #[inline(never)]
    fn finish(&mut self) -> Result<(), Abort> {
        if self.images.owner.is_receiving() {
            return self.finish_owner();
        }
        self.images.end();
        Ok(())
    }

    fn abandon(&mut self) {
        self.images.owner.abandon();
        self.images.end();
    }

    #[inline(never)]
    fn store(&mut self, group: Group, communication: &CommunicationParameters) -> Result<(), Abort> {
        self.authorise()?;
        let configuration = self.configuration;
        let ranges = Range::ALL.map(|range| self.shared.range(range));
        self.store_record(&Update {
            node_id: None,
            application: part(group, Group::Application, Part::New((&configuration, ranges))),
            communication: part(group, Group::Communication, Part::New((self.node_id.get(), communication))),
        })
    }

    #[inline(never)]
    fn restore(&mut self, group: Group) -> Result<(), Abort> {
        self.authorise()?;
        self.store_record(&Update {
            node_id: None,
            application: part(group, Group::Application, Part::Removed),
            communication: part(group, Group::Communication, Part::Removed),
        })
    }

    fn has_changed(&mut self) -> bool {
        core::mem::take(&mut self.changed)
    }

    fn may_change_node_id(&self) -> bool {
        !self.needs_control()
    }

    #[inline(never)]
    fn store_node_id(&mut self, node_id: u8) -> Result<(), Abort> {
        self.authorise()?;
        let update = Update { node_id: Some(node_id), application: Part::Kept, communication: Part::Kept };
        self.store_record(&update)?;
        self.configuration.node_id = node_id;
        self.staged.node_id = node_id;
        Ok(())
    }

    #[inline(never)]
    fn communication_parameters(&self, node_id: u8) -> CommunicationParameters {
        self.node_id.set(node_id);
        self.program.record(|record| communication_parameters(record, node_id))
    }

    fn event(&mut self, event: Event) {
        match event {
            Event::State(state) => {
                self.state = state;
                self.was_started |= state == NmtState::Operational;
                // Behind the boot-up message, which forgets what waits to be sent.
                if !self.told_reset && state == NmtState::PreOperational {
                    self.told_reset = true;
                    if let Some(emergency) = last_reset::emergency(&self.program.last_reset()) {
                        self.log(emergency.code, 0);
                        self.report(emergency);
                    }
                    let damaged = self.damaged();
                    if damaged != 0 {
                        self.report(Emergency { code: LOST, register: 0, information: [damaged, 0, 0, 0, 0] });
                    }
                }
            }
            Event::HeartbeatLost { .. } => self.heartbeat_lost = true,
            Event::HeartbeatBack { .. } => self.heartbeat_lost = false,
            _ => {}
        }
        self.program.event(event);
    }
}
