//! Process data of the joint: RPDOs to one [`Demand`], actual values to TPDOs; the receive interrupt.
//!
//! An RPDO counts as a whole, once all of its objects are there. That it arrives renews the command deadline
//! ([`Demand::sequence`]), whatever its mapping; of a joint in operation in a cyclic mode only if it carries that
//! mode's set-point ([`Several::target`]), because another PDO says nothing of whether that one still comes. A
//! controlword with which there is no operation, or that begins to reset a fault, renews it in every mode:
//! otherwise a joint whose set-points came late could not be had out of its fault before they come again. Where a
//! master maps object 2010h:1 beside its set-points, one that repeats itself without thinking is not alive: the
//! PDO with the number of the one before renews nothing.
//!
//! A demand comes before everything that can wait: copies of the set-points for the task are left behind it, by
//! [`JointImage::leave_copies`].
//!
//! A joint whose configuration is lost is asked for nothing but a fault reset: it stays in "switch on disabled".
//!
//! Outside OPERATIONAL, and in it until a controlword comes, the joint is asked for a quick stop and no torque. It is
//! the node's own demand, and its sequence changes with the transition only: a joint that still brakes when the command
//! deadline is over has a fault.

use super::field::{Field, SetPoint, Several};
use super::interpolation::Interpolation;
use super::observed::Observed;
use super::set_points::SetPoints;
use super::shared::Shared;
use super::table;
use crate::joint::configuration::CollisionReaction;
use crate::joint::configuration::LOADS;
use crate::joint::state_machine::Controlword;
use crate::joint::{Command, Coupled, Demand, Mode, PROFILES};
use canopen_node::{MappedObject, NmtState, ProcessImage};

/// The interrupt's part of the objects.
#[derive(Debug)]
pub struct JointImage<'a> {
    shared: &'a Shared,
    observed: Observed,
    state: NmtState,
    /// Set-points in force.
    points: SetPoints,
    /// Set-points with what has arrived of an RPDO.
    arriving: SetPoints,
    /// Parts of it.
    arrived: Several,
    sequence: u32,
    coupled_sequence: u32,
    interpolation: [Interpolation; PROFILES as usize],
    /// µs.
    now: u32,
    /// The task has not been left a copy of the set-points in force.
    changed: bool,
    /// Reaction to a collision that nobody has acknowledged yet.
    reaction: [Option<CollisionReaction>; LOADS as usize],
}

impl<'a> JointImage<'a> {
    /// One for each [`Shared`].
    pub fn new(shared: &'a Shared) -> Self {
        let points = SetPoints::NONE;
        points.publish(shared);
        Self {
            shared,
            observed: Observed::default(),
            state: NmtState::Initialising,
            points,
            arriving: points,
            arrived: Several::NONE,
            sequence: 0,
            coupled_sequence: 0,
            interpolation: [Interpolation::default(); PROFILES as usize],
            now: 0,
            changed: false,
            reaction: [None; LOADS as usize],
        }
    }

    /// Begins the reaction to a collision of a joint that is to be in operation. A controlword that does not enable
    /// operation acknowledges it; but for the quick stop, so does one that begins to halt.
    pub fn collide(&mut self, reaction: CollisionReaction) {
        let acts = !matches!(reaction, CollisionReaction::Off | CollisionReaction::Warning);
        if acts && Controlword(self.points.controlword).enables_operation() {
            self.reaction.iter_mut().for_each(|place| *place = Some(reaction));
            self.changed = true;
        }
    }

    /// Sets what TPDOs carry from now on. Before [`Receiver::receive`](canopen_node::Receiver::receive), at least where
    /// the frame is SYNC.
    pub fn observe(&mut self, observed: &Observed) {
        self.observed = *observed;
    }

