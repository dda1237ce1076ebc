//! The members of a farm that `bottega up` runs, and their part of the server's configuration.

use std::{fmt::Write, fs, path::PathBuf};

use bottega_agents::driver::nats::{Login, MemberKey, Rights, is_public_key};
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    names::plain,
    server::{
        address::{FARM, Group},
        link::{EnrolmentAnswer, EnrolmentRequest, write_secret},
    },
};

/// The most members of a farm.
const MEMBERS_MAX: usize = 1 << 14;
/// The user that makes the server reload its configuration.
const SYSTEM_USER: &str = "system";
/// The number of characters of its key in a member's name.
const KEY_LETTERS: usize = 8;

/// An admitted machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct AdmittedMachine {
    /// The unique name of the machine, which its agents' names end with.
    name: String,
    /// The public NKey of the machine.
    key: String,
    is_guest: bool,
}

/// The secrets and members of a farm, in a file that only its user may read.
#[derive(Debug, Serialize, Deserialize)]
struct Roll {
    /// The secrets of the join words.
    trusted: String,
    guest: String,
    /// The password of `bottega up` for the server's system account.
    system: String,
    /// The key of `bottega up` itself.
    seed: String,
    key: String,
    /// The certificate of the server and its private key, PEM.
    certificate: String,
    certificate_key: String,
    members: Vec<AdmittedMachine>,
}

/// The members of a farm.
pub(crate) struct Members {
    path: PathBuf,
    roll: Roll,
}

impl Members {
    /// Reads the members of an earlier run, or creates a new list.
    pub(crate) fn open(path: PathBuf) -> Result<Self, Error> {
        match fs::read(&path) {
            Ok(text) => {
                let roll = serde_json::from_slice(&text).map_err(|error| {
                    Error::failed(
                        format!("`{}` is damaged: {error}", path.display()),
                        "remove it; every machine must then join again, by the new line",
                    )
                })?;
                Ok(Self { path, roll })
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                let members = Self { path, roll: Roll::new()? };
                members.save()?;
                Ok(members)
            }
            Err(source) => Err(Error::read(path, source)),
        }
    }

    fn save(&self) -> Result<(), Error> {
        write_secret(&self.path, &serde_json::to_vec_pretty(&self.roll).unwrap_or_default())
    }

    /// Returns the secret of a group's join word.
    pub(crate) fn secret(&self, group: Group) -> &str {
        match group {
            Group::Trusted => &self.roll.trusted,
            Group::Guest => &self.roll.guest,
        }
    }

    /// Returns the number of members. It never decreases.
    pub(crate) fn count(&self) -> usize {
        self.roll.members.len()
    }

    /// Returns the login for the server's system account.
    pub(crate) fn system_login(&self) -> Login {
        Login::User(SYSTEM_USER.to_owned(), self.roll.system.clone())
    }

    /// Returns the user of the system account, in the syntax of the server's configuration.
    pub(crate) fn system_user(&self) -> String {
        format!("{{ user: {SYSTEM_USER}, password: \"{}\" }}", self.roll.system)
    }

    /// Returns the seed of the key of `bottega up` itself.
    pub(crate) fn seed(&self) -> &str {
        &self.roll.seed
    }

    /// Returns the certificate of the server, and its private key.
    pub(crate) fn certificate(&self) -> (&str, &str) {
        (&self.roll.certificate, &self.roll.certificate_key)
    }

    /// Admits a machine that knows the word of a group. Its request is untrusted.
    pub(crate) fn answer(&mut self, group: Group, request: &[u8]) -> EnrolmentAnswer {
        let refuse = |reason: &str| EnrolmentAnswer { member: None, refused: Some(reason.to_owned()) };
        let Ok(EnrolmentRequest { key, host }) = serde_json::from_slice(request) else {
            return refuse("its request is not an enrolment request");
        };
        if !is_public_key(&key) {
            return refuse("its key is not a public key of NATS");
        }
        if let Some(known) = self.roll.members.iter().find(|member| member.key == key) {
            return EnrolmentAnswer { member: Some(known.name.clone()), refused: None };
        }
        if self.roll.members.len() >= MEMBERS_MAX {
            return refuse("there are too many members");
        }
        // The first letter is the same for all public keys. The directories compare names in lower case.
        let name = format!("{}-{}", plain(&host), &key[1..=KEY_LETTERS]).to_lowercase();
        if self.roll.members.iter().any(|member| member.name == name) {
            return refuse("another member has its name");
        }
        self.roll.members.push(AdmittedMachine { name: name.clone(), key, is_guest: group == Group::Guest });
        match self.save() {
            Ok(()) => EnrolmentAnswer { member: Some(name), refused: None },
            Err(error) => {
                self.roll.members.pop();
                refuse(&format!("the farm cannot store it: {error}"))
            }
        }
    }

