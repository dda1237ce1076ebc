//! The address of a farm, and the credentials of a client.

use std::{path::PathBuf, time::Duration};

use async_nats::ConnectOptions;

use super::{error::NatsError, names, pin::Pin};

/// How long the server may take to answer before it counts as silent.
pub(super) const ANSWER_TIME: Duration = Duration::from_secs(2);

/// How long is waited for the server at first.
pub(super) const CONNECT_TIME: Duration = Duration::from_secs(5);

/// The address of a farm.
#[derive(Clone, Debug, Default)]
pub struct NatsOptions {
    /// Addresses of its servers: `nats://host:4222`.
    pub servers: Vec<String>,
    /// Who one is to the servers.
    pub login: Login,
    /// How the way to them is kept from others.
    pub tls: Tls,
    /// The name of the farm: farms of different names on one server know nothing of each other.
    pub farm: String,
    /// Whose agents these are: their names end in `@MEMBER`, or `@MEMBER.` and anything.
    pub member: String,
    /// Whether the farm is to be there already: who has no right to make it does not try.
    pub is_guest: bool,
}

/// The credentials for a server.
#[derive(Clone, Debug, Default)]
pub enum Login {
    /// Nobody asks.
    #[default]
    Nobody,
    /// Who knows a word.
    Token(String),
    /// A name and a word.
    User(String, String),
    /// Who has a key: its seed.
    NKey(String),
    /// What a file says.
    Credentials(PathBuf),
}

/// The encryption of a connection.
#[derive(Clone, Debug, Default)]
pub struct Tls {
    /// Nothing is said before it is.
    pub is_required: bool,
    /// The one certificate that the server may have; without it, one that an authority vouches for.
    pub pin: Option<Pin>,
    /// Certificates of more authorities than those of the system.
    pub authorities: Option<PathBuf>,
    /// Certificate and key by which one is known to the server.
    pub own: Option<(PathBuf, PathBuf)>,
}

impl NatsOptions {
    /// What the library is to be told.
    ///
    /// # Errors
    /// The credentials cannot be read, or a name is none.
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
