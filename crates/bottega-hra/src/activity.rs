//! The activities of a resource.

/// The activity of a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// The resource waits for work.
    Idle,
    /// The resource works on a packet.
    Working,
    /// The resource is suspended after a failure; or it does not return from a call.
    Suspended,
    /// The resource was given up after too many consecutive failures, or could not be started.
    Retired,
}
