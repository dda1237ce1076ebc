//! The address of a farm in one line: `bottega://WORD@host:4222` for a farm of `bottega up`, `nats://…` for other NATS servers.

use std::{fmt, fs, path::PathBuf, str::FromStr};

use bottega_agents::driver::nats::{Login, Pin};

use bottega_platform::folders::state_folder;
use thiserror::Error as ThisError;

use crate::error::Error;

/// The default name of a farm.
pub(crate) const FARM: &str = "bottega";
const PORT: u16 = 4222;
/// Length of a secret in hexadecimal digits.
const SECRET_DIGITS: usize = 32;

/// The group of a member, which determines its permissions in a farm of `bottega up`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// A member that may do everything.
    Trusted,
    /// A member that may only render.
    Guest,
}

impl Group {
    /// All groups.
    pub(crate) const ALL: [Self; 2] = [Self::Trusted, Self::Guest];

    /// Returns the name of the group.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Trusted => "trusted",
            Self::Guest => "guest",
        }
    }

    fn letter(self) -> char {
        match self {
            Self::Trusted => 't',
            Self::Guest => 'g',
        }
    }
}

/// The word with which a machine joins a farm: a group, a secret, and the pin of the server.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JoinWord {
    /// The group that the word admits to.
    pub group: Group,
    /// The secret, 32 hexadecimal digits.
    pub secret: String,
    /// The pin of the server's certificate.
    pub pin: Pin,
}

/// The reason why a text is not the address of a farm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ThisError)]
pub enum AddressError {
    /// The word to join is cut off or damaged.
    #[error("the word is incomplete: copy the whole line that `bottega up` printed")]
    Word,
    /// There is no scheme, and the text is not a word to join.
    #[error("an address such as bottega://WORD@host:4222 is needed")]
    NoScheme,
    /// The scheme is not one of a farm.
    #[error("an address such as bottega://WORD@host:4222 or nats://TOKEN@host:4222 is needed")]
    Scheme,
    /// A host is missing.
    #[error("the address names no host")]
    NoHost,
}

impl FromStr for JoinWord {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let wrong = AddressError::Word;
        let group = Group::ALL.into_iter().find(|group| text.starts_with(group.letter())).ok_or(wrong)?;
        let (secret, pin) = text[1..].split_at_checked(SECRET_DIGITS).ok_or(wrong)?;
        if !secret.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(wrong);
        }
        Ok(Self { group, secret: secret.to_owned(), pin: pin.parse().map_err(|()| wrong)? })
    }
}

impl fmt::Display for JoinWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}{}", self.group.letter(), self.secret, self.pin)
    }
}

/// The operator of a farm's NATS servers.
#[derive(Clone, Debug)]
pub enum Operator {
    /// `bottega up`, with the word to join it.
    Up(JoinWord),
    /// Another operator, with permissions of its own.
    Other {
        /// The login at the servers.
        login: Login,
        /// The login as written in the address, before the `@`; empty: none.
        written: String,
        /// True if the link must be encrypted.
        tls: bool,
    },
}

/// The address of a farm.
#[derive(Clone, Debug)]
pub struct FarmAddress {
    /// `host:port` of each server; empty: the farm is discovered on the local network.
    pub servers: Vec<String>,
    /// The operator of the servers, and how to log in.
    pub operator: Operator,
    /// The name of the farm among those on the same servers.
    pub farm: String,
}

impl FarmAddress {
    /// Returns the address of a farm that `bottega up` runs.
    ///
    /// - `server`: `host:port` of its server.
    /// - `word`: the word to join it.
    pub fn of_up(server: String, word: JoinWord) -> Self {
        Self { servers: vec![server], operator: Operator::Up(word), farm: FARM.to_owned() }
    }
}

impl FromStr for FarmAddress {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let (scheme, rest) = text.split_once("://").unwrap_or(("", text));
        if scheme.is_empty() {
            let word = rest.parse().map_err(|_| AddressError::NoScheme)?;
            return Ok(Self { servers: Vec::new(), operator: Operator::Up(word), farm: FARM.to_owned() });
        }
        let (rest, farm) = rest.split_once('/').map_or((rest, FARM), |(rest, farm)| (rest, farm.trim_end_matches('/')));
        let (user, servers) = rest.rsplit_once('@').map_or(("", rest), |(user, servers)| (user, servers));
        let operator = match scheme {
            "bottega" => Operator::Up(user.parse()?),
            "nats" | "tls" => Operator::Other { login: login(user), written: user.to_owned(), tls: scheme == "tls" },
            _ => return Err(AddressError::Scheme),
        };
        if servers.split(',').any(str::is_empty) {
            return Err(AddressError::NoHost);
        }
        let with_port = |server: &str| {
            let has_port = server.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
            if has_port { server.to_owned() } else { format!("{server}:{PORT}") }
        };
        let farm = if farm.is_empty() { FARM } else { farm }.to_owned();
        Ok(Self { servers: servers.split(',').map(with_port).collect(), operator, farm })
    }
}

