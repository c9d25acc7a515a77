//! The thread: orders, supervision of a motion, live values, in turn.

use super::led::{Guided, Led, Part};
use super::pages::Pages;
use super::retraining::retrain;
use super::watch::Watch;
use super::{Order, Setup};
use crate::hold::{Hold, LIMIT};
use crate::message::{Ask, Wanted};
use crate::motion::{Motion, RATE, Steered};
use crate::reports::Reports;
use crate::slow::{Load, Slow};
use crate::{checklist, history, learning, scan, settings};
use bus::client::{Command as Nmt, NmtState, Target};
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::field::{Actual, Field};
use jointctl::commission::joint::Joint;
use jointctl::commission::{Found, Plan, commission, find_index, page};
use jointctl::remote::commission::RemoteObjects;
use jointctl::remote::{Entry, RemoteError, RemoteJoint, Stream, condition, configured};
use report::output::OutputFile;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Longest wait for an order: how soon a hold that is over is noticed here. The stream of set-points notices it with
/// the next set-point.
const TURN: Duration = Duration::from_millis(5);
/// The same where nobody looks.
const IDLE: Duration = Duration::from_millis(50);
/// Time between two looks at a joint that moves.
const LOOK: Duration = Duration::from_millis(50);
/// Time between two slow values.
const SLOW: Duration = Duration::from_millis(100);
/// Parts of the page that are led.
const COMMISSIONING: Part =
    Part { key: "commission", busy: "the joint is being commissioned: this waits until it ends" };
const LEARNING: Part = Part { key: "retrain", busy: "the joint learns: this waits until it ends" };
/// Time between two attempts to find a joint that does not answer.
const AGAIN: Duration = Duration::from_secs(2);

/// A motion for a page.
struct Moving {
    stream: Stream,
    page: u64,
    hold: Arc<Hold>,
    number: u64,
    looked: Instant,
}

pub struct Worker {
    setup: Setup,
    orders: Receiver<Order>,
    stop: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
    pages: Pages,
    joint: Option<RemoteJoint>,
    watch: Option<Watch>,
    /// Live values are those of friction by its parts.
    by_part: bool,
    slow: Slow,
    load: Load,
    moving: Option<Moving>,
    /// The image that a page uploaded last, for its next steps.
    uploaded: Vec<u8>,
    /// Time at which a joint that did not answer is asked again, and at which the next slow value is read.
    due: Instant,
}

impl Worker {
    pub fn new(setup: Setup, orders: Receiver<Order>, stop: Arc<AtomicBool>, over: Arc<AtomicBool>) -> Self {
        Self {
            load: Load::of(&setup.network),
            setup,
            orders,
            stop,
            over,
            pages: Pages::default(),
            joint: None,
            watch: None,
            by_part: false,
            slow: Slow::default(),
            moving: None,
            uploaded: Vec::new(),
            due: Instant::now(),
        }
    }

    pub fn run(mut self) {
        while !self.over.load(Ordering::Relaxed) {
            let wait = if self.pages.is_empty() { IDLE } else { TURN };
            let order = self.orders.recv_timeout(wait);
            self.pages.forget();
            self.obey_stop();
            self.supervise();
            match order {
                Ok(Order::Attach { page, wants, hold, tell }) => {
                    self.pages.attach(page, wants, hold, tell);
                    self.greet(page);
                }
                Ok(Order::Ask { page, id, ask }) => {
                    let answer = match self.answer(page, ask) {
                        Ok(done) => json!({ "answer": id, "done": done }),
                        Err(error) => json!({ "answer": id, "error": error }),
                    };
                    self.pages.tell_one(page, &answer);
                }
                Err(_) => {}
            }
            if self.pages.is_empty() {
                self.rest();
                continue;
            }
            self.look();
        }
        self.rest();
    }

    /// Leaves the joint as it was found.
    fn rest(&mut self) {
        self.end_motion("nobody looks any more");
        if let Some(watch) = self.watch.take() {
            // Nobody is left to be told.
            let _ = watch.end();
        }
        self.joint = None;
        self.due = Instant::now();
    }

    fn greet(&mut self, page: u64) {
        if let Some(hello) = self.hello() {
            self.pages.tell_one(page, &hello);
        }
    }

    fn hello(&self) -> Option<Value> {
        let signals = self.watch.as_ref()?.signals();
        let limit = LIMIT.as_millis() as u64;
        let (node, boards, robot) = (self.setup.node, settings::boards(), &self.setup.robot);
        Some(json!({
            "hello": { "node": node, "signals": signals, "held_ms": limit, "boards": boards, "robot": robot.as_deref() }
        }))
    }

