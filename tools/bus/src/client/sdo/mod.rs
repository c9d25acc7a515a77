//! SDO client: expedited, segmented and block transfers in both directions, CiA 301 section 7.2.4; no I/O, time passed
//! in, host.
//!
//! A [`Transfer`] is one reading or writing of one object. Send what [`Transfer::poll`] gives, give what the node
//! answers to [`Transfer::receive`], until [`Transfer::outcome`]. Time is a [`Duration`] since any instant that stays
//! the same.
//!
//! Lost frames: in a block they are sent again, as the protocol provides. Everywhere else the transfer ends by time-out
//! with nothing half done, as it may be unknown whether the node acted; whoever asked decides whether to ask again.
//! Late messages of a transfer before are passed over where they can be told apart: by command or by object.

mod crc;
mod download;
mod upload;

use super::error::Object;
use canopen_node::Abort;
use std::time::Duration;

/// An SDO message.
pub type Message = [u8; 8];

const ABORT: u8 = 0x80;
const TOGGLE: u8 = 0x10;
/// Data bytes of a segment.
const SEGMENT: usize = 7;

/// Protocol that carries the data.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Writing: expedited up to 4 bytes, segmented up to 28, then block; segmented where the node has no block
    /// transfer. Reading: as the node answers a plain request, expedited or segmented, which every node can.
    #[default]
    Automatic,
    /// Segmented, also what would fit into one frame. Reading: a node answers up to 4 bytes expedited all the same.
    Segmented,
    /// Block transfer, with CRC where the node can; else refused with abort code 0504 0001h.
    Block,
}

/// Settings of a client: its time-outs, and how much it takes at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Silence of the node after which a transfer is given up.
    pub timeout: Duration,
    /// Segments of a block that the node sends without being answered, 1 to 127.
    pub block_size: u8,
    /// Most bytes that are read of an object.
    pub limit: usize,
}

impl Default for Settings {
    /// One second, which leaves a node of half a second the first word; whole blocks; 1 MiB.
    fn default() -> Self {
        Self { timeout: Duration::from_secs(1), block_size: 127, limit: 1 << 20 }
    }
}

/// Reason for the failure of a transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The node was silent for the time-out.
    Timeout,
    /// The node refused.
    Aborted(Abort),
    /// Another client sent to the node's SDO server.
    OtherClient,
    /// The node sent what the protocol does not allow.
    Protocol(String),
}

/// State of the transfer: what it waits for.
#[derive(Debug)]
enum State {
    Download(download::Download),
    Upload(upload::Upload),
    Over(Result<Vec<u8>, Failure>),
}

/// Effect of a message.
enum Step {
    /// No effect: it belongs to something else.
    Ignored,
    /// Expected message, and the one that answers it, if there is one.
    Answer(Option<Message>),
    /// The transfer is whole; the message tells the node, if there is one.
    Done(Option<Message>, Vec<u8>),
    /// Wrong message of the node; it is told.
    Wrong(Abort, String),
}

/// One reading or writing of an object.
#[derive(Debug)]
pub struct Transfer {
    object: Object,
    settings: Settings,
    state: State,
    /// Message to be sent at once.
    pending: Option<Message>,
    /// Time at which the node was last heard, or sent something to answer.
    active: Duration,
    started: bool,
    /// The request that begins the transfer, to be sent again once: a transfer that somebody left half done makes the
    /// node refuse the first request after it, and the second one begins anew.
    again: Option<Message>,
}

impl Transfer {
    /// Writes `data`, which may be empty.
    pub fn download(object: Object, data: &[u8], method: Method, settings: Settings) -> Self {
        let (download, first) = download::Download::new(object, data, method);
        Self::new(object, settings, State::Download(download), first)
    }

    /// Reads the object.
    pub fn upload(object: Object, method: Method, settings: Settings) -> Self {
        let (upload, first) = upload::Upload::new(object, method, settings);
        Self::new(object, settings, State::Upload(upload), first)
    }

    fn new(object: Object, settings: Settings, state: State, first: Message) -> Self {
        let pending = Some(first);
        Self { object, settings, state, pending, active: Duration::ZERO, started: false, again: pending }
    }

    /// Object that is read or written.
    pub fn object(&self) -> Object {
        self.object
    }

