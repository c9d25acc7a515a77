//! Progress of a long computation; host.

/// Listens to a computation's progress, from several threads.
pub trait Progress: Sync {
    /// A new stage begins.
    fn stage(&self, name: &str);
    /// Tells something worth knowing about the current stage.
    fn detail(&self, text: &str);
}

/// Tells nobody.
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &str) {}
    fn detail(&self, _: &str) {}
}
