//! Network management: states and commands of CiA 301 section 7.3.2; any context.

/// NMT state, with the number that a heartbeat carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum NmtState {
    /// State from reset until the boot-up message; also that of a node without a node id. Its number is the boot-up
    /// message's data byte.
    Initialising = 0x00,
    /// NMT, heartbeat and LSS alone.
    Stopped = 0x04,
    /// All services.
    Operational = 0x05,
    /// All services but PDOs and SYNC.
    PreOperational = 0x7F,
}

impl NmtState {
    /// The state that a byte stands for; the toggle bit of node guarding is not looked at.
    pub const fn from_byte(byte: u8) -> Self {
        match byte & 0x7F {
            0x04 => Self::Stopped,
            0x05 => Self::Operational,
            0x7F => Self::PreOperational,
            _ => Self::Initialising,
        }
    }

    /// Returns `true` if SDO and EMCY exist in this state (CiA 301 table 39).
    pub const fn communicates(self) -> bool {
        matches!(self, Self::Operational | Self::PreOperational)
    }
}

/// Scope of a reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reset {
    /// The communication parameters get their power-on values.
    Communication,
    /// The application, too.
    Node,
}

/// A command of the NMT master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Command {
    Enter(NmtState),
    Reset(Reset),
}

impl Command {
    /// The command of an NMT message for node `node_id`, itself 1 to 127. CiA 301 section 7.2.8.3.1.
    pub(super) const fn parse(data: &[u8], node_id: u8) -> Option<Self> {
        let &[command, node] = data else { return None };
        if node != 0 && node != node_id {
            return None;
        }
        Some(match command {
            0x01 => Self::Enter(NmtState::Operational),
            0x02 => Self::Enter(NmtState::Stopped),
            0x80 => Self::Enter(NmtState::PreOperational),
            0x81 => Self::Reset(Reset::Node),
            0x82 => Self::Reset(Reset::Communication),
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_are_for_this_node_or_for_all() {
        assert_eq!(Command::parse(&[2, 5], 5), Some(Command::Enter(NmtState::Stopped)));
        assert_eq!(Command::parse(&[2, 0], 5), Some(Command::Enter(NmtState::Stopped)));
        for length in [0, 1, 3, 8] {
            assert_eq!(Command::parse(&[2, 5, 0, 0, 0, 0, 0, 0][..length], 5), None, "{length} bytes are no command");
        }
        assert_eq!(Command::parse(&[2, 6], 5), None);
        assert_eq!(Command::parse(&[2], 5), None);
        assert_eq!(Command::parse(&[3, 5], 5), None);
    }

    #[test]
    fn a_state_is_the_number_of_its_heartbeat() {
        use NmtState::*;
        for state in [Initialising, Stopped, Operational, PreOperational] {
            assert_eq!(NmtState::from_byte(state as u8), state);
        }
    }
}
