//! End of an owner's session with his work; host.

use super::entry::Entry;
use bus::client::Node;
use friction_compensation::parameters::authentication::Key;
use joint_firmware::objects::field::{Field, OwnerField};
use std::sync::atomic::{AtomicBool, Ordering};

/// The owner of a joint at work: ends the session that was opened for it.
#[derive(Debug)]
pub(super) struct Owner {
    /// The key.
    pub key: Key,
    /// The joint.
    pub node: Node,
    /// A session was opened.
    pub opened: AtomicBool,
}

impl Drop for Owner {
    fn drop(&mut self) {
        if self.opened.load(Ordering::Relaxed) {
            let Entry { object, .. } = Entry::of(Field::Owner(OwnerField::Session));
            // If it cannot be ended it ends by itself.
            let _ = self.node.download(object.index, object.sub_index, &0u32.to_le_bytes());
        }
    }
}
