//! The whole client over `virtual:`: a network with nodes, disturbances, other clients, and nobody.

use crate::disturbed::Disturbed;
use crate::node::{Node, Running, identity, pattern};
use bus::client::heartbeat::{Change, Watch};
use bus::client::lss::Address;
use bus::client::sdo::{Method, Settings};
use bus::client::{ClientError, Command, Emergency, Network, NmtState, Subscription, SyncProducer, Target, heartbeat};
use bus::{BusError, Frame, Transport, open};
use canopen_node::Abort;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

const MS: Duration = Duration::from_millis(1);

/// A master, and a node that has booted.
fn pair(bus: &str, id: u8, heartbeat: u16) -> (Network, Running) {
    pair_over(open(bus).unwrap(), bus, id, heartbeat)
}

/// The same, the master over a transport of its own.
fn pair_over(master: Arc<dyn Transport>, bus: &str, id: u8, heartbeat: u16) -> (Network, Running) {
    let network = Network::new(master);
    let booted = network.heartbeats();
    let running = Running::new(open(bus).unwrap(), Node::new(id, 1, heartbeat));
    assert!(booted.next(Duration::from_secs(60)).unwrap().is_some(), "boots");
    (network, running)
}

#[test]
fn bits_are_counted_of_what_is_sent_and_of_what_is_received() {
    let (one, other) = (Network::new(open("virtual:bits").unwrap()), Network::new(open("virtual:bits").unwrap()));
    let all = other.subscribe(|_| true);
    let frames = [Frame::new(0x123, &[1, 2, 3]).unwrap(), Frame::new(0, &[0; 8]).unwrap()];
    for frame in &frames {
        one.send(frame).unwrap();
        assert_eq!(all.next(Duration::from_secs(60)).unwrap().unwrap().frame, *frame);
    }
    let sum = frames.iter().map(|frame| u64::from(bus::pacing::bits(frame))).sum::<u64>();
    one.sync().unwrap();
    all.next(Duration::from_secs(60)).unwrap().unwrap();
    let sync = u64::from(bus::pacing::bits(&Frame::new(0x80, &[]).unwrap()));
    assert_eq!((one.bits(), other.bits()), (sum + sync, sum + sync));
    assert!(sum > (47 + 24) + (47 + 64) && sync >= 47);
}

fn quick(node: bus::client::Node) -> bus::client::Node {
    node.with_settings(Settings { timeout: 100 * MS, ..Settings::default() })
}

#[test]
fn objects_are_read_and_written_over_a_bus() {
    let (network, _running) = pair("virtual:objects", 5, 0);
    let node = network.node(5).unwrap();
    assert_eq!(u32::from_le_bytes(node.number(0x1000, 0).unwrap()), 0x0002_0192);
    assert_eq!(node.upload(0x1008, 0).unwrap(), b"test node");
    node.download(0x2000, 0, &7u32.to_le_bytes()).unwrap();
    assert_eq!(u32::from_le_bytes(node.number(0x2000, 0).unwrap()), 7);
    for length in (0..64).chain([600, 888, 889, 890, 1024, 1778, 2048]) {
        for method in [Method::Automatic, Method::Segmented, Method::Block] {
            node.download_by(0x2001, 0, &pattern(length), method).unwrap();
            assert_eq!(node.upload_by(0x2001, 0, method).unwrap(), pattern(length), "{length} {method:?}");
        }
    }
    assert_eq!(network.heard(), [5]);
}

#[test]
fn a_refusal_says_object_code_and_reason() {
    let (network, _running) = pair("virtual:refusal", 5, 0);
    let node = network.node(5).unwrap();
    let told = |result: Result<(), ClientError>| result.unwrap_err().to_string();
    let message = told(node.download(0x2002, 0, &[0; 4]));
    assert!(message.starts_with("2002h:0 of node 5 refused: 08000022h, Data cannot be transferred"), "{message}");
    let message = told(node.upload(0x3000, 1).map(drop));
    assert!(message.contains("3000h:1") && message.contains("06020000h, Object does not exist"), "{message}");
    let message = told(node.number::<2>(0x2000, 0).map(drop));
    assert!(message.contains("4 bytes, where 2 were expected"), "{message}");
}

#[test]
fn no_answer_tells_a_wrong_node_id_from_a_silent_node_and_a_dead_bus() {
    let (network, _running) = pair("virtual:silence", 5, 0);
    let told = |network: &Network, id| quick(network.node(id).unwrap()).upload(0x1000, 0).unwrap_err().to_string();
    let message = told(&network, 6);
    assert!(message.contains("node 6") && message.contains("100 ms") && message.contains("heard (5)"), "{message}");
    network.command(Command::Stop, Target::Node(5)).unwrap();
    let message = told(&network, 5);
    assert!(message.contains("stopped by NMT"), "{message}");
    let message = told(&Network::new(open("virtual:nobody").unwrap()), 5);
    assert!(message.contains("Nothing at all was heard"), "{message}");
    for id in [0, 128, 255] {
        assert!(network.node(id).unwrap_err().to_string().contains("1 to 127"));
        assert!(network.command(Command::Start, Target::Node(id)).is_err());
    }
}

