//! A sequence with a page as its guide, a commissioning or a round of learning: the owner's thread stays with it until
//! its end and takes orders meanwhile.
//!
//! While the bridge may be on, a hold of the page has to last as in a motion, without a button: the page begins it with
//! its yes and ends it where it is hidden, loses the focus, or is told to stop. While a question is open nothing flows,
//! and nothing needs to be held.

use super::Order;
use super::pages::{LOOKS_ON, Pages};
use crate::message::Ask;
use jointctl::commission::{Guide, Stage, page};
use serde_json::{Value, json};
use std::cell::RefCell;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

/// Longest wait for an order while a question is open.
pub const TURN: Duration = Duration::from_millis(5);

/// Part of the page that is led.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Key of its messages.
    pub key: &'static str,
    /// Answer to whatever else is asked meanwhile.
    pub busy: &'static str,
}

struct Inner<'w> {
    part: Part,
    pages: &'w mut Pages,
    /// Page that commands.
    page: u64,
    /// Hold that has to last; none while nothing flows.
    hold: Option<u64>,
    /// Number of the last question, counted from 1, and its text while it is open.
    question: (u64, Option<String>),
    /// Last stage, for pages that come.
    stage: String,
    /// Reason of an end that nobody at the joint has asked for.
    reason: Option<&'static str>,
}

/// The page's side of a sequence.
pub struct Led<'w> {
    inner: RefCell<Inner<'w>>,
    orders: &'w Receiver<Order>,
    /// STOP, and the end of the program.
    ends: [&'w AtomicBool; 2],
}

/// The same, as the guide of a commissioning.
pub struct Guided<'l, 'w>(pub &'l Led<'w>);

impl<'w> Led<'w> {
    pub const fn new(
        part: Part,
        pages: &'w mut Pages,
        orders: &'w Receiver<Order>,
        page: u64,
        ends: [&'w AtomicBool; 2],
    ) -> Self {
        let inner = Inner { part, pages, page, hold: None, question: (0, None), stage: String::new(), reason: None };
        Self { inner: RefCell::new(inner), orders, ends }
    }

    /// Takes the orders that wait; `false` once it has to end.
    pub fn goes_on(&self) -> bool {
        let mut inner = self.inner.borrow_mut();
        while let Ok(order) = self.orders.try_recv() {
            inner.take(order);
        }
        inner.goes_on(self.ends)
    }

    /// A stage begins.
    pub fn stage(&self, stage: String) {
        let mut inner = self.inner.borrow_mut();
        inner.tell("stage", stage.clone().into());
        inner.stage = stage;
    }

    /// Tells something worth knowing.
    pub fn tell(&self, key: &str, value: Value) {
        self.inner.borrow_mut().tell(key, value);
    }

    /// Nothing flows or moves from now until the next yes: nothing needs to be held.
    pub fn rests(&self) {
        self.inner.borrow_mut().let_go();
    }

    /// Asks the page that commands, which holds from its yes on.
    pub fn agrees(&self, question: &str) -> bool {
        let mut inner = self.inner.borrow_mut();
        inner.let_go();
        inner.question = (inner.question.0 + 1, Some(question.to_owned()));
        let open = inner.open();
        inner.tell("question", open);
        while inner.question.1.is_some() {
            if let Ok(order) = self.orders.recv_timeout(TURN) {
                inner.take(order);
            }
            if !inner.goes_on(self.ends) {
                inner.question.1 = None;
            }
        }
        inner.tell("question", Value::Null);
        inner.reason.is_none() && inner.hold.is_some()
    }

    /// Ends it: the reason, where it was ended from here.
    pub fn end(self) -> Option<&'static str> {
        let mut inner = self.inner.into_inner();
        inner.let_go();
        inner.reason
    }
}

impl Inner<'_> {
    fn tell(&mut self, key: &str, value: Value) {
        self.pages.tell(&json!({ self.part.key: { key: value } }));
    }

    fn open(&self) -> Value {
        match &self.question {
            (number, Some(text)) => json!({ "number": number, "text": text }),
            (_, None) => Value::Null,
        }
    }

    fn let_go(&mut self) {
        if let Some(number) = self.hold.take()
            && let Some(hold) = self.pages.hold(self.page)
        {
            hold.end(number);
        }
    }

    fn take(&mut self, order: Order) {
        match order {
            Order::Attach { page, wants, hold, tell } => {
                self.pages.attach(page, wants, hold, tell);
                let told = json!({ self.part.key: { "stage": self.stage, "question": self.open() } });
                self.pages.tell_one(page, &told);
            }
            Order::Ask { page, id, ask } => {
                let answer = match self.answer(page, &ask) {
                    Ok(()) => json!({ "answer": id, "done": null }),
                    Err(error) => json!({ "answer": id, "error": error }),
                };
                self.pages.tell_one(page, &answer);
            }
        }
    }

    fn answer(&mut self, page: u64, ask: &Ask) -> Result<(), &'static str> {
        let Ask::Agree { question, hold } = ask else {
            return Err(self.part.busy);
        };
        if page != self.page {
            return Err(LOOKS_ON);
        }
        if self.question.1.is_none() || self.question.0 != *question {
            return Err("this question is not open");
        }
        if let Some(number) = hold
            && !self.pages.hold(page).is_some_and(|hold| hold.is_held(*number, Instant::now()))
        {
            return Err("let go before it was begun: nothing was done");
        }
        self.hold = *hold;
        self.question.1 = None;
        Ok(())
    }

    /// Returns `false` once it has to end, and keeps the first reason for it.
    fn goes_on(&mut self, [stop, over]: [&AtomicBool; 2]) -> bool {
        self.pages.forget();
        let lasts = |hold: &crate::hold::Hold| self.hold.is_none_or(|number| hold.is_held(number, Instant::now()));
        let reason = match self.pages.hold(self.page) {
            _ if over.load(Ordering::Relaxed) => Some("the panel ends"),
            _ if stop.load(Ordering::Relaxed) => Some("STOP"),
            None => Some("the page is gone"),
            Some(hold) if !lasts(&hold) => Some("not held any more"),
            Some(_) => None,
        };
        self.reason = self.reason.or(reason);
        self.reason.is_none()
    }
}

