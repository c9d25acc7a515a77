//! The security list of docs/panel.md, a test for each line.

use crate::page::Page;
use crate::served::{NODE, Served};
use panel::assets::{ASSETS, HEADERS};
use panel::guard::{Guard, TOKEN_LIFE};
use panel::message::LONGEST;
use serde_json::json;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::Command;
use std::time::{Duration, Instant};
use tungstenite::Message;

/// Description of an arm of three joints.
const ARM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../jointctl/robots/arm/robot.toml");

/// Status, headers and body of an answer to these bytes.
fn exchange(address: SocketAddr, request: &str) -> (u16, String, String) {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(crate::served::PATIENCE)).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = Vec::new();
    // A connection that is cut has said what it has to say.
    let _ = stream.read_to_end(&mut bytes);
    let text = String::from_utf8_lossy(&bytes).into_owned();
    let (head, body) = text.split_once("\r\n\r\n").unwrap_or((&text, ""));
    let status = head.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
    (status, head.to_lowercase(), body.to_owned())
}

pub fn get(address: SocketAddr, path: &str, host: &str, more: &str) -> (u16, String, String) {
    exchange(address, &format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n{more}Connection: close\r\n\r\n"))
}

/// Headers that ask for a WebSocket: RFC 6455, section 1.2.
const UPGRADE: &str = "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n\
                       Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

fn socket(address: SocketAddr, host: &str, more: &str) -> u16 {
    let request = format!("GET /joint/5 HTTP/1.1\r\nHost: {host}\r\n{UPGRADE}{more}\r\n");
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(crate::served::PATIENCE)).unwrap();
    stream.write_all(request.as_bytes()).unwrap();
    let mut bytes = [0; 12];
    stream.read_exact(&mut bytes).unwrap();
    String::from_utf8_lossy(&bytes[9..]).parse().unwrap()
}

pub fn other_hosts_and_origins_are_refused() {
    let served = Served::joints(&[NODE]);
    let (address, own) = (served.address, served.address.to_string());
    let origin = |origin: &str| format!("Origin: {origin}\r\n");
    assert_eq!(socket(address, &own, &origin(&format!("http://{own}"))), 101);
    let local = format!("localhost:{}", address.port());
    assert_eq!(socket(address, &local, &origin(&format!("http://{local}"))), 101);
    for host in ["evil.example", "127.0.0.1", "127.0.0.1:1", "evil.example:8402"] {
        let (status, _, body) = get(address, "/", host, "");
        assert!(status == 403 && body.contains(&format!("host '{host}'")), "{host}: {status} {body}");
        assert_eq!(socket(address, host, &origin(&format!("http://{own}"))), 403, "{host}");
    }
    for foreign in ["http://evil.example", "null", "https://127.0.0.1", &format!("https://{own}"), "http://127.0.0.1:1"]
    {
        assert_eq!(socket(address, &own, &origin(foreign)), 403, "{foreign}");
        assert_eq!(get(address, "/panel.js", &own, &origin(foreign)).0, 403, "{foreign}");
    }
    assert_eq!(socket(address, &own, ""), 403);
    // Two of a kind are none.
    assert_eq!(socket(address, &own, &origin(&format!("http://{own}")).repeat(2)), 403);
    assert_eq!(get(address, "/", &own, &format!("Host: {own}\r\n")).0 / 100, 4);
}

pub fn no_path_leads_beyond_the_table() {
    let served = Served::joints(&[NODE]);
    let own = served.address.to_string();
    for path in [
        "/index.html",
        "/../Cargo.toml",
        "/assets/../../Cargo.toml",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/..%2fCargo.toml",
        "//etc/passwd",
        "/panel.css/",
        "/panel.css%00",
        "/PANEL.CSS",
        "/joint",
        "/joint/",
        "/joint/5/../../Cargo.toml",
    ] {
        let (status, _, body) = get(served.address, path, &own, "");
        assert!(status == 404 && body == "this server has no such file\n", "{path}: {status} {body}");
    }
    for asset in ASSETS {
        let (status, head, body) = get(served.address, asset.path, &own, "");
        assert!(status == 200 && head.contains(asset.kind), "{}: {head}", asset.path);
        assert!(body == asset.text, "{}", asset.path);
    }
    for node in ["0", "128", "-1", "x", "5%2f..", "999999999999"] {
        let request = format!("GET /joint/{node} HTTP/1.1\r\nHost: {own}\r\nOrigin: http://{own}\r\n{UPGRADE}\r\n");
        let mut stream = TcpStream::connect(served.address).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = [0; 12];
        stream.read_exact(&mut bytes).unwrap();
        assert_eq!(&bytes[9..], b"404", "{node}");
    }
}

pub fn every_answer_forbids_other_sources_and_frames() {
    let served = Served::joints(&[NODE]);
    let own = served.address.to_string();
    for (path, host) in [("/", own.as_str()), ("/none", own.as_str()), ("/", "evil.example")] {
        let (_, head, _) = get(served.address, path, host, "");
        for (name, value) in HEADERS {
            assert!(head.contains(&format!("{name}: {value}")), "{path} {host}: {name} in {head}");
        }
    }
    let policy = HEADERS.iter().find(|(name, _)| *name == "content-security-policy").unwrap().1;
    for part in ["default-src 'none'", "script-src 'self';", "frame-ancestors 'none'", "connect-src 'self'"] {
        assert!(policy.contains(part), "{policy}");
    }
}

