//! Access to the server: requests for this host, of this server's own page, and beyond this machine with a cookie that
//! a one-time token was given for; time is passed in.
//!
//! A page of another origin in the same browser may send requests here: its Origin tells it (RFC 6454, section 7). One
//! whose name was made to resolve to this machine (DNS rebinding) is told by its Host.

use std::net::{IpAddr, SocketAddr};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Age from which on a token is not taken.
pub const TOKEN_LIFE: Duration = Duration::from_secs(600);
/// Browsers that may have a cookie; the oldest loses it.
const COOKIES: usize = 16;
/// Bytes of a token and of a cookie.
const RANDOM: usize = 16;
/// Name of the cookie.
const NAME: &str = "panel";

/// Reason for which a request is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Host.
    #[error("the request is for host '{0}', which this server is not")]
    Host(String),
    /// Origin.
    #[error("a page of '{0}' may not use this server")]
    Origin(String),
    /// No Origin where one is needed.
    #[error("a WebSocket needs the Origin of this server's page")]
    NoOrigin,
    /// Neither cookie nor token.
    #[error("this server wants the token that its terminal shows: open the whole address")]
    NoToken,
    /// A token that never was, was used, or is too old.
    #[error("the token is wrong, used or older than {} minutes; the terminal has a new one", TOKEN_LIFE.as_secs() / 60)]
    Token,
}

/// Reason for which an address is not listened on.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// All addresses at once.
    #[error("{0} stands for every address of this machine: name the one that the page will be opened by")]
    Unspecified(IpAddr),
    /// No randomness.
    #[error("the operating system gives no random bytes for a token: {0}")]
    Random(String),
}

fn random() -> Result<String, AddressError> {
    let mut bytes = [0u8; RANDOM];
    getrandom::fill(&mut bytes).map_err(|error| AddressError::Random(error.to_string()))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Equal, in a time that does not tell where they differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |all, (a, b)| all | (a ^ b)) == 0
}

#[derive(Debug)]
struct Doors {
    token: String,
    made: Instant,
    cookies: Vec<String>,
}

/// The rules of one server.
#[derive(Debug)]
pub struct Guard {
    hosts: Vec<String>,
    /// None on this machine alone: there the operating system keeps others out.
    doors: Option<Mutex<Doors>>,
}

impl Guard {
    /// Rules for a server on `address`.
    ///
    /// # Errors
    /// [`AddressError`].
    pub fn new(address: SocketAddr, now: Instant) -> Result<Self, AddressError> {
        if address.ip().is_unspecified() {
            return Err(AddressError::Unspecified(address.ip()));
        }
        let mut hosts = vec![address.to_string()];
        if address.ip().is_loopback() {
            hosts.push(format!("localhost:{}", address.port()));
            return Ok(Self { hosts, doors: None });
        }
        let doors = Doors { token: random()?, made: now, cookies: Vec::new() };
        Ok(Self { hosts, doors: Some(Mutex::new(doors)) })
    }

    /// Address of the page, with a token where one is needed.
    pub fn address(&self) -> String {
        let host = self.hosts.first().map_or("", String::as_str);
        match &self.doors {
            None => format!("http://{host}/"),
            Some(doors) => {
                let doors = doors.lock().unwrap_or_else(PoisonError::into_inner);
                format!("http://{host}/?token={}", doors.token)
            }
        }
    }

    fn host(&self, host: Option<&str>) -> Result<(), Refusal> {
        let host = host.unwrap_or_default();
        let known = self.hosts.iter().any(|own| own.eq_ignore_ascii_case(host));
        if known { Ok(()) } else { Err(Refusal::Host(host.into())) }
    }

    /// An Origin that is there has to be this server's, `needed` or not.
    fn origin(&self, origin: Option<&str>, needed: bool) -> Result<(), Refusal> {
        match origin {
            None if needed => Err(Refusal::NoOrigin),
            None => Ok(()),
            Some(origin) => {
                let host = origin.strip_prefix("http://").unwrap_or_default();
                self.host(Some(host)).map_err(|_| Refusal::Origin(origin.into()))
            }
        }
    }

    fn cookie(&self, cookies: Option<&str>) -> Result<(), Refusal> {
        let Some(doors) = &self.doors else { return Ok(()) };
        let doors = doors.lock().unwrap_or_else(PoisonError::into_inner);
        let values = cookies.unwrap_or_default().split(';').filter_map(|pair| pair.trim().split_once('='));
        let given = values.filter(|(name, _)| *name == NAME).map(|(_, value)| value);
        let known = |value: &str| doors.cookies.iter().any(|cookie| same(cookie, value));
        if given.into_iter().any(known) { Ok(()) } else { Err(Refusal::NoToken) }
    }

