//! The program itself, with a joint behind slcan over TCP: what it prints, and the exit codes.

use crate::punctual;
use crate::served::{NODE, Served, image, program};
use crate::tables::{ADDRESS, OF_A_JOINT, assert_is_table};
use bus::client::Network;
use canopen_node::NO_NODE_ID;
use joint_firmware::joint::state_machine::State;
use jointctl::remote::condition::state_of;
use std::io::Read;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

/// A joint at an address of its own, and a folder.
struct Desk {
    _served: Served,
    client: String,
    folder: tempfile::TempDir,
}

impl Desk {
    fn new() -> Self {
        let port = bus::free_port().unwrap();
        let served = Served::on(&format!("slcan:listen://127.0.0.1:{port}"), &[NODE]);
        Self { _served: served, client: format!("slcan:tcp://127.0.0.1:{port}"), folder: tempfile::tempdir().unwrap() }
    }

    fn command(&self, arguments: &[&str], node: &str) -> Command {
        let mut command = program();
        command.current_dir(&self.folder).args(arguments).args(["--bus", &self.client, "--node", node]);
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments, &NODE.to_string()).output().unwrap()
    }

    fn prints(&self, arguments: &[&str], expected: &[&str]) {
        let output = self.run(arguments);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{arguments:?} {}", String::from_utf8_lossy(&output.stderr));
        for expected in expected {
            assert!(text.contains(expected), "{arguments:?}: {expected} in {text}");
        }
    }

    fn fails(&self, arguments: &[&str], expected: &[&str]) {
        refused(&self.run(arguments), 1, arguments, expected);
    }

    fn misunderstands(&self, arguments: &[&str], expected: &[&str]) {
        refused(&self.run(arguments), 2, arguments, expected);
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        std::fs::write(self.folder.path().join(name), bytes).unwrap();
    }
}

/// One line that says what and where, and an exit code: 1 failed, 2 wrong arguments.
fn refused(output: &Output, code: i32, arguments: &[&str], expected: &[&str]) {
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    let last = text.lines().last().unwrap_or_default();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {text}");
    assert_eq!(text.matches("error: ").count(), 1, "{arguments:?}: {text}");
    for expected in expected {
        assert!(last.starts_with("error: ") && last.contains(expected), "{arguments:?}: {expected} in {text}");
    }
}

pub fn a_joint_is_looked_at_set_moved_and_fed_from_the_command_line() {
    let desk = Desk::new();
    desk.write("first.img", &image(1, 0.25, 0));
    desk.write("second.img", &image(2, 0.5, 0));
    desk.prints(&["info"], &["node            5: virtual joint", "started         by power", "image           none"]);
    desk.prints(
        &["get", "bus-voltage", "gear", "6041"],
        &["bus-voltage (2021h:1)", " V\n", "gear-ratio", "statusword (6041h:0)"],
    );
    desk.prints(&["set", "gain", "0.5", "requested-model", "1"], &["gain (2200h:3)", " 0.5\n"]);
    desk.prints(&["set", "2100:1", "2"], &["(2100h:1)", " done\n"]);
    desk.prints(
        &["bus-yml", "--out", "master", "--period", "50"],
        &["written: master/bus.yml", "written: master/joint-"],
    );
    let text = std::fs::read_to_string(desk.folder.path().join("master/bus.yml")).unwrap();
    assert!(text.contains("joint_5:\n") && text.contains("  revision_number: 0x"), "{text}");
    // Two periods have to fit into the command deadline.
    desk.prints(&["set", "command-deadline", "0.06"], &["command-deadline (2103h:"]);
    desk.prints(&["bus-yml", "--out", "master", "--force", "--period", "30"], &["written: master/bus.yml"]);
    desk.fails(&["bus-yml", "--out", "master", "--force", "--period", "31"], &["node 5", "0.06 s", "0.062 s or more"]);
    desk.prints(&["set", "command-deadline", "5"], &["command-deadline (2103h:"]);
    desk.prints(&["store"], &["node 5: stored"]);
    desk.prints(&["move", "velocity", "-0.4", "--duration", "1"], &["rad/s", "node 5: disabled"]);
    desk.prints(&["monitor", "--once"], &["state           disabled", "position      ", "gear "]);
    desk.prints(&["record", "--out", "log.csv", "--duration", "1"], &[" samples in ", "Written: log.csv"]);
    desk.misunderstands(&["record", "--out", "log.csv", "--duration", "1"], &["log.csv exists; --force replaces"]);
    for log in ["log.mcap", "log.parquet"] {
        let arguments = ["record", "--out", log, "--duration", "0.5", "--force"];
        desk.prints(&arguments, &[" samples in ", &format!("Written: {log}")]);
        let wanted = logs::Wanted::numbers(["time_s", "position_rad", "measured_torque_Nm"]);
        let table = logs::read(&desk.folder.path().join(log), &wanted).unwrap();
        table.all_finite(log.as_ref()).unwrap();
        let times = table.number("time_s").unwrap();
        assert!(times[0] == 0.0 && times.last() > Some(&0.2), "{log}: {times:?}");
        let described = std::fs::read_to_string(desk.folder.path().join("dataset.toml")).unwrap();
        assert!(described.contains(&format!("files = [\"{log}\"]")), "{described}");
    }
    desk.prints(&["upload", "first.img", "--commit"], &["version 1 is stored; in use"]);
    desk.prints(&["upload", "second.img"], &["version 1 is stored; an image is verified", "Not in use"]);
    desk.prints(&["upload", "second.img", "--trial", "60"], &["on trial for another "]);
    desk.prints(&["discard"], &["version 1 is stored; in use, nothing staged"]);
    desk.prints(&["upload", "second.img", "--commit"], &["version 2 is stored; in use"]);
    desk.prints(&["get", "2211", "--out", "read.img"], &["written: read.img"]);
    assert_eq!(std::fs::read(desk.folder.path().join("read.img")).unwrap(), image(2, 0.5, 0));
    desk.prints(&["rollback"], &["version 1 is stored; in use"]);
    desk.prints(&["disable"], &["node 5: disabled"]);
}

