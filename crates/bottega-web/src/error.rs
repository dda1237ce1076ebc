//! Why a door could not be opened.

/// Why a door could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be listened on.
    #[error(transparent)]
    Listen(#[from] bottega_cluster::Error),
    /// The operating system gives no thread, or does not let it listen.
    #[error("the system does not let it listen")]
    System(#[from] std::io::Error),
    /// There are no tokens or no certificate.
    #[error("no way to tell who may come in: {0}")]
    Secrets(String),
}
