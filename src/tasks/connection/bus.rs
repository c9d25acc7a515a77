//! The joint on the bus: what the receive interrupt leaves, SDO, LSS, heartbeats, EMCYs, the life of images; thread
//! mode.
//!
//! The proof of an image may take up to 21 million instructions (0.12 s at one a cycle), and writing one stalls for the
//! flash. Neither has been measured on a board. Meanwhile this task sends no heartbeat; NMT, SYNC and RPDOs act in the
//! interrupt all the same.

use super::program::BoardProgram;
use crate::board::can::{self, Condition};
use crate::board::{control, faults, options, shadow};
use canopen_node::{Frame, Server};
use embassy_time::{Duration, Instant, with_timeout};
use friction_compensation::parameters::life_cycle::{Action, Mode};
use friction_compensation::parameters::slots::SlotError;
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::{Objects, StoredImages};

/// Period with which timers are looked at where nothing arrives.
const TICK: Duration = Duration::from_millis(1);
/// Time for which the node stays away after bus-off: whatever disturbs the bus is given time to end.
const AWAY: Duration = Duration::from_millis(100);

/// The task's part of the node.
pub struct Node {
    shared: &'static canopen_node::Shared,
    server: Server<'static>,
    objects: &'static mut Objects<'static, BoardProgram>,
    stored: StoredImages,
    /// Action that the control step has not taken yet.
    waiting: Option<Action>,
    /// Bytes of the staged image that is to run in shadow.
    shadow: Option<usize>,
    /// Condition as it was when looked at last, and since when.
    condition: (Condition, Instant),
}

/// Serves the bus for ever.
#[embassy_executor::task]
pub async fn serve(node: &'static mut Node) {
    loop {
        let frame = with_timeout(TICK, can::next()).await.ok();
        node.work(frame);
        // By now its writes to flash are done.
        control::release();
        // The transition stopped the joint; a start in the middle of that would let it fall.
        let (restart, set_options) = (node.objects.program().restart, node.objects.program().set_options);
        if (restart || set_options) && control::report().is_none_or(|report| is_off(report.telemetry.state)) {
            if set_options {
                // The answer leaves the controller meanwhile.
                options::set();
            }
            faults::restart();
        }
    }
}

/// Returns `true` if nothing is under current.
const fn is_off(state: State) -> bool {
    matches!(state, State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault)
}

impl Node {
    /// Node, before the receive interrupt is enabled.
    pub fn new(
        shared: &'static canopen_node::Shared,
        server: Server<'static>,
        objects: &'static mut Objects<'static, BoardProgram>,
        stored: StoredImages,
    ) -> Self {
        Self {
            shared,
            server,
            objects,
            stored,
            waiting: None,
            shadow: None,
            condition: (Condition::Active, Instant::now()),
        }
    }

    fn work(&mut self, frame: Option<Frame>) {
        self.observe();
        self.act();
        self.keep_shadow();
        if let Some(frame) = frame {
            if let Some(answer) = self.server.receive(&frame, can::now(), self.objects) {
                can::send(answer, self.shared);
            }
            self.act();
        }
        self.mind_the_bus();
        while let Some(emergency) = self.objects.take_emergency() {
            self.server.emergency(emergency.code, emergency.register, emergency.information);
        }
        while can::has_room()
            && let Some(frame) = self.server.poll(can::now(), self.objects)
        {
            can::send(frame, self.shared);
        }
        // A set-point that came by SDO, a transition of the server's own.
        can::attend();
    }

    /// A function of its own, as all that takes much of the stack and is not in the way of an image's proof.
    #[inline(never)]
    fn observe(&mut self) {
        if let Some(observed) = can::observed() {
            self.objects.poll(Instant::now().as_millis(), &observed);
        }
    }

    /// Reports an error-passive controller, and brings it back from bus-off.
    #[inline(never)]
    fn mind_the_bus(&mut self) {
        let condition = can::condition();
        let (before, since) = self.condition;
        if condition == before && (condition != Condition::Off || since.elapsed() < AWAY) {
            return;
        }
        self.condition = (condition, Instant::now());
        if condition == before {
            can::recover();
            return;
        }
        if before == Condition::Off {
            self.server.bus_off_recovered(self.objects);
        }
        self.server.error_passive(condition != Condition::Active);
    }

    /// Does what the life of an image asks for, until it asks for nothing or the control step has to be waited for.
    #[inline(never)]
    fn act(&mut self) {
        loop {
            let action = self.waiting.take().unwrap_or_else(|| self.objects.take_action());
            if action == Action::Nothing {
                return;
            }
            let Some(outcome) = self.carry_out(action) else {
                self.waiting = Some(action);
                return;
            };
            self.objects.finished(outcome, self.stored);
        }
    }

    /// Has the image run in shadow that is to, again where a configuration took its place.
    #[inline(never)]
    fn keep_shadow(&mut self) {
        let Some(length) = self.shadow.filter(|_| !shadow::runs()) else { return };
        let (staging, program) = self.objects.staging_and_program();
        if let Some(image) = staging.get(..length) {
            shadow::prepare(&mut program.active, image);
        }
    }

    /// Carries out an action and returns its outcome; none while the control step has not taken what it was offered
    /// before.
    fn carry_out(&mut self, action: Action) -> Option<Result<(), SlotError>> {
        let configuration = *self.objects.configuration();
        let (staging, program) = self.objects.staging_and_program();
        let outcome = match action {
            Action::Nothing => return None,
            Action::Run { mode: Mode::Shadow, length } => {
                // A trial may have been before: the stored model acts again.
                if !program.run_stored(&configuration) {
                    return None;
                }
                self.shadow = Some(length);
                return Some(Ok(()));
            }
            Action::Run { mode: Mode::Trial, length } => {
                self.shadow = None;
                return program.run(&configuration, staging.get(..length)?).then_some(Ok(()));
            }
            Action::Revert | Action::Activate => {
                self.shadow = None;
                return program.run_stored(&configuration).then_some(Ok(()));
            }
            Action::Store { length } => program.store.store_image(staging.get(..length)?),
            Action::RollBack => program.store.roll_back(staging),
        };
        self.stored = program.store.stored_images();
        Some(outcome)
    }
}
