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
    node.write(0x1019, 0, &[240]).unwrap();
    node.write(0x1802, 6, &[17]).unwrap();
    let parameters = node.server.parameters(&mut node.dictionary);
    node.write(0x1010, 2, b"save").unwrap();
    assert_eq!(node.dictionary.stored, Some((Group::Communication, parameters)));
    node.dictionary.parameters = Some(parameters);
    assert_eq!(node.bus(0, &[0x82, 0])[0], frame(0x705, &[0]));
    assert_eq!(node.server.parameters(&mut node.dictionary), parameters);
    assert_eq!((node.read(0x1017, 0), node.read(0x1800, 5)), (Ok(250), Ok(7)));
    assert_eq!((node.read(0x1019, 0), node.read(0x1802, 6)), (Ok(240), Ok(17)));
}

const DATE: u32 = 15_669;
const TIME: u32 = 49_320_000;

impl Node {
    fn date(&mut self) {
        self.write(0x1020, 1, &DATE.to_le_bytes()).unwrap();
        self.write(0x1020, 2, &TIME.to_le_bytes()).unwrap();
        assert_eq!(self.dated(), (DATE, TIME));
    }

    fn dated(&mut self) -> (u32, u32) {
        (self.read(0x1020, 1).unwrap() as u32, self.read(0x1020, 2).unwrap() as u32)
    }
}

#[test]
fn date_and_time_of_the_configuration_last_until_something_else_that_is_stored_changes() {
    let changes: [(u16, u8, &[u8]); 10] = [
        (0x1005, 0, &[0x90, 0, 0, 0]),
        (0x1014, 0, &[0x85, 0, 0, 0x80]),
        (0x1015, 0, &[10, 0]),
        (0x1016, 4, &[100, 0, 7, 0]),
        (0x1017, 0, &[50, 0]),
        (0x1019, 0, &[10]),
        (0x1029, 1, &[1]),
        (0x1400, 5, &[20, 0]),
        (0x1800, 2, &[3]),
        (0x1801, 6, &[7]),
    ];
    for (index, sub_index, value) in changes {
        let mut node = Node::booted();
        node.date();
        // The history of errors is not stored; what is refused changes nothing; nor does the same value.
        node.write(0x1003, 0, &[0]).unwrap();
        assert!(node.write(0x1019, 0, &[1]).is_err());
        let before = client::upload(&mut node, index, sub_index).unwrap();
        node.write(index, sub_index, &before).unwrap();
        assert_eq!(node.dated(), (DATE, TIME), "{index:04X}h:{sub_index}");
        node.write(index, sub_index, value).unwrap();
        assert_eq!(node.dated(), (0, 0), "{index:04X}h:{sub_index}");
        // Written behind the change it is there again.
        node.date();
    }
    let mut node = Node::booted();
    node.date();
    node.dictionary.changed = true;
    assert_eq!(node.dated(), (0, 0), "an object of the application");
    node.date();
    assert_eq!(node.write(0x1020, 3, &[0; 4]), Err(Abort::NO_SUB_INDEX.0));
}

#[test]
fn date_and_time_are_stored_with_everything_and_with_nothing_less() {
    for (sub_index, kept) in [(1, true), (2, false), (3, false)] {
        let mut node = Node::booted();
        node.date();
        node.write(0x1010, sub_index, b"save").unwrap();
        let (_, stored) = node.dictionary.stored.unwrap();
        let expected = if kept { [DATE, TIME] } else { [0, 0] };
        assert_eq!((stored.verification, node.dated().into()), (expected, expected), "1010h:{sub_index}");
        node.date();
        node.write(0x1011, sub_index, b"load").unwrap();
        assert_eq!(node.dated(), (0, 0), "1011h:{sub_index}");
    }
}

#[test]
fn a_reset_brings_date_and_time_back_where_the_configuration_is_as_stored() {
    let stored = |node: &mut Node| {
        node.date();
        node.write(0x1010, 1, b"save").unwrap();
        let (_, parameters) = node.dictionary.stored.unwrap();
        node.dictionary.parameters = Some(parameters);
    };
    // A reset of communication leaves what the application has changed.
    for (changed, command, expected) in
        [(false, 0x82, (DATE, TIME)), (true, 0x82, (0, 0)), (false, 0x81, (DATE, TIME)), (true, 0x81, (DATE, TIME))]
    {
        let mut node = Node::booted();
        stored(&mut node);
        node.dictionary.changed = changed;
        node.read(0x1000, 0).unwrap();
        node.bus(0, &[command, NODE]);
        assert_eq!(node.dated(), expected, "changed {changed}, command {command:#x}");
    }
    // Another date that was not stored is not one of what is there after the reset.
    let mut node = Node::booted();
    stored(&mut node);
    node.write(0x1020, 2, &[1, 0, 0, 0]).unwrap();
    node.bus(0, &[0x82, NODE]);
    assert_eq!(node.dated(), (0, 0));
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
    // 1000 1001 1003:0 1005 1008-100A 1010 1011 1014 1015 1016 1017 1018 1019 1020 1029 1200, then RPDOs and TPDOs.
    assert_eq!(count, 1 + 1 + 1 + 1 + 3 + 4 + 4 + 1 + 1 + 5 + 1 + 5 + 1 + 3 + 2 + 3 + 4 * (4 + 9) + 4 * (6 + 9));
}

impl Node {
    fn read_any(&mut self, index: u16, sub_index: u8) -> Result<Vec<u8>, u32> {
        client::upload(self, index, sub_index)
    }
}
