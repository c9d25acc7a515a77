//! Four joints at 1 kHz, a page each, and what the server costs: samples lost, processor time, memory.
//!
//! `cargo bench -p panel --bench rate` runs it for ten minutes, `PANEL_SECONDS` for another time of more than a minute.
//! It fails where a sample is missing that the page was not told of, where the server takes more than a quarter of a
//! core, or where its memory grows by more than a tenth after the first minute. Joints and pages are in this process,
//! the server is the program itself; the bus is UDP multicast on this machine.

#![allow(dead_code, reason = "pages and joints are those of the tests, which use more of them")]

#[path = "../tests/panel/page.rs"]
mod page;
#[path = "../tests/panel/program.rs"]
mod program;
#[path = "../tests/panel/served.rs"]
mod served;

use bus::client::{Network, cob_id};
use page::Page;
use program::Program;
use serde_json::json;
use served::Joints;
use std::net::SocketAddr;
use std::process::Child;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Node ids.
const NODES: [u8; 4] = [5, 6, 7, 8];
/// Samples a second.
const RATE: f64 = 1_000.0;
/// Time over which the server keeps every sample, s.
const KEPT: f64 = 60.0;
/// Largest part of a core that the server may take.
const CORE: f64 = 0.25;
/// Largest growth of its memory after the first minute.
const GROWTH: f64 = 0.1;
/// Samples that may be on their way, or before the minute, at either end of it.
const EDGE: f64 = 100.0;

fn main() {
    // Cargo passes `--bench`; tests, which pass nothing, have no minutes for it.
    if !std::env::args().any(|argument| argument == "--bench") {
        return;
    }
    let seconds = std::env::var("PANEL_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(600.0);
    let bus = format!("udp:239.74.163.9:{}", bus::free_port().unwrap());
    let joints = Joints::on(&bus, &NODES);
    let mut server = Program::with(&bus, &["--rate", &RATE.to_string()]);
    let address = server.address;
    // What the joints are asked for: this machine may be late for its SYNC.
    let network = Network::new(bus::open(&bus).unwrap());
    let syncs = Arc::<AtomicU64>::default();
    let counted = Arc::clone(&syncs);
    let _counts = network.subscribe(move |frame| {
        counted.fetch_add(u64::from(frame.id() == cob_id::SYNC), Ordering::Relaxed);
        false
    });
    let pages = NODES.map(|node| std::thread::spawn(move || looks(address, node, seconds)));
    let measured = measure(&server.child, seconds, &syncs);
    let kept = pages.map(|page| page.join().unwrap());
    server.kill();
    drop(joints);
    let Measured { core, memory, asked } = measured;
    println!("{asked} SYNCs in the last minute");
    println!("server: {:.1} % of a core; after each minute and at the end {memory:.1?} MB", 100.0 * core);
    let mut failed = core > CORE || memory.iter().any(|later| *later > (1.0 + GROWTH) * memory[0]);
    for (node, (rows, lost, strokes)) in NODES.into_iter().zip(kept) {
        let missing = asked - rows - lost;
        println!("node {node}: {rows} samples of the last minute, {lost} told as lost, {strokes} strokes in all");
        failed |= missing > EDGE;
    }
    assert!(!failed, "beyond what it may be");
}

/// A page of a joint for a time: samples of the last minute that the server kept, and that it told as lost; strokes.
fn looks(address: SocketAddr, node: u8, seconds: f64) -> (f64, f64, usize) {
    let mut page = Page::connect(address, &node.to_string());
    page.until(|message| message.get("hello").map(drop));
    let began = Instant::now();
    let (mut before, mut lost, mut strokes) = (0.0, 0.0, 0);
    while began.elapsed().as_secs_f64() < seconds {
        if let Some(live) = page.look().unwrap().as_ref().and_then(|message| message.get("live")) {
            lost = live["lost"].as_f64().unwrap();
            if began.elapsed().as_secs_f64() < seconds - KEPT {
                before = lost;
            }
            strokes += live["t"].as_array().unwrap().len();
        }
        page.seen.clear();
    }
    let table = page.answer(json!("csv")).unwrap();
    println!("node {node}: {lost} samples lost in all");
    ((table.as_str().unwrap().lines().count() - 1) as f64, lost - before, strokes)
}

/// Cost of a server, and what was asked for meanwhile.
struct Measured {
    /// Part of a core from the first minute on.
    core: f64,
    /// Memory after each minute, and shortly before the end, when each page has its table made, MB.
    memory: Vec<f64>,
    /// SYNCs of the last minute.
    asked: f64,
}

fn measure(server: &Child, seconds: f64, syncs: &AtomicU64) -> Measured {
    let began = Instant::now();
    let until = |time: f64| std::thread::sleep(Duration::from_secs_f64(time).saturating_sub(began.elapsed()));
    let first = seconds.min(KEPT);
    until(first);
    let (from, used) = (Instant::now(), processor_time(server.id()));
    let mut memories = vec![memory(server.id())];
    let last = (seconds - KEPT).max(first);
    for minute in 2..=(last / KEPT) as u32 {
        until(KEPT * f64::from(minute));
        memories.push(memory(server.id()));
    }
    until(last);
    let begun = syncs.load(Ordering::Relaxed);
    until(seconds - 1.0);
    memories.push(memory(server.id()));
    until(seconds);
    let asked = (syncs.load(Ordering::Relaxed) - begun) as f64;
    let core = (processor_time(server.id()) - used) / from.elapsed().as_secs_f64();
    Measured { core, memory: memories, asked }
}

/// Processor time of a process, s (proc(5): utime and stime, in ticks of 10 ms).
fn processor_time(process: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    let fields: Vec<&str> = stat.rsplit(')').next().unwrap().split_whitespace().collect();
    0.01 * (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap())
}

/// Memory of a process (proc(5), VmRSS), MB.
fn memory(process: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1_024.0
}