#[test]
fn lost_and_late_segments_are_made_good() {
    let segment =
        |frame: &Frame| frame.data()[0] & 0x7F > 2 && frame.data()[0] & 0x7F < 0x20 && frame.data().len() == 8;
    let disturb = |seed: u32| {
        let bus = Disturbed::new(open("virtual:lossy").unwrap(), 12, 60, segment);
        bus.random.store(seed, Ordering::Relaxed);
        Arc::new(bus)
    };
    let (ours, theirs) = (disturb(1), disturb(2));
    let network = Network::new(ours.clone());
    let booted = network.heartbeats();
    let running = Running::new(theirs.clone(), Node::new(5, 1, 0));
    assert!(booted.next(Duration::from_secs(5)).unwrap().is_some());
    let node = network.node(5).unwrap();
    for round in 0..10 {
        let data = pattern(2000 + round);
        node.download_by(0x2001, 0, &data, Method::Block).unwrap();
        assert_eq!(node.upload_by(0x2001, 0, Method::Block).unwrap(), data);
    }
    assert!(ours.lost.load(Ordering::Relaxed) > 20 && theirs.lost.load(Ordering::Relaxed) > 20);
    drop(running);
}

#[test]
fn a_second_client_is_noticed_and_nothing_is_half_done() {
    let bus = "virtual:two clients";
    let (network, running) = pair(bus, 5, 0);
    network.node(5).unwrap().download(0x2001, 0, &pattern(50)).unwrap();
    let other = open(bus).unwrap();
    let upload = std::thread::spawn({
        let network = network.clone();
        // Long enough for the other one to come in between.
        move || {
            (0..2000).find_map(|round| {
                network.node(5).unwrap().download_by(0x2001, 0, &pattern(2000 + round % 40), Method::Segmented).err()
            })
        }
    });
    // Between two transfers it disturbs nobody: it asks until it has come in between.
    while !upload.is_finished() {
        std::thread::sleep(7 * MS);
        other.send(&Frame::new(0x605, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]).unwrap()).unwrap();
    }
    // The answer to the last question has passed.
    std::thread::sleep(100 * MS);
    let error = upload.join().unwrap().unwrap();
    assert!(matches!(error, ClientError::OtherClient { .. }), "{error}");
    assert!(error.to_string().contains("2001h:0 of node 5") && error.to_string().contains("another client"), "{error}");
    // Whole, and usable at once.
    let whole = network.node(5).unwrap().upload(0x2001, 0).unwrap();
    assert_eq!(whole, pattern(whole.len()));
    assert!(whole.len() == 50 || whole.len() >= 2000, "{}", whole.len());
    drop(running);
}

/// A bus on which another client asks in the middle of so many reads of 2001h: before the first segment is asked for.
/// That segment is refused, and the network has heard of it, before the read goes on: a refusal that is late would fall
/// into the next one. One that is late is made where `late` asks for it.
#[derive(Debug)]
struct Interrupted {
    ours: Arc<dyn Transport>,
    other: Arc<dyn Transport>,
    refusals: Mutex<Option<Subscription>>,
    reads: AtomicUsize,
    begun: AtomicBool,
    late: AtomicBool,
}

impl Transport for Interrupted {
    fn name(&self) -> &str {
        self.ours.name()
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        let sends = |command: &[u8]| frame.id() == 0x605 && frame.data().starts_with(command);
        self.begun.fetch_or(sends(&[0x40, 0x01, 0x20]), Ordering::Relaxed);
        if !sends(&[0x60]) || !self.begun.swap(false, Ordering::Relaxed) {
            return self.ours.send(frame);
        }
        let left = self.reads.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        if left.is_ok() {
            let refusals = self.refusals.lock().unwrap();
            let refusals = refusals.as_ref().unwrap();
            while refusals.try_next().unwrap().is_some() {}
            self.other.send(&Frame::new(0x605, &[0x40, 0, 0x10, 0, 0, 0, 0, 0]).unwrap())?;
            self.ours.send(frame)?;
            assert!(refusals.next(Duration::from_secs(60)).unwrap().is_some(), "refused");
            return Ok(());
        }
        match self.late.swap(false, Ordering::Relaxed) {
            // In place of the node's answer.
            true => self.other.send(&Frame::new(0x585, &[0x80, 0x01, 0x20, 0, 0x01, 0, 0x04, 0x05]).unwrap()),
            false => self.ours.send(frame),
        }
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        self.ours.receive(timeout)
    }
}

