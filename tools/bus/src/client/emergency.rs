//! EMCY: CiA 301 section 7.2.7; no I/O, host.

use super::cob_id;
use crate::Frame;
use std::fmt;

/// An error that a node reports, or with code 0 the end of errors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Node id, 1 to 127.
    pub node: u8,
    /// Error code.
    pub code: u16,
    /// Error register (object 1001h) at that moment.
    pub register: u8,
    /// The manufacturer's field.
    pub information: [u8; 5],
}

impl Emergency {
    /// None where the frame is no EMCY of the predefined connection set. A frame that is too short is none.
    pub fn decode(frame: &Frame) -> Option<Self> {
        let node = frame.id().checked_sub(cob_id::EMERGENCY).filter(|node| matches!(node, 1..=127))? as u8;
        let &[low, high, register, a, b, c, d, e] = frame.eight()?;
        Some(Self { node, code: u16::from_le_bytes([low, high]), register, information: [a, b, c, d, e] })
    }

    /// Meaning of the code: CiA 301 table 26 (classes) and the single codes of its text.
    pub fn meaning(&self) -> &'static str {
        match self.code {
            0x8110 => "CAN overrun: objects lost",
            0x8120 => "CAN in error passive mode",
            0x8130 => "life guard or heartbeat error",
            0x8140 => "recovered from bus off",
            0x8150 => "CAN identifier collision",
            0x8210 => "PDO not processed: length error",
            0x8220 => "PDO length exceeded",
            0x8230 => "DAM MPDO not processed: destination object not available",
            0x8240 => "unexpected SYNC data length",
            0x8250 => "RPDO time-out",
            0x1000..=0x10FF => "generic error",
            0x2000..=0x20FF => "current",
            0x2100..=0x21FF => "current, device input side",
            0x2200..=0x22FF => "current inside the device",
            0x2300..=0x23FF => "current, device output side",
            0x3000..=0x30FF => "voltage",
            0x3100..=0x31FF => "mains voltage",
            0x3200..=0x32FF => "voltage inside the device",
            0x3300..=0x33FF => "output voltage",
            0x4000..=0x40FF => "temperature",
            0x4100..=0x41FF => "ambient temperature",
            0x4200..=0x42FF => "device temperature",
            0x5000..=0x50FF => "device hardware",
            0x5500..=0x55FF => "device hardware, data storage",
            0x6000..=0x60FF => "device software",
            0x6100..=0x61FF => "internal software",
            0x6200..=0x62FF => "user software",
            0x6300..=0x63FF => "data set",
            0x7000..=0x70FF => "additional modules",
            0x8000..=0x80FF => "monitoring",
            0x8100..=0x81FF => "communication",
            0x8200..=0x82FF => "protocol error",
            0x9000..=0x90FF => "external error",
            0xF000..=0xF0FF => "additional functions",
            0xFF04 => "collision: external torque beyond its uncertainty and the threshold",
            0xFF00.. => "device specific",
            0x0000..=0x00FF => "error reset or no error",
            _ => "a code that CiA 301 does not list: see the device's manual",
        }
    }

    /// Returns `true` if this is the end of an error.
    pub fn is_reset(&self) -> bool {
        self.code & 0xFF00 == 0
    }
}

impl fmt::Display for Emergency {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { node, code, register, information } = self;
        write!(formatter, "node {node}: EMCY {code:04X}h, {}; error register {register:02X}h", self.meaning())?;
        if *information != [0; 5] {
            write!(formatter, "; {information:02X?}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen_node::emergency::code;

    fn decode(id: u16, data: &[u8]) -> Option<Emergency> {
        Emergency::decode(&Frame::new(id, data).unwrap())
    }

    #[test]
    fn an_emcy_says_who_and_what() {
        let emergency = decode(0x85, &[0x50, 0x82, 0x11, 3, 0, 0, 0, 0]).unwrap();
        assert_eq!((emergency.node, emergency.code, emergency.register), (5, code::PDO_DEADLINE, 0x11));
        assert_eq!(
            emergency.to_string(),
            "node 5: EMCY 8250h, RPDO time-out; error register 11h; [03, 00, 00, 00, 00]"
        );
        assert!(decode(0xFF, &[0; 8]).unwrap().is_reset());
    }

    #[test]
    fn sync_and_short_frames_are_none() {
        assert_eq!(decode(0x80, &[0; 8]), None);
        assert_eq!(decode(0x100, &[0; 8]), None);
        assert_eq!(decode(0x85, &[0; 7]), None);
    }

    #[test]
    fn every_code_of_the_server_has_a_meaning_of_its_own() {
        for code in [
            code::HEARTBEAT,
            code::BUS_OFF,
            code::PDO_SHORT,
            code::PDO_LONG,
            code::PDO_DEADLINE,
            0x5530,
            0x6010,
            0x6100,
            0x6320,
            0xFF01,
            0xFF03,
            0xFF04,
        ] {
            let emergency = Emergency { node: 1, code, register: 0, information: [0; 5] };
            assert!(!emergency.meaning().contains("not list"), "{code:04X}");
        }
    }
}