    /// Returns all users of the server, in the syntax of its configuration.
    pub(crate) fn users(&self) -> String {
        let mut users = format!("    {{ nkey: {} }}\n", self.roll.key);
        for group in Group::ALL {
            let rights = permissions(&Rights::of_newcomer(group.word()));
            let (word, secret) = (group.word(), self.secret(group));
            // Writing to a string does not fail.
            _ = writeln!(users, "    {{ user: {word}, password: \"{secret}\", permissions: {rights} }}");
        }
        for AdmittedMachine { name, key, is_guest } in &self.roll.members {
            let rights = is_guest.then(|| format!(", permissions: {}", permissions(&Rights::of_guest(FARM, name))));
            _ = writeln!(users, "    {{ nkey: {key}{} }}", rights.unwrap_or_default());
        }
        users
    }
}

/// Creates a self-signed certificate, and its private key (PEM).
pub(crate) fn own_certificate() -> Result<(String, String), Error> {
    let made = rcgen::generate_simple_self_signed(vec!["bottega".to_owned()]).map_err(|error| {
        Error::failed(format!("cannot make a certificate: {error}"), "this is unexpected; report it")
    })?;
    Ok((made.cert.pem(), made.signing_key.serialize_pem()))
}

/// Returns permissions in the syntax of the server's configuration.
fn permissions(rights: &Rights) -> String {
    let list =
        |subjects: &[String]| subjects.iter().map(|subject| format!("{subject:?}")).collect::<Vec<_>>().join(", ");
    format!("{{ publish: [{}], subscribe: [{}] }}", list(&rights.publish), list(&rights.subscribe))
}

impl Roll {
    fn new() -> Result<Self, Error> {
        let unexpected = |what: String| Error::failed(what, "this is unexpected; report it");
        let secret = || {
            let mut bytes = [0; 16];
            getrandom::fill(&mut bytes)
                .map_err(|error| unexpected(format!("the system gives no random numbers: {error}")))?;
            Ok::<_, Error>(bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>())
        };
        let key = MemberKey::new();
        let seed = key.seed().ok_or_else(|| unexpected("a new key has no seed".to_owned()))?;
        let (certificate, certificate_key) = own_certificate()?;
        Ok(Self {
            trusted: secret()?,
            guest: secret()?,
            system: secret()?,
            seed,
            key: key.public(),
            certificate,
            certificate_key,
            members: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn request(key: &str, host: &str) -> Vec<u8> {
        serde_json::to_vec(&EnrolmentRequest { key: key.to_owned(), host: host.to_owned() }).unwrap()
    }

    #[test]
    fn who_was_let_in_is_a_member_after_a_new_start() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("members.json");
        let mut members = Members::open(path.clone()).unwrap();
        let key = MemberKey::new().public();
        let name = members.answer(Group::Guest, &request(&key, "paint.example.com")).member.unwrap();
        assert!(name.starts_with("paint-"));
        let mut again = Members::open(path).unwrap();
        assert_eq!(again.users(), members.users());
        let answer = again.answer(Group::Trusted, &request(&key, "x"));
        assert_eq!(answer.member, Some(name.clone()), "it stays what it is");
        assert!(again.users().contains(&format!("from.{name}.*")));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 32, ..ProptestConfig::default() })]

        #[test]
        fn nothing_that_one_sends_gets_into_the_configuration(
            bytes in prop::collection::vec(any::<u8>(), 0..80),
            text in "\\PC{0,60}",
        ) {
            let folder = tempfile::tempdir().unwrap();
            let mut members = Members::open(folder.path().join("m")).unwrap();
            let before = members.users();
            prop_assert!(members.answer(Group::Guest, &bytes).member.is_none());
            prop_assert!(members.answer(Group::Guest, &request(&text, "h")).member.is_none());
            prop_assert_eq!(&members.users(), &before);
            let key = MemberKey::new().public();
            let name = members.answer(Group::Guest, &request(&key, &text)).member.unwrap();
            prop_assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || c == '-'));
        }
    }
}