    /// Lets a request in, or says why not.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn admit(
        &self,
        host: Option<&str>,
        origin: Option<&str>,
        cookies: Option<&str>,
        socket: bool,
    ) -> Result<(), Refusal> {
        self.host(host)?;
        self.origin(origin, socket)?;
        self.cookie(cookies)
    }

    /// A cookie for a token, once. The next token is another one; none where this machine has no randomness.
    ///
    /// # Errors
    /// [`Refusal::Host`], [`Refusal::Origin`], [`Refusal::Token`].
    pub fn redeem(
        &self,
        host: Option<&str>,
        origin: Option<&str>,
        token: &str,
        now: Instant,
    ) -> Result<String, Refusal> {
        self.host(host)?;
        self.origin(origin, false)?;
        let Some(doors) = &self.doors else { return Err(Refusal::Token) };
        let mut doors = doors.lock().unwrap_or_else(PoisonError::into_inner);
        if !same(&doors.token, token) {
            return Err(Refusal::Token);
        }
        let young = now.saturating_duration_since(doors.made) < TOKEN_LIFE;
        let (Ok(next), Ok(cookie)) = (random(), random()) else { return Err(Refusal::Token) };
        (doors.token, doors.made) = (next, now);
        if !young {
            return Err(Refusal::Token);
        }
        if doors.cookies.len() == COOKIES {
            doors.cookies.remove(0);
        }
        doors.cookies.push(cookie.clone());
        Ok(format!("{NAME}={cookie}; HttpOnly; SameSite=Strict; Path=/"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOCAL: Option<&str> = Some("127.0.0.1:4000");

    fn guard(address: &str) -> (Guard, Instant) {
        let now = Instant::now();
        (Guard::new(address.parse().unwrap(), now).unwrap(), now)
    }

    #[test]
    fn on_this_machine_host_and_origin_decide() {
        let (guard, now) = guard("127.0.0.1:4000");
        assert_eq!(guard.address(), "http://127.0.0.1:4000/");
        for own in ["127.0.0.1:4000", "localhost:4000", "LOCALHOST:4000"] {
            assert_eq!(guard.admit(Some(own), Some(&format!("http://{own}")), None, true), Ok(()));
        }
        for host in [None, Some(""), Some("127.0.0.1"), Some("127.0.0.1:4001"), Some("evil.example:4000")] {
            let refused = guard.admit(host, Some("http://127.0.0.1:4000"), None, true);
            assert_eq!(refused, Err(Refusal::Host(host.unwrap_or_default().into())));
        }
        let others =
            ["null", "", "http://evil.example", "https://127.0.0.1:4000", "http://127.0.0.1:4001", "127.0.0.1:4000"];
        for origin in others {
            for socket in [true, false] {
                let refused = guard.admit(LOCAL, Some(origin), None, socket);
                assert_eq!(refused, Err(Refusal::Origin(origin.into())), "{origin}");
            }
        }
        assert_eq!(guard.admit(LOCAL, None, None, true), Err(Refusal::NoOrigin));
        assert_eq!(guard.admit(LOCAL, None, None, false), Ok(()));
        assert_eq!(guard.redeem(LOCAL, None, "", now), Err(Refusal::Token));
    }

    #[test]
    fn beyond_this_machine_a_token_opens_once_and_for_ten_minutes() {
        let host = Some("192.0.2.7:4000");
        let (guard, now) = guard("192.0.2.7:4000");
        let token = || guard.address().split_once("?token=").unwrap().1.to_owned();
        assert_eq!(guard.admit(host, None, None, false), Err(Refusal::NoToken));
        assert_eq!(guard.redeem(host, None, "", now), Err(Refusal::Token));
        assert_eq!(guard.redeem(Some("evil.example"), None, &token(), now), Err(Refusal::Host("evil.example".into())));
        let first = token();
        let below = now + TOKEN_LIFE - Duration::from_nanos(1);
        let cookie = guard.redeem(host, None, &first, below).unwrap();
        assert!(cookie.ends_with("; HttpOnly; SameSite=Strict; Path=/"), "{cookie}");
        let value = cookie.split(';').next();
        assert_eq!(guard.admit(host, None, value, false), Ok(()));
        assert_eq!(guard.admit(host, None, Some(&format!("a=b; {}", value.unwrap())), false), Ok(()));
        assert_eq!(guard.admit(host, None, Some("panel=; panel"), false), Err(Refusal::NoToken));
        // Used.
        assert_eq!(guard.redeem(host, None, &first, below), Err(Refusal::Token));
        // Old; and then there is another one.
        let second = token();
        assert_ne!(first, second);
        assert_eq!(guard.redeem(host, None, &second, below + TOKEN_LIFE), Err(Refusal::Token));
        assert_ne!(token(), second);
        assert!(guard.redeem(host, None, &token(), below + TOKEN_LIFE).is_ok());
    }

    #[test]
    fn every_address_at_once_is_no_address_to_listen_on() {
        for address in ["0.0.0.0:1", "[::]:1"] {
            let error = Guard::new(address.parse().unwrap(), Instant::now()).unwrap_err();
            assert!(matches!(error, AddressError::Unspecified(_)), "{error}");
        }
    }
}
