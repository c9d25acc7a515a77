//! CAN over UDP multicast, as python-can's `udp_multicast` speaks it: every program in the group is a node of one bus;
//! host.
//!
//! There are two sockets. The one that receives is bound to the group's port, which all programs on a machine share.
//! The one that sends has a port of its own, because the kernel gives every sender its own frames back, and by that
//! port they are known and left out. (`IP_MULTICAST_LOOP` would not do: without it nobody else on this machine hears
//! them either.)

use super::msgpack::{Message, decode, encode};
use super::{BusError, Transport, error::is_timeout};
use crate::Frame;
use socket2::{Domain, Protocol, SockAddr, Socket, Type};
use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// python-can's `hop_limit`: the local network.
const HOPS: u32 = 1;
const ADVICE: &str = "Is there a network that takes multicast? On a machine without one: `sudo ip route add 224.0.0.0/4 dev lo src 127.0.0.1`";
/// python-can reads no more than this of a datagram.
const LONGEST: usize = 4096;
/// Room for frames that come while the program does something else, bytes.
const RECEIVE_BUFFER: usize = 1 << 20;

/// A member of the multicast group.
#[derive(Debug)]
pub(super) struct Multicast {
    name: String,
    input: UdpSocket,
    output: UdpSocket,
    /// Address that this program's own frames come from.
    own: SocketAddr,
    /// Time for which `input` waits, as the kernel was told last.
    waits: Mutex<Option<Duration>>,
    lost: AtomicU64,
}

impl Multicast {
    pub(super) fn open(bus: &str, place: &str) -> Result<Self, BusError> {
        let group: SocketAddr = place.parse().map_err(|_| {
            BusError::malformed(bus, format!("'{place}' is no address and port (python-can's are 239.74.163.2:43113)"))
        })?;
        if !group.ip().is_multicast() {
            return Err(BusError::malformed(
                bus,
                format!("{} is no multicast address (224.0.0.0/4 or ff00::/8)", group.ip()),
            ));
        }
        if group.port() == 0 {
            return Err(BusError::malformed(bus, "port 0 is none (python-can's is 43113)"));
        }
        let failed = |error| BusError::open(bus, error, ADVICE);
        let input = join(group).map_err(failed)?;
        let output = sender(group).map_err(failed)?;
        let own = output.local_addr().map_err(failed)?;
        Ok(Self { name: bus.into(), input, output, own, waits: Mutex::default(), lost: AtomicU64::new(0) })
    }

    /// Has `input` wait for so long. The kernel is told only where it was told another time before: two calls less for
    /// each frame of a burst.
    fn wait(&self, time: Duration) -> io::Result<()> {
        let mut waits = self.waits.lock().unwrap_or_else(PoisonError::into_inner);
        if *waits == Some(time) {
            return Ok(());
        }
        *waits = None;
        // A timeout of zero would mean "for ever", and the kernel makes one of a microsecond some milliseconds.
        self.input.set_nonblocking(time.is_zero())?;
        if !time.is_zero() {
            self.input.set_read_timeout(Some(time))?;
        }
        *waits = Some(time);
        Ok(())
    }
}

fn join(group: SocketAddr) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::for_address(group), Type::DGRAM, Some(Protocol::UDP))?;
    // Both, as python-can sets them: the port is shared with it.
    socket.set_reuse_address(true)?;
    #[cfg(unix)]
    socket.set_reuse_port(true)?;
    // The kernel may give less.
    let _ = socket.set_recv_buffer_size(RECEIVE_BUFFER);
    match group.ip() {
        IpAddr::V4(address) => {
            socket.bind(&SockAddr::from(SocketAddr::from((Ipv4Addr::UNSPECIFIED, group.port()))))?;
            // Other groups on the same port are other buses.
            #[cfg(target_os = "linux")]
            socket.set_multicast_all_v4(false)?;
            socket.join_multicast_v4(&address, &Ipv4Addr::UNSPECIFIED)?;
        }
        IpAddr::V6(address) => {
            socket.bind(&SockAddr::from(SocketAddr::from((Ipv6Addr::UNSPECIFIED, group.port()))))?;
            #[cfg(target_os = "linux")]
            socket.set_multicast_all_v6(false)?;
            socket.join_multicast_v6(&address, 0)?;
        }
    }
    Ok(socket.into())
}

fn sender(group: SocketAddr) -> io::Result<UdpSocket> {
    let socket = Socket::new(Domain::for_address(group), Type::DGRAM, Some(Protocol::UDP))?;
    match group.ip() {
        IpAddr::V4(_) => socket.set_multicast_ttl_v4(HOPS)?,
        IpAddr::V6(_) => socket.set_multicast_hops_v6(HOPS)?,
    }
    // Connecting settles this machine's address on the way to the group.
    socket.connect(&SockAddr::from(group))?;
    Ok(socket.into())
}

impl Transport for Multicast {
    fn name(&self) -> &str {
        &self.name
    }

    fn send(&self, frame: &Frame) -> Result<(), BusError> {
        let timestamp = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
        match self.output.send(&encode(frame, timestamp)) {
            Ok(_) => Ok(()),
            Err(error) => Err(BusError::gone(&self.name, error, ADVICE)),
        }
    }

    fn receive(&self, timeout: Duration) -> Result<Option<Frame>, BusError> {
        let deadline = Instant::now() + timeout;
        let gone = |error| BusError::gone(&self.name, error, ADVICE);
        let mut rest = timeout;
        loop {
            self.wait(rest).map_err(gone)?;
            let mut datagram = [0; LONGEST];
            match self.input.recv_from(&mut datagram) {
                // Not what was asked for, and what waits behind it has come already.
                Ok((_, from)) if from == self.own => {
                    rest = deadline.saturating_duration_since(Instant::now());
                    continue;
                }
                Ok((length, _)) => match decode(datagram.get(..length).unwrap_or_default()) {
                    Message::Frame(frame) => return Ok(Some(frame)),
                    Message::Other => {}
                    Message::Garbage => {
                        self.lost.fetch_add(1, Ordering::Relaxed);
                    }
                },
                Err(error) if is_timeout(&error) => {}
                Err(error) => return Err(gone(error)),
            }
            rest = deadline.saturating_duration_since(Instant::now());
            if rest.is_zero() {
                return Ok(None);
            }
        }
    }

    fn lost(&self) -> u64 {
        self.lost.load(Ordering::Relaxed)
    }
}
