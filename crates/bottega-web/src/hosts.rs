//! The host names of a door. They protect against DNS rebinding: a page of another site may resolve its own name to this
//! machine's address, but its requests then have that name as `Host`, and are refused.

use std::{collections::BTreeSet, net::SocketAddr};

/// The allowed host names of a door, with their ports.
#[derive(Debug)]
pub(crate) struct HostNames {
    allowed: BTreeSet<String>,
    scheme: &'static str,
}

impl HostNames {
    /// Collects the host names of a door.
    ///
    /// - `bound`: address on which the door listens.
    /// - `more`: further host names, such as that of a proxy, with port if it is part of the `Host` header.
    /// - `is_secure`: true for https.
    pub(crate) fn new(bound: SocketAddr, more: &[String], is_secure: bool) -> Self {
        let (scheme, default_port) = if is_secure { ("https", 443) } else { ("http", 80) };
        let mut hosts = Vec::new();
        if bound.ip().is_unspecified() {
            let interfaces = if_addrs::get_if_addrs().unwrap_or_default();
            hosts.extend(interfaces.into_iter().map(|interface| host_of(SocketAddr::new(interface.ip(), 0))));
        } else {
            hosts.push(host_of(bound));
        }
        if bound.ip().is_loopback() || bound.ip().is_unspecified() {
            hosts.extend(["localhost", "127.0.0.1", "[::1]"].map(str::to_owned));
        }
        let mut allowed: BTreeSet<String> = more.iter().map(|name| name.to_ascii_lowercase()).collect();
        for host in hosts {
            if bound.port() == default_port {
                allowed.insert(host.clone());
            }
            allowed.insert(format!("{host}:{}", bound.port()));
        }
        Self { allowed, scheme }
    }

    /// Returns true if a `Host` header names this door.
    pub(crate) fn has(&self, host: &str) -> bool {
        self.allowed.contains(&host.to_ascii_lowercase())
    }

    /// Returns true if an `Origin` header is that of this door's pages.
    pub(crate) fn is_origin(&self, origin: &str) -> bool {
        let (scheme, host) = origin.split_once("://").unwrap_or_default();
        // A proxy may terminate TLS.
        (scheme == self.scheme || scheme == "https") && self.has(host)
    }
}

/// Returns the host of an address in the form of URLs.
pub(crate) fn host_of(address: SocketAddr) -> String {
    match address {
        SocketAddr::V4(address) => address.ip().to_string(),
        SocketAddr::V6(address) => format!("[{}]", address.ip()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_own_names_with_the_own_port_are_taken() {
        let names = HostNames::new(([127, 0, 0, 1], 8080).into(), &["farm.example".to_owned()], false);
        for own in ["127.0.0.1:8080", "localhost:8080", "LOCALHOST:8080", "[::1]:8080", "farm.example"] {
            assert!(names.has(own), "{own}");
        }
        for other in [
            "",
            "evil.example",
            "evil.example:8080",
            "127.0.0.1",
            "127.0.0.1:80",
            "localhost:8080.evil.example",
            "10.0.0.7:8080",
        ] {
            assert!(!names.has(other), "{other}");
        }
        assert!(names.is_origin("http://127.0.0.1:8080") && names.is_origin("https://farm.example"));
        for other in ["null", "", "http://evil.example", "http://127.0.0.1:8081", "file://127.0.0.1:8080"] {
            assert!(!names.is_origin(other), "{other}");
        }
    }

    #[test]
    fn one_that_listens_everywhere_is_called_by_the_addresses_of_its_machine() {
        let names = HostNames::new(([0, 0, 0, 0], 443).into(), &[], true);
        assert!(names.has("127.0.0.1") && names.has("localhost:443") && !names.has("0.0.0.0:443"));
        assert!(names.is_origin("https://localhost") && !names.is_origin("http://localhost"));
    }
}
