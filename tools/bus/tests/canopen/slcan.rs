//! slcan over TCP and over a pty, unplugged and refused.

use crate::node::{Node, Running, pattern};
use bus::client::sdo::Method;
use bus::client::{ClientError, Network};
use bus::{BusError, Frame, Transport, open};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::time::{Duration, Instant};

const SECOND: Duration = Duration::from_secs(1);

/// A client connected to a listening program of this project.
fn connected() -> (Arc<dyn Transport>, Arc<dyn Transport>) {
    let port = bus::free_port().unwrap();
    let adapter = open(&format!("slcan:listen://127.0.0.1:{port}")).unwrap();
    // The adapter answers while somebody receives from it.
    let opening = std::thread::spawn(move || open(&format!("slcan:tcp://127.0.0.1:{port}")));
    while !opening.is_finished() {
        assert_eq!(adapter.receive(Duration::from_millis(1)).unwrap(), None);
    }
    (opening.join().unwrap().unwrap(), adapter)
}

#[test]
fn a_node_behind_tcp_is_read_and_written_without_stalls() {
    let (host, adapter) = connected();
    let _running = Running::new(adapter, Node::new(5, 1, 0));
    let node = Network::new(host).node(5).unwrap();
    for length in [1, 7, 21, 600, 889, 2048] {
        for method in [Method::Automatic, Method::Segmented, Method::Block] {
            node.download_by(0x2001, 0, &pattern(length), method).unwrap();
            assert_eq!(node.upload_by(0x2001, 0, method).unwrap(), pattern(length), "{length} {method:?}");
        }
    }
    let began = Instant::now();
    for _ in 0..100 {
        node.number::<4>(0x1000, 0).unwrap();
    }
    let mean = began.elapsed() / 100;
    println!("expedited read over slcan over TCP: {mean:?}");
    // Without TCP_NODELAY it is 40 ms.
    assert!(mean < Duration::from_millis(20), "{mean:?}");
}

#[test]
fn an_adapter_that_hangs_up_is_told_from_one_that_is_silent() {
    let (host, adapter) = connected();
    let network = Network::new(host);
    let frames = network.subscribe(|_| true);
    adapter.send(&Frame::new(0x123, &[1]).unwrap()).unwrap();
    assert_eq!(frames.next(SECOND).unwrap().unwrap().frame.data(), [1]);
    assert_eq!(frames.next(Duration::from_millis(50)).unwrap(), None);
    drop(adapter);
    let error = frames.next(SECOND).unwrap_err();
    assert!(matches!(error, ClientError::Bus(BusError::Gone { .. })), "{error}");
    assert!(
        error.to_string().contains("slcan:tcp://127.0.0.1") && error.to_string().contains("closed the connection"),
        "{error}"
    );
    let error = network.node(5).unwrap().upload(0x1000, 0).unwrap_err();
    assert!(error.to_string().contains("is gone"), "{error}");
}

#[test]
fn the_next_client_is_served_when_one_hangs_up() {
    let port = bus::free_port().unwrap();
    let adapter = open(&format!("slcan:listen://127.0.0.1:{port}")).unwrap();
    for round in 0..3u8 {
        let mut client = TcpStream::connect(("127.0.0.1", port)).unwrap();
        client.set_read_timeout(Some(SECOND)).unwrap();
        client.write_all(b"S8\rO\rV\rS6\rt1232").unwrap();
        client.write_all(format!("{round:02X}55\r").as_bytes()).unwrap();
        let frame = adapter.receive(SECOND).unwrap().unwrap();
        assert_eq!((frame.id(), frame.data()), (0x123, &[round, 0x55][..]));
        adapter.send(&Frame::new(0x7A, &[1, 0xAB]).unwrap()).unwrap();
        let mut answers = [0; 21];
        client.read_exact(&mut answers).unwrap();
        assert_eq!(answers, *b"\r\rV1013\r\x07z\rt07A201AB\r");
    }
    // With nobody there, frames are gone as on a wire.
    while adapter.receive(Duration::from_millis(5)).unwrap().is_some() {}
    adapter.send(&Frame::new(1, &[]).unwrap()).unwrap();
    let error = open(&format!("slcan:listen://127.0.0.1:{port}")).unwrap_err().to_string();
    assert!(error.contains("another port"), "{error}");
}

/// An adapter that says this to every line.
fn stubborn(answer: &'static [u8]) -> u16 {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap().port();
    std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut byte = [0];
        while stream.read(&mut byte).is_ok_and(|length| length == 1) {
            if byte == *b"\r" && stream.write_all(answer).is_err() {
                return;
            }
        }
    });
    port
}

#[test]
fn an_adapter_that_refuses_is_told_and_one_that_never_answers_is_taken() {
    let error = open(&format!("slcan:tcp://127.0.0.1:{}", stubborn(b"\x07"))).unwrap_err();
    assert!(matches!(error, BusError::Refused { .. }), "{error}");
    assert!(error.to_string().contains("refuses 1 Mbit/s"), "{error}");
    open(&format!("slcan:tcp://127.0.0.1:{}", stubborn(b""))).unwrap();
}

#[cfg(unix)]
#[test]
fn a_pty_carries_frames_and_a_pulled_plug_is_noticed() {
    use serialport::{SerialPort, TTYPort};
    let (mut adapter, port) = TTYPort::pair().unwrap();
    let path = port.name().unwrap();
    // The other end is opened by name, as an adapter's is.
    drop(port);
    adapter.set_timeout(SECOND).unwrap();
    let host = open(&format!("slcan:{path}")).unwrap();
    host.send(&Frame::new(0x7A, &[1, 0xAB]).unwrap()).unwrap();
    let mut text = Vec::new();
    while !text.ends_with(b"t07A201AB\r") {
        let mut byte = [0];
        adapter.read_exact(&mut byte).unwrap();
        text.extend(byte);
    }
    assert_eq!(text, b"\r\rC\rS8\rO\rt07A201AB\r");
    adapter.write_all(b"z\rt7FF3").unwrap();
    adapter.write_all(b"010203\rT000001230\r").unwrap();
    assert_eq!(host.receive(SECOND).unwrap(), Some(Frame::new(0x7FF, &[1, 2, 3]).unwrap()));
    assert_eq!(host.receive(Duration::from_millis(10)).unwrap(), None);
    drop(adapter);
    let error = (0..100).find_map(|_| host.receive(Duration::from_millis(10)).err()).unwrap();
    assert!(error.to_string().contains(&path) && error.to_string().contains("Plug the adapter in again"), "{error}");
    assert!(host.send(&Frame::new(1, &[]).unwrap()).is_err());
}
