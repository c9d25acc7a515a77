//! The table of all objects: index, type, access, mapping, field, and for people name, unit, scale, limits and a line
//! of description.
//!
//! Declared once, in the rooms below, and kept in two statics of the same length: [`OBJECTS`], which the joint itself
//! needs, and [`TEXTS`], which only what runs on a host refers to, so that a board's program does not carry it.
//! Sub-index 0 of a record is made from the record.

mod communication;
mod configuration;
mod friction;
mod image;
mod load;
mod motion;
mod profile;
mod supervision;

use super::field::Field;
use canopen_node::{Access, Mappable};

/// Data types of CiA 301 section 7.4.7, by their index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum DataType {
    /// BOOLEAN, a byte of 0 or 1.
    Bool = 0x01,
    /// INTEGER8.
    I8 = 0x02,
    /// INTEGER16.
    I16 = 0x03,
    /// INTEGER32.
    I32 = 0x04,
    /// UNSIGNED8.
    U8 = 0x05,
    /// UNSIGNED16.
    U16 = 0x06,
    /// UNSIGNED32.
    U32 = 0x07,
    /// REAL32.
    F32 = 0x08,
    /// VISIBLE_STRING.
    Text = 0x09,
    /// DOMAIN.
    Domain = 0x0F,
    /// UNSIGNED64.
    U64 = 0x1B,
}

impl DataType {
    /// Bytes of a value; none for what has no fixed length.
    pub const fn bytes(self) -> Option<u8> {
        Some(match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::U64 => 8,
            Self::Text | Self::Domain => return None,
        })
    }

    /// CiA's name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Bool => "BOOLEAN",
            Self::I8 => "INTEGER8",
            Self::I16 => "INTEGER16",
            Self::I32 => "INTEGER32",
            Self::U8 => "UNSIGNED8",
            Self::U16 => "UNSIGNED16",
            Self::U32 => "UNSIGNED32",
            Self::F32 => "REAL32",
            Self::Text => "VISIBLE_STRING",
            Self::Domain => "DOMAIN",
            Self::U64 => "UNSIGNED64",
        }
    }
}

/// One entry of the dictionary.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Object {
    /// Index.
    pub index: u16,
    /// Sub-index.
    pub sub_index: u8,
    /// Data type.
    pub data_type: DataType,
    /// Access of an SDO client.
    pub access: Access,
    /// PDOs that it may be part of.
    pub mappable: Mappable,
    /// Field that it reads or writes.
    pub field: Field,
}

/// Texts of an entry for people.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Text {
    /// Name of the object: what all its sub-indices share.
    pub object: &'static str,
    /// Name of the entry.
    pub name: &'static str,
    /// Unit of the scaled value; empty where it has none.
    pub unit: &'static str,
    /// One step of the raw value in that unit.
    pub scale: f64,
    /// Lowest and highest value that is taken, in that unit, whatever the other settings are.
    pub limits: Option<(f64, f64)>,
    /// Description of the entry.
    pub description: &'static str,
}

const RO: Access = Access::ReadOnly;
const WO: Access = Access::WriteOnly;
const RW: Access = Access::ReadWrite;
const UNMAPPED: Mappable = Mappable { receive: false, transmit: false };
const RECEIVE: Mappable = Mappable { receive: true, transmit: false };
const TRANSMIT: Mappable = Mappable { receive: false, transmit: true };
/// Every value that the type has.
const ANY: Option<(f64, f64)> = None;

/// Values from `low` to `high`.
const fn within(low: f64, high: f64) -> Option<(f64, f64)> {
    Some((low, high))
}

/// Returns `true` if an object is there for the profile modes, homing or the limits and offsets of a command: not every
/// program has these ([`PROFILES`](crate::joint::PROFILES)).
pub const fn is_of_profiles(object: &Object) -> bool {
    use super::field::{Actual, SetPoint};
    matches!(
        object.field,
        Field::Profile(_)
            | Field::Milli(_)
            | Field::Micro(_)
            | Field::SetPoint(
                SetPoint::ProfileVelocity
                    | SetPoint::ProfileAcceleration
                    | SetPoint::ProfileDeceleration
                    | SetPoint::MaxTorque
                    | SetPoint::PositionOffset
                    | SetPoint::VelocityOffset
            )
            | Field::Actual(Actual::PositionDemand | Actual::FollowingError | Actual::Current | Actual::DcLink)
    )
}

/// Returns `true` if an object is there for the model of the load: not every program has it
/// ([`LOADS`](crate::joint::configuration::LOADS)).
pub const fn is_of_the_load(object: &Object) -> bool {
    matches!(object.index, 0x2202 | 0x2203)
}

/// Returns `true` if an object wants room that not every program has: those of the profile modes, of the load, friction
/// by its parts, the SYNC counter, date and time of the configuration, the log of faults. A program has all of these or
/// none; 6502h tells which ([`Operation::has_profiles`](super::Operation::has_profiles)).
pub const fn wants_room(object: &Object) -> bool {
    let own = matches!((object.index, object.sub_index), (0x1019 | 0x1020 | 0x2022 | 0x2305, _) | (0x1800..=0x19FF, 6));
    own || is_of_profiles(object) || is_of_the_load(object)
}

/// Returns `true` if this program has the row.
const fn is_there(object: &Object) -> bool {
    (crate::joint::PROFILES || !wants_room(object)) && (crate::joint::configuration::LOADS || !is_of_the_load(object))
}

/// Rows of a room.
#[derive(Clone, Copy)]
struct Room {
    objects: &'static [Object],
    texts: &'static [Text],
}

