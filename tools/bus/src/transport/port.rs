//! A port for a bus of one's own on this machine; host.

use std::net::{TcpListener, UdpSocket};
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering};

/// Below those that systems give to clients (IANA: from 49152 on; Linux: from 32768 on): one of these that is free is a client's in the next moment.
const PORTS: Range<u16> = 20_000..32_000;

/// A port that nobody uses now, by UDP or TCP, and that this function has not given to anybody else in this process; none where all are in use. For
/// `udp:` and `slcan:listen:`, in tests for instance.
pub fn free_port() -> Option<u16> {
    static GIVEN: AtomicU32 = AtomicU32::new(0);
    let count = u32::from(PORTS.end - PORTS.start);
    // Other processes begin elsewhere.
    let first = std::process::id().wrapping_mul(101);
    (0..count)
        .map(|_| PORTS.start + (first.wrapping_add(GIVEN.fetch_add(1, Ordering::Relaxed)) % count) as u16)
        .find(|port| UdpSocket::bind(("0.0.0.0", *port)).is_ok() && TcpListener::bind(("127.0.0.1", *port)).is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_port_is_given_twice_nor_where_somebody_has_it() {
        let first = free_port().unwrap();
        // Whoever takes the next one is not asked.
        let taken: Vec<_> = (first + 1..first + 4).filter_map(|port| UdpSocket::bind(("0.0.0.0", port)).ok()).collect();
        let given: Vec<u16> = (0..20).map(|_| free_port().unwrap()).collect();
        for socket in &taken {
            assert!(!given.contains(&socket.local_addr().unwrap().port()));
        }
        assert!(given.iter().all(|port| PORTS.contains(port) && *port != first));
        assert_eq!(given.iter().collect::<std::collections::BTreeSet<_>>().len(), given.len());
    }
}