#[test]
fn a_read_that_another_client_disturbs_is_repeated_four_times() {
    let bus = "virtual:reads";
    let (ours, other) = (open(bus).unwrap(), open(bus).unwrap());
    let no = || AtomicBool::new(false);
    let interrupted = Arc::new(Interrupted {
        ours,
        other,
        refusals: Mutex::default(),
        reads: AtomicUsize::new(0),
        begun: no(),
        late: no(),
    });
    let (network, running) = pair_over(interrupted.clone(), bus, 5, 0);
    let refusals = network.subscribe(|frame| frame.id() == 0x585 && frame.data().starts_with(&[0x80]));
    *interrupted.refusals.lock().unwrap() = Some(refusals);
    let node = network.node(5).unwrap();
    node.download(0x2001, 0, &pattern(2000)).unwrap();
    for times in [1, 4] {
        interrupted.reads.store(times, Ordering::Relaxed);
        assert_eq!(node.upload_by(0x2001, 0, Method::Segmented).unwrap(), pattern(2000), "{times}");
        assert_eq!(interrupted.reads.load(Ordering::Relaxed), 0);
    }
    // Without a disturbance a refusal is one.
    interrupted.late.store(true, Ordering::Relaxed);
    let error = node.upload_by(0x2001, 0, Method::Segmented).unwrap_err();
    assert!(matches!(error, ClientError::Aborted { abort: Abort::COMMAND, .. }), "{error}");
    interrupted.late.store(true, Ordering::Relaxed);
    interrupted.reads.store(1, Ordering::Relaxed);
    assert_eq!(node.upload_by(0x2001, 0, Method::Segmented).unwrap(), pattern(2000), "late");
    assert!(!interrupted.late.load(Ordering::Relaxed));
    interrupted.reads.store(5, Ordering::Relaxed);
    let error = node.upload_by(0x2001, 0, Method::Segmented).unwrap_err();
    assert!(matches!(error, ClientError::OtherClient { .. }), "{error}");
    assert_eq!(interrupted.reads.load(Ordering::Relaxed), 0);
    // It holds the network, which holds this bus.
    interrupted.refusals.lock().unwrap().take();
    drop(running);
}

#[test]
fn two_threads_of_one_program_wait_for_each_other() {
    let (network, _running) = pair("virtual:threads", 5, 0);
    let threads: Vec<_> = (0..4)
        .map(|thread| {
            let node = network.node(5).unwrap();
            std::thread::spawn(move || {
                for _ in 0..50 {
                    node.download_by(0x2001, 0, &pattern(100 + thread), Method::Block).unwrap();
                    node.upload_by(0x2001, 0, Method::Segmented).unwrap();
                }
            })
        })
        .collect();
    threads.into_iter().for_each(|thread| thread.join().unwrap());
}

#[test]
fn commands_heartbeats_and_boot_up_are_followed() {
    let (network, _running) = pair("virtual:states", 5, 10);
    let heartbeats = network.heartbeats();
    let reaches = |wanted| {
        let deadline = Instant::now() + Duration::from_secs(2);
        while Instant::now() < deadline {
            if let Some(received) = heartbeats.next(100 * MS).unwrap()
                && heartbeat::parse(&received.frame) == Some((5, wanted))
            {
                return true;
            }
        }
        false
    };
    for (command, state) in [
        (Command::Start, NmtState::Operational),
        (Command::Stop, NmtState::Stopped),
        (Command::EnterPreOperational, NmtState::PreOperational),
    ] {
        network.command(command, Target::All).unwrap();
        assert!(reaches(state), "{command:?}");
    }
    for command in [Command::ResetNode, Command::ResetCommunication] {
        network.reset_and_wait(command, 5, Duration::from_secs(2)).unwrap();
    }
    let error = network.reset_and_wait(Command::ResetNode, 6, 50 * MS).unwrap_err().to_string();
    assert_eq!(error, "the boot-up message of node 6 did not come within 50 ms");
}

#[test]
fn a_node_that_falls_silent_is_missed() {
    let (network, running) = pair("virtual:loss", 5, 10);
    let heartbeats = network.heartbeats();
    let (mut watch, began) = (Watch::new(500 * MS), Instant::now());
    let first = heartbeats.next(Duration::from_secs(2)).unwrap().unwrap();
    assert_eq!(
        watch.receive(&first.frame, began.elapsed()),
        Some(Change::State { node: 5, state: NmtState::PreOperational })
    );
    running.stop();
    while let Some(received) = heartbeats.try_next().unwrap() {
        watch.receive(&received.frame, received.at - began);
    }
    assert_eq!(watch.poll(began.elapsed() + Duration::from_secs(1)), Some(Change::Lost { node: 5 }));
}

