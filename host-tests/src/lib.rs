//! What several scenarios share.