pub fn what_goes_wrong_ends_in_one_line_and_an_exit_code_that_tells_why() {
    let desk = Desk::new();
    desk.write("first.img", &image(1, 0.25, 0));
    desk.write("other.img", &image(1, 0.25, 99));
    let mut damaged = image(1, 0.25, 0);
    damaged[40] ^= 1;
    desk.write("damaged.img", &damaged);
    desk.write("joint.key", "00112233445566778899aabbccddeeff00112233445566778899aabbccddee11".as_bytes());
    desk.write("wrong.key", "11112233445566778899aabbccddeeff00112233445566778899aabbccddee11".as_bytes());
    let missing = desk.command(&["info", "--timeout", "500"], "9").output().unwrap();
    refused(&missing, 1, &["info"], &["1000h:0 of node 9: no answer within 500 ms", "(5): is the node id right?"]);
    let no_id = desk.command(&["info"], "200").output().unwrap();
    refused(&no_id, 2, &["info"], &["200 is no node id: they are 1 to 127"]);
    desk.misunderstands(&["get", "torque-limt"], &["'torque-limt' is no object of a joint; did you mean torque-limit"]);
    desk.fails(&["get", "2212:1"], &["2212h:1 of node 5 refused: 06010001h, Attempt to read a write only object"]);
    desk.misunderstands(&["set", "torque-limit", "5000"], &["5000 Nm is outside 0.01 to 2000 Nm"]);
    desk.misunderstands(&["set", "gain", "0.5", "clamp"], &["'clamp' has no value"]);
    desk.fails(
        &["move", "velocity", "1e3", "--duration", "1"],
        &["a velocity of 1000 rad/s is outside", "velocity-limit (2103h:2)"],
    );
    desk.fails(&["upload", "nowhere.img"], &["cannot read nowhere.img"]);
    desk.fails(&["upload", "damaged.img", "--commit"], &["node 5 does not accept the image", "0205h"]);
    desk.fails(&["upload", "other.img", "--commit"], &["image for serial number 99, this joint has 12"]);
    desk.fails(&["rollback"], &["node 5 does not roll back the image", "0905h"]);
    desk.prints(&["key", "give", "joint.key"], &["node 5: belongs to who has key"]);
    let signed =
        program().current_dir(&desk.folder).args(["sign", "first.img", "--key", "wrong.key"]).output().unwrap();
    assert!(signed.status.success(), "{}", String::from_utf8_lossy(&signed.stderr));
    desk.fails(
        &["upload", "first.signed", "--commit"],
        &["the tag is not that of this image and key (1 wrong ones so far)", "0302h"],
    );
    desk.prints(&["get", "2213:1"], &["active-images-identity.version (2213h:1) 0\n"]);
    let nonsense = program().args(["info", "--bus", "can0", "--node", "5"]).output().unwrap();
    refused(&nonsense, 2, &["--bus can0"], &["bus 'can0': a kind and a colon are missing"]);
}

