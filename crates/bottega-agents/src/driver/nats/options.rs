//! The address of a farm, and the credentials of a client.

use std::{path::PathBuf, time::Duration};

use async_nats::ConnectOptions;

use super::{error::NatsError, names, pin::Pin};

/// Timeout of answers of the server.
pub(super) const ANSWER_TIME: Duration = Duration::from_secs(2);

/// Timeout of the first connection.
pub(super) const CONNECT_TIME: Duration = Duration::from_secs(5);

/// The address of a farm, and the name, credentials and encryption with which a member connects to it.
#[derive(Clone, Debug, Default)]
pub struct NatsOptions {
    /// The addresses of the farm's servers: `nats://host:4222`.
    pub servers: Vec<String>,
    /// The credentials for the server.
    pub login: Login,
    /// The TLS settings of the connection.
    pub tls: Tls,
    /// The name of the farm, at most 64 letters, digits, `-` and `_`: farms with different names on one server are
    /// independent.
    pub farm: String,
    /// The name of the member: names of its agents end in `@MEMBER`, or in `@MEMBER.` and more.
    pub member: String,
    /// True if the farm must exist already: a guest has no right to create it.
    pub is_guest: bool,
}

/// The credentials for a server.
#[derive(Clone, Debug, Default)]
pub enum Login {
    /// No credentials.
    #[default]
    Nobody,
    /// A token, as in `nats://TOKEN@host`.
    Token(String),
    /// User name and password.
    User(String, String),
    /// The seed of an NKey, a key pair of NATS.
    NKey(String),
    /// The path of a `.creds` file of NATS.
    Credentials(PathBuf),
}

/// The encryption of a connection: whether it is required, and the certificates of both sides.
#[derive(Clone, Debug, Default)]
pub struct Tls {
    /// True if encryption is required.
    pub is_required: bool,
    /// The only accepted certificate of the server, which makes encryption required; then `authorities` and `own` are
    /// not used. `None`: one signed by a known authority.
    pub pin: Option<Pin>,
    /// The path of a file with the certificates of the known authorities (PEM); `None`: those of the system.
    pub authorities: Option<PathBuf>,
    /// The paths of the client's certificate and of its private key (PEM).
    pub own: Option<(PathBuf, PathBuf)>,
}

impl NatsOptions {
    /// Returns the options for the library.
    ///
    /// # Errors
    /// The credentials cannot be read, or a name is invalid.
    pub(super) async fn connect_options(&self) -> Result<ConnectOptions, NatsError> {
        let is_name = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if self.farm.is_empty() || self.farm.len() > 64 || !self.farm.chars().all(is_name) {
            return Err(NatsError::Name { name: self.farm.clone() });
        }
        let mut options = ConnectOptions::new()
            .name("bottega")
            .connection_timeout(CONNECT_TIME)
            .request_timeout(Some(ANSWER_TIME))
            .custom_inbox_prefix(names::inbox(&self.member));
        options = match &self.login {
            Login::Nobody => options,
            Login::Token(token) => options.token(token.clone()),
            Login::User(name, word) => options.user_and_password(name.clone(), word.clone()),
            Login::NKey(seed) => options.nkey(seed.clone()),
            Login::Credentials(path) => {
                let read = options.credentials_file(path).await;
                read.map_err(|source| NatsError::Credentials { path: path.clone(), source })?
            }
        };
        let Tls { is_required, pin, authorities, own } = &self.tls;
        if let Some(path) = authorities {
            options = options.add_root_certificates(path.clone());
        }
        if let Some((certificate, key)) = own {
            options = options.add_client_certificate(certificate.clone(), key.clone());
        }
        if let Some(pin) = pin {
            options = options.tls_client_config(pin.client_config());
        }
        Ok(if *is_required || pin.is_some() { options.require_tls(true) } else { options })
    }
}