    /// Takes what came by SDO, and follows a transition that the task made: `state` is
    /// [`canopen_node::Shared::state`](canopen_node::Shared::state). At the end of every receive interrupt, before
    /// [`JointImage::demand`].
    pub fn follow(&mut self, state: NmtState) {
        if state != self.state {
            self.state_changed(state);
        }
        for way in &mut self.interpolation {
            way.settle(self.now, self.shared);
        }
        if PROFILES && self.points.go_on(self.shared) {
            self.arriving = self.points;
            self.changed = true;
        }
        let Some((set_point, value)) = self.shared.take_written() else { return };
        if set_point.is_choice() || self.state == NmtState::Operational {
            self.arriving = self.points;
            self.put(set_point, value);
            self.arriving.insist(set_point);
            self.come_into_force();
        }
    }

    /// The time of what comes, µs, wrapping. Before [`Receiver::receive`](canopen_node::Receiver::receive).
    pub fn at(&mut self, now: u32) {
        self.now = now;
    }

    /// Leaves copies of the set-points in force for the task, and for TPDOs. At the end of every receive interrupt,
    /// once the demand is published.
    pub fn leave_copies(&mut self) {
        if core::mem::take(&mut self.changed) {
            self.publish();
        }
    }

    /// Demand on the joint at the time that [`JointImage::at`] told.
    pub fn demand(&self) -> Demand {
        let coupled = Coupled { velocity: self.points.coupled_velocity(), sequence: self.coupled_sequence };
        if self.state != NmtState::Operational {
            let controlword = Controlword::QUICK_STOP;
            return Demand { controlword, command: Command::default(), sequence: self.sequence, coupled };
        }
        let word = Controlword(self.points.controlword);
        let (word, command) = match self.reaction.first().copied().flatten() {
            None => (word, self.command()),
            Some(CollisionReaction::QuickStop) => (Controlword::QUICK_STOP, self.command()),
            Some(reaction) => {
                let halted = self.points.halted();
                let command = halted.command(self.shared);
                // Nobody renews the set-point of a joint that holds or follows a profile: as impedance it would be
                // late.
                let renewed = !matches!(self.points.command(self.shared).mode, Mode::Hold | Mode::Profile);
                match reaction {
                    CollisionReaction::Yield if renewed => (word, command.giving_way()),
                    _ => (Controlword(halted.controlword), command),
                }
            }
        };
        let controlword = if self.shared.is_locked() { word.reset_alone() } else { word };
        Demand { controlword, command, sequence: self.sequence, coupled }
    }

    /// Leaves copies for the task; a joint that reacts to a collision follows no target.
    fn publish(&self) {
        self.points.publish(self.shared);
        if self.reaction.iter().any(Option::is_some) {
            self.points.halted().publish_follows(self.shared);
        }
    }

    fn command(&self) -> Command {
        let mut command = self.points.command(self.shared);
        for way in &self.interpolation {
            way.apply(&mut command, self.now, self.shared);
        }
        command
    }

    /// Others are in force from now on.
    fn change(&mut self) {
        self.changed = true;
        for way in &mut self.interpolation {
            way.follow(self.points.cyclic_target(), self.now, self.shared);
        }
    }

    fn put(&mut self, set_point: SetPoint, value: u64) {
        self.arriving.set(set_point, value);
        self.arrived = self.arrived.and(set_point);
    }

    fn come_into_force(&mut self) {
        let arrived = core::mem::take(&mut self.arrived);
        let (word, last) = (Controlword(self.arriving.controlword), Controlword(self.points.controlword));
        let own = Several::target(self.arriving.mode);
        let carries = |several| arrived.among(several) != Several::NONE;
        let any = || own == Several::NONE || !word.permits_operation() || word.begins_reset(last);
        let repeated = || arrived.has(SetPoint::Counter) && self.arriving.counter == self.points.counter;
        // Nearly every PDO has its mode's own.
        if (carries(own) || any() && carries(Several::ASKED)) && !repeated() {
            self.sequence = self.sequence.wrapping_add(1);
        }
        if arrived.has(SetPoint::CoupledVelocity) {
            self.coupled_sequence = self.coupled_sequence.wrapping_add(1);
        }
        let actual = if PROFILES { self.shared.position() } else { 0 };
        self.arriving.succeed(&self.points, arrived.has(SetPoint::TargetPosition), actual);
        self.points = self.arriving;
        self.change();
        let halts_anew = word.halts() && !last.halts();
        for reaction in &mut self.reaction {
            let ends = !word.enables_operation() || halts_anew && *reaction != Some(CollisionReaction::QuickStop);
            *reaction = reaction.filter(|_| !ends);
        }
    }
}

