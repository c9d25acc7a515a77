//! A page that leads a sequence: it says yes or no to what it is asked.

use crate::page::Page;
use serde_json::{Value, json};

/// Attempts on a machine that has much else to do.
pub const TIMES: usize = 60;

pub enum Next {
    Question(u64),
    Stage(String),
    End(Result<Value, String>),
}

/// Page and what it does of its own accord.
pub struct Led<'p> {
    pub page: &'p mut Page,
    id: u64,
    key: &'static str,
}

impl<'p> Led<'p> {
    /// Begins what `ask` asks for, which is told of under its name.
    pub fn begin(page: &'p mut Page, key: &'static str, ask: Value) -> Self {
        let id = page.tell(json!({ key: ask }));
        Self { page, id, key }
    }

    pub fn next(&mut self) -> Next {
        let (id, key) = (self.id, self.key);
        self.page.until(|message| {
            if message["answer"] == json!(id) {
                let error = message["error"].as_str().map(str::to_owned);
                return Some(Next::End(error.map_or_else(|| Ok(message["done"].clone()), Err)));
            }
            let told = &message[key];
            let stage = || told["stage"].as_str().map(|stage| Next::Stage(stage.to_owned()));
            told["question"]["number"].as_u64().map(Next::Question).or_else(stage)
        })
    }

    /// Presses the button of a question until it counts.
    pub fn agree(&mut self, question: u64) {
        for _ in 0..TIMES {
            let hold = self.page.press();
            match self.page.answer(json!({ "agree": { "question": question, "hold": hold } })) {
                Ok(_) => return,
                Err(error) => assert!(error.contains("let go before"), "{error}"),
            }
            self.page.let_go(true);
        }
        panic!("no yes counted in {TIMES}");
    }

    /// Says yes to everything but question `no`.
    pub fn answer_all(&mut self, no: Option<u64>) -> Result<Value, String> {
        loop {
            match self.next() {
                Next::Stage(_) => {}
                Next::Question(question) => {
                    self.page.let_go(true);
                    if Some(question) == no {
                        self.page.answer(json!({ "agree": { "question": question, "hold": null } })).unwrap();
                    } else {
                        self.agree(question);
                    }
                }
                Next::End(ended) => {
                    self.page.let_go(true);
                    return ended;
                }
            }
        }
    }
}