    /// Finds the joint, takes what it sends, reads a slow value where one is due.
    fn look(&mut self) {
        if let Some(load) = self.load.next(&self.setup.network) {
            self.pages.tell(&json!({ "slow": load }));
        }
        let Some(joint) = self.joint.clone() else {
            if Instant::now() >= self.due {
                self.open();
            }
            return;
        };
        if let Some(watch) = &mut self.watch {
            let pages = &mut self.pages;
            if let Err(error) = watch.look(&mut |message| pages.tell(&message)) {
                self.pages.tell(&json!({ "failure": error.to_string() }));
                if let Some(watch) = self.watch.take() {
                    watch.leave();
                }
            }
        }
        let alone = self.watch.as_ref().is_some_and(|watch| !watch.is_shared());
        if alone && Instant::now() >= self.due {
            self.due = Instant::now() + SLOW;
            match self.slow.next(&joint) {
                Ok(None) => {}
                Ok(Some(value)) => self.pages.tell(&json!({ "slow": value })),
                Err(error) => {
                    self.due = Instant::now() + AGAIN;
                    self.pages.tell(&json!({ "failure": error.to_string() }));
                }
            }
        }
    }

    fn open(&mut self) {
        self.due = Instant::now() + AGAIN;
        let found = RemoteJoint::on(&self.setup.network, self.setup.node).map(|joint| match &self.setup.key {
            Some(key) => joint.owned_by(key.clone()),
            None => joint,
        });
        match found {
            Ok(joint) => {
                self.joint = Some(joint);
                self.due = Instant::now();
                if let Err(error) = self.watch_anew() {
                    self.pages.tell(&json!({ "failure": error.to_string() }));
                }
            }
            Err(error) => self.pages.tell(&json!({ "failure": error.to_string() })),
        }
    }

    fn watch_anew(&mut self) -> Result<(), RemoteError> {
        let Some(joint) = &self.joint else { return Ok(()) };
        if let Some(watch) = self.watch.take() {
            watch.end()?;
        }
        self.watch = Some(Watch::begin(&self.setup, joint, self.by_part)?);
        if let Some(hello) = self.hello() {
            self.pages.tell(&hello);
        }
        Ok(())
    }

    /// Keeps what is in use, without the PDOs that live values come in.
    fn store(&mut self, joint: &RemoteJoint) -> Result<Value, RemoteError> {
        if let Some(watch) = self.watch.take() {
            watch.end()?;
        }
        let stored = settings::store(joint);
        self.watch_anew()?;
        stored
    }

    /// Other live values, where the joint has them.
    fn draw(&mut self, joint: &RemoteJoint, by_part: bool) -> Result<(), String> {
        match joint.raw(Field::Actual(Actual::PhysicalTorque)) {
            Err(error) if by_part && error.is_absent() => {
                return Err("this board's program has no room for friction by its parts (2022h)".into());
            }
            Err(error) if !error.is_absent() => return Err(error.to_string()),
            _ => {}
        }
        self.by_part = by_part;
        self.watch_anew().map_err(|error| error.to_string())
    }

    /// STOP of any page: along the same way as the end of a motion, or whoever moves the joint.
    fn obey_stop(&mut self) {
        if !self.stop.load(Ordering::Relaxed) {
            return;
        }
        if let Some(moving) = &self.moving {
            // The stream stands still from now on, whatever comes after.
            moving.hold.release();
        }
        self.stop.store(false, Ordering::Relaxed);
        if self.moving.is_some() {
            self.end_motion("STOP");
            return;
        }
        let told = match &self.joint {
            Some(joint) => stop(joint, self.watch.is_some()),
            // A joint that has not answered yet may still hear.
            None => {
                let sent = self.setup.network.command(Nmt::EnterPreOperational, Target::Node(self.setup.node));
                sent.map(|()| "sent; the joint has not answered yet".to_owned()).map_err(RemoteError::from)
            }
        };
        self.pages.tell(&match told {
            Ok(state) => json!({ "stopped": { "state": state } }),
            Err(error) => json!({ "stopped": { "error": error.to_string() } }),
        });
    }

    /// Ends a motion that is not held any more, or that the joint does not follow.
    fn supervise(&mut self) {
        let Some(moving) = &mut self.moving else { return };
        let ended = if self.pages.hold(moving.page).is_none() {
            Some("the page is gone".to_owned())
        } else if !moving.hold.is_held(moving.number, Instant::now()) {
            Some("not held any more".to_owned())
        } else if moving.looked.elapsed() >= LOOK {
            moving.looked = Instant::now();
            moving.stream.check().err().map(|error| error.to_string())
        } else {
            None
        };
        if let Some(reason) = ended {
            self.end_motion(&reason);
        }
    }

    /// Brakes and disables, as `jointctl move` does at its end.
    fn end_motion(&mut self, reason: &str) {
        let Some(moving) = self.moving.take() else { return };
        moving.hold.end(moving.number);
        let state = moving.stream.end();
        if state.is_ok() {
            self.operate();
        }
        let state = state.map_or_else(|error| error.to_string(), |state| condition::name(state).to_owned());
        self.pages.tell(&json!({ "motion": { "moving": false, "reason": reason, "state": state } }));
    }

