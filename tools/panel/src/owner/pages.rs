//! Pages that look at a joint. Of those that want to, the one that came first commands it; the others look.

use super::Told;
use crate::hold::Hold;
use serde_json::{Value, json};
use std::sync::Arc;
use tokio::sync::mpsc::Sender;

/// Answer to a page that does not command.
pub const LOOKS_ON: &str = "another page commands this joint; this one looks on, and may stop it";

/// Part of a page in a joint's life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wants {
    /// It commands the joint where nobody else does.
    ToCommand,
    /// It looks on, and may stop the joint.
    ToLook,
}

#[derive(Debug)]
struct Page {
    id: u64,
    wants: Wants,
    hold: Arc<Hold>,
    tell: Sender<Told>,
}

/// Pages, the oldest first.
#[derive(Debug, Default)]
pub struct Pages {
    pages: Vec<Page>,
    /// The page that was told last that it commands.
    told: Option<u64>,
}

impl Pages {
    /// Takes a page in and tells it whether it commands.
    pub fn attach(&mut self, id: u64, wants: Wants, hold: Arc<Hold>, tell: Sender<Told>) {
        self.pages.push(Page { id, wants, hold, tell });
        if self.commander() == Some(id) {
            self.announce();
        } else {
            self.tell_one(id, &json!({ "role": "looks" }));
        }
    }

    /// Forgets pages that are gone; the next one is told that it commands now.
    pub fn forget(&mut self) {
        self.pages.retain(|page| !page.tell.is_closed());
        self.announce();
    }

    fn announce(&mut self) {
        if let Some(id) = self.commander()
            && Some(id) != self.told
        {
            self.told = Some(id);
            self.tell_one(id, &json!({ "role": "commands" }));
        }
    }

    /// Returns `true` if nobody looks.
    pub fn is_empty(&self) -> bool {
        self.pages.is_empty()
    }

    /// Page that may change something.
    pub fn commander(&self) -> Option<u64> {
        self.pages.iter().find(|page| page.wants == Wants::ToCommand).map(|page| page.id)
    }

    /// Reason for which a page may not change anything; none where it commands.
    pub fn refusal(&self, id: u64) -> Option<&'static str> {
        match self.commander() {
            Some(commander) if commander == id => None,
            Some(_) => Some(LOOKS_ON),
            None => Some("this page looks on, and may stop the joint"),
        }
    }

    /// Hold of a page.
    pub fn hold(&self, id: u64) -> Option<Arc<Hold>> {
        self.pages.iter().find(|page| page.id == id).map(|page| Arc::clone(&page.hold))
    }

    /// Tells one page. One that reads so slowly that no room is left is given up: its connection ends.
    pub fn tell_one(&mut self, id: u64, message: &Value) {
        let text: Told = message.to_string().into();
        self.pages.retain(|page| page.id != id || page.tell.try_send(Arc::clone(&text)).is_ok());
    }

    /// Tells all, likewise.
    pub fn tell(&mut self, message: &Value) {
        let text: Told = message.to_string().into();
        self.pages.retain(|page| page.tell.try_send(Arc::clone(&text)).is_ok());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tokio::sync::mpsc::channel;

    #[test]
    fn the_first_page_commands_then_the_next_and_one_that_does_not_read_is_given_up() {
        let mut pages = Pages::default();
        let (first, mut of_first) = channel(2);
        let (second, mut of_second) = channel(8);
        let (only, mut of_only) = channel(8);
        pages.attach(0, Wants::ToLook, Arc::default(), only);
        assert_eq!(pages.commander(), None);
        pages.attach(1, Wants::ToCommand, Arc::default(), first);
        pages.attach(2, Wants::ToCommand, Arc::default(), second);
        assert_eq!(pages.commander(), Some(1));
        assert_eq!(of_second.try_recv().unwrap().as_ref(), r#"{"role":"looks"}"#);
        // There is room for its role and one more.
        pages.tell(&json!(1));
        pages.forget();
        assert_eq!((pages.commander(), pages.hold(1).is_some()), (Some(1), true));
        pages.tell(&json!(2));
        pages.forget();
        assert_eq!((pages.commander(), pages.hold(1).is_some()), (Some(2), false));
        assert_eq!(of_first.try_recv().unwrap().as_ref(), r#"{"role":"commands"}"#);
        let told = std::iter::from_fn(|| of_second.try_recv().ok()).map(|text| text.to_string()).collect::<Vec<_>>();
        assert_eq!(told, ["1", "2", r#"{"role":"commands"}"#]);
        drop(of_second);
        pages.forget();
        // Who wants to look alone never commands.
        assert_eq!((pages.commander(), pages.is_empty()), (None, false));
        assert_eq!(of_only.try_recv().unwrap().as_ref(), r#"{"role":"looks"}"#);
        drop(of_only);
        pages.forget();
        assert!(pages.is_empty());
    }
}
