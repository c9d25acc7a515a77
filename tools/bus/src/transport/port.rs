//! A port for a bus of one's own on this machine; host.

use socket2::{Domain, Socket, Type};
use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// Below those that systems give to clients (IANA: from 49152 on; Linux: from 32768 on): one of these that is free is a
/// client's in the next moment.
const PORTS: Range<u16> = 20_000..32_000;

/// A port that nobody uses now, by UDP or TCP, and that this function has not given to anybody else in this process;
/// none where all are in use. For `udp:` and `slcan:listen:`, in tests for instance.
pub fn free_port() -> Option<u16> {
    static GIVEN: AtomicU32 = AtomicU32::new(0);
    let count = u32::from(PORTS.end - PORTS.start);
    // Other processes begin elsewhere.
    let first = std::process::id().wrapping_mul(101);
    (0..count)
        .map(|_| PORTS.start + (first.wrapping_add(GIVEN.fetch_add(1, Ordering::Relaxed)) % count) as u16)
        .find(|port| try_udp(*port).is_ok() && try_tcp(*port).is_ok())
}

/// Takes a port for a moment, where nobody has it. The moment can last: a program that another thread starts just now
/// has a copy of the socket until it runs. So these sockets are such that they are in nobody's way.
fn try_udp(port: u16) -> io::Result<Socket> {
    let socket = Socket::new(Domain::IPV4, Type::DGRAM, None)?;
    socket.bind(&SocketAddr::from((Ipv4Addr::UNSPECIFIED, port)).into())?;
    // Not before: then it would share the port with a bus that is there.
    socket.set_reuse_address(true)?;
    #[cfg(unix)]
    socket.set_reuse_port(true)?;
    Ok(socket)
}

/// TCP counterpart of [`try_udp`]: one that does not listen is in the way of none that does, where both may reuse the
/// address, as std has it.
fn try_tcp(port: u16) -> io::Result<Socket> {
    let socket = Socket::new(Domain::IPV4, Type::STREAM, None)?;
    #[cfg(unix)]
    socket.set_reuse_address(true)?;
    socket.bind(&SocketAddr::from((Ipv4Addr::LOCALHOST, port)).into())?;
    Ok(socket)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::{TcpListener, UdpSocket};
    use std::sync::{Mutex, PoisonError};

    /// One of the tests takes ports without asking.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

    #[test]
    fn no_port_is_given_twice_nor_where_somebody_has_it() {
        let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let first = free_port().unwrap();
        // Sockets of somebody who does not ask take the next ports.
        let sockets: Vec<_> =
            (first + 1..first + 4).filter_map(|port| UdpSocket::bind(("0.0.0.0", port)).ok()).collect();
        let buses: Vec<_> =
            (first + 4..first + 7).filter_map(|port| crate::open(&format!("udp:239.74.163.2:{port}")).ok()).collect();
        let adapters: Vec<_> =
            (first + 7..first + 10).filter_map(|port| TcpListener::bind(("127.0.0.1", port)).ok()).collect();
        assert!(!sockets.is_empty() && !buses.is_empty() && !adapters.is_empty());
        let given: Vec<u16> = (0..20).map(|_| free_port().unwrap()).collect();
        assert!(sockets.iter().all(|socket| !given.contains(&socket.local_addr().unwrap().port())));
        assert!(buses.iter().all(|bus| given.iter().all(|port| !bus.name().ends_with(&port.to_string()))));
        assert!(adapters.iter().all(|adapter| !given.contains(&adapter.local_addr().unwrap().port())));
        assert!(given.iter().all(|port| PORTS.contains(port) && *port != first));
        assert_eq!(given.iter().collect::<std::collections::BTreeSet<_>>().len(), given.len());
    }

    #[cfg(unix)]
    #[test]
    fn a_port_is_free_while_others_start_programs() {
        let _alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        // A program that is just being started has what this process had open, for a moment.
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    while !done.load(Ordering::Relaxed) {
                        std::process::Command::new("true").status().unwrap();
                    }
                });
            }
            let refused: Vec<_> = (0..500)
                .flat_map(|_| {
                    let port = free_port().unwrap();
                    let shared = crate::open(&format!("udp:239.74.163.2:{port}")).err();
                    shared.into_iter().chain(crate::open(&format!("slcan:listen://127.0.0.1:{port}")).err())
                })
                .collect();
            done.store(true, Ordering::Relaxed);
            assert!(refused.is_empty(), "{} refused, {}", refused.len(), refused[0]);
        });
    }
}
