//! Tokens as clients present them: in the printed URL, which becomes a cookie, or as a bearer token. The farm knows their
//! holders.

use std::net::IpAddr;

use axum::http::{HeaderMap, header};
use bottega_cluster::{web_secrets::TokenRole, web_tokens::TokenHolder};

/// The holder of a valid token, and the address of the client.
#[derive(Clone, Debug)]
pub(crate) struct TokenBearer {
    pub(crate) holder: TokenHolder,
    pub(crate) address: IpAddr,
}

impl TokenBearer {
    pub(crate) fn role(&self) -> TokenRole {
        self.holder.role
    }

    /// Returns the bearer as text for logs.
    pub(crate) fn said(&self) -> String {
        format!("the token `{}` at {}", self.holder.name, self.address)
    }
}

/// The cookie with a door's token.
pub(crate) struct TokenCookie {
    /// Name of the cookie; it contains the port, since cookies of one host are shared by all ports.
    name: String,
    is_secure: bool,
}

impl TokenCookie {
    pub(crate) fn new(port: u16, is_secure: bool) -> Self {
        Self { name: format!("bottega_{port}"), is_secure }
    }

    /// Returns the token of a request: from `Authorization: Bearer …`, or from the cookie; `None`: it has none.
    pub(crate) fn shown<'a>(&self, headers: &'a HeaderMap) -> Option<&'a str> {
        let bearer = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok());
        if let Some(bearer) = bearer.and_then(|value| value.split_once(' ')) {
            return Some(bearer.1.trim()).filter(|_| bearer.0.eq_ignore_ascii_case("bearer"));
        }
        let cookies = headers.get_all(header::COOKIE).into_iter().filter_map(|value| value.to_str().ok());
        let mut pairs = cookies.flat_map(|cookies| cookies.split(';')).filter_map(|pair| pair.trim().split_once('='));
        pairs.find(|(name, _)| *name == self.name).map(|(_, value)| value)
    }

    /// Returns the `Set-Cookie` header of a token.
    pub(crate) fn of(&self, token: &str) -> String {
        let secure = if self.is_secure { "; Secure" } else { "" };
        format!("{}={token}; Path=/; HttpOnly; SameSite=Strict{secure}", self.name)
    }
}
