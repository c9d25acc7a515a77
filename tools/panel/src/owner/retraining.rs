//! A round of learning with a page as its guide. The round has a thread of its own, because it computes for a
//! while; the owner's thread stays with the pages, tells them of it and ends it.

use super::led::{Led, TURN};
use crate::reports::Reports;
use identification::page::verdict;
use identification::progress::Progress;
use jointctl::commands::fit;
use jointctl::remote::RemoteJoint;
use jointctl::remote::retrain::{DESCRIPTION, Outcome, RetrainError, Round, TABLE, bounds};
use report::output::OutputFile;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};

enum Event {
    Stage(String),
    /// Key and value of a message.
    Tell(&'static str, Value),
    /// The joint stands until the next question is answered.
    Rests,
    Question(String),
}

/// The round's side.
struct Talk<'t> {
    events: Sender<Event>,
    goes_on: &'t AtomicBool,
}

impl Talk<'_> {
    fn say(&self, event: Event) {
        // The owner's thread listens until this is dropped.
        let _ = self.events.send(event);
    }
}

impl Progress for Talk<'_> {
    fn stage(&self, name: &str) {
        self.say(Event::Stage(name.to_owned()));
    }

    fn detail(&self, text: &str) {
        self.say(Event::Tell("found", text.into()));
    }
}

/// Runs a round, for as long as the page that began it agrees.
///
/// # Errors
/// [`RetrainError`]; the joint is as it was.
pub fn retrain(joint: &RemoteJoint, round: &Round, reports: &Reports, led: &Led<'_>) -> Result<Outcome, RetrainError> {
    let (events, told) = channel();
    let (answers, answered) = channel();
    let goes_on = AtomicBool::new(true);
    std::thread::scope(|scope| {
        let talk = Talk { events, goes_on: &goes_on };
        let working = scope.spawn(move || work(joint, round, &talk, &answered));
        loop {
            match told.recv_timeout(TURN) {
                Ok(Event::Stage(name)) => led.stage(name),
                Ok(Event::Tell(key, mut value)) => {
                    reports.keep_of(&mut value);
                    led.tell(key, value);
                }
                Ok(Event::Rests) => led.rests(),
                Ok(Event::Question(text)) => {
                    // A round that has ended asks nothing.
                    let _ = answers.send(led.agrees(&text));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            if !led.goes_on() {
                goes_on.store(false, Ordering::Relaxed);
            }
        }
        working.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    })
}

fn work(
    joint: &RemoteJoint,
    round: &Round,
    talk: &Talk<'_>,
    answered: &Receiver<bool>,
) -> Result<Outcome, RetrainError> {
    let running = || talk.goes_on.load(Ordering::Relaxed);
    let asks = |question: String| {
        talk.say(Event::Question(question));
        let agrees = answered.recv() == Ok(true);
        if agrees { Ok(()) } else { Err(RetrainError::Interrupted { node: joint.id() }) }
    };
    round.check(joint)?;
    let reach = bounds(joint)?;
    let (low, high) = reach.position;
    asks(format!(
        "The joint moves by itself for about {} s, from {low:.2} to {high:.2} rad with up to {:.2} rad/s, without \
         compensation. Is its way free?",
        2.0 * round.excitation,
        reach.velocity
    ))?;
    let recorded = round.record(joint, &running, talk)?;
    talk.say(Event::Rests);
    let learned = recorded.learn(talk)?;
    talk.say(Event::Tell("found", verdict(&learned.fitted.report).sentence.into()));
    talk.say(Event::Tell("files", files(round, &learned.fitted)?));
    asks(format!(
        "The joint moves three times for about {} s, with what it had, with the new image, and with what it had once \
         more. Where the new image leaves less torque unexplained it is stored and in use. Is the way free?",
        round.validation
    ))?;
    learned.compare(&running, talk)
}

/// Files of `jointctl retrain` for a page to save, as text, or as bytes where they are none.
fn files(round: &Round, fitted: &identification::fit::Fitted) -> Result<Value, RetrainError> {
    let mut files = fit::files(fitted, &round.out).map_err(|error| RetrainError::Report(error.to_string()))?;
    // The report has its figures within.
    files.retain(|file| file.path.components().count() == 1);
    for name in [TABLE, DESCRIPTION] {
        let path = round.out.join(name);
        let read = std::fs::read(&path);
        let read = read.map_err(|error| RetrainError::Report(format!("cannot read {}: {error}", path.display())))?;
        files.push(OutputFile::new(name, read));
    }
    let file = |OutputFile { path, contents }| match String::from_utf8(contents) {
        Ok(text) => json!({ "name": path, "text": text }),
        Err(binary) => json!({ "name": path, "bytes": binary.into_bytes() }),
    };
    Ok(files.into_iter().map(file).collect())
}
