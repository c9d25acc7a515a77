//! Contents of the PDOs of a joint: read, changed and put back; host.

use super::error::RemoteError;
use super::joint::RemoteJoint;
use canopen_node::{MAPPED, MappedObject, PDOS, PdoParameters};

/// "Does not exist" in a PDO's COB-ID.
const INVALID: u32 = 1 << 31;
/// The identifier in a COB-ID.
const IDENTIFIER: u32 = 0x7FF;

/// Direction of a PDO.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// PDO to the joint.
    Receive,
    /// PDO from the joint.
    Transmit,
}

/// One of the four PDOs of a direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pdo {
    /// Direction.
    pub direction: Direction,
    /// 0 to 3.
    pub number: u8,
}

impl Pdo {
    /// All of a direction.
    pub fn all(direction: Direction) -> [Self; PDOS] {
        std::array::from_fn(|number| Self { direction, number: number as u8 })
    }

    fn communication(self) -> u16 {
        let base = match self.direction {
            Direction::Receive => 0x1400,
            Direction::Transmit => 0x1800,
        };
        base + u16::from(self.number)
    }

    fn mapping(self) -> u16 {
        self.communication() + 0x200
    }

    /// Parameters that the joint has.
    pub fn read(self, joint: &RemoteJoint) -> Result<PdoParameters, RemoteError> {
        let node = joint.node();
        let (communication, mapping) = (self.communication(), self.mapping());
        let word = |index, sub_index| node.number(index, sub_index).map(u32::from_le_bytes);
        let byte = |index, sub_index| node.number(index, sub_index).map(u8::from_le_bytes);
        let short = |index, sub_index| node.number(index, sub_index).map(u16::from_le_bytes);
        let mut parameters = PdoParameters {
            cob_id: word(communication, 1)? & (INVALID | IDENTIFIER),
            transmission: byte(communication, 2)?,
            inhibit: match self.direction {
                Direction::Receive => 0,
                Direction::Transmit => short(communication, 3)?,
            },
            event_timer: short(communication, 5)?,
            // Not every joint has it, and nothing here changes it: what `write` leaves alone stays.
            sync_start: 0,
            count: byte(mapping, 0)?,
            mapping: [MappedObject(0); MAPPED],
        };
        for (place, sub_index) in parameters.mapping.iter_mut().zip(1..=parameters.count) {
            *place = MappedObject(word(mapping, sub_index)?);
        }
        Ok(parameters)
    }

    /// Changes it, in the order that CiA 301 demands: out of service, mapping, back into service. The identifier is
    /// free to choose.
    pub fn write(self, joint: &RemoteJoint, parameters: &PdoParameters) -> Result<(), RemoteError> {
        let node = joint.node();
        let (communication, mapping) = (self.communication(), self.mapping());
        let cob_id = parameters.cob_id & (INVALID | IDENTIFIER);
        node.download(communication, 1, &(INVALID | cob_id).to_le_bytes())?;
        node.download(mapping, 0, &[0])?;
        for (object, sub_index) in objects(parameters).zip(1..) {
            node.download(mapping, sub_index, &object.0.to_le_bytes())?;
        }
        node.download(mapping, 0, &[parameters.count])?;
        node.download(communication, 2, &[parameters.transmission])?;
        if self.direction == Direction::Transmit {
            node.download(communication, 3, &parameters.inhibit.to_le_bytes())?;
        }
        node.download(communication, 5, &parameters.event_timer.to_le_bytes())?;
        if cob_id & INVALID == 0 {
            node.download(communication, 1, &cob_id.to_le_bytes())?;
        }
        Ok(())
    }

    /// Changes it where it is not as wanted; what it was before, to be put back. An identifier that somebody chose
    /// stays.
    pub fn ensure(self, joint: &RemoteJoint, wanted: &PdoParameters) -> Result<Change, RemoteError> {
        let before = self.read(joint)?;
        let cob_id = if in_service(&before) { before.cob_id } else { wanted.cob_id };
        let wanted = PdoParameters { cob_id, ..*wanted };
        if !same(&before, &wanted)
            && let Err(error) = self.write(joint, &wanted)
        {
            // Half a mapping is none; the error that is reported is the first one.
            let _ = self.write(joint, &before);
            return Err(error);
        }
        Ok(Change { pdo: self, before, now: wanted })
    }
}

