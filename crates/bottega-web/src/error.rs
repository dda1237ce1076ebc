//! Why a door could not be opened.

use std::net::SocketAddr;

/// Why a door could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
    /// There are no tokens or no certificate.
    #[error("no way to tell who may come in: {0}")]
    Secrets(String),
}
