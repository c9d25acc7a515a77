//! Errors between this program and a joint, in one line each: what, where, which limit; host.

use bus::BusError;
use bus::client::{Abort, ClientError};
use canopen_node::NmtState;
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;

/// A number with as many digits as it has: what was single precision on the joint is printed as that.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let single = self.0 as f32;
        if f64::from(single) == self.0 { single.fmt(f) } else { self.0.fmt(f) }
    }
}

impl RemoteError {
    /// Returns `true` if a joint refused because it has no such object: not every board has room for every one.
    #[must_use]
    pub const fn is_absent(&self) -> bool {
        matches!(self, Self::Client(ClientError::Aborted { abort: Abort::NO_OBJECT | Abort::NO_SUB_INDEX, .. }))
    }

    /// Returns `true` if what was asked for is wrong, whatever the joint is and does.
    #[must_use]
    pub const fn is_usage(&self) -> bool {
        matches!(
            self,
            Self::UnknownName { .. }
                | Self::AmbiguousName { .. }
                | Self::Record { .. }
                | Self::Value { .. }
                | Self::Range { .. }
        ) || matches!(self, Self::Client(ClientError::NodeId(_)) | Self::Bus(BusError::Malformed { .. }))
    }
}

/// Reason for which something did not happen.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RemoteError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The node, or the way to it.
    #[error(transparent)]
    Client(#[from] ClientError),
    /// Owned joint: only its owner may do that.
    #[error("node {node}: only the owner of key {number:08x} may do that; {problem}")]
    Owned {
        /// Node id.
        node: u8,
        /// Number of the joint's key.
        number: u32,
        /// Missing part.
        problem: String,
    },
    /// Silent node, or nobody has this node id. Many nodes send nothing unless they are asked.
    #[error("{0} `jointctl scan` asks every node id")]
    Silent(ClientError),
    /// A node that is something else.
    #[error("node {node} is no joint: its device type (1000h) is {device_type:08X}h, a joint's is {expected:08X}h")]
    NoJoint {
        /// Node id.
        node: u8,
        /// Device type that it states.
        device_type: u32,
        /// Device type of a joint.
        expected: u32,
    },
    /// No object has this name.
    #[error("'{name}' is no object of a joint{}", suggestion(near))]
    UnknownName {
        /// Name that was asked for.
        name: String,
        /// Names that are like it.
        near: Vec<String>,
    },
    /// Several objects have this name.
    #[error("'{name}' is the name of several objects: {}", names.join(", "))]
    AmbiguousName {
        /// Name that was asked for.
        name: String,
        /// Their full names.
        names: Vec<String>,
    },
    /// A record, where one of its entries is meant.
    #[error("'{name}' is a record; its entries are {}", names.join(", "))]
    Record {
        /// Name that was asked for.
        name: String,
        /// Its entries.
        names: Vec<String>,
    },
    /// A value that the object does not take.
    #[error("{object}: {problem}")]
    Value {
        /// The object, with its index.
        object: String,
        /// Reason.
        problem: String,
    },
    /// A setting that does not fit the others.
    #[error(
        "node {node}: {setting} of {} is outside {} to {}, with the other settings as they are; nothing was changed",
        Short(*value), Short(*low), Short(*high)
    )]
    Setting {
        /// Node id.
        node: u8,
        /// Its name.
        setting: String,
        /// Value that was asked for.
        value: f64,
        /// Least that is possible.
        low: f64,
        /// Greatest that is possible.
        high: f64,
    },
    /// Staged settings that somebody has not taken.
    #[error(
        "node {node}: settings were staged and neither taken nor forgotten; `jointctl set configuration.command 2` forgets them"
    )]
    Staged {
        /// Node id.
        node: u8,
    },
    /// Armed joint: not while the motor may be under current.
    #[error("node {node}: {what} is possible with the motor off only, and the joint is {}; `jointctl disable` switches it off", super::condition::name(*state))]
    Armed {
        /// Node id.
        node: u8,
        /// Name of what was asked for.
        what: &'static str,
        /// The joint's state.
        state: State,
    },
    /// A fault has to be acknowledged.
    #[error(
        "node {node} is in a fault: {}. Once its cause is gone, `jointctl enable --reset` acknowledges it",
        super::condition::list(faults)
    )]
    Fault {
        /// Node id.
        node: u8,
        /// The latched faults.
        faults: Vec<Fault>,
    },
    /// The joint does not get to where it was told to go.
    #[error("node {node} is {}, and did not become {} within {within_ms} ms", super::condition::name(*state), super::condition::name(*wanted))]
    State {
        /// Node id.
        node: u8,
        /// State in which it is.
        state: State,
        /// State in which it should be.
        wanted: State,
        /// Time for which it was waited for, ms.
        within_ms: u64,
    },
    /// A joint that is not enabled because of what it has, or has not, stored.
    #[error(
        "node {node} is not enabled: the configuration that it had stored is damaged or refused, and another one is in use. Look at it \
         (`jointctl info`) and set what is wrong; then `jointctl store` keeps it, or `jointctl restore` the defaults"
    )]
    ConfigurationLost {
        /// Node id.
        node: u8,
    },
    /// The joint stopped by itself.
    #[error("node {node} stopped following its commands: it is {}{}", super::condition::name(*state), fault_list(faults))]
    Stopped {
        /// Node id.
        node: u8,
        /// State in which it is.
        state: State,
        /// The latched faults.
        faults: Vec<Fault>,
    },
    /// Another master that tells the joint what to do.
    #[error(
        "another client sends set-points to node {node} (identifier {identifier:03X}h); the joint was disabled. Stop that client first"
    )]
    OtherMaster {
        /// Node id.
        node: u8,
        /// Identifier of the foreign frame.
        identifier: u16,
    },
    /// Another client that commands the joint already.
    #[error(
        "another client sends set-points to node {node} (identifier {identifier:03X}h); nothing was commanded. Stop that client first"
    )]
    Commanded {
        /// Node id.
        node: u8,
        /// Identifier of the foreign frame.
        identifier: u16,
    },
    /// A joint that does not answer SYNC.
    #[error("node {node}: no samples within {within_ms} ms")]
    NoSamples {
        /// Node id.
        node: u8,
        /// Time for which they were waited for, ms.
        within_ms: u64,
    },
    /// Two producers of SYNC.
    #[error("another client sends SYNC on the bus of node {node}; stop it, or follow it (`jointctl record --follow`)")]
    OtherSync {
        /// Node id.
        node: u8,
    },
    /// The node is not where PDOs count.
    #[error("node {node} is {state:?}, and did not become {wanted:?} within {within_ms} ms")]
    Nmt {
        /// Node id.
        node: u8,
        /// Its NMT state.
        state: NmtState,
        /// The NMT state that was asked for.
        wanted: NmtState,
        /// Time for which it was waited for, ms.
        within_ms: u64,
    },
    /// Beyond a limit of the joint.
    #[error(
        "{what} of {} {unit} is outside {} to {} {unit}, the limits of node {node} ({object})",
        Short(*value), Short(*low), Short(*high)
    )]
    Limit {
        /// Node id.
        node: u8,
        /// Name of what was asked for.
        what: &'static str,
        /// Value of it.
        value: f64,
        /// Lowest.
        low: f64,
        /// Highest.
        high: f64,
        /// Unit of these.
        unit: &'static str,
        /// The objects that say so.
        object: String,
    },
    /// The joint does not take an image a step further.
    #[error("node {node} does not {step} the image: {text} (refusal {code:04X}h). {unchanged}")]
    Refused {
        /// Node id.
        node: u8,
        /// Name of the step.
        step: &'static str,
        /// Number of the reason, object 2212h:3.
        code: u16,
        /// The reason.
        text: String,
        /// Image that is still in use, in words.
        unchanged: String,
    },
    /// Another error of an image.
    #[error("node {node}: {problem}")]
    Image {
        /// Node id.
        node: u8,
        /// Problem.
        problem: String,
    },
    /// More signals than TPDOs carry.
    #[error("{signals} signals of {bits} bits do not fit into {} TPDOs of 64 bits", canopen_node::PDOS)]
    TooManySignals {
        /// Number of signals.
        signals: usize,
        /// Their lengths together.
        bits: u32,
    },
    /// A time or rate that makes no sense.
    #[error("{what} is {} {unit}, must lie in {} to {} {unit}", Short(*value), Short(*low), Short(*high))]
    Range {
        /// Name of the quantity.
        what: &'static str,
        /// Value of it.
        value: f64,
        /// Least.
        low: f64,
        /// Most.
        high: f64,
        /// Unit of these.
        unit: &'static str,
    },
    /// Node ids have run out.
    #[error("no node id from {first} to 127 is free for the joint with {address}")]
    NoFreeId {
        /// First node id that was looked for.
        first: u8,
        /// LSS address.
        address: String,
    },
}

fn suggestion(near: &[String]) -> String {
    match near {
        [] => "; `jointctl get --list` names them all".into(),
        [one] => format!("; did you mean {one}?"),
        [rest @ .., last] => format!("; did you mean {} or {last}?", rest.join(", ")),
    }
}

fn fault_list(faults: &[Fault]) -> String {
    if faults.is_empty() { String::new() } else { format!(", {}", super::condition::list(faults)) }
}