/// Declares a room, one row an entry: sub-index, name, type, access, mapping, field; unit, scale, limits; description.
macro_rules! room {
    ($($index:literal $object:literal {$(
        $sub:literal, $name:literal, $type:ident, $access:expr, $mappable:expr, $field:expr;
        $unit:literal, $scale:expr, $limits:expr; $description:literal
    )+})+) => {
        pub(super) const ROOM: Room = Room {
            objects: &[$($(Object {
                index: $index,
                sub_index: $sub,
                data_type: DataType::$type,
                access: $access,
                mappable: $mappable,
                field: $field,
            }),+),+],
            texts: &[$($(Text {
                object: $object,
                name: $name,
                unit: $unit,
                scale: $scale,
                limits: $limits,
                description: $description,
            }),+),+],
        };
    };
}
use room;

/// Rooms in the order of their indices.
const ROOMS: [Room; 7] =
    [motion::ROOM, configuration::ROOM, friction::ROOM, load::ROOM, image::ROOM, supervision::ROOM, profile::ROOM];

/// The application's objects, sorted by index and sub-index.
pub static OBJECTS: [Object; LENGTH] = ALL.0;
/// Texts of them for people, in the same order.
pub static TEXTS: [Text; LENGTH] = ALL.1;
/// The server's own objects, sorted; those of the PDOs are the same for each of the four.
pub static COMMUNICATION: [Object; COMMUNICATION_LENGTH] = COMMUNICATION_ALL.0;
/// Texts of them for people, in the same order.
pub static COMMUNICATION_TEXTS: [Text; COMMUNICATION_LENGTH] = COMMUNICATION_ALL.1;

const LENGTH: usize = length(&ROOMS);
const ALL: ([Object; LENGTH], [Text; LENGTH]) = join(&ROOMS);
const COMMUNICATION_LENGTH: usize = length(&communication::ROOMS);
const COMMUNICATION_ALL: ([Object; COMMUNICATION_LENGTH], [Text; COMMUNICATION_LENGTH]) = join(&communication::ROOMS);

/// Returns `true` if row `at` is the first of a record.
const fn begins_record(objects: &[Object], at: usize) -> bool {
    objects[at].sub_index != 0 && (at == 0 || objects[at - 1].index != objects[at].index)
}

/// Rows, with those that [`join`] adds. While compiling.
const fn length(rooms: &[Room]) -> usize {
    let (mut length, mut room) = (0, 0);
    while room < rooms.len() {
        let mut row = 0;
        while row < rooms[room].objects.len() {
            if is_there(&rooms[room].objects[row]) {
                length += 1 + begins_record(rooms[room].objects, row) as usize;
            }
            row += 1;
        }
        room += 1;
    }
    length
}

/// All rows one behind another, with sub-index 0 of each record. While compiling.
const fn join<const N: usize>(rooms: &[Room]) -> ([Object; N], [Text; N]) {
    let mut objects = [rooms[0].objects[0]; N];
    let mut texts = [rooms[0].texts[0]; N];
    let (mut next, mut room) = (0, 0);
    while room < rooms.len() {
        let Room { objects: rows, texts: words } = rooms[room];
        let mut row = 0;
        while row < rows.len() {
            if !is_there(&rows[row]) {
                row += 1;
                continue;
            }
            if begins_record(rows, row) {
                let mut last = row;
                while last + 1 < rows.len() && rows[last + 1].index == rows[row].index {
                    last += 1;
                }
                let highest = rows[last].sub_index;
                let field =
                    if matches!(rows[row].field, Field::Server) { Field::Server } else { Field::Highest(highest) };
                // Clearing the error history, and changing a mapping.
                let written = matches!(rows[row].index, 0x1003 | 0x1600..=0x17FF | 0x1A00..=0x1BFF);
                let access = if written { RW } else { RO };
                objects[next] =
                    Object { sub_index: 0, data_type: DataType::U8, access, mappable: UNMAPPED, field, ..rows[row] };
                texts[next] = Text {
                    name: "highest sub-index supported",
                    unit: "",
                    scale: 1.0,
                    limits: None,
                    description: "",
                    ..words[row]
                };
                next += 1;
            }
            objects[next] = rows[row];
            texts[next] = words[row];
            next += 1;
            row += 1;
        }
        room += 1;
    }
    (objects, texts)
}

/// The entry at an index and a sub-index of the application. One number is compared, because the receive interrupt
/// looks each mapped object up, and a pair takes a third more cycles.
#[inline(never)]
pub fn find(index: u16, sub_index: u8) -> Option<&'static Object> {
    let key = |index: u16, sub_index: u8| u32::from(index) << 8 | u32::from(sub_index);
    let place = OBJECTS.binary_search_by_key(&key(index, sub_index), |object| key(object.index, object.sub_index));
    OBJECTS.get(place.ok()?)
}

/// Returns `true` if the application has an object of this index.
pub fn exists(index: u16) -> bool {
    OBJECTS.get(OBJECTS.partition_point(|object| object.index < index)).is_some_and(|object| object.index == index)
}

/// The application's entries with their texts; host.
pub fn described() -> impl Iterator<Item = (&'static Object, &'static Text)> {
    OBJECTS.iter().zip(&TEXTS)
}

/// The server's entries with their texts; host.
pub fn communication() -> impl Iterator<Item = (&'static Object, &'static Text)> {
    COMMUNICATION.iter().zip(&COMMUNICATION_TEXTS)
}
