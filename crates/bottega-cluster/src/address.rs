//! The address of a farm in one word: `bottega://WORD@host:4222` where `bottega up` runs it, `nats://…` where somebody else does.

use std::{fmt, fs, path::PathBuf, str::FromStr};

use bottega_agents::driver::nats::{Login, Pin};

use bottega_platform::folders::state_folder;

use crate::error::Error;

/// The name of a farm of which nobody gave one.
pub(crate) const FARM: &str = "bottega";
const PORT: u16 = 4222;
/// Hexadecimal digits of a secret.
const SECRET_DIGITS: usize = 32;

/// The group of a member, which says what it may do in a farm that `bottega up` runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Everything.
    Trusted,
    /// Paint.
    Guest,
}

impl Group {
    pub(crate) const ALL: [Self; 2] = [Self::Trusted, Self::Guest];

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

/// The word that lets one into a farm: as whom, a secret, and how its server is known.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct JoinWord {
    /// Whose word it is.
    pub group: Group,
    /// The secret.
    pub secret: String,
    /// How the server is known.
    pub pin: Pin,
}

impl FromStr for JoinWord {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "the word is not whole: copy all of the line that `bottega up` printed".to_owned();
        let group = Group::ALL.into_iter().find(|group| text.starts_with(group.letter())).ok_or_else(wrong)?;
        let (secret, pin) = text[1..].split_at_checked(SECRET_DIGITS).ok_or_else(wrong)?;
        if !secret.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        Ok(Self { group, secret: secret.to_owned(), pin: pin.parse().map_err(|()| wrong())? })
    }
}

impl fmt::Display for JoinWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}{}", self.group.letter(), self.secret, self.pin)
    }
}

/// The keeper of a farm's servers.
#[derive(Clone, Debug)]
pub enum Keeper {
    /// `bottega up`.
    Up(JoinWord),
    /// Somebody else, who says who may come.
    Other {
        /// Who one is there.
        login: Login,
        /// What was written of it.
        written: String,
        /// Whether the link must be encrypted.
        tls: bool,
    },
}

/// The address of a farm.
#[derive(Clone, Debug)]
pub struct FarmAddress {
    /// `host:port` of its servers; none: to be found on the local network.
    pub servers: Vec<String>,
    /// Who runs the servers.
    pub keeper: Keeper,
    /// The name of the farm among those of the servers.
    pub farm: String,
}

impl FarmAddress {
    /// The address of a farm that `bottega up` runs.
    pub fn of_up(server: String, word: JoinWord) -> Self {
        Self { servers: vec![server], keeper: Keeper::Up(word), farm: FARM.to_owned() }
    }
}

impl FromStr for FarmAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (scheme, rest) = text.split_once("://").unwrap_or(("", text));
        if scheme.is_empty() {
            let word = rest.parse().map_err(|_| "an address such as bottega://WORD@host:4222 is needed".to_owned())?;
            return Ok(Self { servers: Vec::new(), keeper: Keeper::Up(word), farm: FARM.to_owned() });
        }
        let (rest, farm) = rest.split_once('/').map_or((rest, FARM), |(rest, farm)| (rest, farm.trim_end_matches('/')));
        let (user, servers) = rest.rsplit_once('@').map_or(("", rest), |(user, servers)| (user, servers));
        let keeper = match scheme {
            "bottega" => Keeper::Up(user.parse()?),
            "nats" | "tls" => Keeper::Other { login: login(user), written: user.to_owned(), tls: scheme == "tls" },
            _ => {
                return Err(
                    "an address such as bottega://WORD@host:4222 or nats://TOKEN@host:4222 is needed".to_owned()
                );
            }
        };
        if servers.split(',').any(str::is_empty) {
            return Err("the address names no host".to_owned());
        }
        let with_port = |server: &str| {
            let has_port = server.rsplit_once(':').is_some_and(|(_, port)| port.parse::<u16>().is_ok());
            if has_port { server.to_owned() } else { format!("{server}:{PORT}") }
        };
        let farm = if farm.is_empty() { FARM } else { farm }.to_owned();
        Ok(Self { servers: servers.split(',').map(with_port).collect(), keeper, farm })
    }
}

/// Who one is to servers that somebody else runs: `NAME:WORD` or a token.
fn login(user: &str) -> Login {
    match user.split_once(':') {
        _ if user.is_empty() => Login::Nobody,
        Some((name, word)) => Login::User(name.to_owned(), word.to_owned()),
        None => Login::Token(user.to_owned()),
    }
}

impl fmt::Display for FarmAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.keeper {
            Keeper::Up(word) => write!(f, "bottega://{word}@")?,
            Keeper::Other { written, tls, .. } => {
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

/// The file in which `bottega up` says where its farm is, for others on this machine.
pub(crate) fn address_file() -> PathBuf {
    state_folder().join("farm")
}

/// The addresses of the farm that `bottega up` runs on this machine, as its file has them: the farm's, and a line each for the page and
/// the FIPA platform that the same process serves.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LocalAddresses {
    /// How the farm is found from this machine: its secret word is part of it.
    pub farm: String,
    /// The page, such as `http://127.0.0.1:8080`; none: no page is served.
    pub page: Option<String>,
    /// The message transport of the FIPA platform, such as `http://127.0.0.1:7779/acc`; none: no platform is served.
    pub platform: Option<String>,
}

/// What the lines of the page and the platform begin with.
const PAGE: &str = "page ";
const PLATFORM: &str = "platform ";

impl LocalAddresses {
    /// Reads the file. `None`: no `bottega up` of this user runs here.
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

/// The farm of this machine, if `bottega up` runs here.
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