impl Guide for Guided<'_, '_> {
    fn stage(&mut self, stage: Stage) {
        self.0.stage(page::headline(stage));
    }

    fn found(&mut self, text: &str) {
        self.0.tell("found", text.into());
    }

    fn agrees(&mut self, question: &str) -> bool {
        self.0.agrees(question)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hold::{Hold, LIMIT};
    use crate::owner::Wants;
    use std::sync::Arc;
    use std::sync::mpsc::sync_channel;

    const PART: Part = Part { key: "commission", busy: "busy" };

    /// A guide's answer to one question, to which a page gives these answers, and the reason where it ended otherwise.
    fn asked(answers: &[(u64, u64, Option<u64>)], stop: bool) -> (bool, Option<&'static str>, Vec<String>) {
        let (orders, inbox) = sync_channel(8);
        let (tell, mut told) = tokio::sync::mpsc::channel(32);
        let hold = Arc::<Hold>::default();
        hold.renew(3, Instant::now() + 100 * LIMIT);
        let mut pages = Pages::default();
        pages.attach(1, Wants::ToCommand, hold, tell);
        for (id, (page, question, hold)) in (1..).zip(answers) {
            let ask = Ask::Agree { question: *question, hold: *hold };
            orders.send(Order::Ask { page: *page, id, ask }).unwrap();
        }
        let (stop, over) = (AtomicBool::new(stop), AtomicBool::new(false));
        let led = Led::new(PART, &mut pages, &inbox, 1, [&stop, &over]);
        let agrees = led.agrees("Is it free?");
        let reason = led.end();
        let told = std::iter::from_fn(|| told.try_recv().ok()).map(|text| text.to_string());
        (agrees, reason, told.collect())
    }

    #[test]
    fn a_yes_needs_a_hold_that_lasts_of_the_page_that_commands_for_the_question_that_is_open() {
        let answers = [(2, 1, Some(3)), (1, 2, Some(3)), (1, 1, Some(2)), (1, 1, Some(3))];
        let (agrees, reason, told) = asked(&answers, false);
        assert_eq!((agrees, reason), (true, None));
        assert!(told[1].contains(r#""question":{"number":1,"text":"Is it free?"}"#), "{told:?}");
        assert!(told[2].contains("this question is not open"), "{told:?}");
        assert!(told[3].contains("let go before it was begun"), "{told:?}");
        assert_eq!(told[4], r#"{"answer":4,"done":null}"#);
        assert_eq!(told[5], r#"{"commission":{"question":null}}"#);
    }

    #[test]
    fn a_no_ends_it_without_a_reason_from_here_and_stop_with_one() {
        let (agrees, reason, _) = asked(&[(1, 1, None)], false);
        assert_eq!((agrees, reason), (false, None));
        let (agrees, reason, _) = asked(&[], true);
        assert_eq!((agrees, reason), (false, Some("STOP")));
    }

    #[test]
    fn what_flows_ends_with_the_hold_and_an_open_question_needs_none() {
        let (_orders, inbox) = sync_channel(8);
        let (tell, _told) = tokio::sync::mpsc::channel(32);
        let hold = Arc::<Hold>::default();
        let mut pages = Pages::default();
        pages.attach(1, Wants::ToCommand, Arc::clone(&hold), tell);
        let (stop, over) = (AtomicBool::new(false), AtomicBool::new(false));
        let led = Led::new(PART, &mut pages, &inbox, 1, [&stop, &over]);
        assert!(led.goes_on());
        hold.renew(1, Instant::now() + 100 * LIMIT);
        led.inner.borrow_mut().hold = Some(1);
        assert!(led.goes_on());
        // Where it rests, nothing has to be held.
        led.rests();
        assert!(led.goes_on());
        hold.renew(2, Instant::now() + 100 * LIMIT);
        led.inner.borrow_mut().hold = Some(2);
        assert!(led.goes_on());
        hold.release();
        assert!(!led.goes_on());
        assert_eq!(led.end(), Some("not held any more"));
    }
}