    /// Has the joint send TPDOs again: the end of a stream leaves it PRE-OPERATIONAL, with its controlword forgotten.
    fn operate(&mut self) {
        if let (Some(joint), Some(_)) = (&self.joint, &self.watch)
            && let Err(error) = joint.nmt(Nmt::Start, NmtState::Operational)
        {
            self.pages.tell(&json!({ "failure": error.to_string() }));
        }
    }

    fn answer(&mut self, page: u64, ask: Ask) -> Result<Value, String> {
        if ask.changes()
            && let Some(reason) = self.pages.refusal(page)
        {
            return Err(reason.into());
        }
        if self.moving.is_some() && ask != Ask::Csv {
            return Err("the joint moves: this waits until it stands".into());
        }
        let node = self.setup.node;
        let (stop, ended) = (Arc::clone(&self.stop), Arc::clone(&self.over));
        let over = move || stop.load(Ordering::Relaxed) || ended.load(Ordering::Relaxed);
        let words = |error: RemoteError| error.to_string();
        // A new board has no node id: what finds it and gives it one does not wait for an answer of this node.
        match ask {
            Ask::Scan => return scan::scan(&self.setup.network, &over).map_err(words),
            Ask::Address { first } => return self.address(first).map_err(words),
            _ => {}
        }
        let Some(joint) = self.joint.clone() else { return Err(format!("node {node} has not answered yet")) };
        match ask {
            Ask::Held { .. } | Ask::Release | Ask::Stop | Ask::Scan | Ask::Address { .. } => Ok(Value::Null),
            Ask::Move { hold, motion, reset } => {
                self.begin_motion(&joint, page, hold, motion, reset).map(|()| Value::Null)
            }
            Ask::Checklist => {
                let items = checklist::checklist(&joint).map_err(words)?;
                serde_json::to_value(items).map_err(|error| error.to_string())
            }
            Ask::History => history::history(&joint).map_err(words),
            Ask::Commission { plan, index_only } => self.commission(&joint, page, &plan, index_only),
            Ask::Retrain { wanted } => self.retrain(&joint, page, &wanted),
            Ask::Agree { .. } => Err("no question is open".into()),
            Ask::Look => self.watch_anew().map(|()| Value::Null).map_err(words),
            Ask::Draw { by_part } => self.draw(&joint, by_part).map(|()| Value::Null),
            Ask::Csv => match &self.watch {
                Some(watch) => Ok(watch.csv().into()),
                None => Err("there are no live values; Look begins them".into()),
            },
            Ask::Objects => settings::objects(&joint, &over),
            Ask::Set { values } => settings::set(&joint, &values).map_err(words),
            Ask::Store => self.store(&joint).map_err(words),
            Ask::Stored => configured::read(&joint).map(|told| told.to_string().into()).map_err(words),
            Ask::Export => settings::export(&joint, &over).map(Value::from),
            Ask::Compare { with } => settings::compare(&joint, &with, &over),
            Ask::Import { text } => settings::import(&joint, &text, &over),
            Ask::Images => learning::images(&joint).map_err(words),
            Ask::Upload { image, usage } => {
                let told = learning::upload(&joint, &image, usage).map_err(words);
                self.uploaded = image;
                told
            }
            Ask::Use { usage } => learning::go_on(&joint, &self.uploaded, usage).map_err(words),
            Ask::RollBack => learning::roll_back(&joint).map_err(words),
            Ask::Discard => learning::discard(&joint).map_err(words),
        }
    }

    /// Gives node ids, and obeys STOP meanwhile: it takes seconds for each joint.
    fn address(&mut self, first: u8) -> Result<Value, RemoteError> {
        let network = self.setup.network.clone();
        std::thread::scope(|scope| {
            let giving = scope.spawn(|| scan::address(&network, first));
            while !giving.is_finished() {
                self.obey_stop();
                std::thread::sleep(TURN);
            }
            // It may be this page's joint that has one now.
            self.due = Instant::now();
            giving.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })
    }

    /// Leads a page through the commissioning of the joint.
    fn commission(&mut self, joint: &RemoteJoint, page: u64, plan: &Plan, index_only: bool) -> Result<Value, String> {
        plan.check().map_err(|failure| failure.to_string())?;
        joint.require_configuration().map_err(|error| error.to_string())?;
        let (node, reports) = (self.setup.node, Arc::clone(&self.setup.reports));
        self.lead(COMMISSIONING, page, |led| {
            let running = || led.goes_on();
            let mut bench = Joint::new(RemoteObjects::new(joint.clone(), &running));
            let found = match index_only {
                true => find_index(&mut bench, plan, &mut Guided(led)).map(|_| Value::Null),
                false => commission(&mut bench, plan, &mut Guided(led))
                    .map(|found| outcome(&found, node, &reports).unwrap_or_else(|error| json!({ "error": error }))),
            };
            found.map_err(|failure| failure.to_string())
        })
    }

