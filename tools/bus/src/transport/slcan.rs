//! Host of an slcan adapter: opens the channel at 1 Mbit/s, then frames in both directions; host.
//!
//! TCP needs `TCP_NODELAY`: a short line otherwise waits for the acknowledgement of the one before, about 40 ms a
//! frame.

use super::slcan_text::{Decoder, Line, encode};
use super::{BusError, Transport, error::is_timeout};
use crate::Frame;
use std::io::{self, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// Longest time of an adapter's answer to the commands that open the channel. One that never answers is taken to have
/// obeyed: several firmwares do not.
const ANSWER: Duration = Duration::from_millis(150);
/// Longest time for a line to be written.
pub(super) const WRITE: Duration = Duration::from_secs(1);
/// Longest time of a connection.
const CONNECT: Duration = Duration::from_secs(3);

/// The two directions of a connection.
pub(super) trait Reader: Read + Send {
    /// Sets the longest wait of the next read; not zero.
    fn set_timeout(&mut self, timeout: Duration) -> io::Result<()>;
}

impl Reader for TcpStream {
    fn set_timeout(&mut self, timeout: Duration) -> io::Result<()> {
        self.set_read_timeout(Some(timeout))
    }
}

/// An adapter whose channel is open.
pub(super) struct Slcan {
    name: String,
    advice: &'static str,
    input: Mutex<(Box<dyn Reader>, Decoder)>,
    output: Mutex<Box<dyn Write + Send>>,
    lost: AtomicU64,
}

impl std::fmt::Debug for Slcan {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Slcan").field("name", &self.name).finish_non_exhaustive()
    }
}

/// Connects to an adapter behind `host:port`.
pub(super) fn tcp(bus: &str, address: &str) -> Result<Slcan, BusError> {
    let addresses = address
        .to_socket_addrs()
        .map_err(|error| BusError::malformed(bus, format!("'{address}' is no host and port: {error}")))?;
    let mut failure = io::Error::other("the name has no address");
    for address in addresses {
        match TcpStream::connect_timeout(&address, CONNECT) {
            Err(error) => failure = error,
            Ok(stream) => {
                let open = |error| BusError::open(bus, error, "The connection broke at once");
                stream.set_nodelay(true).map_err(open)?;
                stream.set_write_timeout(Some(WRITE)).map_err(open)?;
                let input = stream.try_clone().map_err(open)?;
                return Slcan::open(bus, "The other side closed the connection", Box::new(input), Box::new(stream));
            }
        }
    }
    Err(BusError::open(
        bus,
        failure,
        "Does the other side listen there? Start it first, and check address and firewall",
    ))
}

impl Slcan {
    /// Opens the channel. `advice` is for when the connection is gone later.
    pub(super) fn open(
        bus: &str,
        advice: &'static str,
        input: Box<dyn Reader>,
        output: Box<dyn Write + Send>,
    ) -> Result<Self, BusError> {
        let slcan = Self {
            name: bus.into(),
            advice,
            input: Mutex::new((input, Decoder::default())),
            output: Mutex::new(output),
            lost: AtomicU64::new(0),
        };
        // Ends whatever half line the adapter still holds, and a channel that another program left open. Refusals of
        // these do not matter.
        slcan.write(b"\r\rC\r")?;
        while slcan.line(Instant::now() + ANSWER / 3)?.is_some() {}
        for (command, problem) in
            [(b"S8\r", "the adapter refuses 1 Mbit/s"), (b"O\r\r", "the adapter refuses to open its channel")]
        {
            slcan.write(command.trim_ascii_end())?;
            slcan.write(b"\r")?;
            let deadline = Instant::now() + ANSWER;
            while let Some(line) = slcan.line(deadline)? {
                match line {
                    Line::Accepted => break,
                    Line::Refused => {
                        let advice = "Close other programs that use it, and unplug it and plug it in again";
                        return Err(BusError::Refused { bus: bus.into(), problem: problem.into(), advice });
                    }
                    _ => {}
                }
            }
        }
        Ok(slcan)
    }

    fn write(&self, bytes: &[u8]) -> Result<(), BusError> {
        let mut output = self.output.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        output.write_all(bytes).and_then(|()| output.flush()).map_err(|error| match is_timeout(&error) {
            true => BusError::Saturated { bus: self.name.clone(), within_ms: WRITE.as_millis() as u64 },
            false => BusError::gone(&self.name, error, self.advice),
        })
    }

    /// The next line before `deadline`; what has come already in any case.
    fn line(&self, deadline: Instant) -> Result<Option<Line>, BusError> {
        let mut input = self.input.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let (reader, decoder) = &mut *input;
        let gone = |problem: &dyn ToString| BusError::gone(&self.name, problem.to_string(), self.advice);
        loop {
            if let Some(line) = decoder.next() {
                return Ok(Some(line));
            }
            let rest = deadline.saturating_duration_since(Instant::now());
            // Zero would mean "for ever" to a socket; a serial port counts milliseconds.
            reader.set_timeout(rest.max(Duration::from_millis(1))).map_err(|error| gone(&error))?;
            let mut bytes = [0; 512];
            match reader.read(&mut bytes) {
                Ok(0) => return Err(gone(&"end of the stream")),
                Ok(length) => decoder.push(bytes.get(..length).unwrap_or_default()),
                Err(error) if is_timeout(&error) && rest.is_zero() => return Ok(None),
                Err(error) if is_timeout(&error) => {}
                Err(error) => return Err(gone(&error)),
            }
        }
    }
}

impl Transport for Slcan {
    fn name(&self) -> &str {
        &self.name
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        self.write(&encode(frame))
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let deadline = Instant::now() + timeout;
        while let Some(line) = self.line(deadline)? {
            match line {
                Line::Frame(frame) => return Ok(Some(frame)),
                // BEL in answer to a frame: the adapter's own queue is full.
                Line::Garbage | Line::Refused => {
                    self.lost.fetch_add(1, Ordering::Relaxed);
                }
                Line::Other | Line::Accepted | Line::Text(_) => {}
            }
            if Instant::now() >= deadline {
                return Ok(None);
            }
        }
        Ok(None)
    }

    fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
}

impl Drop for Slcan {
    fn drop(&mut self) {
        // Leaves the adapter off the bus; where it is gone there is nobody to tell.
        let _ = self.write(b"C\r");
    }
}
