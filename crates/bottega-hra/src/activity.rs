//! The activities of a resource.

/// The activity of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// It waits for work.
    Idle,
    /// The resource works on a packet.
    Working,
    /// It is suspended after a failure; or it does not return from a call.
    Suspended,
    /// It was given up after too many consecutive failures, or could not be started.
    Retired,
}
