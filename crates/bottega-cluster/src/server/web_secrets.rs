//! Secrets of the HTTP servers of one farm: two tokens, derived from the farm's word, and a certificate.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    server::{
        address::{FarmAddress, Group, Operator},
        members::{Members, own_certificate},
    },
};

/// Contexts of the key derivation from the farm's word, which is one-way.
const SEE: &str = "bottega 2026-11-26 web token: see";
const STEER: &str = "bottega 2026-11-26 web token: steer";
/// Length of a token in bytes.
const TOKEN_BYTES: usize = 16;

/// The permissions of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum TokenRole {
    /// A token that may only look.
    See,
    /// A token that may do everything.
    Steer,
}

impl TokenRole {
    /// All roles, from the least permissions to the most.
    pub const ALL: [Self; 2] = [Self::See, Self::Steer];

    /// Returns the name of the role.
    pub fn word(self) -> &'static str {
        match self {
            Self::See => "see",
            Self::Steer => "steer",
        }
    }
}

/// The secrets of an HTTP server: its tokens and its certificate.
#[derive(Clone)]
pub struct WebSecrets {
    /// The secret from which the tokens are derived.
    secret: Vec<u8>,
    /// True if other processes of the farm have the same secret.
    is_shared: bool,
    /// The certificate of the server, and its private key (PEM).
    pub certificate: (String, String),
}

impl WebSecrets {
    /// Returns new secrets for one process.
    ///
    /// # Errors
    /// The system gives no random numbers, or no certificate can be made.
    pub fn fresh() -> Result<Self, Error> {
        let secret = random::<32>()?.to_vec();
        Ok(Self { secret, is_shared: false, certificate: own_certificate()? })
    }

    /// Returns the secrets of a farm, the same in each trusted process. With servers of other operators, or as a guest: new
    /// ones for this process.
    ///
    /// # Errors
    /// As for [`Self::fresh`].
    pub fn of_farm(farm: &FarmAddress) -> Result<Self, Error> {
        match &farm.operator {
            Operator::Up(word) if word.group == Group::Trusted => {
                let secret = word.secret.as_bytes().to_vec();
                Ok(Self { secret, is_shared: true, certificate: own_certificate()? })
            }
            _ => Self::fresh(),
        }
    }

    /// Returns the secrets of a farm, for the process that runs it.
    pub(crate) fn of_host(members: &Members) -> Result<Self, Error> {
        let (certificate, key) = members.certificate();
        let secret = members.secret(Group::Trusted).as_bytes().to_vec();
        Ok(Self { secret, is_shared: true, certificate: (certificate.to_owned(), key.to_owned()) })
    }

    /// Returns true if other processes of the farm derive the same tokens.
    pub fn is_shared(&self) -> bool {
        self.is_shared
    }

    /// Returns the token of a role, 32 hexadecimal digits, derived from the secret.
    ///
    /// - `generation`: number of times that it was revoked and replaced.
    pub fn token(&self, role: TokenRole, generation: u64) -> String {
        let context = match role {
            TokenRole::See => SEE,
            TokenRole::Steer => STEER,
        };
        let mut material = self.secret.clone();
        if generation > 0 {
            material.extend(generation.to_le_bytes());
        }
        hexadecimal(&blake3::derive_key(context, &material)[..TOKEN_BYTES])
    }
}

/// Returns a new random token.
pub(crate) fn fresh_token() -> Result<String, Error> {
    random::<TOKEN_BYTES>().map(|bytes| hexadecimal(&bytes))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn random<const N: usize>() -> Result<[u8; N], Error> {
    let mut bytes = [0; N];
    getrandom::fill(&mut bytes).map_err(|error| {
        Error::failed(format!("the system gives no random numbers: {error}"), "check that /dev/urandom exists")
    })?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_doors_of_a_farm_have_the_same_tokens_and_other_farms_have_others() {
        let folder = tempfile::tempdir().unwrap();
        let members = Members::open(folder.path().join("m")).unwrap();
        let host = WebSecrets::of_host(&members).unwrap();
        let pin = crate::server::up::pin(&members).unwrap();
        let word = |group, secret: &str| crate::server::address::JoinWord { group, secret: secret.to_owned(), pin };
        let at = |word| FarmAddress::of_up("127.0.0.1:1".to_owned(), word);
        let trusted = word(Group::Trusted, members.secret(Group::Trusted));
        let other = WebSecrets::of_farm(&at(trusted)).unwrap();
        let tokens =
            |of: &WebSecrets| TokenRole::ALL.map(|role| [0, 1, 2].map(|generation| of.token(role, generation)));
        assert_eq!(tokens(&host), tokens(&other));
        let all: std::collections::BTreeSet<String> = tokens(&host).into_iter().flatten().collect();
        assert_eq!(all.len(), 6, "each role and generation has its own");
        assert!(all.iter().all(|token| token.len() == 2 * TOKEN_BYTES));
        for secret in [members.secret(Group::Guest), &"0".repeat(32)] {
            for group in Group::ALL {
                let stranger = WebSecrets::of_farm(&at(word(group, secret))).unwrap();
                assert!(tokens(&stranger).iter().flatten().all(|token| !all.contains(token)));
            }
        }
    }
}
