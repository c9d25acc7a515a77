//! The owner of a joint: one thread that alone talks to it, for all pages; host.
//!
//! Pages give orders, which the thread takes one after the other, and are told as JSON; a sequence that a page
//! leads (`led`) takes them while it lasts. Three things do not wait for their turn: held-messages and releases,
//! which go straight to the [hold](crate::hold) that the stream of set-points looks at, and STOP, which the stream
//! sees as well.

mod led;
mod pages;
mod retraining;
mod watch;
mod worker;

pub use pages::Wants;

use crate::hold::Hold;
use crate::message::{Ask, Message};
use crate::reports::Reports;
use bus::client::{Network, SyncProducer};
use friction_compensation::parameters::authentication::Key;
use serde_json::Value;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::sync::mpsc::Sender;

/// Orders that may wait.
const WAITING: usize = 64;
/// Messages that a page may leave unread.
pub const UNREAD: usize = 256;

/// A message for a page, JSON.
pub type Told = Arc<str>;

/// SYNC for all joints of a bus, as long as somebody looks at one.
#[derive(Debug)]
pub struct Syncs {
    network: Network,
    period: Duration,
    producer: Mutex<Weak<SyncProducer>>,
}

impl Syncs {
    /// `rate` a second.
    pub fn new(network: &Network, rate: f64) -> Self {
        Self { network: network.clone(), period: Duration::from_secs_f64(1.0 / rate), producer: Mutex::default() }
    }

    fn join(&self) -> Arc<SyncProducer> {
        let mut producer = self.producer.lock().unwrap_or_else(PoisonError::into_inner);
        producer.upgrade().unwrap_or_else(|| {
            let new = Arc::new(SyncProducer::new(&self.network, self.period));
            *producer = Arc::downgrade(&new);
            new
        })
    }
}

/// Joint that is meant, and the means to reach it.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The bus.
    pub network: Network,
    /// Node id.
    pub node: u8,
    /// The joint's key, where it has one.
    pub key: Option<Key>,
    /// SYNC.
    pub syncs: Arc<Syncs>,
    /// Reports that a page can show.
    pub reports: Arc<Reports>,
    /// Robot that the joint belongs to, as a page draws it.
    pub robot: Option<Arc<Value>>,
}

enum Order {
    Attach { page: u64, wants: Wants, hold: Arc<Hold>, tell: Sender<Told> },
    Ask { page: u64, id: u64, ask: Ask },
}

/// A joint's owner. Ends with being dropped: a motion is stopped, and the joint's PDOs are put back.
#[derive(Debug)]
pub struct Owner {
    orders: SyncSender<Order>,
    stop: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
    pages: AtomicU64,
    thread: Option<JoinHandle<()>>,
}

impl Owner {
    /// Begins to wait for pages; nothing is sent on the bus before one comes.
    pub fn begin(setup: Setup) -> Self {
        let (orders, inbox) = sync_channel(WAITING);
        let (stop, over) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let worker = worker::Worker::new(setup, inbox, Arc::clone(&stop), Arc::clone(&over));
        let thread = Some(std::thread::spawn(move || worker.run()));
        Self { orders, stop, over, pages: AtomicU64::new(0), thread }
    }

    /// A page that wants to be told of this joint; none where too many orders wait.
    pub fn attach(&self, wants: Wants, tell: Sender<Told>) -> Option<Session> {
        let page = self.pages.fetch_add(1, Ordering::Relaxed);
        let hold = Arc::<Hold>::default();
        let order = Order::Attach { page, wants, hold: Arc::clone(&hold), tell };
        self.orders.try_send(order).ok()?;
        Some(Session { page, hold, orders: self.orders.clone(), stop: Arc::clone(&self.stop) })
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // A panic has been reported; its stream has stopped the joint.
            let _ = thread.join();
        }
    }
}

/// A page's side. Dropping it releases its hold; the thread notices that nobody listens any more.
#[derive(Debug)]
pub struct Session {
    page: u64,
    hold: Arc<Hold>,
    orders: SyncSender<Order>,
    stop: Arc<AtomicBool>,
}

impl Session {
    /// Takes a message of the page.
    ///
    /// # Errors
    /// More orders than may wait.
    pub fn take(&self, message: Message) -> Result<(), String> {
        let Message { id, ask } = message;
        match ask {
            Ask::Held { hold } => self.hold.renew(hold, Instant::now()),
            Ask::Release => self.hold.release(),
            // Seen by the thread whether or not there is room for an order.
            Ask::Stop => self.stop.store(true, Ordering::Relaxed),
            ask => {
                let order = Order::Ask { page: self.page, id, ask };
                let full = |_| format!("more than {WAITING} questions wait for the joint");
                self.orders.try_send(order).map_err(full)?;
            }
        }
        Ok(())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.hold.release();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sixty_four_questions_wait_and_stop_does_not() {
        let (orders, inbox) = sync_channel(WAITING);
        let (hold, stop) = (Arc::<Hold>::default(), Arc::<AtomicBool>::default());
        let session = Session { page: 0, hold: Arc::clone(&hold), orders, stop: Arc::clone(&stop) };
        for id in 1..=64 {
            assert_eq!(session.take(Message { id, ask: Ask::Scan }), Ok(()));
        }
        let refused = session.take(Message { id: 65, ask: Ask::Scan });
        assert_eq!(refused, Err("more than 64 questions wait for the joint".into()));
        for ask in [Ask::Held { hold: 1 }, Ask::Stop] {
            assert_eq!(session.take(Message { id: 66, ask }), Ok(()));
        }
        assert!(stop.load(Ordering::Relaxed) && hold.is_held(1, Instant::now()));
        drop(session);
        assert!(!hold.is_held(1, Instant::now()));
        assert_eq!(inbox.iter().count(), 64);
    }
}
