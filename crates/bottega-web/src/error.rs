//! The errors of opening a door.

/// The reason why an HTTP server could not be started.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be listened on.
    #[error(transparent)]
    Listen(#[from] bottega_cluster::Error),
    /// The operating system refuses a thread or a socket.
    #[error("the system does not allow it to listen")]
    System(#[from] std::io::Error),
    /// Tokens or the certificate cannot be made or used.
    #[error("cannot make tokens: {0}")]
    Secrets(String),
}
