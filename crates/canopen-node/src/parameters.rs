//! Communication parameters as plain values: defaults, and what object 1010h stores; the task's context.

use super::pdo::MappedObject;

/// Number of RPDOs, and of TPDOs.
pub const PDOS: usize = 4;
/// Objects that one PDO may carry.
pub const MAPPED: usize = 8;
/// Nodes that object 1016h can monitor.
pub const CONSUMERS: usize = 4;

/// The highest that the SYNC counter may reach, object 1019h.
pub(super) const HIGHEST_COUNTER: u8 = 240;
/// "Does not exist" in the COB-ID of a PDO or of EMCY.
pub(super) const INVALID: u32 = 1 << 31;
/// "No remote request" in the COB-ID of a TPDO; always set here.
pub(super) const NO_REMOTE: u32 = 1 << 30;

/// One PDO: objects 1400h+n and 1600h+n, or 1800h+n and 1A00h+n.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PdoParameters {
    /// Sub-index 1. Bit 31: the PDO does not exist.
    pub cob_id: u32,
    /// Sub-index 2: 0 to 240 with SYNC, 254 and 255 by event.
    pub transmission: u8,
    /// Sub-index 3 of a TPDO: least distance of two events, 100 us.
    pub inhibit: u16,
    /// Sub-index 5, ms: a TPDO is sent at least so often; an RPDO has to arrive so often. 0 is never.
    pub event_timer: u16,
    /// Sub-index 6 of a TPDO: SYNC counter from which on its SYNCs count, 1 to 240; 0: from any.
    pub sync_start: u8,
    /// Sub-index 0 of the mapping.
    pub count: u8,
    /// Sub-indices 1 to 8 of the mapping.
    pub mapping: [MappedObject; MAPPED],
}

impl PdoParameters {
    /// A PDO that exists, by event, without timers; objects after the eighth are left out.
    pub fn new(cob_id: u16, mapping: &[MappedObject]) -> Self {
        let mut parameters = Self { cob_id: cob_id.into(), ..Self::unused(cob_id) };
        for (slot, object) in parameters.mapping.iter_mut().zip(mapping) {
            *slot = *object;
            parameters.count = parameters.count.saturating_add(1);
        }
        parameters
    }

    /// A PDO that does not exist, but has this identifier once it does.
    pub const fn unused(cob_id: u16) -> Self {
        Self {
            cob_id: INVALID | cob_id as u32,
            transmission: 255,
            inhibit: 0,
            event_timer: 0,
            sync_start: 0,
            count: 0,
            mapping: [MappedObject(0); MAPPED],
        }
    }
}

/// All communication parameters that a client can change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommunicationParameters {
    /// 1005h.
    pub sync_cob_id: u32,
    /// 1014h. Bit 31: no EMCY.
    pub emergency_cob_id: u32,
    /// 1015h: least distance of two EMCYs, 100 us.
    pub emergency_inhibit: u16,
    /// 1016h: node id in bits 16 to 22, ms in bits 0 to 15.
    pub consumers: [u32; CONSUMERS],
    /// 1017h: distance of two heartbeats, ms; 0 is none.
    pub heartbeat: u16,
    /// 1019h: the value behind which the SYNC counter begins anew at 1, 2 to 240; 0: SYNC has no counter.
    pub sync_overflow: u8,
    /// 1020h:1 and 2: date and time of the configuration, as its tool counts them; 0 where it is another one.
    pub verification: [u32; 2],
    /// 1029h:1: on a communication error 0 leaves OPERATIONAL for PRE-OPERATIONAL, 1 changes nothing, 2 stops.
    pub error_behaviour: u8,
    /// RPDOs.
    pub receive: [PdoParameters; PDOS],
    /// TPDOs.
    pub transmit: [PdoParameters; PDOS],
}

impl CommunicationParameters {
    /// The predefined connection set of CiA 301 section 7.3.3: its identifiers, no heartbeat, and no PDO exists yet.
    pub fn predefined(node_id: u8) -> Self {
        let pdo = |base: u16| PdoParameters::unused(base.saturating_add(node_id.into()));
        Self {
            sync_cob_id: 0x80,
            emergency_cob_id: 0x80 + u32::from(node_id),
            emergency_inhibit: 0,
            consumers: [0; CONSUMERS],
            heartbeat: 0,
            sync_overflow: 0,
            verification: [0; 2],
            error_behaviour: 0,
            receive: [0x200, 0x300, 0x400, 0x500].map(pdo),
            transmit: [0x180, 0x280, 0x380, 0x480].map(pdo),
        }
    }
}

/// Returns `true` if a client may choose this identifier: 11 bits, and none that CiA 301 table 40 restricts.
pub(super) const fn is_free(cob_id: u32) -> bool {
    !matches!(
        cob_id,
        0..=0x07F | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x7FF | 0x800..
    )
}

/// Returns `true` if this node id can be used on the bus.
pub(super) const fn is_node_id(node_id: u8) -> bool {
    node_id >= 1 && node_id <= 127
}