/// Parses the login for servers of another operator: `NAME:PASSWORD`, a token, or nothing.
fn login(user: &str) -> Login {
    match user.split_once(':') {
        _ if user.is_empty() => Login::Nobody,
        Some((name, word)) => Login::User(name.to_owned(), word.to_owned()),
        None => Login::Token(user.to_owned()),
    }
}

impl fmt::Display for FarmAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.operator {
            Operator::Up(word) => write!(f, "bottega://{word}@")?,
            Operator::Other { written, tls, .. } => {
                f.write_str(if *tls { "tls://" } else { "nats://" })?;
                if !written.is_empty() {
                    write!(f, "{written}@")?;
                }
            }
        }
        f.write_str(&self.servers.join(","))?;
        if self.farm == FARM { Ok(()) } else { write!(f, "/{}", self.farm) }
    }
}

/// Returns the path of the file in which `bottega up` publishes its farm's address to other processes of this user.
pub(crate) fn address_file() -> PathBuf {
    state_folder().join("farm")
}

/// The addresses that `bottega up` publishes on this machine: the farm, and on a line each the web page and the FIPA
/// platform that the same process serves.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LocalAddresses {
    /// The address of the farm as seen from this machine; it contains the secret word.
    pub farm: String,
    /// The URL of the web page, such as `http://127.0.0.1:8080`; none: no page is served.
    pub page: Option<String>,
    /// The URL of the FIPA platform's message transport, such as `http://127.0.0.1:7779/acc`; none: no platform is served.
    pub platform: Option<String>,
}

/// Prefixes of the lines for the page and the platform.
const PAGE: &str = "page ";
const PLATFORM: &str = "platform ";

impl LocalAddresses {
    /// Reads the addresses from the file of this user, and returns them; `None`: this user runs no `bottega up` on this machine,
    /// or the file cannot be read.
    pub fn read() -> Option<Self> {
        fs::read_to_string(address_file()).ok().map(|text| Self::of_text(&text))
    }

    fn of_text(text: &str) -> Self {
        let line = |name: &str| text.lines().find_map(|line| line.strip_prefix(name)).map(str::to_owned);
        let farm = text.lines().next().unwrap_or_default().to_owned();
        Self { farm, page: line(PAGE), platform: line(PLATFORM) }
    }
}

impl fmt::Display for LocalAddresses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.farm)?;
        for (name, address) in [(PAGE, &self.page), (PLATFORM, &self.platform)] {
            if let Some(address) = address {
                writeln!(f, "{name}{address}")?;
            }
        }
        Ok(())
    }
}

/// Returns the address of the farm that `bottega up` runs on this machine.
///
/// # Errors
/// This user runs no `bottega up` on this machine, or the saved address is invalid.
pub fn saved_address() -> Result<FarmAddress, Error> {
    let known = LocalAddresses::read().and_then(|addresses| addresses.farm.parse().ok());
    known.ok_or_else(|| {
        Error::usage(
            "which farm?",
            "start one here with `bottega up`, or name one: the line that `bottega up` printed elsewhere",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_addresses_of_a_farm_on_this_machine_are_read_as_they_were_written() {
        let farm = "bottega://word@127.0.0.1:4222".to_owned();
        let page = Some("http://127.0.0.1:8081".to_owned());
        let platform = Some("http://127.0.0.1:7780/acc".to_owned());
        for (page, platform) in [(None, None), (page.clone(), None), (None, platform.clone()), (page, platform)] {
            let addresses = LocalAddresses { farm: farm.clone(), page, platform };
            assert_eq!(LocalAddresses::of_text(&addresses.to_string()), addresses);
        }
    }

    #[test]
    fn an_address_is_read_as_it_was_written() {
        let word = "t0123456789abcdef0123456789abcdef00112233445566778899aabbccddeeff";
        for (text, servers, farm) in [
            (format!("bottega://{word}@10.0.0.7:4222"), "10.0.0.7:4222", FARM),
            ("nats://secret@10.0.0.7:4222".to_owned(), "10.0.0.7:4222", FARM),
            ("nats://a:4222,b:4223/night".to_owned(), "a:4222,b:4223", "night"),
            ("tls://me:x@farm.example:443".to_owned(), "farm.example:443", FARM),
        ] {
            let address: FarmAddress = text.parse().unwrap();
            assert_eq!((address.servers.join(",").as_str(), &*address.farm), (servers, farm));
            assert_eq!(address.to_string(), text);
        }
        assert_eq!("nats://host".parse::<FarmAddress>().unwrap().servers, ["host:4222"]);
        assert!(word.parse::<FarmAddress>().unwrap().servers.is_empty());
        let short = &word[..60];
        let wrongs =
            ["host:4222", "http://host", "nats://", "nats://a@", "bottega://x@h", "", short, "té", "bottega://h"];
        for wrong in wrongs {
            assert!(wrong.parse::<FarmAddress>().is_err(), "{wrong}");
        }
    }
}
