//! The errors of starting an HTTP server.

/// The reason why an HTTP server could not be started.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The server cannot listen on the address.
    #[error(transparent)]
    Listen(#[from] bottega_cluster::Error),
    /// The operating system refuses a thread or a socket.
    #[error("the system does not allow it to listen")]
    System(#[from] std::io::Error),
    /// Tokens or the certificate cannot be made, or the certificate or its key is invalid; with the reason.
    #[error("cannot make tokens: {0}")]
    Secrets(String),
}