impl ProcessImage for JointImage<'_> {
    fn receive(&mut self, object: MappedObject, value: u64) {
        if let Some(object) = table::find(object.index(), object.sub_index())
            && let Field::SetPoint(set_point) = object.field
        {
            self.put(set_point, value);
        }
    }

    fn received(&mut self, _pdo: u8) {
        self.come_into_force();
    }

    fn transmit(&mut self, object: MappedObject) -> u64 {
        match table::find(object.index(), object.sub_index()).map(|object| object.field) {
            Some(Field::Actual(actual)) => self.observed.actual(actual, self.shared),
            Some(Field::Constant(constant)) => super::observed::signed(constant.number()),
            _ => 0,
        }
    }

    /// TPDOs are sampled now, and some carry set-points.
    fn sync(&mut self) {
        self.leave_copies();
    }

    fn state_changed(&mut self, state: NmtState) {
        let none = self.points.forgotten();
        // A transition by the task comes here twice: after it, and with the next frame.
        if state == self.state && self.points == none {
            return;
        }
        self.state = state;
        self.arriving = none;
        self.arrived = Several::NONE;
        self.points = none;
        self.reaction = [None; LOADS as usize];
        self.change();
        self.sequence = self.sequence.wrapping_add(1);
        self.coupled_sequence = self.coupled_sequence.wrapping_add(1);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The transition forgets set-points, and the guard does not rely on it: here the state alone changes.
    #[test]
    fn no_set_point_counts_outside_operational_even_if_it_was_not_forgotten() {
        let shared = Shared::new();
        shared.set_rated_torque(10.0);
        let mut image = JointImage::new(&shared);
        image.state_changed(NmtState::Operational);
        for _ in 0..2 {
            for (index, value) in [(0x6040, 0x0F), (0x6071, 500)] {
                image.receive(MappedObject::new(index, 0, 16), value);
            }
            image.received(0);
        }
        let asked = image.demand();
        assert!(asked.controlword == Controlword(0x0F) && (asked.command.torque - 5.0).abs() < 1e-5);
        for state in [NmtState::Stopped, NmtState::PreOperational, NmtState::Initialising] {
            image.state = state;
            let demand = image.demand();
            assert_eq!(
                (demand.controlword, demand.command),
                (Controlword::QUICK_STOP, Command::default()),
                "{state:?}"
            );
        }
        // The set-points are still there: it is the guard that held them back.
        image.state = NmtState::Operational;
        assert_eq!(image.demand(), asked);
    }

    /// A frame and a SYNC that wait for one interrupt: its TPDOs are sampled before anything else of it.
    #[test]
    fn a_tpdo_of_the_sync_behind_a_set_point_shows_it_and_the_task_sees_it_once_the_demand_is_published() {
        let shared = Shared::new();
        let mut image = JointImage::new(&shared);
        image.state_changed(NmtState::Operational);
        let [mode, shown] = [0x6060, 0x6061].map(|index| MappedObject::new(index, 0, 8));
        for number in [9, 8] {
            image.receive(mode, number);
            image.received(0);
            image.sync();
            assert_eq!(image.transmit(shown), number);
        }
        image.receive(mode, 9);
        image.received(0);
        assert_eq!(shared.set_point(SetPoint::Mode), 8);
        image.leave_copies();
        assert_eq!(shared.set_point(SetPoint::Mode), 9);
    }
}
