//! Errors as EMCY messages: which code, which bits of the error register; the task.

use super::number::to_u16;
use super::observed::{Observed, fault_bits, reason_number};
use crate::hardware::GateDriver;
use crate::joint::configuration::CollisionReaction;
use crate::joint::fault::{Fault, Faults};
use friction_compensation::parameters::life_cycle::Refusal;

/// The joint left the range that its friction was learned in. Information: [`reason`](super::table), number of
/// departures (u16).
pub const ENVELOPE: u16 = 0xFF01;
/// Friction is no more what the image says, as adaptation has found. Information: friction factor and its deviation in
/// thousandths (u16 each).
pub const MISFIT: u16 = 0xFF03;
/// Collision: an external torque beyond uncertainty and threshold. Information: that torque, Nm (REAL32).
pub const COLLISION: u16 = 0xFF04;
/// An image with a wrong tag, or none, or for a joint whose key is damaged. Information: code of the refusal (u16).
pub const AUTHENTICATION: u16 = 0xFF02;
/// An image was refused for another reason. Information: code of the refusal (u16).
pub const PARAMETER: u16 = 0x6320;
/// Flash could not be written or read. Information: code of the refusal (u16).
pub const FLASH: u16 = 0x5530;
/// The watchdog had to reset the program. Information: object 2301h:1, 0.
pub const WATCHDOG: u16 = 0x6010;
/// The program stopped by itself before this start. Information: object 2301h:1 and 2.
pub const STOPPED: u16 = 0x6100;
/// Stored parameters are damaged, and what was stored before, or the defaults, are in use. Information: bits: 0
/// friction images, 1 configuration (the joint is not enabled then), 2 key.
pub const LOST: u16 = 0x6310;
/// Bit of the error register for them: the manufacturer's.
pub(super) const LOST_BIT: u8 = 1 << 7;
/// No error any more.
const RESET: u16 = 0;
/// A joint that wanders along the edge of the range reports it once in this time, ms.
const ENVELOPE_QUIET: u64 = 1_000;

/// Emergency for [`Server::emergency`](canopen_node::Server::emergency).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emergency {
    /// Error code.
    pub code: u16,
    /// All bits of the error register that are set from now on.
    pub register: u8,
    /// The manufacturer's field.
    pub information: [u8; 5],
}

/// The bit of the error register, CiA 301 section 7.5.2.2.
const fn register_bit(fault: Fault) -> u8 {
    match fault {
        Fault::OverCurrent | Fault::CurrentSensor | Fault::CurrentNotFollowed => 1 << 1,
        Fault::OverVoltage | Fault::UnderVoltage => 1 << 2,
        Fault::BridgeTemperature | Fault::WindingTemperature | Fault::TemperatureSensor => 1 << 3,
        Fault::StaleCommand => 1 << 4,
        Fault::EncoderLost | Fault::EncoderJump | Fault::EncoderImplausible => 1 << 5,
        Fault::OverSpeed | Fault::PositionLimit => 1 << 5,
        Fault::Overrun | Fault::BridgeDriver => 1 << 7,
    }
}

fn register(faults: Faults) -> u8 {
    faults.iter().fold(0, |register, fault| register | register_bit(fault))
}

/// Reports made so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Reports {
    faults: Faults,
    violations: u16,
    quiet_until: u64,
    misfits: bool,
    collisions: u16,
}

impl Reports {
    /// The next thing to report: a fault that is new, the end of all, a departure from the trained range, an image that
    /// no more fits. Information of a fault: its
    /// number, and the bits of object 2021h:4 (u16); of the gate driver's: its number, and both its status words (u16
    /// each), for which it waits.
    pub(super) fn next(&mut self, observed: &Observed, driver: &GateDriver, now: u64) -> Option<Emergency> {
        let latched = observed.latched;
        if latched.is_empty() && !self.faults.is_empty() {
            self.faults = Faults::NONE;
            return Some(Emergency { code: RESET, register: 0, information: [0; 5] });
        }
        let waits = |fault: &Fault| *fault == Fault::BridgeDriver && driver.unread;
        let new = |fault: &Fault| !(self.faults.contains(*fault) || waits(fault));
        if let Some(fault) = latched.iter().find(new) {
            self.faults.set(fault, true);
            let words = if fault == Fault::BridgeDriver { driver.status } else { [fault_bits(latched), 0] };
            let [[a, b], [c, d]] = words.map(u16::to_le_bytes);
            let information = [fault as u8, a, b, c, d];
            return Some(Emergency { code: fault.error_code(), register: register(latched), information });
        }
        let violations = observed.friction.violations();
        if violations != self.violations && now >= self.quiet_until {
            self.violations = violations;
            self.quiet_until = now.saturating_add(ENVELOPE_QUIET);
            let [low, high] = violations.to_le_bytes();
            let reason = reason_number(observed.telemetry.compensated.output.reason);
            let information = [reason, low, high, 0, 0];
            return Some(Emergency { code: ENVELOPE, register: register(latched), information });
        }
        let misfits = observed.adaptation.misfits();
        if misfits && !self.misfits {
            self.misfits = true;
            let permille = |value: f32| to_u16(1e3 * value).to_le_bytes();
            let [a, b] = permille(observed.adaptation.factors.factor);
            let [c, d] = permille(observed.adaptation.deviation);
            return Some(Emergency { code: MISFIT, register: register(latched), information: [a, b, c, d, 0] });
        }
        self.misfits &= !observed.adaptation.fits();
        let external = observed.external.first()?;
        if core::mem::replace(&mut self.collisions, external.collisions) == external.collisions
            || external.reaction == CollisionReaction::Off
        {
            return None;
        }
        let [a, b, c, d] = external.collided.to_le_bytes();
        Some(Emergency { code: COLLISION, register: register(latched), information: [a, b, c, d, 0] })
    }
}

/// The end of what the manufacturer's bit of the error register told.
pub(super) fn over(latched: Faults) -> Emergency {
    Emergency { code: RESET, register: register(latched), information: [0; 5] }
}

/// EMCY of a refused image.
pub(super) fn of_refusal(refusal: Refusal, latched: Faults) -> Emergency {
    let code = match refusal {
        Refusal::TagMissing | Refusal::TagWrong { .. } | Refusal::KeyDamaged => AUTHENTICATION,
        Refusal::Slots(_) => FLASH,
        _ => PARAMETER,
    };
    let [low, high] = refusal.code().to_le_bytes();
    Emergency { code, register: register(latched), information: [low, high, 0, 0, 0] }
}
