//! Slcan adapter that listens on TCP, so that a virtual joint serves any slcan client (python-can's `slcan` with
//! `socket://host:port`); host. One client at a time; a second one waits until the first hangs up.
//!
//! A client that has not opened the channel (`O`), or no client at all, is a wire that nobody listens to: frames to it
//! are gone, as on a bus.

use super::slcan::WRITE;
use super::slcan_text::{BEL, Decoder, Line, encode};
use super::{BusError, Transport, error::is_timeout};
use crate::Frame;
use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

const ADVICE: &str = "Start anew";
/// Longest delay of a wait for a client.
const PATIENCE: Duration = Duration::from_millis(2);

/// The client at the other end.
#[derive(Debug)]
struct Client {
    stream: TcpStream,
    decoder: Decoder,
}

/// An adapter's side of slcan.
#[derive(Debug)]
pub(super) struct Listener {
    name: String,
    listener: TcpListener,
    client: Mutex<Option<Client>>,
    /// Destination of frames while the channel is open.
    output: Mutex<Option<Arc<TcpStream>>>,
    lost: AtomicU64,
}

impl Listener {
    pub(super) fn open(bus: &str, address: &str) -> Result<Self, BusError> {
        let failed = |error: io::Error| match error.kind() {
            io::ErrorKind::InvalidInput => BusError::malformed(bus, format!("'{address}' is no host and port")),
            _ => BusError::open(bus, error, "Another program may listen there: choose another port"),
        };
        let listener = TcpListener::bind(address).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let (client, output, lost) = (Mutex::new(None), Mutex::new(None), AtomicU64::new(0));
        Ok(Self { name: bus.into(), listener, client, output, lost })
    }

    fn set_output(&self, output: Option<Arc<TcpStream>>) {
        *self.output.lock().unwrap_or_else(PoisonError::into_inner) = output;
    }

    /// A client that is there or came just now.
    fn accept(&self, client: &mut Option<Client>) -> Result<bool, BusError> {
        if client.is_some() {
            return Ok(true);
        }
        let stream = match self.listener.accept() {
            Ok((stream, _)) => stream,
            Err(error) if is_timeout(&error) || error.kind() == io::ErrorKind::ConnectionAborted => return Ok(false),
            Err(error) => return Err(BusError::gone(&self.name, error, ADVICE)),
        };
        let ready = stream
            .set_nonblocking(false)
            .and_then(|()| stream.set_nodelay(true))
            .and_then(|()| stream.set_write_timeout(Some(WRITE)));
        // One that is gone already is none.
        *client = ready.ok().map(|()| Client { stream, decoder: Decoder::default() });
        Ok(client.is_some())
    }

    /// Answers a command; false where the client is gone.
    fn answer(&self, stream: &mut TcpStream, command: &[u8]) -> bool {
        let answer: &[u8] = match command {
            [b'O' | b'L', ..] => {
                let Ok(output) = stream.try_clone() else { return false };
                self.set_output(Some(Arc::new(output)));
                b"\r"
            }
            [b'C', ..] => {
                self.set_output(None);
                b"\r"
            }
            // There is one bit rate on this bus, and whoever asks for another gets no other.
            b"S8" | [b'Z' | b'M' | b'm' | b'X', ..] => b"\r",
            b"V" => b"V1013\r",
            b"v" => b"v0100\r",
            b"N" => b"N0001\r",
            b"F" => b"F00\r",
            _ => &[BEL],
        };
        stream.write_all(answer).is_ok()
    }
}

impl Transport for Listener {
    fn name(&self) -> &str {
        &self.name
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        let output = self.output.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if let Some(stream) = output
            && stream.as_ref().write_all(&encode(frame)).is_err()
        {
            self.lost.fetch_add(1, Ordering::Relaxed);
        }
        Ok(())
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let deadline = Instant::now() + timeout;
        let mut place = self.client.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            let rest = deadline.saturating_duration_since(Instant::now());
            if !self.accept(&mut place)? {
                if rest.is_zero() {
                    return Ok(None);
                }
                std::thread::sleep(rest.min(PATIENCE));
                continue;
            }
            let Some(Client { stream, decoder }) = place.as_mut() else { continue };
            let mut present = true;
            match decoder.next() {
                Some(Line::Frame(frame)) => {
                    // Lawicel: a frame is on its way.
                    if stream.write_all(b"z\r").is_err() {
                        self.set_output(None);
                        *place = None;
                    }
                    return Ok(Some(frame));
                }
                Some(Line::Text(command)) => present = self.answer(stream, &command),
                Some(Line::Accepted) => present = stream.write_all(b"\r").is_ok(),
                Some(Line::Other | Line::Garbage) => {
                    self.lost.fetch_add(1, Ordering::Relaxed);
                    present = stream.write_all(&[BEL]).is_ok();
                }
                Some(Line::Refused) => {}
                None if rest.is_zero() => return Ok(None),
                None => {
                    let mut bytes = [0; 512];
                    let read = stream
                        .set_read_timeout(Some(rest.max(Duration::from_micros(1))))
                        .and_then(|()| stream.read(&mut bytes));
                    match read {
                        Ok(0) => present = false,
                        Ok(length) => decoder.push(bytes.get(..length).unwrap_or_default()),
                        Err(error) => present = is_timeout(&error),
                    }
                }
            }
            if !present {
                self.set_output(None);
                *place = None;
            }
        }
    }

    fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
}
