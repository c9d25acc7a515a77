//! A bus with one reader and any number of subscribers; host, a thread of its own.

use super::cob_id;
use super::error::{ClientError, Object};
use super::frame::frame;
use super::nmt::{Command, Target};
use super::sdo::{Failure, Settings, Transfer};
use super::{Emergency, NmtState};
use crate::pacing::bits;
use crate::{BusError, Frame, Transport};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Frames that a subscriber may leave unread; newer ones are dropped and counted.
const UNREAD: usize = 1 << 14;
/// Time after which the reader notices that nobody needs it any more.
const READ: Duration = Duration::from_millis(20);
/// Frames within [`READ`] from which the reader rests for [`REST`] once it has read all that came, instead of waiting
/// for the next one: waking up for each of some thousand frames a second costs more than reading them.
const BUSY: u32 = 80;
/// See [`BUSY`].
const REST: Duration = Duration::from_micros(500);

/// A frame and when it came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// The frame.
    pub frame: Frame,
    /// Time at which the reader had it: some tens of microseconds after the bus, half a millisecond where the bus
    /// carries more than 4,000 frames a second, a millisecond over USB.
    pub at: Instant,
    /// SYNCs that were on the bus by then, of this program and of others, since it listens.
    pub syncs: u64,
}

type Filter = Box<dyn Fn(&Frame) -> bool + Send>;

struct Subscriber {
    filter: Filter,
    frames: SyncSender<Received>,
    dropped: Arc<AtomicU64>,
}

/// State that the reader and everyone else share.
struct Shared {
    transport: Arc<dyn Transport>,
    subscribers: Mutex<Vec<Subscriber>>,
    /// Reason for the reader's end.
    failure: Mutex<Option<BusError>>,
    over: AtomicBool,
    /// A bit for every node id that was heard.
    heard: [AtomicU64; 2],
    /// One SDO transfer at a time and node within this program.
    channels: [Mutex<()>; 128],
    frames: AtomicU64,
    /// Bits of the frames that were received and sent.
    bits: AtomicU64,
    syncs: AtomicU64,
}

/// A CANopen network as a master sees it. Cloning gives another handle to the same reader, which ends with the last of
/// them.
#[derive(Clone)]
pub struct Network {
    reader: Arc<Reader>,
    patience: Duration,
}

struct Reader {
    shared: Arc<Shared>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl std::fmt::Debug for Network {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("Network").field(&self.reader.shared.transport).finish()
    }
}

