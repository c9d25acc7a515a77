//! A page as the server sees it: a WebSocket client that presses buttons.

use crate::served::PATIENCE;
use serde_json::{Value, json};
use std::io::{ErrorKind, Write};
use std::net::{SocketAddr, TcpStream};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Error, Message, WebSocket};

/// Interval at which a page looks for messages, and says that its button is held.
const LOOK: Duration = Duration::from_millis(20);
/// A machine that is busy misses held-messages: the button is pressed again.
const PRESSES: u64 = 20;

/// Reason and state, where a message tells the end of a motion.
fn end(message: &Value) -> Option<(String, String)> {
    let motion = message.get("motion").filter(|motion| motion["moving"] == json!(false))?;
    Some((motion["reason"].as_str()?.to_owned(), motion["state"].as_str()?.to_owned()))
}

pub struct Page {
    socket: WebSocket<TcpStream>,
    ids: u64,
    holds: u64,
    held: Option<u64>,
    /// Signals' names.
    pub signals: Vec<String>,
    /// Messages in their order.
    pub seen: Vec<Value>,
}

impl Page {
    /// A page of this server, once it knows the joint.
    pub fn open(address: SocketAddr) -> Self {
        let mut page = Self::connect(address, "default");
        let hello = page.until(|message| message.get("hello").cloned());
        let names = hello["signals"].as_array().unwrap().iter();
        page.signals = names.map(|signal| signal["name"].as_str().unwrap().to_owned()).collect();
        page
    }

    pub fn connect(address: SocketAddr, node: &str) -> Self {
        let mut request = format!("ws://{address}/joint/{node}").into_client_request().unwrap();
        request.headers_mut().insert("origin", format!("http://{address}").parse().unwrap());
        let stream = TcpStream::connect(address).unwrap();
        let (socket, _) = tungstenite::client(request, stream).unwrap();
        socket.get_ref().set_read_timeout(Some(LOOK)).unwrap();
        Self { socket, ids: 0, holds: 0, held: None, signals: Vec::new(), seen: Vec::new() }
    }

    /// Sends a message; where the connection has ended the next look says so.
    pub fn send(&mut self, message: Message) {
        let _ = self.socket.send(message);
    }

