//! The listening ports of a farm, bound before anything is started, so that a port in use leaves nothing behind.

use std::{
    io::ErrorKind,
    net::{SocketAddr, TcpListener},
};

use crate::error::Error;

/// The purpose of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Port {
    /// The NATS server.
    Server,
    /// The FIPA platform of `bottega up`.
    Platform,
    /// The FIPA platform of `bottega platform serve`.
    OwnPlatform,
    /// The web page and the HTTP API.
    Page,
    /// The dashboard, a web page for one picture.
    Dashboard,
}

impl Port {
    fn word(self) -> &'static str {
        match self {
            Self::Server => "the NATS server",
            Self::Platform | Self::OwnPlatform => "the FIPA platform",
            Self::Page => "the page",
            Self::Dashboard => "the dashboard",
        }
    }

    /// Returns the command-line option that sets the address.
    fn option(self) -> &'static str {
        match self {
            Self::Server | Self::OwnPlatform => "--listen",
            Self::Platform => "--fipa",
            Self::Page => "--web",
            Self::Dashboard => "--dashboard",
        }
    }
}

/// Listens on an address. Returns the listening socket.
///
/// # Errors
/// The address cannot be bound: the error names the purpose of the port, the reason and the option that chooses another.
pub fn bind(port: Port, address: SocketAddr) -> Result<TcpListener, Error> {
    TcpListener::bind(address).map_err(|error| {
        let option = port.option();
        let remedy = match error.kind() {
            ErrorKind::AddrInUse => {
                format!(
                    "another program has this port: end that program, or choose another port with {option} ADDRESS:PORT"
                )
            }
            ErrorKind::AddrNotAvailable => {
                format!(
                    "{} is not an address of this machine: choose one that is, with {option} ADDRESS:PORT",
                    address.ip()
                )
            }
            _ => format!("choose another address or port with {option} ADDRESS:PORT"),
        };
        Error::failed(format!("{} cannot listen on {address}: {error}", port.word()), remedy)
    })
}

/// Listens on a default address, or on the next free port above it. Returns the listening socket.
///
/// - `tries`: the number of ports above it that are tried, before any free port is taken.
///
/// # Errors
/// The error of [`bind`] for the address itself, if no port is free.
pub fn bind_near(port: Port, address: SocketAddr, tries: u16) -> Result<TcpListener, Error> {
    bind(port, address).or_else(|error| {
        let others = (address.port()..).skip(1).take(tries.into()).chain([0]);
        let mut found = others.map(|number| TcpListener::bind(SocketAddr::new(address.ip(), number)));
        found.find_map(Result::ok).ok_or(error)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_of_a_port_in_use_names_the_option_that_chooses_another() {
        let taken = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = taken.local_addr().unwrap();
        for (port, option) in [(Port::Server, "--listen"), (Port::Platform, "--fipa"), (Port::Page, "--web")] {
            let error = bind(port, address).unwrap_err();
            let remedy = error.remedy().unwrap();
            assert!(error.to_string().contains(&address.to_string()) && remedy.contains(option), "{error}; {remedy}");
        }
        let near = bind_near(Port::Page, address, 3).unwrap().local_addr().unwrap();
        assert!(near.ip() == address.ip() && near.port() != address.port());
        let elsewhere = bind(Port::Page, "192.0.2.1:0".parse().unwrap()).unwrap_err();
        assert!(elsewhere.remedy().unwrap().contains("not an address of this machine"), "{elsewhere}");
    }
}
