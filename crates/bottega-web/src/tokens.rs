//! Tokens as clients show them: in the URL that was printed, which becomes a cookie, or as a bearer. Whose they are the farm knows.

use std::net::IpAddr;

use axum::http::{HeaderMap, header};
use bottega_cluster::{web_secrets::TokenRole, web_tokens::TokenHolder};

/// One who has shown a token.
#[derive(Clone, Debug)]
pub(crate) struct TokenBearer {
    pub(crate) holder: TokenHolder,
    pub(crate) address: IpAddr,
}

impl TokenBearer {
    pub(crate) fn role(&self) -> TokenRole {
        self.holder.role
    }

    /// Who it is, for logs.
    pub(crate) fn said(&self) -> String {
        format!("the token `{}` at {}", self.holder.name, self.address)
    }
}

/// The cookie of a door.
pub(crate) struct TokenCookie {
    /// Cookies know no port: doors of one machine have cookies of different names.
    name: String,
    is_secure: bool,
}

impl TokenCookie {
    pub(crate) fn new(port: u16, is_secure: bool) -> Self {
        Self { name: format!("bottega_{port}"), is_secure }
    }

    /// The token that a client shows: `Authorization: Bearer …`, or the cookie.
    pub(crate) fn shown<'a>(&self, headers: &'a HeaderMap) -> Option<&'a str> {
        let bearer = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
        if let Some(bearer) = bearer.and_then(|value| value.split_once(' ')) {
            return Some(bearer.1.trim()).filter(|_| bearer.0.eq_ignore_ascii_case("bearer"));
        }
        let cookies = headers.get_all(header::COOKIE).into_iter().filter_map(|value| value.to_str().ok());
        let mut pairs = cookies.flat_map(|cookies| cookies.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.find(|(name, _)| *name == self.name).map(|(_, value)| value)
    }

    /// The cookie that a token becomes.
    pub(crate) fn of(&self, token: &str) -> String {
        let secure = if self.is_secure { "; Secure" } else { "" };
        format!("{}={token}; Path=/; HttpOnly; SameSite=Strict{secure}", self.name)
    }
}
