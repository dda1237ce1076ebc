//! Where a farm is, in one word: `nats://TOKEN@host:4222/FARM`.

use std::{env, fmt, fs, path::PathBuf, str::FromStr, sync::Arc};

use bottega_agents::driver::nats::{NatsError, NatsOptions, NatsUplink};
use bottega_farm::FarmCodec;

use crate::error::CliError;

/// The name of a farm of which nobody gave one.
const FARM: &str = "bottega";
const PORT: u16 = 4222;

/// Where a farm is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FarmAddress {
    /// `host:port` of its servers.
    pub(crate) servers: Vec<String>,
    pub(crate) token: Option<String>,
    pub(crate) farm: String,
    tls: bool,
}

impl FarmAddress {
    pub(crate) fn new(server: String, token: String) -> Self {
        Self { servers: vec![server], token: Some(token), farm: FARM.to_owned(), tls: false }
    }

    /// Links up with the farm.
    pub(crate) fn link(&self) -> Result<Arc<NatsUplink<FarmCodec>>, CliError> {
        let scheme = if self.tls { "tls" } else { "nats" };
        let servers = self.servers.iter().map(|server| format!("{scheme}://{server}")).collect();
        let options = NatsOptions { servers, token: self.token.clone(), farm: self.farm.clone() };
        NatsUplink::connect(&options, FarmCodec).map(Arc::new).map_err(|source| {
            let remedy = match &source {
                NatsError::Connect { .. } => "is `bottega up` running there, and is this the line that it printed?",
                NatsError::Version { .. } => "install a newer nats-server, see `bottega up --help`",
                _ => "see what `bottega up` printed",
            };
            CliError::Farm { source, remedy: remedy.to_owned() }
        })
    }
}

impl FromStr for FarmAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (tls, rest) = match text.split_once("://") {
            Some(("nats", rest)) => (false, rest),
            Some(("tls", rest)) => (true, rest),
            _ => return Err("an address such as nats://TOKEN@host:4222 is needed".to_owned()),
        };
        let (rest, farm) = rest.split_once('/').map_or((rest, FARM), |(rest, farm)| (rest, farm.trim_end_matches('/')));
        let (token, servers) = rest.rsplit_once('@').map_or((None, rest), |(token, rest)| (Some(token), rest));
        let with_port = |server: &str| {
            let has_port = server.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
            if has_port { server.to_owned() } else { format!("{server}:{PORT}") }
        };
        if servers.split(',').any(str::is_empty) {
            return Err("the address names no host".to_owned());
        }
        Ok(Self {
            servers: servers.split(',').map(with_port).collect(),
            token: token.filter(|token| !token.is_empty()).map(str::to_owned),
            farm: if farm.is_empty() { FARM } else { farm }.to_owned(),
            tls,
        })
    }
}

impl fmt::Display for FarmAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.tls { "tls://" } else { "nats://" })?;
        if let Some(token) = &self.token {
            write!(f, "{token}@")?;
        }
        f.write_str(&self.servers.join(","))?;
        if self.farm == FARM { Ok(()) } else { write!(f, "/{}", self.farm) }
    }
}

/// Where this machine keeps what a farm needs between runs.
pub(crate) fn state_folder() -> PathBuf {
    let in_home = |folder: &str| env::home_dir().map(|home| home.join(folder));
    let base = env::var_os("XDG_STATE_HOME").filter(|path| !path.is_empty()).map(PathBuf::from);
    base.or_else(|| in_home(".local/state")).unwrap_or_else(|| PathBuf::from(".")).join("bottega")
}

/// The file in which `bottega up` says where its farm is, for others on this machine.
pub(super) fn address_file() -> PathBuf {
    state_folder().join("farm")
}

/// The farm of this machine, if `bottega up` runs here.
pub(crate) fn saved_address() -> Result<FarmAddress, CliError> {
    let missing = || {
        CliError::usage(
            "which farm?",
            "start one here with `bottega up`, or name one: the line that `bottega up` printed elsewhere",
        )
    };
    let text = fs::read_to_string(address_file()).map_err(|_| missing())?;
    text.trim().parse().map_err(|_| missing())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_read_as_it_was_written() {
        for (text, servers, token, farm) in [
            ("nats://secret@10.0.0.7:4222", "10.0.0.7:4222", Some("secret"), FARM),
            ("nats://a:4222,b:4223/night", "a:4222,b:4223", None, "night"),
            ("tls://x@farm.example:443", "farm.example:443", Some("x"), FARM),
        ] {
            let address: FarmAddress = text.parse().unwrap();
            assert_eq!(address.servers.join(","), servers);
            assert_eq!((address.token.as_deref(), &*address.farm), (token, farm));
            assert_eq!(address.to_string(), text);
        }
        assert_eq!("nats://host".parse::<FarmAddress>().unwrap().servers, ["host:4222"]);
        for wrong in ["host:4222", "http://host", "nats://", "nats://a@"] {
            assert!(wrong.parse::<FarmAddress>().is_err(), "{wrong}");
        }
    }
}
