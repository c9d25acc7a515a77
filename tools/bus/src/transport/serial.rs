//! The serial port of an slcan adapter, or a pty; host.

use super::BusError;
use super::slcan::{Reader, Slcan, WRITE};
use std::io;
use std::time::Duration;

/// USB adapters ignore it; those with a real UART commonly run at this rate.
const BAUD_RATE: u32 = 115_200;

impl Reader for Box<dyn serialport::SerialPort> {
    fn set_timeout(&mut self, timeout: Duration) -> io::Result<()> {
        serialport::SerialPort::set_timeout(self.as_mut(), timeout).map_err(io::Error::from)
    }
}

/// `path`, or `path@baud`.
pub(super) fn open(bus: &str, place: &str) -> Result<Slcan, BusError> {
    let (path, baud_rate) = match place.rsplit_once('@') {
        None => (place, BAUD_RATE),
        Some((path, rate)) => {
            let rate = rate.parse().ok().filter(|rate| *rate > 0);
            (path, rate.ok_or_else(|| BusError::malformed(bus, "what follows '@' is no baud rate"))?)
        }
    };
    let advice = |error: &serialport::Error| match error.kind() {
        serialport::ErrorKind::NoDevice => {
            "Is it plugged in, and does no other program use it? `ls /dev/ttyACM* /dev/ttyUSB*` lists the ports"
        }
        serialport::ErrorKind::Io(io::ErrorKind::NotFound) => {
            "Is it plugged in? `ls /dev/ttyACM* /dev/ttyUSB*` lists the ports"
        }
        _ => "Is it a serial port? `ls /dev/ttyACM* /dev/ttyUSB*` lists the ports",
    };
    let failed = |error: serialport::Error| {
        let advice = advice(&error);
        BusError::open(bus, error.into(), advice)
    };
    let output = serialport::new(path, baud_rate).timeout(WRITE).open().map_err(failed)?;
    let input = output.try_clone().map_err(failed)?;
    Slcan::open(bus, "Plug the adapter in again and start anew", Box::new(input), Box::new(output))
}
