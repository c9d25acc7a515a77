//! Bytes as what happens to a joint's server and objects on a bus (`node::hostile::interpret` has the table): no panic,
//! and nothing that the judge of `node::hostile` does not allow. The first byte says whether the joint has a key.

#![no_main]

use friction_compensation::parameters::authentication::Key;
use libfuzzer_sys::fuzz_target;
use node::hostile::{HostileNode, Statics, images, interpret};
use std::sync::OnceLock;

static PREPARED: OnceLock<(Key, Vec<Vec<u8>>)> = OnceLock::new();

fuzz_target!(|bytes: &[u8]| {
    let (key, images) = PREPARED.get_or_init(|| {
        let key = Key::new(std::array::from_fn(|i| i as u8)).expect("its bytes differ");
        let images = images(&key);
        (key, images)
    });
    let Some((first, rest)) = bytes.split_first() else { return };
    let mut statics = Statics::new();
    let key = (first & 1 != 0).then_some(key);
    let mut node = HostileNode::new(&mut statics, key).expect("erased flash can be written");
    if let Err(violation) = interpret(rest, &mut node, images) {
        panic!("{violation}");
    }
});
