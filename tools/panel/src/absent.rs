//! Objects that a joint does not have: not every board has room for every one; any context.

use bus::client::{Abort, ClientError};
use jointctl::remote::RemoteError;

/// Returns `true` if this refusal says that there is no such object.
pub const fn is_absent(error: &RemoteError) -> bool {
    matches!(error, RemoteError::Client(ClientError::Aborted { abort: Abort::NO_OBJECT | Abort::NO_SUB_INDEX, .. }))
}