    /// The next message to send. None until something is received or [`Transfer::deadline`] has come.
    pub fn poll(&mut self, now: Duration) -> Option<Message> {
        if !std::mem::replace(&mut self.started, true) {
            self.active = now;
        }
        if let Some(message) = self.pending.take() {
            self.active = now;
            return Some(message);
        }
        if let State::Download(download) = &mut self.state
            && let Some(segment) = download.segment()
        {
            self.active = now;
            return Some(segment);
        }
        let silent = now.saturating_sub(self.active);
        if let State::Upload(upload) = &mut self.state
            && silent >= self.settings.timeout / 4
            && let Some(message) = upload.acknowledge_after_silence()
        {
            self.active = now;
            return Some(message);
        }
        if silent >= self.settings.timeout && !matches!(self.state, State::Over(_)) {
            self.state = State::Over(Err(Failure::Timeout));
            return Some(self.abort(Abort::TIMEOUT));
        }
        None
    }

    /// Time at which [`Transfer::poll`] has to be called again if nothing is received; none once it is over.
    pub fn deadline(&self) -> Option<Duration> {
        match &self.state {
            State::Over(_) => None,
            State::Upload(upload) if upload.may_acknowledge() => Some(self.active + self.settings.timeout / 4),
            _ => Some(self.active + self.settings.timeout),
        }
    }

    /// Takes a message of the node's SDO server. Messages that are not 8 bytes long are none.
    pub fn receive(&mut self, data: &[u8], now: Duration) {
        let Ok(message) = <&Message>::try_from(data) else { return };
        if !self.started || matches!(self.state, State::Over(_)) {
            return;
        }
        let [command, ..] = *message;
        if command == ABORT {
            // One that names another object ends a transfer before this one, late. Some nodes name none within a
            // transfer.
            let &[_, low, high, sub_index, a, b, c, d] = message;
            if !names(message, self.object) && (low, high, sub_index) != (0, 0, 0) {
                return;
            }
            let abort = Abort(u32::from_le_bytes([a, b, c, d]));
            if abort == Abort::COMMAND && (self.begin_again() || self.fall_back()) {
                self.active = now;
                return;
            }
            self.pending = None;
            self.state = State::Over(Err(Failure::Aborted(abort)));
            return;
        }
        let step = match &mut self.state {
            State::Download(download) => download.receive(message),
            State::Upload(upload) => upload.receive(message),
            State::Over(_) => return,
        };
        match step {
            Step::Ignored => return,
            Step::Answer(answer) => self.pending = answer,
            Step::Done(last, data) => {
                self.pending = last;
                self.state = State::Over(Ok(data));
            }
            Step::Wrong(abort, problem) => {
                self.pending = Some(self.abort(abort));
                self.state = State::Over(Err(Failure::Protocol(problem)));
            }
        }
        self.active = now;
    }

    /// Gives up because another client sent to the node's SDO server, and lets the node know.
    pub fn disturbed(&mut self) {
        if !matches!(self.state, State::Over(_)) {
            self.pending = Some(self.abort(Abort::GENERAL));
            self.state = State::Over(Err(Failure::OtherClient));
        }
    }

    /// Outcome: what was read (nothing where it was written). Send what [`Transfer::poll`] still gives before.
    pub fn outcome(&self) -> Option<&Result<Vec<u8>, Failure>> {
        match &self.state {
            State::Over(outcome) if self.pending.is_none() => Some(outcome),
            _ => None,
        }
    }

    /// Repeats the first request, where it was refused for the first time.
    fn begin_again(&mut self) -> bool {
        let beginning = match &self.state {
            State::Download(download) => download.is_beginning(),
            State::Upload(upload) => upload.is_beginning(),
            State::Over(_) => false,
        };
        match self.again.take().filter(|_| beginning) {
            None => false,
            first => {
                self.pending = first;
                true
            }
        }
    }

    /// Begins anew without block transfer, where that is allowed and was just refused.
    fn fall_back(&mut self) -> bool {
        let State::Download(download) = &mut self.state else { return false };
        let first = download.fall_back();
        let fell_back = first.is_some();
        self.pending = first.or(self.pending.take());
        fell_back
    }

    fn abort(&self, abort: Abort) -> Message {
        request(ABORT, self.object, abort.0.to_le_bytes())
    }
}

/// A message that names its object.
fn request(command: u8, object: Object, data: [u8; 4]) -> Message {
    let [low, high] = object.index.to_le_bytes();
    let [a, b, c, d] = data;
    [command, low, high, object.sub_index, a, b, c, d]
}

/// Returns `true` if a message names this object.
fn names(message: &Message, object: Object) -> bool {
    let &[_, low, high, sub_index, ..] = message;
    u16::from_le_bytes([low, high]) == object.index && sub_index == object.sub_index
}

fn length(data: &[u8]) -> [u8; 4] {
    u32::try_from(data.len()).unwrap_or(u32::MAX).to_le_bytes()
}
