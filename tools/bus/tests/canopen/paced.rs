//! The client and the server on the modelled wire: how long transfers take at 1 Mbit/s.

use crate::node::{Node, pattern};
use bus::Frame;
use bus::client::Object;
use bus::client::sdo::{Method, Settings, Transfer};
use bus::pacing::{Order, PacedBus};
use std::time::Duration;

const STEP: Duration = Duration::from_micros(10);
/// Time that client and server take to answer a frame.
const ANSWER: Duration = Duration::from_micros(50);

/// Writes `data` to a node over a wire at 1 Mbit/s, with a station that sends frames of a higher priority every
/// `period`; the time from the first bit until the client knows.
fn write(data: &[u8], method: Method, other: Option<Duration>) -> (Duration, f64) {
    let mut wire = PacedBus::new(1_000_000);
    let [client, server, flood] = [Order::Identifier; 3].map(|order| wire.add_station(order));
    let mut node = Node::new(5, 1, 0);
    assert!(node.poll(Duration::ZERO).is_some());
    let object = Object { node: 5, index: 0x2001, sub_index: 0 };
    let mut transfer = Transfer::download(object, data, method, Settings::default());
    let (mut now, mut next) = (Duration::ZERO, Duration::ZERO);
    let mut arriving: Vec<(Duration, bool, Frame)> = Vec::new();
    while transfer.outcome().is_none() {
        if let Some(period) = other
            && now >= next
        {
            wire.send(flood, Frame::new(0x181, &[0x5A; 8]).unwrap(), now);
            next += period;
        }
        // A controller with room for three frames, as the FDCAN has.
        if wire.waiting(client) < 3
            && let Some(message) = transfer.poll(now)
        {
            wire.send(client, Frame::new(0x605, &message).unwrap(), now);
        }
        while let Some(delivery) = wire.advance(now) {
            arriving.push((delivery.ended + ANSWER, delivery.senders.contains(&client), delivery.frame));
        }
        while let Some(at) = arriving.iter().position(|(at, ..)| *at <= now) {
            let (_, by_client, frame) = arriving.remove(at);
            if by_client {
                node.receive(&frame, now).into_iter().for_each(|answer| wire.send(server, answer, now));
            } else if frame.id() == 0x585 {
                transfer.receive(frame.data(), now);
            }
        }
        now += STEP;
        assert!(now < Duration::from_secs(5));
    }
    assert_eq!(transfer.outcome(), Some(&Ok(Vec::new())));
    assert_eq!(node.dictionary.domain, data);
    (now, wire.statistics().load(now))
}

#[test]
fn a_kibibyte_by_block_takes_less_than_30_ms() {
    let data = pattern(1024);
    let (block, load) = write(&data, Method::Block, None);
    let (segmented, _) = write(&data, Method::Segmented, None);
    // A quarter of the bus is somebody else's: one joint's command and reply each millisecond.
    let (shared, _) = write(&data, Method::Block, Some(Duration::from_micros(500)));
    println!(
        "1 KiB at 1 Mbit/s: block {block:?} (load {load:.2}), on a shared bus {shared:?}; segmented {segmented:?}"
    );
    assert!(block < Duration::from_millis(30) && shared < Duration::from_millis(30), "{block:?} {shared:?}");
    assert!(segmented > 2 * block, "{segmented:?}");
    assert!(load > 0.9, "{load}");
}