    /// Bytes below WebSocket.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.socket.get_mut().write_all(bytes).unwrap();
    }

    pub fn tell(&mut self, ask: Value) -> u64 {
        self.ids += 1;
        let text = json!({ "id": self.ids, "ask": ask }).to_string();
        self.send(Message::text(text));
        self.ids
    }

    /// The next message; none where there is none yet, an error once the connection is closed.
    pub fn look(&mut self) -> Result<Option<Value>, ()> {
        if let Some(hold) = self.held {
            self.tell(json!({ "held": { "hold": hold } }));
        }
        match self.socket.read() {
            Ok(Message::Text(text)) => {
                let message: Value = serde_json::from_str(&text).unwrap();
                self.seen.push(message.clone());
                Ok(Some(message))
            }
            Ok(_) => Ok(None),
            Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => Ok(None),
            Err(_) => Err(()),
        }
    }

    /// Waits for a message that says it.
    pub fn until<T>(&mut self, mut says: impl FnMut(&Value) -> Option<T>) -> T {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            let message = self.look().unwrap_or_else(|()| panic!("closed: {:?}", self.last()));
            if let Some(found) = message.as_ref().and_then(&mut says) {
                return found;
            }
        }
        panic!("not said within {PATIENCE:?}: {:?}", self.last());
    }

    /// Messages that are not live values, the last of them.
    fn last(&self) -> Vec<&Value> {
        let words = self.seen.iter().filter(|message| message.get("live").is_none() && message.get("slow").is_none());
        words.rev().take(8).collect()
    }

    pub fn answer(&mut self, ask: Value) -> Result<Value, String> {
        let id = self.tell(ask);
        self.answer_to(id)
    }

    /// The answer to a question, which may have come already.
    pub fn answer_to(&mut self, id: u64) -> Result<Value, String> {
        let says = |message: &Value| {
            (message["answer"] == json!(id)).then(|| match message.get("error") {
                Some(error) => Err(error.as_str().unwrap().to_owned()),
                None => Ok(message["done"].clone()),
            })
        };
        let seen = self.seen.iter().find_map(says);
        seen.unwrap_or_else(|| self.until(says))
    }

    /// Waits until this page is the one that may change something.
    pub fn commands(&mut self) {
        let role = json!({ "role": "commands" });
        if !self.seen.contains(&role) {
            self.until(|message| (message == &role).then_some(()));
        }
    }

    /// Presses a button; the number of the hold.
    pub fn press(&mut self) -> u64 {
        self.holds += 1;
        self.held = Some(self.holds);
        self.tell(json!({ "held": { "hold": self.holds } }));
        self.holds
    }

    /// Lets it go, and says so or not.
    pub fn let_go(&mut self, say: bool) {
        self.held = None;
        if say {
            self.tell(json!("release"));
        }
    }

    /// Presses a button and holds it until a signal has come to where it is wanted.
    pub fn move_until(&mut self, motion: &Value, name: &str, there: impl Fn(f64) -> bool) {
        let signals = self.signals.clone();
        let place = signals.iter().position(|signal| signal == name).unwrap();
        for _ in 0..PRESSES {
            let hold = self.press();
            let id = self.tell(json!({ "move": { "hold": hold, "motion": motion } }));
            // Values and the end of a motion before this one may still come: this one begins with its answer.
            let mut moves = false;
            let arrived = self.until(|message| {
                if message["answer"] == json!(id) {
                    if let Some(error) = message["error"].as_str() {
                        assert!(error.contains("let go before"), "{error}");
                        return Some(false);
                    }
                    moves = true;
                }
                if !moves {
                    return None;
                }
                if message["motion"]["moving"] == json!(false) {
                    let reason = message["motion"]["reason"].as_str();
                    assert_eq!(reason, Some("not held any more"), "{message}");
                    return Some(false);
                }
                let newest = message["live"]["high"].as_array()?.last()?[place].as_f64()?;
                there(newest).then_some(true)
            });
            if arrived {
                return;
            }
            self.let_go(true);
        }
        panic!("{motion} did not come to where it was wanted in {PRESSES} presses");
    }

    /// Waits for the end of a motion: reason and state.
    pub fn ended(&mut self) -> (String, String) {
        self.until(end)
    }

    /// The same for the motion of another page, whose button stays held meanwhile.
    pub fn sees_end_of(&mut self, other: &mut Self) -> (String, String) {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            other.look().unwrap();
            if let Some(found) = self.look().unwrap().as_ref().and_then(end) {
                return found;
            }
        }
        panic!("no end within {PATIENCE:?}: {:?}", self.last());
    }

    fn begun(&self) -> usize {
        self.seen.iter().filter(|message| message["motion"]["moving"] == json!(true)).count()
    }

    /// Reads what was said before the motion in which another page is now; its button stays held meanwhile.
    pub fn follow(&mut self, other: &mut Self) {
        let began = Instant::now();
        while self.begun() < other.begun() {
            assert!(began.elapsed() < PATIENCE, "{:?}", self.last());
            other.look().unwrap();
            self.look().unwrap();
        }
    }

    /// Waits for a value of a signal.
    pub fn sees(&mut self, name: &str, there: impl Fn(f64) -> bool) {
        let place = self.signals.iter().position(|signal| signal == name).unwrap();
        self.until(|message| {
            let newest = message["live"]["high"].as_array()?.last()?[place].as_f64()?;
            there(newest).then_some(())
        });
    }

    /// Message that is said before the connection ends.
    pub fn closed(&mut self) -> Option<String> {
        let began = Instant::now();
        let mut said = None;
        self.held = None;
        while began.elapsed() < PATIENCE {
            match self.look() {
                Ok(Some(message)) => said = message["error"].as_str().map(str::to_owned).or(said),
                Ok(None) => {}
                Err(()) => return said,
            }
        }
        panic!("the connection stays open");
    }
}
