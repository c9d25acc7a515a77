//! A CAN interface of Linux; host.

use super::{BusError, Transport, error::is_timeout};
use crate::Frame;
use embedded_can::{Frame as _, Id, StandardId};
use socketcan::{CanDataFrame, CanFrame, CanSocket, Socket};
use std::io;
use std::time::{Duration, Instant};

/// Longest time for which the interface's queue may stay full.
const SATURATED: Duration = Duration::from_millis(500);
const ADVICE: &str = "`ip -details link show` tells whether it is up; set it up again with `sudo ip link set can0 up type can bitrate 1000000`";
/// The queue of the interface is full (Linux errno).
const ENOBUFS: i32 = 105;
/// The kernel has no CAN (Linux errno).
const EAFNOSUPPORT: i32 = 97;

/// A raw CAN socket.
#[derive(Debug)]
pub(super) struct SocketCan {
    name: String,
    socket: CanSocket,
}

impl SocketCan {
    pub(super) fn open(bus: &str, interface: &str) -> Result<Self, BusError> {
        let failed = |error: io::Error| {
            let advice = match error.raw_os_error() {
                Some(EAFNOSUPPORT) => {
                    "This kernel has no CAN (try `sudo modprobe can_raw`, then `ip link`); slcan and udp need none"
                        .into()
                }
                _ => format!(
                    "`ip link` lists the interfaces; `sudo ip link set {interface} up type can bitrate 1000000` starts one"
                ),
            };
            BusError::open(bus, error, advice)
        };
        let socket = CanSocket::open(interface).map_err(failed)?;
        socket.set_nonblocking(true).map_err(failed)?;
        Ok(Self { name: bus.into(), socket })
    }
}

impl Transport for SocketCan {
    fn name(&self) -> &str {
        &self.name
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        let id = StandardId::new(frame.id()).unwrap_or(StandardId::MAX);
        let Some(out) = CanDataFrame::new(id, frame.data()) else {
            return Err(BusError::gone(&self.name, "a frame with more than 8 bytes", "It cannot be sent"));
        };
        let deadline = Instant::now() + SATURATED;
        loop {
            match self.socket.write_frame(&CanFrame::Data(out)) {
                Ok(()) => return Ok(()),
                Err(error) if error.raw_os_error() != Some(ENOBUFS) && !is_timeout(&error) => {
                    return Err(BusError::gone(&self.name, error, ADVICE));
                }
                Err(_) if Instant::now() < deadline => std::thread::sleep(Duration::from_micros(200)),
                Err(_) => {
                    return Err(BusError::Saturated {
                        bus: self.name.clone(),
                        within_ms: SATURATED.as_millis() as u64,
                    });
                }
            }
        }
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let deadline = Instant::now() + timeout;
        loop {
            let rest = deadline.saturating_duration_since(Instant::now());
            match self.socket.read_frame_timeout(rest) {
                Ok(CanFrame::Data(data)) => {
                    if let Id::Standard(id) = embedded_can::Frame::id(&data)
                        && let Some(frame) = Frame::new(id.as_raw(), embedded_can::Frame::data(&data))
                    {
                        return Ok(Some(frame));
                    }
                }
                Ok(CanFrame::Remote(_) | CanFrame::Error(_)) => {}
                Err(error) if is_timeout(&error) => {}
                Err(error) => return Err(BusError::gone(&self.name, error, ADVICE)),
            }
            if Instant::now() >= deadline {
                return Ok(None);
            }
        }
    }
}
