//! SDO server: one channel, object 1200h, with expedited, segmented and block transfers. CiA 301 section 7.2.4; the
//! task.
//!
//! A channel has one client. Two clients on the same identifiers cannot be told apart: the request that does not
//! belong into the transfer in progress aborts it (0504 0001h, which both see), nothing is half written, and the next
//! request begins anew.
//!
//! A client's abort ends any transfer at any moment, without an answer. Requests that are not 8 bytes long are not
//! requests.

mod block_download;
mod block_upload;
mod crc;
mod segmented;

use super::abort::Abort;
use super::access::{Objects, Sink, Source};
use super::dictionary::ObjectDictionary;
use super::time::elapsed;
use block_download::BlockDownload;
use block_upload::BlockUpload;
use segmented::{Download, Upload};

/// An SDO message.
type Message = [u8; 8];

/// The command specifier of an abort, in either direction.
const ABORT: u8 = 0x80;

/// Time-out of the server, and the size of its blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SdoSettings {
    /// A client that is silent for so long within a transfer loses it, us; at most half an hour.
    pub timeout: u32,
    /// Segments of a downloaded block, 1 to 127: what the queue between interrupt and task holds.
    pub block_size: u8,
}

impl Default for SdoSettings {
    /// Half a second, whole blocks.
    fn default() -> Self {
        Self { timeout: 500_000, block_size: 127 }
    }
}

#[derive(Debug, Default)]
enum State {
    #[default]
    Idle,
    Download(Download),
    Upload(Upload),
    BlockDownload(BlockDownload),
    BlockUpload(BlockUpload),
}

/// The server's side of the channel.
#[derive(Debug)]
pub(super) struct SdoServer {
    settings: SdoSettings,
    state: State,
    /// Destination of a download in progress.
    sink: Option<Sink>,
    /// Index and sub-index of the transfer, as they were sent.
    address: [u8; 3],
    /// Time at which the client was heard last, or given something to answer.
    heard: u32,
}

/// A request to begin a transfer.
struct Initiate {
    command: u8,
    index: u16,
    sub_index: u8,
    data: [u8; 4],
}

impl Initiate {
    fn parse(message: &Message) -> Self {
        let &[command, low, high, sub_index, a, b, c, d] = message;
        Self { command, index: u16::from_le_bytes([low, high]), sub_index, data: [a, b, c, d] }
    }

    fn number(&self) -> u32 {
        u32::from_le_bytes(self.data)
    }

    /// An answer to it.
    fn answer(&self, command: u8, data: [u8; 4]) -> Message {
        let [low, high] = self.index.to_le_bytes();
        let [a, b, c, d] = data;
        [command, low, high, self.sub_index, a, b, c, d]
    }
}

impl SdoServer {
    pub(super) fn new(settings: SdoSettings) -> Self {
        let block_size = settings.block_size.clamp(1, 127);
        let settings = SdoSettings { block_size, ..settings };
        Self { settings, state: State::Idle, sink: None, address: [0; 3], heard: 0 }
    }

