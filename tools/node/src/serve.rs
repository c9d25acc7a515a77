//! A node on a bus, in real time.

use crate::virtual_node::VirtualNode;
use bus::{BusError, Transport};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Time that is waited for a frame, and simulated at once.
const TICK: Duration = Duration::from_millis(1);
/// A machine that is so much behind gives the time up.
const LOST: Duration = Duration::from_millis(100);

/// Why a node left the bus.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// Runs the node until `stop`; simulated time that the machine was too slow for, s.
///
/// # Errors
/// A bus that is gone.
pub fn serve(node: &mut VirtualNode, bus: &dyn Transport, stop: &AtomicBool) -> Result<f64, ServeError> {
    let rate = f64::from(node.rate());
    let mut start = Instant::now();
    let (mut done, mut lost) = (0u64, Duration::ZERO);
    while !stop.load(Ordering::Relaxed) {
        let mut wait = TICK;
        while let Some(frame) = bus.receive(wait)? {
            node.receive(&frame);
            node.work();
            send(node, bus)?;
            wait = Duration::ZERO;
            if elapsed(start, rate) > done + (rate * TICK.as_secs_f64()) as u64 {
                break;
            }
        }
        let target = elapsed(start, rate);
        let behind = Duration::from_secs_f64(target.saturating_sub(done) as f64 / rate);
        if behind > LOST {
            start += behind;
            lost += behind;
        } else {
            node.advance(target.saturating_sub(done));
            done = done.max(target);
            send(node, bus)?;
        }
    }
    Ok(lost.as_secs_f64())
}

/// Control steps since the start.
fn elapsed(start: Instant, rate: f64) -> u64 {
    (Instant::now().saturating_duration_since(start).as_secs_f64() * rate) as u64
}

fn send(node: &mut VirtualNode, bus: &dyn Transport) -> Result<(), BusError> {
    while let Some(frame) = node.take_frame() {
        bus.send(&frame)?;
    }
    Ok(())
}
