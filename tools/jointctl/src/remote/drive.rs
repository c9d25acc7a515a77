//! State machine of a joint: its state, its faults, and what changes them; host.

use super::condition::{faults_of, state_of};
use super::error::RemoteError;
use super::joint::RemoteJoint;
use bus::client::{ClientError, Command, NmtState, Target};
use joint_firmware::joint::fault::Fault;
use joint_firmware::joint::state_machine::State;
use joint_firmware::objects::field::{Actual, Field, StorageField};
use std::time::{Duration, Instant};

/// Longest time in which a joint has to brake: the longest braking time of a configuration.
pub(super) const BRAKING: Duration = Duration::from_secs(11);
/// Time between two looks at a node.
pub(super) const LOOK: Duration = Duration::from_millis(5);

impl RemoteJoint {
    /// State of the state machine.
    pub fn state(&self) -> Result<State, RemoteError> {
        Ok(state_of(self.raw(Field::Actual(Actual::Statusword))? as u16))
    }

    /// Faults since the last acknowledgement.
    pub fn faults(&self) -> Result<Vec<Fault>, RemoteError> {
        Ok(faults_of(self.raw(Field::Actual(Actual::LatchedFaults))? as u16))
    }

    /// Refuses where the configuration in use is not the one that was stored last: the joint would not be enabled.
    pub fn require_configuration(&self) -> Result<(), RemoteError> {
        match self.raw(Field::Storage(StorageField::Damaged))? & 2 {
            0 => Ok(()),
            _ => Err(RemoteError::ConfigurationLost { node: self.id() }),
        }
    }

    /// Refuses where the motor may be under current.
    pub fn require_off(&self, what: &'static str) -> Result<(), RemoteError> {
        match self.state()? {
            State::NotReadyToSwitchOn | State::SwitchOnDisabled | State::Fault => Ok(()),
            state => Err(RemoteError::Armed { node: self.id(), what, state }),
        }
    }

    /// Waits for a state; a fault, where it is not waited for, ends the waiting.
    pub fn await_state(&self, wanted: State, timeout: Duration) -> Result<(), RemoteError> {
        let began = Instant::now();
        loop {
            let state = self.state()?;
            if state == wanted {
                return Ok(());
            }
            if state == State::Fault {
                return Err(RemoteError::Fault { node: self.id(), faults: self.faults()? });
            }
            if began.elapsed() > timeout {
                let within_ms = timeout.as_millis() as u64;
                return Err(RemoteError::State { node: self.id(), state, wanted, within_ms });
            }
            std::thread::sleep(LOOK);
        }
    }

    /// Sends an NMT command and makes sure that it acted. In PRE-OPERATIONAL and STOPPED a joint brakes and switches
    /// off by itself.
    pub fn nmt(&self, command: Command, wanted: NmtState) -> Result<(), RemoteError> {
        let heartbeats = self.network().heartbeats();
        let node = self.id();
        self.network().command(command, Target::Node(node))?;
        // A node without heartbeats does not tell its state; its answers to SDO at least come after the command.
        let period = u16::from_le_bytes(self.node().number(0x1017, 0)?);
        if period == 0 {
            return Ok(());
        }
        let deadline = Instant::now() + self.network().patience() + Duration::from_millis(period.into());
        let mut last = None;
        while let Some(received) = heartbeats.next(deadline.saturating_duration_since(Instant::now()))? {
            match bus::client::heartbeat::parse(&received.frame) {
                Some((from, state)) if from == node && state == wanted => return Ok(()),
                Some((from, state)) if from == node => last = Some(state),
                _ => {}
            }
        }
        let state = last.unwrap_or(NmtState::Initialising);
        Err(RemoteError::Nmt {
            node,
            state,
            wanted,
            within_ms: self.network().patience().as_millis() as u64 + u64::from(period),
        })
    }

    /// Brakes and switches off, whoever commands the joint: outside OPERATIONAL no set-point counts. The state that it
    /// ends in: [`State::SwitchOnDisabled`], or [`State::Fault`] where there is one: a joint that brakes for longer
    /// than its command deadline has one. [`Stream::end`](super::Stream::end) brakes without.
    pub fn disable(&self) -> Result<State, RemoteError> {
        let began = Instant::now();
        let disturbed = |error: &RemoteError| {
            matches!(error, RemoteError::Client(ClientError::OtherClient { .. })) && began.elapsed() < BRAKING
        };
        match self.nmt(Command::EnterPreOperational, NmtState::PreOperational) {
            // It was sent; what was disturbed is the question after it.
            Err(error) if disturbed(&error) => {}
            sent => sent?,
        }
        loop {
            let state = match self.state() {
                // A joint is not left half braked because somebody else asks it something.
                Err(error) if disturbed(&error) => {
                    std::thread::sleep(LOOK);
                    continue;
                }
                state => state?,
            };
            match state {
                State::SwitchOnDisabled | State::Fault | State::NotReadyToSwitchOn => return Ok(state),
                _ if began.elapsed() > BRAKING => {
                    let (wanted, within_ms) = (State::SwitchOnDisabled, BRAKING.as_millis() as u64);
                    return Err(RemoteError::State { node: self.id(), state, wanted, within_ms });
                }
                _ => std::thread::sleep(LOOK),
            }
        }
    }
}