    /// Takes a request; its answer, if it has one.
    pub(super) fn receive<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        now: u32,
        objects: &mut Objects<'_, '_, D>,
    ) -> Option<Message> {
        self.heard = now;
        let [command, ..] = *request;
        if command == ABORT {
            self.cancel(objects.dictionary);
            return None;
        }
        match self.step(request, objects) {
            Ok(answer) => answer,
            Err(abort) => Some(self.abort(abort, objects.dictionary)),
        }
    }

    /// Messages that have to be sent without a request: segments of a block upload, and the abort after a time-out. One
    /// message at a time, so that the sender's queue paces the upload.
    pub(super) fn poll<D: ObjectDictionary>(&mut self, now: u32, objects: &mut Objects<'_, '_, D>) -> Option<Message> {
        if let State::BlockUpload(upload) = &mut self.state
            && upload.is_sending()
        {
            self.heard = now;
            return Some(match upload.segment(objects) {
                Ok(segment) => segment,
                Err(abort) => self.abort(abort, objects.dictionary),
            });
        }
        let waiting = !matches!(self.state, State::Idle);
        let over = waiting && elapsed(now, self.heard) > self.settings.timeout;
        over.then(|| self.abort(Abort::TIMEOUT, objects.dictionary))
    }

    /// Back to idle, without a word.
    pub(super) fn cancel(&mut self, dictionary: &mut impl ObjectDictionary) {
        self.state = State::Idle;
        if let Some(sink) = self.sink.take() {
            sink.abandon(dictionary);
        }
    }

    #[cfg(test)]
    pub(super) fn is_idle(&self) -> bool {
        matches!(self.state, State::Idle) && self.sink.is_none()
    }

    fn abort(&mut self, abort: Abort, dictionary: &mut impl ObjectDictionary) -> Message {
        self.cancel(dictionary);
        let [low, high, sub_index] = self.address;
        let [a, b, c, d] = abort.0.to_le_bytes();
        [ABORT, low, high, sub_index, a, b, c, d]
    }

    fn step<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<Option<Message>, Abort> {
        match &mut self.state {
            State::Idle => return self.begin(request, objects),
            State::BlockUpload(upload) if upload.is_over(request) => {
                self.state = State::Idle;
                return Ok(None);
            }
            State::BlockUpload(upload) => return upload.receive(request),
            State::Upload(upload) => {
                let (answer, last) = upload.receive(request, objects)?;
                if last {
                    self.state = State::Idle;
                }
                return Ok(Some(answer));
            }
            State::Download(_) | State::BlockDownload(_) => {}
        }
        // Every download has a sink.
        let sink = self.sink.as_mut().ok_or(Abort::GENERAL)?;
        let (answer, last) = match &mut self.state {
            State::Download(download) => {
                let (answer, last) = download.receive(request, sink, objects)?;
                (Some(answer), last)
            }
            State::BlockDownload(download) => download.receive(request, sink, objects)?,
            _ => return Err(Abort::GENERAL),
        };
        if last {
            self.state = State::Idle;
            self.sink.take().ok_or(Abort::GENERAL)?.finish(objects)?;
        }
        Ok(answer)
    }

    fn begin<D: ObjectDictionary>(
        &mut self,
        request: &Message,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<Option<Message>, Abort> {
        let initiate = Initiate::parse(request);
        let [low, high] = initiate.index.to_le_bytes();
        self.address = [low, high, initiate.sub_index];
        match initiate.command >> 5 {
            1 if initiate.command & 2 != 0 => {
                let mut sink = segmented::open(&initiate, objects)?;
                if let Err(abort) = sink.push(objects, segmented::expedited(&initiate, &sink)) {
                    sink.abandon(objects.dictionary);
                    return Err(abort);
                }
                sink.finish(objects)?;
                Ok(Some(initiate.answer(0x60, [0; 4])))
            }
            1 => {
                self.sink = Some(segmented::open(&initiate, objects)?);
                self.state = State::Download(Download::default());
                Ok(Some(initiate.answer(0x60, [0; 4])))
            }
            2 => {
                let source = Source::open(objects, initiate.index, initiate.sub_index)?;
                self.upload(&initiate, source, objects)
            }
            5 if initiate.command & 3 == 0 => {
                let [block_size, threshold, ..] = initiate.data;
                let source = Source::open(objects, initiate.index, initiate.sub_index)?;
                if threshold != 0 && source.length() <= u32::from(threshold) {
                    // The client allows the plain protocol for so few bytes, CiA 301 section 7.2.4.3.12.
                    return self.upload(&initiate, source, objects);
                }
                let upload = BlockUpload::new(source, block_size, initiate.command & 4 != 0)?;
                let answer = initiate.answer(upload.command(), source.length().to_le_bytes());
                self.state = State::BlockUpload(upload);
                Ok(Some(answer))
            }
            6 if initiate.command & 1 == 0 => {
                let announced = (initiate.command & 2 != 0).then(|| initiate.number());
                self.sink = Some(Sink::open(objects, initiate.index, initiate.sub_index, announced)?);
                let size = self.settings.block_size;
                self.state = State::BlockDownload(BlockDownload::new(size, initiate.command & 4 != 0));
                Ok(Some(initiate.answer(block_download::COMMAND, [size, 0, 0, 0])))
            }
            _ => Err(Abort::COMMAND),
        }
    }

    /// Expedited where it fits, else segmented.
    fn upload<D: ObjectDictionary>(
        &mut self,
        initiate: &Initiate,
        source: Source,
        objects: &mut Objects<'_, '_, D>,
    ) -> Result<Option<Message>, Abort> {
        if let 1..=4 = source.length() {
            let ([a, b, c, d, ..], bytes, _) = source.segment(objects, 0)?;
            let unused = 4u8.saturating_sub(bytes);
            return Ok(Some(initiate.answer(0x43 | unused << 2, [a, b, c, d])));
        }
        self.state = State::Upload(Upload::new(source));
        Ok(Some(initiate.answer(0x41, source.length().to_le_bytes())))
    }
}