    /// Leads a page through a round of learning. SYNC goes on as other joints' pages have it.
    fn retrain(&mut self, joint: &RemoteJoint, page: u64, wanted: &Wanted) -> Result<Value, String> {
        let folder = tempfile::tempdir().map_err(|error| format!("no folder for the recording: {error}"))?;
        let round = learning::round(wanted, self.setup.key.clone(), folder.path())?;
        let _sync = self.setup.syncs.join();
        let reports = Arc::clone(&self.setup.reports);
        self.lead(LEARNING, page, |led| match retrain(joint, &round, &reports, led) {
            Ok(outcome) => Ok(learning::outcome(&outcome)),
            Err(error) => Err(error.to_string()),
        })
    }

    /// Leads a page through a sequence, whose errors have the reason for which it was ended before them. Live values
    /// rest meanwhile: it has the joint's PDOs, or restarts it.
    fn lead(
        &mut self,
        part: Part,
        page: u64,
        run: impl FnOnce(&Led<'_>) -> Result<Value, String>,
    ) -> Result<Value, String> {
        if let Some(watch) = self.watch.take() {
            watch.end().map_err(|error| error.to_string())?;
        }
        let led = Led::new(part, &mut self.pages, &self.orders, page, [&self.stop, &self.over]);
        let done = run(&led);
        let reason = led.end();
        let watched = self.watch_anew();
        let done = done.map_err(|failure| match reason {
            Some(reason) => format!("{reason}: {failure}"),
            None => failure,
        })?;
        watched.map(|()| done).map_err(|error| error.to_string())
    }

    fn begin_motion(
        &mut self,
        joint: &RemoteJoint,
        page: u64,
        number: u64,
        motion: Motion,
        reset: bool,
    ) -> Result<(), String> {
        let words = |error: RemoteError| error.to_string();
        let position = || joint.number(Field::Actual(Actual::Position)).map_err(words);
        motion.check(joint, position()?).map_err(words)?;
        let Some(hold) = self.pages.hold(page) else { return Err("the page is gone".into()) };
        let let_go = || "let go before the joint was enabled: nothing moved".to_owned();
        if !hold.is_held(number, Instant::now()) {
            return Err(let_go());
        }
        // Enabling takes some time, in which the joint is held where it is.
        let begun = Stream::begin(joint, motion.mode(), RATE, reset).map_err(words);
        let (stream, from) = match begun.and_then(|stream| Ok((stream, position()?))) {
            Ok(begun) => begun,
            Err(error) => {
                self.operate();
                return Err(error);
            }
        };
        let mut steered = Steered::new(motion, from);
        let (held, stop) = (Arc::clone(&hold), Arc::clone(&self.stop));
        stream.play(move |elapsed| {
            let held = held.is_held(number, Instant::now()) && !stop.load(Ordering::Relaxed);
            steered.next(elapsed, held)
        });
        self.moving = Some(Moving { stream, page, hold, number, looked: Instant::now() });
        self.pages.tell(&json!({ "motion": { "moving": true } }));
        Ok(())
    }
}

/// A commissioning's outcome, for a page: the settings that the joint took, and the files that `jointctl commission`
/// writes.
fn outcome(found: &Found, node: u8, reports: &Reports) -> Result<Value, String> {
    let settings = found.settings.iter().map(|(setting, value)| {
        let entry = Entry::of_setting(*setting);
        json!({ "name": entry.name(), "value": value, "unit": entry.text.unit })
    });
    let files = page::files(found, node).map_err(|error| error.to_string())?;
    let text = |file: &OutputFile| json!({ "name": file.path, "text": String::from_utf8_lossy(&file.contents) });
    let mut files = files.iter().map(text).collect::<Value>();
    reports.keep_of(&mut files);
    Ok(json!({ "settings": settings.collect::<Value>(), "files": files, "index": found.index.is_some() }))
}

/// Brakes and switches off, whoever commands the joint. Where nothing was under current before, it goes on to send live
/// values; otherwise it stays PRE-OPERATIONAL, where no other client's set-points count.
fn stop(joint: &RemoteJoint, watched: bool) -> Result<String, RemoteError> {
    let off = |state| matches!(state, State::SwitchOnDisabled | State::Fault | State::NotReadyToSwitchOn);
    let before = joint.state();
    let state = joint.disable()?;
    if watched && before.is_ok_and(off) {
        joint.nmt(Nmt::Start, NmtState::Operational)?;
    }
    Ok(condition::name(state).to_owned())
}