/// True for a PDO that exists.
pub fn in_service(parameters: &PdoParameters) -> bool {
    parameters.cob_id & INVALID == 0
}

fn same(a: &PdoParameters, b: &PdoParameters) -> bool {
    let plain = |parameters: &PdoParameters| PdoParameters { mapping: [MappedObject(0); MAPPED], ..*parameters };
    plain(a) == plain(b) && objects(a).eq(objects(b))
}

/// The objects that a PDO carries.
pub fn objects(parameters: &PdoParameters) -> impl Iterator<Item = MappedObject> {
    parameters.mapping.into_iter().take(parameters.count.into())
}

/// A PDO that was changed, or found to be right.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    pdo: Pdo,
    before: PdoParameters,
    now: PdoParameters,
}

impl Change {
    /// Parameters that it has now.
    pub fn parameters(&self) -> &PdoParameters {
        &self.now
    }

    /// Identifier of its frames.
    pub fn identifier(&self) -> u16 {
        (self.now.cob_id & IDENTIFIER) as u16
    }

    /// Puts back what was there before.
    pub fn undo(&self, joint: &RemoteJoint) -> Result<(), RemoteError> {
        if same(&self.before, &self.now) { Ok(()) } else { self.pdo.write(joint, &self.before) }
    }
}

/// The values in a PDO's content, in the order of its mapping; those that do not fit into `data` are left out.
pub fn unpack(parameters: &PdoParameters, data: &[u8]) -> impl Iterator<Item = (MappedObject, u64)> {
    let content = data.iter().rev().fold(0u64, |content, byte| content << 8 | u64::from(*byte));
    let length = 8 * data.len() as u32;
    let mut at = 0;
    objects(parameters).map_while(move |object| {
        let (from, bits) = (at, object.bits());
        at += bits;
        let value = content.checked_shr(from).unwrap_or(0) & mask(bits);
        (at <= length).then_some((object, value))
    })
}

/// A PDO's content, of the values that `value` gives for its objects.
pub fn pack(parameters: &PdoParameters, mut value: impl FnMut(MappedObject) -> u64) -> Vec<u8> {
    let (mut content, mut at) = (0u64, 0);
    for object in objects(parameters) {
        content |= (value(object) & mask(object.bits())).checked_shl(at).unwrap_or(0);
        at += object.bits();
    }
    content.to_le_bytes().into_iter().take(at.div_ceil(8) as usize).collect()
}

fn mask(bits: u32) -> u64 {
    1u64.checked_shl(bits).map_or(u64::MAX, |above| above - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_packed_comes_out_again(values in proptest::collection::vec((0u8..4, any::<u64>()), 0..8)) {
            let lengths = values.iter().map(|(length, _)| 8 << length).collect::<Vec<u8>>();
            prop_assume!(lengths.iter().map(|bits| u32::from(*bits)).sum::<u32>() <= 64);
            let mapping: Vec<_> = lengths.iter().zip(1..).map(|(bits, sub)| MappedObject::new(0x2000, sub, *bits)).collect();
            let parameters = PdoParameters::new(0x181, &mapping);
            let given = |object: MappedObject| values[usize::from(object.sub_index()) - 1].1;
            let data = pack(&parameters, given);
            prop_assert_eq!(data.len() * 8, lengths.iter().map(|bits| usize::from(*bits)).sum::<usize>());
            let unpacked: Vec<_> = unpack(&parameters, &data).collect();
            prop_assert_eq!(unpacked.len(), values.len());
            for (object, value) in unpacked {
                prop_assert_eq!(value, given(object) & mask(object.bits()));
            }
        }
    }

    #[test]
    fn a_frame_that_is_too_short_gives_only_what_is_whole() {
        let mapping = [MappedObject::new(0x6041, 0, 16), MappedObject::new(0x6064, 0, 32)];
        let parameters = PdoParameters::new(0x181, &mapping);
        assert_eq!(unpack(&parameters, &[1, 2, 3]).collect::<Vec<_>>(), [(mapping[0], 0x0201)]);
    }
}
