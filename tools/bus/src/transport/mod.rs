//! CAN buses behind one trait, chosen by a string; host.
//!
//! | string | bus |
//! |---|---|
//! | `socketcan:can0` | a CAN interface of Linux |
//! | `slcan:/dev/ttyACM0` | a serial adapter, or a pty |
//! | `slcan:tcp://host:port` | the same text over TCP |
//! | `slcan:listen://host:port` | this program as the adapter: one client at a time connects over TCP |
//! | `udp:239.74.163.2:43113` | python-can's `udp_multicast` |
//! | `virtual:NAME` | within this process; `virtual:NAME?bitrate=1000000` with the pace of a wire |
//!
//! Only data frames with 11-bit identifiers exist here ([`Frame`]); others that a bus carries are passed over.
//!
//! Sending and receiving take `&self` and may happen at once in two threads, so a monitor needs no second half: it
//! shares the bus by [`Arc`]. Two threads that *receive* would take frames from each other; [`crate::client::Network`]
//! is the one reader that gives every frame to everyone.

mod error;
mod msgpack;
mod port;
mod serial;
mod slcan;
mod slcan_listen;
mod slcan_text;
#[cfg(target_os = "linux")]
mod socketcan;
mod udp;
mod virtual_bus;

pub use canopen_node::Frame;
pub use error::BusError;
pub use port::free_port;

use crate::pacing::Statistics;
use std::sync::Arc;
use std::time::Duration;

/// The strings that [`open`] takes, for messages.
const FORMS: &str = "socketcan:can0, slcan:/dev/ttyACM0, slcan:tcp://host:port, slcan:listen://host:port, udp:239.74.163.2:43113, virtual:NAME or virtual:NAME?bitrate=1000000";

/// A bus that classic CAN frames come from and go to.
pub trait Transport: Send + Sync + std::fmt::Debug {
    /// The string that it was opened by.
    fn name(&self) -> &str;

    /// Sends a frame. It is then on its way, in the order of calls; that somebody received it is not known. The sender
    /// does not hear it. After [`BusError::Gone`] every call fails.
    fn send(&self, frame: &Frame) -> Result<(), BusError>;

    /// The next frame; none when nothing came within `timeout`, which may be zero (a serial line and SocketCAN may wait
    /// some milliseconds even then).
    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError>;

    /// Frames that came and could not be kept or understood, since the bus was opened.
    fn lost(&self) -> u64 {
        0
    }

    /// Load and latencies, of a paced virtual bus; nobody counts them on others.
    fn statistics(&self) -> Option<Statistics> {
        None
    }
}

/// Opens a bus; the module's documentation lists the strings.
pub fn open(bus: &str) -> Result<Arc<dyn Transport>, BusError> {
    let malformed = |problem: &str| BusError::malformed(bus, problem);
    let (kind, place) = bus.split_once(':').ok_or_else(|| malformed("a kind and a colon are missing"))?;
    if place.is_empty() {
        return Err(malformed("nothing follows the colon"));
    }
    match kind {
        #[cfg(target_os = "linux")]
        "socketcan" => Ok(Arc::new(socketcan::SocketCan::open(bus, place)?)),
        #[cfg(not(target_os = "linux"))]
        "socketcan" => Err(malformed("SocketCAN exists on Linux only; use slcan or udp")),
        "slcan" => match place.split_once("://") {
            Some(("tcp", address)) => Ok(Arc::new(slcan::tcp(bus, address)?)),
            Some(("listen", address)) => Ok(Arc::new(slcan_listen::Listener::open(bus, address)?)),
            Some((scheme, _)) => Err(malformed(&format!("slcan does not know '{scheme}://'"))),
            None => Ok(Arc::new(serial::open(bus, place)?)),
        },
        "udp" => Ok(Arc::new(udp::Multicast::open(bus, place)?)),
        "virtual" => virtual_bus::open(bus, place),
        _ => Err(malformed(&format!("there is no kind '{kind}'"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(bus: &str) -> String {
        open(bus).expect_err(bus).to_string()
    }

    #[test]
    fn a_string_that_is_no_bus_is_answered_with_those_that_are() {
        for (bus, problem) in [
            ("can0", "a kind and a colon are missing"),
            ("virtual:", "nothing follows the colon"),
            ("kvaser:0", "there is no kind 'kvaser'"),
            ("slcan:ftp://a:1", "does not know 'ftp://'"),
            ("slcan:tcp://nowhere", "port"),
            ("udp:239.74.163.2", "port"),
            ("udp:239.74.163.2:0", "port"),
            ("udp:127.0.0.1:43113", "multicast"),
            ("virtual:a?bitrate=0", "bitrate"),
            ("virtual:a?bitrate=fast", "bitrate"),
            ("virtual:a?speed=1", "speed"),
            ("virtual:?bitrate=1000000", "name"),
        ] {
            let message = refused(bus);
            assert!(message.contains(problem), "{message}");
            assert!(message.contains(bus) && message.contains("slcan:/dev/ttyACM0"), "{message}");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_missing_can_interface_is_named_with_the_command_that_makes_one() {
        let message = refused("socketcan:nocan9");
        assert!(message.contains("socketcan:nocan9") && message.contains("ip link"), "{message}");
    }

    #[test]
    #[cfg(unix)]
    fn a_missing_serial_port_is_named() {
        let message = refused("slcan:/dev/no-such-port");
        assert!(message.contains("/dev/no-such-port") && message.contains("plugged in"), "{message}");
        assert!(refused("slcan:/dev/null").contains("serial port"));
    }

    #[test]
    fn a_connection_that_nobody_accepts_is_named() {
        let port = free_port().unwrap();
        let message = refused(&format!("slcan:tcp://127.0.0.1:{port}"));
        assert!(message.contains("listen"), "{message}");
    }

    #[test]
    fn permission_is_explained() {
        let error = std::io::Error::from(std::io::ErrorKind::PermissionDenied);
        let message = BusError::open("slcan:/dev/ttyACM0", error, "").to_string();
        assert!(message.contains("/dev/ttyACM0") && message.contains("dialout"), "{message}");
    }
}
