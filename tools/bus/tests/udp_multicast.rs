//! CAN over UDP multicast: two programs of this project, and python-can itself.
//!
//! On a machine that takes no multicast, or has no Python with python-can and cannot get one, these tests are reported
//! as ignored by name; with `CI` set they run, and fail.

use bus::{Frame, Transport, open};
use libtest_mimic::{Arguments, Failed, Trial};
use python::Packages;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A group of python-can's range; the port is one that nobody else uses.
const GROUP: &str = "239.74.163.2";
const SECOND: Duration = Duration::from_secs(1);

fn main() {
    let arguments = Arguments::from_args();
    let must_run = std::env::var_os("CI").is_some();
    let multicast = must_run || works();
    // Looked for only where it is going to be used.
    let python = if multicast && !arguments.list { PACKAGES.python(env!("CARGO_TARGET_TMPDIR")) } else { None };
    let without_python = !must_run && python.is_none();
    let trials = vec![
        Trial::test("members_of_a_group_hear_each_other_and_not_themselves", members).with_ignored_flag(!multicast),
        Trial::test("groups_on_the_same_port_are_different_buses", groups).with_ignored_flag(!multicast),
        Trial::test("a_client_and_a_python_can_program_share_a_bus", move || python_can(python.as_deref()))
            .with_ignored_flag(!multicast || without_python),
    ];
    libtest_mimic::run(&arguments, trials).exit();
}

fn port() -> u16 {
    bus::free_port().unwrap()
}

fn member(port: u16) -> Arc<dyn Transport> {
    open(&format!("udp:{GROUP}:{port}")).unwrap()
}

/// Returns `true` if a frame comes from one socket of this machine to another.
fn works() -> bool {
    let bus = format!("udp:{GROUP}:{}", port());
    let (Ok(a), Ok(b)) = (open(&bus), open(&bus)) else { return false };
    let sent = a.send(&Frame::new(1, &[]).unwrap());
    sent.is_ok() && b.receive(SECOND).is_ok_and(|frame| frame.is_some())
}

fn received(bus: &dyn Transport, timeout: Duration) -> Vec<u16> {
    std::iter::from_fn(|| bus.receive(timeout).unwrap()).map(|frame| frame.id()).collect()
}

fn members() -> Result<(), Failed> {
    let port = port();
    let [a, b, c] = [(); 3].map(|()| member(port));
    for id in 1..=50 {
        a.send(&Frame::new(id, &[id as u8; 8]).unwrap())?;
    }
    b.send(&Frame::new(100, &[]).unwrap())?;
    let wait = Duration::from_millis(200);
    assert_eq!(received(&*a, wait), [100]);
    assert_eq!(received(&*b, wait), (1..=50).collect::<Vec<_>>());
    assert_eq!(received(&*c, wait), (1..=50).chain([100]).collect::<Vec<_>>());
    // Datagrams that are no frame are counted.
    let stranger = std::net::UdpSocket::bind("0.0.0.0:0")?;
    stranger.send_to(b"hello", (GROUP, port))?;
    assert_eq!((received(&*a, wait), a.lost()), (vec![], 1));
    Ok(())
}

fn groups() -> Result<(), Failed> {
    let port = port();
    let a = member(port);
    let [b, c] = [(); 2].map(|()| open(&format!("udp:239.74.163.3:{port}")).unwrap());
    b.send(&Frame::new(2, &[]).unwrap())?;
    assert_eq!(received(&*c, SECOND / 5), [2]);
    assert_eq!(received(&*a, SECOND / 5), [0u16; 0]);
    Ok(())
}

/// python-can, and what its multicast format needs.
const PACKAGES: Packages =
    Packages { folder: "python-can", install: &["python-can==4.6.1", "msgpack==1.2.4"], import: "can, msgpack" };

/// Says what it hears, and answers with the data reversed and the identifier plus one; then sends what has to be passed
/// over.
const PROGRAM: &str = r#"
import sys, can
with can.Bus(interface="udp_multicast", channel=sys.argv[1], port=int(sys.argv[2])) as bus:
    print("ready", flush=True)
    for _ in range(20):
        message = bus.recv(10)
        print(f"{message.arbitration_id:x} {message.is_extended_id} {message.is_fd} {message.dlc} {message.data.hex()}", flush=True)
        bus.send(can.Message(arbitration_id=message.arbitration_id + 1, is_extended_id=False, data=message.data[::-1]))
        answer = bus.recv(10)  # its own
    bus.send(can.Message(arbitration_id=0x123, is_extended_id=True, data=[1]))
    bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, is_remote_frame=True, dlc=2))
    bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, is_fd=True, data=bytes(64)))
    bus.send(can.Message(arbitration_id=0x7FF, is_extended_id=False, data=[]))
    sys.stdin.read()
"#;

fn python_can(python: Option<&Path>) -> Result<(), Failed> {
    let python = PACKAGES.required(python)?;
    let port = port();
    let bus = member(port);
    let mut program = Command::new(python)
        .args(["-c", PROGRAM, GROUP, &port.to_string()])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()?;
    let mut lines = BufReader::new(program.stdout.take().ok_or("no output")?).lines();
    let mut line = || lines.next().ok_or_else(|| Failed::from("the program ended"))?.map_err(Failed::from);
    assert_eq!(line()?, "ready");
    let began = Instant::now();
    for length in 0..20u16 {
        let data: Vec<u8> = (1..=(length % 9) as u8).collect();
        bus.send(&Frame::new(0x600 + length, &data).unwrap())?;
        let hex: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(line()?, format!("{:x} False False {} {hex}", 0x600 + length, data.len()));
        let answer = bus.receive(5 * SECOND)?.ok_or("no answer")?;
        assert_eq!((answer.id(), answer.data()), (0x601 + length, &data.iter().rev().copied().collect::<Vec<_>>()[..]));
    }
    println!("20 round trips with python-can: {:?}", began.elapsed());
    let last = bus.receive(5 * SECOND)?.ok_or("no last frame")?;
    assert_eq!((last.id(), bus.lost()), (0x7FF, 0));
    program.stdin.take().ok_or("no input")?.flush()?;
    program.wait()?;
    Ok(())
}