#[test]
fn process_data_go_both_ways_with_sync() {
    let (network, _running) = pair("virtual:process data", 5, 0);
    let values = network.subscribe(|frame| frame.id() == 0x185);
    let everything = network.subscribe(|_| true);
    network.send(&Frame::new(0x205, &1u32.to_le_bytes()).unwrap()).unwrap();
    network.sync().unwrap();
    assert_eq!(values.next(50 * MS).unwrap(), None, "not OPERATIONAL");
    network.command(Command::Start, Target::Node(5)).unwrap();
    network.send(&Frame::new(0x205, &0x1234_5678u32.to_le_bytes()).unwrap()).unwrap();
    network.sync().unwrap();
    let value = values.next(Duration::from_secs(1)).unwrap().unwrap();
    assert_eq!(value.frame.data(), 0x1234_5678u32.to_le_bytes());
    assert_eq!(everything.next(Duration::from_secs(1)).unwrap().unwrap().frame.id(), 0x185);
    let producer = SyncProducer::new(&network, 2 * MS);
    for _ in 0..20 {
        assert!(values.next(Duration::from_secs(1)).unwrap().is_some());
    }
    let produced = producer.stop().unwrap();
    assert!(produced.sent >= 20, "{produced:?}");
}

#[test]
fn an_error_of_a_node_is_told_with_its_meaning() {
    let (network, running) = pair("virtual:emergency", 5, 0);
    let emergencies = network.emergencies();
    running.emergency();
    let received = emergencies.next(Duration::from_secs(2)).unwrap().unwrap();
    let emergency = Emergency::decode(&received.frame).unwrap();
    assert_eq!((emergency.node, emergency.code, emergency.information), (5, 0x5530, [1, 2, 3, 4, 5]));
    assert!(emergency.to_string().contains("data storage"), "{emergency}");
}

#[test]
fn identical_new_nodes_get_their_ids_by_fastscan() {
    let bus = "virtual:fastscan";
    let network = Network::new(open(bus).unwrap());
    let serials = [0x8000_0001, 7, 0xFFFF_FFFF];
    let nodes: Vec<_> =
        serials.iter().map(|serial| Running::new(open(bus).unwrap(), Node::new(255, *serial, 0))).collect();
    assert!(network.somebody_has_no_id(Duration::from_secs(60)).unwrap());
    // Silence is an answer here: on a busy machine the nodes' answers come later than an idle one's.
    let (mut found, mut wait) = (Vec::new(), 20 * MS);
    while found.len() < serials.len() {
        let Ok(Some(address)) = network.fastscan(wait) else {
            assert!(wait < Duration::from_secs(5), "{found:?}");
            wait *= 2;
            continue;
        };
        let expected = identity(address.serial);
        assert_eq!(
            (address.vendor, address.product, address.revision),
            (expected.vendor, expected.product, expected.revision)
        );
        let id = 10 + u8::try_from(found.len()).unwrap();
        network.assign(id, true).unwrap();
        let node = network.node(id).unwrap();
        assert_eq!(u32::from_le_bytes(node.number(0x1018, 4).unwrap()), address.serial);
        found.push(address.serial);
    }
    assert_eq!(network.fastscan(wait).unwrap(), None);
    assert!(!network.somebody_has_no_id(wait).unwrap());
    found.sort_unstable();
    assert_eq!(found, [7, 0x8000_0001, 0xFFFF_FFFF]);
    let id = identity(7);
    let mut address = Address { vendor: id.vendor, product: id.product, revision: id.revision, serial: id.serial };
    network.select(&address).unwrap();
    address.serial = 8;
    let error = network.select(&address).unwrap_err().to_string();
    assert!(error.contains("serial number 00000008h did not come within 1000 ms"), "{error}");
    let mut stored: Vec<_> = nodes.into_iter().map(|node| node.stop().dictionary.stored_node_id).collect();
    stored.sort_unstable();
    assert_eq!(stored, [Some(10), Some(11), Some(12)]);
    assert!(network.assign(0, false).is_err());
}

#[test]
fn a_monitor_sees_everything_while_a_client_works() {
    let (network, _running) = pair("virtual:monitor", 5, 0);
    let monitor = network.subscribe(|_| true);
    let node = network.node(5).unwrap();
    for _ in 0..100 {
        node.number::<4>(0x1000, 0).unwrap();
    }
    // The last answer went to the client first.
    std::thread::sleep(20 * MS);
    let mut seen = 0;
    while monitor.try_next().unwrap().is_some() {
        seen += 1;
    }
    assert_eq!((seen, monitor.dropped()), (100, 0));
}
