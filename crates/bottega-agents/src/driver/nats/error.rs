//! Why there is no link.

use std::path::PathBuf;

use async_nats::ConnectErrorKind;

/// Why there is no link.
#[derive(Debug, thiserror::Error)]
pub enum NatsError {
    /// Nobody answers, or not to us.
    #[error("cannot reach a NATS server at {servers}")]
    Connect {
        /// Where it was sought.
        servers: String,
        /// Why not.
        source: async_nats::ConnectError,
    },
    /// An address that is none.
    #[error("`{address}` is no address of a NATS server, such as nats://host:4222")]
    Address {
        /// The address.
        address: String,
    },
    /// A name that cannot be one.
    #[error("`{name}` is no name of a farm: letters, digits, - and _ make one")]
    Name {
        /// The name.
        name: String,
    },
    /// What one says who one is with cannot be read.
    #[error("cannot use the credentials in `{}`", .path.display())]
    Credentials {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: std::io::Error,
    },
    /// The server is older than any that is known to work.
    #[error("the NATS server is of version {version}; 2.9 or newer is needed")]
    Version {
        /// Its version.
        version: String,
    },
    /// The server keeps nothing, or not what was asked for.
    #[error("the NATS server does not keep {what} for the farm: {reason}")]
    Keep {
        /// What.
        what: &'static str,
        /// Why not.
        reason: String,
        /// Whether it is so whenever it is tried again; not of a server that reads its configuration anew.
        is_lasting: bool,
    },
    /// Nobody answers one who wants to be let in.
    #[error("nobody lets machines into the farm: {reason}")]
    NobodyAnswers {
        /// What the server says.
        reason: String,
    },
    /// The server does not say that it has read its configuration again.
    #[error("the NATS server does not read its configuration again: {reason}")]
    NoReload {
        /// What came instead of an answer.
        reason: String,
    },
    /// The server refuses its configuration.
    #[error("the NATS server refuses its new configuration: {reason}")]
    Configuration {
        /// What it says.
        reason: String,
    },
    /// The operating system gives no thread.
    #[error("cannot start a thread")]
    Thread(#[from] std::io::Error),
}

impl NatsError {
    /// Whether the server does not know who one is. One that reads its configuration anew may not know it yet.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Connect { source, .. } if source.kind() == ConnectErrorKind::AuthorizationViolation)
    }

    /// Whether a server that was reached a moment ago may do it when it is asked again: while it reads its configuration anew it
    /// turns members away, closes links and keeps nothing.
    pub fn may_pass(&self) -> bool {
        match self {
            Self::Connect { source, .. } => matches!(
                source.kind(),
                ConnectErrorKind::AuthorizationViolation
                    | ConnectErrorKind::Authentication
                    | ConnectErrorKind::TimedOut
                    | ConnectErrorKind::Io
            ),
            Self::Keep { is_lasting, .. } => !is_lasting,
            Self::NobodyAnswers { .. } | Self::NoReload { .. } => true,
            Self::Address { .. }
            | Self::Name { .. }
            | Self::Credentials { .. }
            | Self::Version { .. }
            | Self::Configuration { .. }
            | Self::Thread(_) => false,
        }
    }
}
