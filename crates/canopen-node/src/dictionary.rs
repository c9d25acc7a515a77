//! Interface of the application to the server: its objects, its identity, what it keeps in flash; the task's context.

use super::abort::Abort;
use super::nmt::{NmtState, Reset};
use super::parameters::CommunicationParameters;

/// Access of an SDO client to an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read access only; constant or not.
    ReadOnly,
    /// Write access only.
    WriteOnly,
    /// Both.
    ReadWrite,
}

/// Length of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Length {
    /// A number of 1 to 8 bytes. It is read and written whole, however many frames it takes.
    Value(u8),
    /// A string or a DOMAIN: streamed in pieces, neither buffered nor copied by the server.
    Stream {
        /// Bytes that a read would give now.
        readable: u32,
        /// Bytes that a write may have at most.
        writable: u32,
    },
}

/// Permission to map an entry into a PDO, by direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mappable {
    /// RPDO: the process image can take it in the receive interrupt.
    pub receive: bool,
    /// TPDO.
    pub transmit: bool,
}

/// Attributes of one entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Length of the entry.
    pub length: Length,
    /// Access of an SDO client.
    pub access: Access,
    /// Permission to map it into a PDO; streams never are.
    pub mappable: Mappable,
}

/// Group of parameters that objects 1010h and 1011h mean: their sub-index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Sub-index 1.
    All,
    /// Sub-index 2: 1000h to 1FFFh.
    Communication,
    /// Sub-index 3: 2000h to 9FFFh.
    Application,
}

/// Event that the task tells the application.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// The NMT state changed. Every set-point that came by PDO is invalid from here on.
    State(NmtState),
    /// The NMT master resets. After [`Reset::Node`] the application restarts itself; if it returns, communication
    /// starts anew.
    Reset(Reset),
    /// A node that object 1016h monitors fell silent. Reported as EMCY 8130h, too, and object 1029h decides about the
    /// NMT state.
    HeartbeatLost {
        /// Its node id.
        node: u8,
    },
    /// Return of a lost heartbeat.
    HeartbeatBack {
        /// Its node id.
        node: u8,
    },
    /// RPDO `0`..`3` did not arrive within its event timer (sub-index 5). Reported as EMCY 8250h, too.
    RpdoDeadline {
        /// Number of the RPDO, 0 to 3.
        pdo: u8,
    },
}

/// Objects 1000h, 1008h to 100Ah and 1018h. The last is also the 128-bit LSS address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity<'a> {
    /// 1000h.
    pub device_type: u32,
    /// 1008h.
    pub device_name: &'a str,
    /// 1009h.
    pub hardware_version: &'a str,
    /// 100Ah.
    pub software_version: &'a str,
    /// 1018h:1.
    pub vendor: u32,
    /// 1018h:2.
    pub product: u32,
    /// 1018h:3.
    pub revision: u32,
    /// 1018h:4.
    pub serial: u32,
}

impl Identity<'_> {
    /// Number 0 to 3 of the LSS address; none for others.
    pub(super) const fn number(&self, number: u8) -> Option<u32> {
        Some(match number {
            0 => self.vendor,
            1 => self.product,
            2 => self.revision,
            3 => self.serial,
            _ => return None,
        })
    }
}

/// The application's objects. The server serves the communication objects itself and asks here for every other one.
///
/// One value or one stream is written at a time. Reads of a stream may interleave with nothing but other reads.
pub trait ObjectDictionary {
    /// Attributes of an entry. [`Abort::NO_OBJECT`] and [`Abort::NO_SUB_INDEX`] are the usual errors.
    fn entry(&self, index: u16, sub_index: u8) -> Result<Entry, Abort>;

    /// Fills all of `out` from byte `offset` on, little endian. A value is read at once, from offset 0; a stream in
    /// any pieces within the length that [`ObjectDictionary::entry`] told when the transfer began. Where a segment was
    /// lost, the same bytes are read again and must still be the same: refuse once they are not
    /// ([`Abort::DEVICE_STATE`]).
    fn read(&mut self, index: u16, sub_index: u8, offset: u32, out: &mut [u8]) -> Result<(), Abort>;

    /// Sets a value: all of its bytes, little endian. An error changes nothing.
    fn write(&mut self, index: u16, sub_index: u8, value: &[u8]) -> Result<(), Abort>;

    /// A stream is going to be written, of `length` bytes where the client said so. An error refuses it, and that was
    /// all.
    fn open(&mut self, index: u16, sub_index: u8, length: Option<u32>) -> Result<(), Abort>;

    /// The next bytes of the open stream, of which `offset` came before. Together never more than announced or
    /// writable.
    fn append(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Abort>;

    /// The open stream is whole: length and, where used, CRC are right. An error is followed by
    /// [`ObjectDictionary::abandon`].
    fn finish(&mut self) -> Result<(), Abort>;

    /// The open stream will not be finished: the client, a time-out, an error or the NMT state ended it.
    fn abandon(&mut self);

    /// Object 1010h: makes `group` outlast a reset. `communication` are the parameters as they are now.
    fn store(&mut self, group: Group, communication: &CommunicationParameters) -> Result<(), Abort>;

    /// Object 1011h: lets `group` be the defaults after the next reset.
    fn restore(&mut self, group: Group) -> Result<(), Abort>;

    /// True where an object that [`ObjectDictionary::store`] makes outlast a reset has changed since the last call.
    fn has_changed(&mut self) -> bool {
        false
    }

    /// LSS: whether the node id may be changed now.
    fn may_change_node_id(&self) -> bool {
        true
    }

    /// LSS: keeps the node id, 1 to 127 or 255, over a loss of power. [`Abort::LOCAL_CONTROL`]: for the owner alone.
    fn store_node_id(&mut self, node_id: u8) -> Result<(), Abort>;

    /// Communication parameters at power-on for a node id of 1 to 127: the stored ones, or the defaults.
    fn communication_parameters(&self, node_id: u8) -> CommunicationParameters;

    /// Tells the application an event; see [`Event`].
    fn event(&mut self, event: Event);
}
