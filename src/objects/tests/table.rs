//! The table against itself and against the server.

use super::*;
use crate::objects::field::Field;
use crate::objects::table::{
    COMMUNICATION, COMMUNICATION_TEXTS, DataType, OBJECTS, TEXTS, communication, described, find,
};
use canopen_node::{Access, MappedObject, ObjectDictionary};

#[test]
fn the_tables_are_sorted_and_each_entry_is_found() {
    for objects in [&OBJECTS[..], &COMMUNICATION[..]] {
        let keys = objects.iter().map(|object| (object.index, object.sub_index)).collect::<Vec<_>>();
        assert!(keys.is_sorted_by(|a, b| a < b));
    }
    for object in &OBJECTS {
        assert_eq!(find(object.index, object.sub_index), Some(object));
    }
    assert_eq!((find(0x2010, 2), find(0x6042, 0)), (None, None));
    assert_eq!((OBJECTS.len(), COMMUNICATION.len()), (TEXTS.len(), COMMUNICATION_TEXTS.len()));
}

#[test]
fn every_record_begins_with_its_highest_sub_index() {
    for object in &OBJECTS {
        let last = OBJECTS.iter().rfind(|other| other.index == object.index).unwrap().sub_index;
        let first = find(object.index, 0).unwrap();
        assert_eq!(last != 0, first.field == Field::Highest(last), "{:04x}", object.index);
    }
}

#[test]
fn no_field_has_two_objects() {
    for (place, object) in OBJECTS.iter().enumerate() {
        if !matches!(object.field, Field::Highest(_)) {
            assert!(OBJECTS[..place].iter().all(|other| other.field != object.field), "{object:?}");
        }
    }
}

#[test]
fn every_entry_is_told_in_words_that_a_text_file_can_hold() {
    for (object, text) in described().chain(communication()) {
        let plain = |word: &str| !word.is_empty() && !word.contains(['\n', '|', ';', '=']) && word.len() < 80;
        assert!(plain(text.name) && plain(text.object), "{object:?} {text:?}");
        assert!(text.scale > 0.0 && text.limits.is_none_or(|(low, high)| low < high), "{text:?}");
        assert_eq!(text.description.is_empty(), text.name == "highest sub-index supported", "{text:?}");
        assert!(object.data_type.bytes().is_some() || object.mappable == Default::default());
    }
}

#[test]
fn every_object_reads_and_writes_as_its_access_says() {
    for (object, _) in described() {
        let mut node = Node::operational();
        let (index, sub_index) = (object.index, object.sub_index);
        let read = node.upload(index, sub_index);
        match object.access {
            Access::WriteOnly => assert_eq!(read, Err(0x0601_0001), "{object:?}"),
            _ => {
                let read = read.unwrap_or_else(|abort| panic!("{object:?} {abort:08x}"));
                assert!(object.data_type.bytes().is_none_or(|bytes| read.len() == usize::from(bytes)), "{object:?}");
                if object.data_type == DataType::Domain {
                    continue;
                }
                let written = node.download(index, sub_index, &read);
                match object.access {
                    Access::ReadOnly if read.is_empty() => assert!(written.is_err()),
                    Access::ReadOnly => assert_eq!(written, Err(0x0601_0002), "{object:?}"),
                    // No trial lasts no time.
                    _ if index == 0x2212 => assert_eq!(written, Err(0x0609_0030)),
                    _ => assert_eq!(written, Ok(()), "{object:?}"),
                }
                if object.access == Access::ReadWrite {
                    assert_eq!(node.upload(index, sub_index), Ok(read), "{object:?}");
                }
            }
        }
    }
}

#[test]
fn the_servers_objects_are_as_the_table_says() {
    let mut node = Node::new();
    for (object, text) in communication() {
        let read = node.upload(object.index, object.sub_index);
        let empty = object.index == 0x1003 && object.sub_index != 0;
        match read {
            Err(abort) => assert!(empty && abort == 0x0800_0024, "{object:?} {text:?} {abort:08x}"),
            Ok(read) => {
                assert!(object.data_type.bytes().is_none_or(|bytes| read.len() == usize::from(bytes)), "{object:?}");
                let refused = node.download(object.index, object.sub_index, &read) == Err(0x0601_0002);
                assert_eq!(refused, object.access == Access::ReadOnly, "{object:?}");
            }
        }
    }
}

#[test]
fn the_server_has_no_object_that_the_tables_do_not_have() {
    let mut node = Node::new();
    for index in 0x1000..0x7000 {
        for sub_index in 0..12 {
            let known = find(index, sub_index).is_some()
                || COMMUNICATION.iter().any(|object| (object.index, object.sub_index) == (index, sub_index));
            let exists = !matches!(node.upload(index, sub_index), Err(0x0602_0000 | 0x0609_0011));
            assert_eq!(known, exists, "{index:04x}:{sub_index}");
        }
    }
}

#[test]
fn what_is_mapped_at_first_may_be_mapped() {
    let node = Node::new();
    let parameters = default_communication(NODE);
    for (pdos, receive) in [(&parameters.receive, true), (&parameters.transmit, false)] {
        for pdo in pdos {
            let objects = &pdo.mapping[..pdo.count.into()];
            assert!(objects.iter().map(|object| object.bits()).sum::<u32>() <= 64);
            for object in objects.iter().filter(|object| **object != MappedObject::new(0x0007, 0, 32)) {
                let entry = node.objects.entry(object.index(), object.sub_index()).unwrap();
                let mappable = if receive { entry.mappable.receive } else { entry.mappable.transmit };
                let bytes = find(object.index(), object.sub_index()).unwrap().data_type.bytes().unwrap();
                assert!(mappable && object.bits() == 8 * u32::from(bytes), "{object:?}");
            }
        }
    }
}

#[test]
fn every_mappable_object_is_the_same_in_a_pdo_and_by_sdo() {
    use canopen_node::ProcessImage;
    let mut node = Node::operational();
    node.observed.telemetry.motion.position = -1.5;
    node.observed.telemetry.bus_voltage = 24.0;
    for object in OBJECTS.iter().filter(|object| object.mappable.transmit) {
        let bits = 8 * object.data_type.bytes().unwrap();
        let by_sdo = node.number(object.index, object.sub_index);
        let by_pdo = node.image.transmit(MappedObject::new(object.index, object.sub_index, bits));
        assert_eq!(by_pdo << (64 - bits), by_sdo << (64 - bits), "{object:?}");
    }
}
