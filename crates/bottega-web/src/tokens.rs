//! Tokens: who may look on, and who may steer, by a token in the URL that was printed, which becomes a cookie, or as a bearer.

use axum::http::{HeaderMap, header};

/// What one may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum VisitorRole {
    /// Look on.
    See,
    /// Everything.
    Steer,
}

impl VisitorRole {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::See => "see",
            Self::Steer => "steer",
        }
    }
}

/// The tokens of a door.
pub(crate) struct Tokens {
    see: String,
    steer: String,
    /// Cookies know no port: doors of one machine have cookies of different names.
    cookie: String,
    is_secure: bool,
}

impl Tokens {
    pub(crate) fn new(see: String, steer: String, port: u16, is_secure: bool) -> Self {
        Self { see, steer, cookie: format!("bottega_{port}"), is_secure }
    }

    /// What a token lets one do.
    pub(crate) fn role(&self, token: &str) -> Option<VisitorRole> {
        // Digests are compared, in constant time: how long it takes says nothing of the token.
        let is = |known: &str| blake3::hash(known.as_bytes()) == blake3::hash(token.as_bytes());
        match (is(&self.steer), is(&self.see)) {
            (true, _) => Some(VisitorRole::Steer),
            (_, true) => Some(VisitorRole::See),
            _ => None,
        }
    }

    /// The token that a client shows: `Authorization: Bearer …`, or the cookie.
    pub(crate) fn shown<'a>(&self, headers: &'a HeaderMap) -> Option<&'a str> {
        let bearer = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
        if let Some(bearer) = bearer.and_then(|value| value.split_once(' ')) {
            return Some(bearer.1.trim()).filter(|_| bearer.0.eq_ignore_ascii_case("bearer"));
        }
        let cookies = headers.get_all(header::COOKIE).into_iter().filter_map(|value| value.to_str().ok());
        let mut pairs = cookies.flat_map(|cookies| cookies.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.find(|(name, _)| *name == self.cookie).map(|(_, value)| value)
    }

    /// The cookie that a token becomes.
    pub(crate) fn set_cookie(&self, token: &str) -> String {
        let secure = if self.is_secure { "; Secure" } else { "" };
        format!("{}={token}; Path=/; HttpOnly; SameSite=Strict{secure}", self.cookie)
    }

    /// The token of a role.
    pub(crate) fn of(&self, role: VisitorRole) -> &str {
        match role {
            VisitorRole::See => &self.see,
            VisitorRole::Steer => &self.steer,
        }
    }
}
