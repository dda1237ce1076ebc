//! The access tokens of a farm's HTTP servers: two derived from the farm's word, and any number of named ones. All are
//! listed and revoked here, and every server of the farm applies this at once.
//!
//! - `token/NAME`: a named token: its digest, from which the token cannot be found, its role, and who made it.
//! - `token/see`, `token/steer`: how often the derived token of that role was revoked.

use bottega::request::{TAG_FORM, is_tag};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    job::{board::JobBoard, record::unix_seconds},
    server::web_secrets::{TokenRole, WebSecrets, fresh_token},
};

/// Prefix of the notices of tokens.
const TOKENS: &str = "token/";
/// The most named tokens of a farm.
const TOKENS_MAX: usize = 256;

/// The description of a token, for lists. Only its holder knows the token itself.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct WebToken {
    /// The name of the token; `see` and `steer` are those derived from the farm's word.
    pub name: String,
    /// `see`: may only look; `steer`: may do everything.
    pub role: TokenRole,
    /// The time at which the token was made, in seconds since 1970; `null`: with the farm.
    pub made: Option<u64>,
    /// The name of the user who made it, or revoked its predecessor; `null`: it was made with the farm.
    pub by: Option<String>,
}

/// The name and role of a token that a client has presented.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TokenHolder {
    /// The name of the token.
    pub name: String,
    /// The role of the token.
    pub role: TokenRole,
}

/// The stored record of a token.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct TokenNotice {
    role: TokenRole,
    /// The BLAKE3 hash of the token; none: it is derived from the farm's word.
    digest: Option<String>,
    /// The number of times that a derived token was revoked and replaced.
    generation: u64,
    made: u64,
    by: String,
}

impl JobBoard {
    /// Returns all tokens: the two derived ones, and then the named ones in the order of their names; at a guest, only the
    /// derived ones.
    pub fn web_tokens(&self) -> Vec<WebToken> {
        let derived = TokenRole::ALL.map(|role| {
            let revoked = self.token_notice(role.word());
            let (made, by) = (revoked.as_ref().map(|token| token.made), revoked.map(|token| token.by));
            WebToken { name: role.word().to_owned(), role, made, by }
        });
        let made = self.made_tokens().into_iter().map(|(name, notice)| {
            let TokenNotice { role, made, by, .. } = notice;
            WebToken { name, role, made: Some(made), by: Some(by) }
        });
        derived.into_iter().chain(made).collect()
    }

    /// Returns the current token of a role that is derived from the secrets.
    pub fn own_token(&self, secrets: &WebSecrets, role: TokenRole) -> String {
        secrets.token(role, self.token_notice(role.word()).map_or(0, |notice| notice.generation))
    }

    /// Returns the name and role of a presented token. `None`: it is unknown or revoked. A guest knows only the derived tokens.
    pub fn token_holder(&self, secrets: &WebSecrets, token: &str) -> Option<TokenHolder> {
        // Compare hashes, in constant time, so that timing reveals nothing.
        let shown = blake3::hash(token.as_bytes());
        let holder = |name: &str, role| TokenHolder { name: name.to_owned(), role };
        let derived = TokenRole::ALL.into_iter().rev();
        let mut derived = derived.filter(|role| blake3::hash(self.own_token(secrets, *role).as_bytes()) == shown);
        derived.next().map(|role| holder(role.word(), role)).or_else(|| {
            let is_shown = |notice: &TokenNotice| {
                notice.digest.as_ref().and_then(|digest| blake3::Hash::from_hex(digest).ok()) == Some(shown)
            };
            let found = self.made_tokens().into_iter().find(|(_, notice)| is_shown(notice));
            found.map(|(name, notice)| holder(&name, notice.role))
        })
    }

    /// Creates a named token. Returns it, 32 hexadecimal digits; it is not stored and cannot be shown again.
    ///
    /// - `by`: the name of the user.
    ///
    /// # Errors
    /// The name is invalid or taken, there are 256 named tokens already, this machine is a guest, the system gives no random
    /// numbers, or the farm does not store the token.
    pub fn make_token(&self, name: &str, role: TokenRole, by: &str) -> Result<String, Error> {
        self.refuse_guests()?;
        if !is_tag(name) {
            return Err(Error::usage(
                format!("`{}` cannot be the name of a token", name.escape_debug()),
                format!("a name consists of {TAG_FORM}"),
            ));
        }
        let is_own = TokenRole::ALL.iter().any(|role| role.word() == name);
        if is_own || self.token_notice(name).is_some() {
            return Err(Error::failed(
                format!("there is a token `{name}` already"),
                format!("choose another name, or revoke that one: bottega tokens revoke {name}"),
            ));
        }
        if self.made_tokens().len() >= TOKENS_MAX {
            return Err(Error::failed(format!("there are {TOKENS_MAX} tokens"), "revoke those that are not needed"));
        }
        let token = fresh_token()?;
        let digest = Some(blake3::hash(token.as_bytes()).to_hex().to_string());
        let notice = TokenNotice { role, digest, generation: 0, made: unix_seconds(), by: by.to_owned() };
        self.put_notice(&notice_name(name), &notice)?;
        tracing::info!(name, role = role.word(), by, "a token was made");
        Ok(token)
    }

    /// Revokes a token: all servers refuse it from now on. A derived token is replaced at once.
    ///
    /// - `name`: the name of the token; `see` and `steer` are the derived ones.
    /// - `by`: the name of the user.
    ///
    /// # Errors
    /// There is no such token, this machine is a guest, or the farm does not store the change.
    pub fn revoke_token(&self, name: &str, by: &str) -> Result<(), Error> {
        self.refuse_guests()?;
        let before = self.token_notice(name);
        if let Some(role) = TokenRole::ALL.into_iter().find(|role| role.word() == name) {
            let generation = before.map_or(0, |notice| notice.generation) + 1;
            let notice = TokenNotice { role, digest: None, generation, made: unix_seconds(), by: by.to_owned() };
            self.put_notice(&notice_name(name), &notice)?;
        } else if before.is_some() {
            self.uplink.notices().remove(&notice_name(name)).map_err(Error::Blob)?;
        } else {
            let remedy = "`bottega tokens list` lists the tokens";
            return Err(Error::failed(format!("there is no token `{}`", name.escape_debug()), remedy));
        }
        tracing::info!(name, by, "a token was revoked");
        Ok(())
    }

    fn token_notice(&self, name: &str) -> Option<TokenNotice> {
        if is_tag(name) { self.read_notice(&notice_name(name)) } else { None }
    }

    /// Returns the named tokens, by name. None at a guest, whose server could keep what clients present.
    fn made_tokens(&self) -> Vec<(String, TokenNotice)> {
        if self.uplink.is_guest() {
            return Vec::new();
        }
        let notices = self.uplink.notices().all(TOKENS).into_iter();
        let mut made: Vec<(String, TokenNotice)> = notices
            .filter_map(|notice| {
                let name = notice.name.strip_prefix(TOKENS)?.to_owned();
                let token: TokenNotice = serde_json::from_slice(&notice.text).ok()?;
                token.digest.is_some().then_some((name, token))
            })
            .collect();
        made.sort_by(|(a, _), (b, _)| a.cmp(b));
        made
    }
}

fn notice_name(name: &str) -> String {
    format!("{TOKENS}{name}")
}
