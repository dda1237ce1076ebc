//! The activities of a resource.

/// The activity of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// Waits for work.
    Idle,
    /// Works.
    Working,
    /// Left alone after a failure, for a while; or it does not return from a call.
    Suspended,
    /// Given up after too many failures in a row, or because it could not be started.
    Retired,
}
