//! Velocity of the joint that shares a joint's drive, told to it with its own set-points: the reference's, by RPDO 4,
//! which is made for that (2030h:1); host.

use super::configured;
use super::entry::Entry;
use super::error::RemoteError;
use super::joint::RemoteJoint;
use super::pdo::{Change, Direction, Pdo, in_service, pack};
use bus::Frame;
use canopen_node::MappedObject;
use joint_firmware::objects::default_communication;
use joint_firmware::objects::field::{Field, SetPoint};

/// RPDO of the joint that takes another one's velocity.
const COUPLED: u8 = 3;

/// Messages to a joint about the one that shares its drive. RPDO 4 is put back when this is dropped.
pub(super) struct Partner {
    joint: RemoteJoint,
    change: Change,
    dated: bool,
}

impl Partner {
    /// Puts RPDO 4 of a joint into service for this client. None where somebody has done so: another joint, or another
    /// master, tells the velocity then.
    pub fn begin(joint: &RemoteJoint) -> Result<Option<Self>, RemoteError> {
        let pdo = Pdo { direction: Direction::Receive, number: COUPLED };
        if in_service(&pdo.read(joint)?) {
            return Ok(None);
        }
        let mut wanted = default_communication(joint.id()).receive[usize::from(COUPLED)];
        wanted.cob_id &= 0x7FF;
        let mut change = None;
        let dated = configured::keep(joint, || {
            change = Some(pdo.ensure(joint, &wanted)?);
            Ok(())
        })?;
        Ok(change.map(|change| Self { joint: joint.clone(), change, dated }))
    }

    /// Tells the velocity, rad/s. Where the bus does not take it, it does not take the set-points either, and they say
    /// so.
    pub fn tell(&self, velocity: f32) {
        let value = |object: MappedObject| match Entry::at(object.index(), object.sub_index()) {
            Some(entry) if entry.object.field == Field::SetPoint(SetPoint::CoupledVelocity) => {
                entry.saturate(velocity.into())
            }
            _ => 0,
        };
        if let Some(frame) = Frame::new(self.change.identifier(), &pack(self.change.parameters(), value)) {
            let _ = self.joint.network().send(&frame);
        }
    }
}

impl Drop for Partner {
    fn drop(&mut self) {
        let undo = || self.change.undo(&self.joint);
        // The error that brought us here is what is reported.
        let _ = if self.dated { configured::keep(&self.joint, undo).map(drop) } else { undo() };
    }
}
