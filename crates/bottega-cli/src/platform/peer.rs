//! Another platform: its name and its address.

use std::{
    io::{Read, Write},
    net::{IpAddr, Ipv4Addr, SocketAddr, TcpStream, ToSocketAddrs, UdpSocket},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{AgentId, driver::http::client::parse_address, sl};
use bottega_cluster::{address::LocalAddresses, platform};

use crate::{error::CliError, option_value::InvalidValue};

/// The timeout for asking a platform's name.
const NAME_WAIT: Duration = Duration::from_secs(5);
/// The maximum length of the answer, in bytes.
const NAME_BYTES_MAX: u64 = 1 << 16;

/// A platform as given by the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Peer {
    /// The name of the platform, if given.
    name: Option<String>,
    /// The URL of the platform: `http://host:port/path`.
    pub(crate) url: String,
}

/// Parses `URL` or `NAME=URL`; the default path is `/acc`.
pub(crate) fn parse_peer(text: &str) -> Result<Peer, InvalidValue> {
    let (name, url) = match text.split_once("=http") {
        Some((name, rest)) => (Some(name.to_owned()), format!("http{rest}")),
        None => (None, text.to_owned()),
    };
    let (_, path) =
        parse_address(&url).map_err(|_| "an address such as http://127.0.0.1:7779/acc is needed".to_owned())?;
    if name.as_deref().is_some_and(str::is_empty) {
        return Err("a name is needed before the =".into());
    }
    let url = if path == "/" { format!("{}/acc", url.trim_end_matches('/')) } else { url };
    Ok(Peer { name, url })
}

impl Peer {
    /// Returns the platform of this machine: that of `bottega up`, if it runs, or else the one at the default address.
    pub(super) fn here() -> Self {
        let usual = Self { name: None, url: format!("http://{}/acc", platform::LISTEN) };
        let of_farm = LocalAddresses::read().and_then(|addresses| parse_peer(&addresses.platform?).ok());
        // The file stays if `bottega up` was killed.
        of_farm.filter(|peer| peer.get(None).is_ok()).unwrap_or(usual)
    }

    /// Returns the id of one of the platform's services; asks the platform for its name if it was not given.
    pub(crate) fn service(&self, local: &str) -> Result<AgentId, CliError> {
        let name = match &self.name {
            Some(name) => name.clone(),
            None => self.ask_name()?,
        };
        Ok(AgentId { name: format!("{local}@{name}").into(), addresses: Arc::new([self.url.clone()]) })
    }

    /// Asks the platform for its name by HTTP GET; Bottega's platforms answer it.
    fn ask_name(&self) -> Result<String, CliError> {
        let remedy = "give its name, too: NAME=URL; check whether it runs there";
        let problem = |what: &str| CliError::failed(format!("{} does not say its name: {what}", self.url), remedy);
        let answer = self.get(None).and_then(|stream| {
            let mut answer = String::new();
            stream.take(NAME_BYTES_MAX).read_to_string(&mut answer).map(|_| answer)
        });
        let answer = answer.map_err(|error| problem(&error.to_string()))?;
        let body = answer.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        let term = sl::parse_term(body).map_err(|_| problem("it is not a platform of Bottega"))?;
        let arguments = term.arguments_of("ap-description").unwrap_or_default();
        let name = arguments.chunks(2).find_map(|pair| match pair {
            [sl::Term::Bare(key), value] if key == ":name" => value.as_str(),
            _ => None,
        });
        name.map(str::to_owned).ok_or_else(|| problem("it is not a platform of Bottega"))
    }

    /// Starts to read a path of the platform; `None`: the path of its messages.
    pub(crate) fn get(&self, path: Option<&str>) -> std::io::Result<TcpStream> {
        let (host, own) = self.parts();
        let mut stream = TcpStream::connect_timeout(&self.socket()?, NAME_WAIT)?;
        stream.set_read_timeout(Some(NAME_WAIT))?;
        let path = path.unwrap_or(&own);
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")?;
        Ok(stream)
    }

    fn parts(&self) -> (String, String) {
        // The URL was parsed before, so this succeeds.
        parse_address(&self.url).map(|(host, path)| (host, path.to_owned())).unwrap_or_default()
    }

    fn socket(&self) -> std::io::Result<SocketAddr> {
        let found = self.parts().0.to_socket_addrs()?.next();
        found.ok_or_else(|| std::io::ErrorKind::NotFound.into())
    }

    /// Returns the address of this machine as seen from the platform, for its answers.
    pub(crate) fn own_address(&self) -> IpAddr {
        let seen = || {
            let to = self.socket()?;
            let any = if to.is_ipv6() { "[::]:0" } else { "0.0.0.0:0" };
            let socket = UdpSocket::bind(any)?;
            // Connecting a UDP socket sends nothing; it only selects the route.
            socket.connect(to)?;
            socket.local_addr()
        };
        seen().map_or(Ipv4Addr::LOCALHOST.into(), |address: SocketAddr| address.ip())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn platforms_are_named_by_address_or_by_name_and_address() {
        let peer = |name: Option<&str>, url: &str| Ok(Peer { name: name.map(str::to_owned), url: url.to_owned() });
        assert_eq!(parse_peer("http://h:1"), peer(None, "http://h:1/acc"));
        assert_eq!(parse_peer("jade=http://h:7778/acc"), peer(Some("jade"), "http://h:7778/acc"));
        for bad in ["", "h:1", "=http://h", "ftp://h", "http://"] {
            assert!(parse_peer(bad).is_err(), "{bad}");
        }
    }
}