pub fn beyond_this_machine_a_token_is_wanted_once() {
    const HOST: &str = "192.0.2.7:8402";
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    // Guard as if it were reached by that address; the token is as old as it may just be.
    let made = Instant::now().checked_sub(TOKEN_LIFE - Duration::from_secs(300)).unwrap_or_else(Instant::now);
    let guard = Guard::new(HOST.parse().unwrap(), made).unwrap();
    let token = guard.address().split_once("?token=").unwrap().1.to_owned();
    let served = Served::guarded(&[NODE], listener, guard);
    let address = served.address;
    let origin = format!("Origin: http://{HOST}\r\n");
    for path in ["/", "/panel.js", "/?token=", "/?token=0123456789abcdef0123456789abcdef", "/panel.js?token=x"] {
        assert_eq!(get(address, path, HOST, "").0, 403, "{path}");
    }
    assert_eq!(socket(address, HOST, &origin), 403);
    assert_eq!(socket(address, HOST, &format!("{origin}Cookie: panel=0123456789abcdef0123456789abcdef\r\n")), 403);
    // Another page cannot use it up, nor can one under another name.
    assert_eq!(get(address, &format!("/?token={token}"), HOST, "Origin: http://evil.example\r\n").0, 403);
    assert_eq!(get(address, &format!("/?token={token}"), "evil.example", "").0, 403);
    let (status, head, _) = get(address, &format!("/?token={token}"), HOST, "");
    assert!(status == 303 && head.contains("location: /\r\n"), "{head}");
    let cookie = head.lines().find_map(|line| line.strip_prefix("set-cookie: ")).unwrap().to_owned();
    assert!(cookie.contains("; httponly; samesite=strict; path=/"), "{cookie}");
    let cookie = format!("Cookie: {}\r\n", cookie.split(';').next().unwrap());
    assert_eq!(get(address, "/", HOST, &cookie).0, 200);
    assert_eq!(socket(address, HOST, &format!("{origin}{cookie}")), 101);
    // The cookie does not stand for the Origin.
    assert_eq!(socket(address, HOST, &cookie), 403);
    // Used: a new one is wanted.
    let (status, _, body) = get(address, &format!("/?token={token}"), HOST, "");
    assert!(status == 403 && body.contains("used or older than 10 minutes"), "{body}");
}

pub fn requests_that_are_not_as_they_should_be_are_refused_and_the_server_goes_on() {
    let served = Served::joints(&[NODE]);
    let (address, own) = (served.address, served.address.to_string());
    for method in ["POST", "PUT", "DELETE", "OPTIONS", "TRACE", "FOO"] {
        let request = format!("{method} / HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n");
        assert_eq!(exchange(address, &request).0, 405, "{method}");
    }
    for request in ["GET\r\n\r\n", "GET / HTTP/9.9\r\n\r\n", "\u{0}\u{1}\u{2}\r\n\r\n"] {
        let (status, ..) = exchange(address, request);
        assert!(status == 400 || status == 505, "{request:?}: {status}");
    }
    let huge = format!("GET / HTTP/1.1\r\nHost: {own}\r\nX: {}\r\n\r\n", "x".repeat(1 << 20));
    assert_eq!(exchange(address, &huge).0 / 100, 4);
    // No WebSocket where one is wanted.
    let (status, _, body) = get(address, "/joint/5", &own, &format!("Origin: http://{own}\r\n"));
    assert!(status == 400 && !body.is_empty(), "{status} {body}");
    // The longest message is read, one that is longer is not.
    let mut page = Page::open(address);
    let padded = |length: usize| {
        let ask = r#"{"id":900,"ask":"checklist"}"#;
        format!("{ask}{}", " ".repeat(length - ask.len()))
    };
    page.send(Message::text(padded(LONGEST)));
    assert!(page.answer_to(900).is_ok());
    page.send(Message::text(padded(LONGEST + 1)));
    // Its rest is not read, so that TCP may reset the connection before the words have arrived.
    assert!(page.closed().is_none_or(|said| said.contains("Message too long: 262145 > 262144")));
    // More questions than may wait are refused, not kept.
    let mut page = Page::open(address);
    let ids = (0..400).map(|_| page.tell(json!("checklist"))).collect::<Vec<_>>();
    let answers = ids.into_iter().map(|id| page.answer_to(id)).collect::<Vec<_>>();
    let refused = answers.iter().filter(|answer| answer.as_ref().is_err_and(|error| error.contains("questions wait")));
    assert!(refused.count() > 0 && answers.iter().any(Result::is_ok));
}

pub fn arguments_that_are_wrong_end_the_program_with_2_and_what_fails_with_1() {
    for (arguments, code, told) in [
        (&["--bus", "can0"][..], 2, "bus 'can0': a kind and a colon are missing"),
        (&["--bus", "socketcan:none9"], 1, "none9"),
        (&["--bus", "virtual:panel-code", "--node", "128"], 2, "1..=127"),
        (&["--bus", "virtual:panel-code", "--key", "nowhere.key"], 1, "nowhere.key"),
        (&["--bus", "virtual:panel-code", "--robot", "nowhere.toml"], 1, "nowhere.toml"),
        (&["--bus", "virtual:panel-code", "--joints", "5"], 2, "--robot"),
        (&["--bus", "virtual:panel-code", "--robot", ARM, "--joints", "5"], 2, "--joints names 1 nodes"),
        (&["--bus", "virtual:panel-code"], 1, "no node answers on virtual:panel-code"),
    ] {
        let mut command = Command::new(env!("CARGO_BIN_EXE_panel"));
        for variable in ["BUS", "NODE", "KEY", "TIMEOUT"] {
            command.env_remove(format!("JOINTCTL_{variable}"));
        }
        let output = command.args(arguments).output().unwrap();
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            output.status.code() == Some(code) && error.contains(told),
            "{arguments:?}: {:?} {error}",
            output.status
        );
    }
}
