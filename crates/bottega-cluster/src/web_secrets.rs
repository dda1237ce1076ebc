//! Secrets of the HTTP doors of one farm: tokens that all of them derive from the word of the farm, and a
//! certificate.

use crate::{
    address::{FarmAddress, Group, Keeper},
    error::Error,
    members::{Members, own_certificate},
};

/// What is derived from the word of a farm; the other way nobody can go.
const SEE: &str = "bottega 2026-11-26 web token: see";
const STEER: &str = "bottega 2026-11-26 web token: steer";
/// Bytes of a token.
const TOKEN_BYTES: usize = 16;

/// By what an HTTP door lets one in, and how it is known.
#[derive(Clone)]
pub struct WebSecrets {
    /// Who shows it may look on.
    pub see: String,
    /// Who shows it may do everything.
    pub steer: String,
    /// The certificate of the door, and its key (PEM).
    pub certificate: (String, String),
}

impl WebSecrets {
    /// Those of one process alone.
    ///
    /// # Errors
    /// The system gives no random numbers, or no certificate can be made.
    pub fn fresh() -> Result<Self, Error> {
        let mut secret = [0; 32];
        getrandom::fill(&mut secret).map_err(|error| {
            Error::failed(format!("the system gives no random numbers: {error}"), "see that /dev/urandom is there")
        })?;
        Self::derived(&secret, own_certificate()?)
    }

    /// Those of a farm, for one of its processes: the same in each that may do everything. Where others run the servers, or this
    /// process is a guest, those of this process alone.
    ///
    /// # Errors
    /// As of [`Self::fresh`].
    pub fn of_farm(farm: &FarmAddress) -> Result<Self, Error> {
        match &farm.keeper {
            Keeper::Up(word) if word.group == Group::Trusted => {
                Self::derived(word.secret.as_bytes(), own_certificate()?)
            }
            _ => Self::fresh(),
        }
    }

    /// Those of a farm, for the process that has it up.
    pub(crate) fn of_host(members: &Members) -> Result<Self, Error> {
        let (certificate, key) = members.certificate();
        Self::derived(members.secret(Group::Trusted).as_bytes(), (certificate.to_owned(), key.to_owned()))
    }

    fn derived(secret: &[u8], certificate: (String, String)) -> Result<Self, Error> {
        let token = |context: &str| {
            let key = blake3::derive_key(context, secret);
            key[..TOKEN_BYTES].iter().map(|byte| format!("{byte:02x}")).collect::<String>()
        };
        Ok(Self { see: token(SEE), steer: token(STEER), certificate })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_doors_of_a_farm_have_the_same_tokens_and_other_farms_have_others() {
        let folder = tempfile::tempdir().unwrap();
        let members = Members::open(folder.path().join("m")).unwrap();
        let host = WebSecrets::of_host(&members).unwrap();
        let pin = crate::up::pin(&members).unwrap();
        let word = |group, secret: &str| crate::address::JoinWord { group, secret: secret.to_owned(), pin };
        let at = |word| FarmAddress::of_up("127.0.0.1:1".to_owned(), word);
        let trusted = word(Group::Trusted, members.secret(Group::Trusted));
        let other = WebSecrets::of_farm(&at(trusted)).unwrap();
        assert_eq!((&host.see, &host.steer), (&other.see, &other.steer));
        assert_ne!(host.see, host.steer);
        assert_eq!(host.see.len(), 2 * TOKEN_BYTES);
        for secret in [members.secret(Group::Guest), &"0".repeat(32)] {
            for group in Group::ALL {
                let stranger = WebSecrets::of_farm(&at(word(group, secret))).unwrap();
                assert!(stranger.see != host.see && stranger.steer != host.steer);
            }
        }
    }
}
