//! Errors of links to a farm.

use std::path::PathBuf;

use async_nats::ConnectErrorKind;

/// An error in connecting to a farm, in enrolment, or in reloading a server.
#[derive(Debug, thiserror::Error)]
pub enum NatsError {
    /// The server is unreachable, or does not accept the connection.
    #[error("cannot reach a NATS server at {servers}")]
    Connect {
        /// The addresses tried, separated by commas.
        servers: String,
        /// The error of the NATS client.
        source: async_nats::ConnectError,
    },
    /// The address of a server is invalid.
    #[error("`{address}` is not the address of a NATS server, such as nats://host:4222")]
    Address {
        /// The address as given.
        address: String,
    },
    /// The name of the farm is invalid.
    #[error("`{name}` is not a valid name of a farm: use letters, digits, - and _")]
    Name {
        /// The name as given.
        name: String,
    },
    /// The credentials cannot be read.
    #[error("cannot use the credentials in `{}`", .path.display())]
    Credentials {
        /// The file of credentials.
        path: PathBuf,
        /// The error of reading it.
        source: std::io::Error,
    },
    /// The server is older than the oldest supported version.
    #[error("the NATS server has version {version}; 2.9 or newer is needed")]
    Version {
        /// The version that the server reports.
        version: String,
    },
    /// The server has no storage for a part of the farm, does not create it, or has a different one than requested.
    #[error("the NATS server does not store {what} of the farm: {reason}")]
    Keep {
        /// The part of the farm that is stored there, such as `blobs`.
        what: &'static str,
        /// The reason, as text for the user.
        reason: String,
        /// `true`: retrying is useless; `false`: it may help, for example if the server is reloading its configuration.
        is_lasting: bool,
    },
    /// Nobody answers the request for enrolment.
    #[error("no process admits machines to the farm: {reason}")]
    NobodyAnswers {
        /// The error received instead of an answer.
        reason: String,
    },
    /// The server does not confirm that it has reloaded its configuration.
    #[error("the NATS server does not read its configuration again: {reason}")]
    NoReload {
        /// The error received instead of an answer.
        reason: String,
    },
    /// The server rejects its configuration.
    #[error("the NATS server refuses its new configuration: {reason}")]
    Configuration {
        /// The server's message.
        reason: String,
    },
    /// A thread, or the runtime of one, cannot be started.
    #[error("cannot start a thread")]
    Thread(#[from] std::io::Error),
}

impl NatsError {
    /// Returns true if the server does not know the credentials. While it reloads its configuration this may be
    /// temporary.
    pub fn is_refusal(&self) -> bool {
        matches!(self, Self::Connect { source, .. } if source.kind() == ConnectErrorKind::AuthorizationViolation)
    }

    /// Returns true if retrying may succeed on a server that was reachable a moment ago: while it reloads its
    /// configuration it rejects members, closes connections and has no storage.
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