impl Drop for Reader {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Relaxed);
        if let Some(thread) = lock(&self.thread).take() {
            // It panics only where a subscriber's filter does, which has been reported.
            let _ = thread.join();
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Shared {
    fn read(&self) {
        let (mut began, mut frames, mut busy) = (Instant::now(), 0, false);
        while !self.over.load(Ordering::Relaxed) {
            let received = self.transport.receive(if busy { Duration::ZERO } else { READ });
            let now = Instant::now();
            match received {
                Ok(Some(frame)) => {
                    frames += 1;
                    self.distribute(frame, now);
                }
                Ok(None) if busy => std::thread::sleep(REST),
                Ok(None) => {}
                Err(error) => {
                    *lock(&self.failure) = Some(error);
                    // Subscribers that wait for a frame see the channel closed.
                    lock(&self.subscribers).clear();
                    return;
                }
            }
            if now.saturating_duration_since(began) >= READ {
                (began, frames, busy) = (now, 0, frames >= BUSY);
            }
        }
    }

    fn distribute(&self, frame: Frame, at: Instant) {
        self.frames.fetch_add(1, Ordering::Relaxed);
        self.passed(&frame);
        let of_others = u64::from(frame.id() == cob_id::SYNC);
        let syncs = self.syncs.fetch_add(of_others, Ordering::Relaxed) + of_others;
        let received = Received { frame, at, syncs };
        if let Some(node) = sender(&received.frame)
            && let Some(bits) = self.heard.get(usize::from(node / 64))
        {
            bits.fetch_or(1 << (node % 64), Ordering::Relaxed);
        }
        lock(&self.subscribers).retain(|subscriber| {
            if !(subscriber.filter)(&received.frame) {
                return true;
            }
            match subscriber.frames.try_send(received) {
                Ok(()) => true,
                Err(TrySendError::Full(_)) => {
                    subscriber.dropped.fetch_add(1, Ordering::Relaxed);
                    true
                }
                Err(TrySendError::Disconnected(_)) => false,
            }
        });
    }

    fn passed(&self, frame: &Frame) {
        self.bits.fetch_add(bits(frame).into(), Ordering::Relaxed);
    }

    #[cfg(test)]
    fn subscribed(&self) -> usize {
        lock(&self.subscribers).len()
    }

    fn failure(&self) -> Option<BusError> {
        lock(&self.failure).clone()
    }
}

/// Node that sent this, by the predefined connection set; PDOs may have other identifiers, so they do not count.
fn sender(frame: &Frame) -> Option<u8> {
    let node = (frame.id() & 0x7F) as u8;
    let by_node = matches!(frame.id() & 0x780, cob_id::EMERGENCY | cob_id::SDO_TRANSMIT | cob_id::HEARTBEAT);
    (by_node && node != 0 && frame.id() < cob_id::LSS_SLAVE).then_some(node)
}

impl Network {
    /// Takes over the receiving side of a bus. Whoever else holds it may send, but not receive.
    pub fn new(transport: Arc<dyn Transport>) -> Self {
        let shared = Arc::new(Shared {
            transport,
            subscribers: Mutex::default(),
            failure: Mutex::default(),
            over: AtomicBool::new(false),
            heard: Default::default(),
            channels: [const { Mutex::new(()) }; 128],
            frames: AtomicU64::new(0),
            bits: AtomicU64::new(0),
            syncs: AtomicU64::new(0),
        });
        let reader = Arc::clone(&shared);
        let thread = std::thread::spawn(move || reader.read());
        let reader = Arc::new(Reader { shared, thread: Mutex::new(Some(thread)) });
        Self { reader, patience: Settings::default().timeout }
    }

    /// The same network for a master that waits longer, or less long, for a node's answer: behind a gateway, or on a
    /// busy machine.
    pub fn with_patience(self, patience: Duration) -> Self {
        Self { patience, ..self }
    }

    /// Time that a node may take to answer before it counts as silent; 1 s unless told otherwise.
    pub fn patience(&self) -> Duration {
        self.patience
    }

    fn shared(&self) -> &Shared {
        &self.reader.shared
    }

    /// The bus.
    pub fn transport(&self) -> &Arc<dyn Transport> {
        &self.shared().transport
    }

    /// Sends a frame: an RPDO, or anything else.
    pub fn send(&self, frame: &Frame) -> Result<(), ClientError> {
        match self.shared().failure() {
            Some(error) => Err(error.into()),
            None => {
                self.shared().transport.send(frame)?;
                self.shared().passed(frame);
                Ok(())
            }
        }
    }

    /// Every frame from now on for which `filter` is true: a TPDO by its identifier, or all of them for a monitor.
    /// `filter` runs in the reader and has to be quick.
    pub fn subscribe(&self, filter: impl Fn(&Frame) -> bool + Send + 'static) -> Subscription {
        let (sender, frames) = sync_channel(UNREAD);
        let dropped = Arc::<AtomicU64>::default();
        let subscriber = Subscriber { filter: Box::new(filter), frames: sender, dropped: Arc::clone(&dropped) };
        let mut subscribers = lock(&self.shared().subscribers);
        // Those that ended are noticed by the next frame of their interest, which may never come.
        subscribers.retain(|subscriber| Arc::strong_count(&subscriber.dropped) > 1);
        // After a failure the channel is closed from the beginning.
        if self.shared().failure().is_none() {
            subscribers.push(subscriber);
        }
        drop(subscribers);
        Subscription { frames, dropped, network: self.clone() }
    }

    /// Sends an NMT command. Nodes do not answer it; see [`Network::heartbeats`].
    pub fn command(&self, command: Command, target: Target) -> Result<(), ClientError> {
        if let Target::Node(id @ (0 | 128..)) = target {
            return Err(ClientError::NodeId(id));
        }
        self.send(&command.frame(target))
    }

    /// SYNCs that were on the bus since this program listens, its own and those of others.
    pub fn syncs(&self) -> u64 {
        self.shared().syncs.load(Ordering::Relaxed)
    }

    /// Sends one SYNC, without counter.
    pub fn sync(&self) -> Result<(), ClientError> {
        self.shared().syncs.fetch_add(1, Ordering::Relaxed);
        self.send(&frame(cob_id::SYNC, &[]))
    }

    /// Heartbeats and boot-up messages of all nodes.
    pub fn heartbeats(&self) -> Subscription {
        self.subscribe(|frame| super::heartbeat::parse(frame).is_some())
    }

    /// EMCYs of all nodes; see [`Emergency::decode`].
    pub fn emergencies(&self) -> Subscription {
        self.subscribe(|frame| Emergency::decode(frame).is_some())
    }

    /// Resets a node, or all, and waits for the boot-up message of `node`. It is listened for before the command is
    /// sent: a quick node is not missed.
    pub fn reset_and_wait(&self, command: Command, node: u8, timeout: Duration) -> Result<(), ClientError> {
        let heartbeats = self.heartbeats();
        self.command(command, Target::Node(node))?;
        let deadline = Instant::now() + timeout;
        while let Some(received) = heartbeats.next(deadline.saturating_duration_since(Instant::now()))? {
            if super::heartbeat::parse(&received.frame) == Some((node, NmtState::Initialising)) {
                return Ok(());
            }
        }
        Err(ClientError::Silence { what: format!("the boot-up message of node {node}"), timeout })
    }

    /// Nodes of which an EMCY, an SDO answer, a heartbeat or a boot-up message was heard since the bus was opened.
    pub fn heard(&self) -> Vec<u8> {
        let bits = self.shared().heard.each_ref().map(|bits| bits.load(Ordering::Relaxed));
        (1..=127u8)
            .filter(|node| bits.get(usize::from(node / 64)).is_some_and(|bits| bits >> (node % 64) & 1 != 0))
            .collect()
    }

    /// Frames that were received.
    pub fn frames(&self) -> u64 {
        self.shared().frames.load(Ordering::Relaxed)
    }

    /// Bits of the frames that were received and sent, as they are on a CAN bus, stuff bits and interframe space
    /// included. What other programs send counts where the bus delivers it to this one.
    pub fn bits(&self) -> u64 {
        self.shared().bits.load(Ordering::Relaxed)
    }

    /// Runs an SDO transfer. Those of one node wait for each other.
    pub(super) fn run(&self, mut transfer: Transfer, timeout: Duration) -> Result<Vec<u8>, ClientError> {
        let object = transfer.object();
        let _channel = self.shared().channels.get(usize::from(object.node)).map(lock);
        let node = u16::from(object.node);
        let (answers, requests) = (cob_id::SDO_TRANSMIT | node, cob_id::SDO_RECEIVE | node);
        let frames = self.subscribe(move |frame| frame.id() == answers || frame.id() == requests);
        let began = Instant::now();
        loop {
            while let Some(message) = transfer.poll(began.elapsed()) {
                self.send(&frame(requests, &message))?;
                // An abort by the node ends a block that is going out.
                while let Some(received) = frames.try_next()? {
                    hear(&mut transfer, &received, answers, began);
                }
            }
            if let Some(outcome) = transfer.outcome() {
                return outcome.clone().map_err(|failure| self.explain(object, failure, timeout));
            }
            let wait = transfer.deadline().unwrap_or_default().saturating_sub(began.elapsed());
            if let Some(received) = frames.next(wait)? {
                hear(&mut transfer, &received, answers, began);
            }
        }
    }

    fn explain(&self, object: Object, failure: Failure, timeout: Duration) -> ClientError {
        match failure {
            Failure::Timeout => ClientError::NoAnswer { object, timeout, heard: self.heard() },
            Failure::Aborted(abort) => ClientError::Aborted { object, abort },
            Failure::OtherClient => ClientError::OtherClient { object },
            Failure::Protocol(problem) => ClientError::Protocol { object, problem },
        }
    }
}

/// Requests that are heard are another client's: one's own are not.
fn hear(transfer: &mut Transfer, received: &Received, answers: u16, began: Instant) {
    if received.frame.id() == answers {
        transfer.receive(received.frame.data(), received.at.saturating_duration_since(began));
    } else {
        transfer.disturbed();
    }
}

/// Frames of one interest, in the order of arrival. Ends with being dropped.
#[derive(Debug)]
pub struct Subscription {
    frames: Receiver<Received>,
    dropped: Arc<AtomicU64>,
    network: Network,
}

impl Subscription {
    /// The next frame; none when nothing came within `timeout`. Fails once the bus is gone and everything that came
    /// before was read.
    pub fn next(&self, timeout: Duration) -> Result<Option<Received>, ClientError> {
        match self.frames.recv_timeout(timeout) {
            Ok(received) => Ok(Some(received)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => match self.network.shared().failure() {
                Some(error) => Err(error.into()),
                None => Ok(None),
            },
        }
    }

    /// A frame that has come already.
    pub fn try_next(&self) -> Result<Option<Received>, ClientError> {
        self.next(Duration::ZERO)
    }

    /// Frames that were dropped because too many waited to be read.
    pub fn dropped(&self) -> u64 {
        self.dropped.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subscriptions_that_ended_are_forgotten_though_nothing_of_their_interest_comes() {
        let network = Network::new(crate::open("virtual:forgotten").unwrap());
        for _ in 0..100 {
            drop(network.heartbeats());
        }
        let kept = network.heartbeats();
        assert_eq!(network.shared().subscribed(), 1);
        drop((network.emergencies(), kept));
    }
}