/// The command `enable`, once it says that the joint is enabled: by then it catches interrupts.
fn enabled(desk: &Desk) -> Child {
    let mut command = desk.command(&["enable"], &NODE.to_string());
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    // Byte by byte: nothing behind the line is taken.
    let (mut told, mut byte) = (Vec::new(), [0]);
    while !told.ends_with(b"  enabled\n") {
        let read = child.stderr.as_mut().unwrap().read(&mut byte).unwrap();
        assert!(read > 0, "it ended before: {}", String::from_utf8_lossy(&told));
        told.extend(byte);
    }
    child
}

fn finished(child: &mut Child) -> (Option<i32>, String) {
    let code = child.wait().unwrap().code();
    let mut text = String::new();
    child.stdout.take().unwrap().read_to_string(&mut text).unwrap();
    child.stderr.take().unwrap().read_to_string(&mut text).unwrap();
    (code, text)
}

pub fn every_table_of_a_joint_is_json_where_that_is_asked_for() {
    let desk = Desk::new();
    // Joints without node ids, which `address` finds.
    let port = bus::free_port().unwrap();
    let _others = Served::on(&format!("slcan:listen://127.0.0.1:{port}"), &[NO_NODE_ID]);
    let lines = OF_A_JOINT.map(|line| {
        let node = if line.starts_with("scan") { String::new() } else { format!(" --node {NODE}") };
        format!("{line} --bus {}{node}", desk.client)
    });
    for line in lines.into_iter().chain([format!("{ADDRESS} --bus slcan:tcp://127.0.0.1:{port}")]) {
        let run = |force: &str| {
            let line = format!("{line}{force}");
            program().current_dir(&desk.folder).args(line.split(' ')).output().unwrap()
        };
        assert_is_table(&line, &punctual::command(run));
    }
}

pub fn tables_are_json_where_asked_for_and_bus_and_node_come_from_the_environment() {
    let desk = Desk::new();
    let run = |line: &str| {
        let mut command = program();
        command.current_dir(&desk.folder).args(line.split_whitespace());
        let output = command.env("JOINTCTL_BUS", &desk.client).env("JOINTCTL_NODE", NODE.to_string()).output().unwrap();
        assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice::<serde_json::Value>(&output.stdout).unwrap_or_else(|error| panic!("{line}: {error}"))
    };
    let nodes = run("scan --json --wait 800");
    assert_eq!((nodes[0]["node"].as_u64(), nodes[0]["serial"].as_u64()), (Some(5), Some(12)), "{nodes}");
    let value = run("get 2103:1 --json");
    assert!(value.to_string().contains("\"Nm\""), "{value}");
    assert!(run("info --json").is_object());
}

#[cfg(unix)]
pub fn a_motion_that_is_interrupted_is_not_done() {
    // A bus for two clients. This one asks nothing by SDO, which a node has for one client at a time: it reads TPDO 1.
    let bus = format!("udp:239.74.163.2:{}", bus::free_port().unwrap());
    let _served = Served::on(&bus, &[NODE]);
    let network = Network::new(bus::open(&bus).unwrap());
    let statuswords = network.subscribe(|frame| frame.id() == 0x180 + u16::from(NODE));
    let mut command = program();
    command.args(["move", "position", "0", "--duration", "30", "--node", "5", "--bus", &bus]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    loop {
        network.sync().unwrap();
        if let Some(received) = statuswords.next(Duration::from_millis(20)).unwrap()
            && let [low, high, ..] = received.frame.data()
            && state_of(u16::from_le_bytes([*low, *high])) == State::OperationEnabled
        {
            break;
        }
        if child.try_wait().unwrap().is_some() {
            panic!("ended before it moved: {:?}", finished(&mut child));
        }
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let (code, text) = finished(&mut child);
    assert!(code == Some(1) && text.contains("node 5: the motion was interrupted; disabled"), "{code:?} {text}");
}

#[cfg(unix)]
pub fn ctrl_c_and_termination_leave_the_joint_disabled() {
    let desk = Desk::new();
    for signal in ["-INT", "-TERM"] {
        let mut child = enabled(&desk);
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        let (code, text) = finished(&mut child);
        assert!(code == Some(0) && text.contains("node 5: ended early; disabled"), "{signal} {code:?} {text}");
        desk.prints(&["get", "error-code"], &[" 0\n"]);
    }
}

pub fn an_adapter_that_goes_away_while_the_joint_is_enabled_is_reported() {
    let desk = Desk::new();
    let mut child = enabled(&desk);
    // The adapter hangs up. What the joint does then by itself: see the master that dies.
    drop(desk);
    let (code, text) = finished(&mut child);
    assert!(
        code == Some(1) && text.contains("error: bus 'slcan:tcp://") && text.contains("is gone"),
        "{code:?} {text}"
    );
}
