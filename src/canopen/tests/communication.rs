//! The server's own objects over SDO.

use super::*;

#[test]
fn identity_and_texts_are_the_applications() {
    let mut node = Node::booted();
    assert_eq!(node.read(0x1000, 0), Ok(0x0002_0192));
    assert_eq!(client::upload(&mut node, 0x1008, 0).unwrap(), b"joint actuator");
    assert_eq!(client::upload(&mut node, 0x1009, 0).unwrap(), b"B");
    assert_eq!(client::upload(&mut node, 0x100A, 0).unwrap(), b"0.1.0");
    let identity = (0..=4).map(|sub_index| node.read(0x1018, sub_index).unwrap()).collect::<Vec<_>>();
    assert_eq!(identity, [4, 0x1234, 0xDEAD_BEEF, 0x0001_0002, 0x8000_0001]);
    assert_eq!((node.read(0x1200, 1), node.read(0x1200, 2)), (Ok(0x605), Ok(0x585)));
    assert_eq!(node.read(0x1201, 0), Err(Abort::NO_OBJECT.0));
    assert_eq!(node.read(0x1404, 0), Err(Abort::NO_OBJECT.0));
    assert_eq!(node.read(0x1018, 5), Err(Abort::NO_SUB_INDEX.0));
}

#[test]
fn what_is_stored_is_what_a_reset_brings_back() {
    let mut node = Node::booted();
    node.write(0x1017, 0, &250u16.to_le_bytes()).unwrap();
    node.write(0x1800, 5, &7u16.to_le_bytes()).unwrap();
    node.write(0x1016, 3, &0x0007_0064u32.to_le_bytes()).unwrap();
    node.write(0x1005, 0, &0x91u32.to_le_bytes()).unwrap();
    let parameters = node.server.parameters(&mut node.dictionary);
    node.write(0x1010, 2, b"save").unwrap();
    assert_eq!(node.dictionary.stored, Some((Group::Communication, parameters)));
    node.dictionary.parameters = Some(parameters);
    assert_eq!(node.bus(0, &[0x82, 0])[0], frame(0x705, &[0]));
    assert_eq!(node.server.parameters(&mut node.dictionary), parameters);
    assert_eq!((node.read(0x1017, 0), node.read(0x1800, 5)), (Ok(250), Ok(7)));
}

#[test]
fn every_object_of_the_server_is_readable_or_says_no_data() {
    let mut node = Node::booted();
    let mut count = 0;
    for index in 0x1000..0x2000 {
        for sub_index in 0..=255 {
            match node.read_any(index, sub_index) {
                Ok(_) => count += 1,
                Err(abort) => assert!(
                    [Abort::NO_OBJECT.0, Abort::NO_SUB_INDEX.0].contains(&abort)
                        || (index, abort) == (0x1003, Abort::NO_DATA.0)
                ),
            }
        }
    }
    // 1000 1001 1003:0 1005 1008-100A 1010 1011 1014 1015 1016 1017 1018 1029 1200, then RPDOs and TPDOs.
    assert_eq!(count, 1 + 1 + 1 + 1 + 3 + 4 + 4 + 1 + 1 + 5 + 1 + 5 + 2 + 3 + 4 * (4 + 9) + 4 * (5 + 9));
}

impl Node {
    fn read_any(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, u32> {
        client::upload(self, index, sub_index)
    }
}
