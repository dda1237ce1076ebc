//! Discovery of farms on the local network by mDNS: a server announces its address and its pin, and no secret.

use std::{
    net::{IpAddr, SocketAddr},
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::Pin;
use mdns_sd::{ServiceDaemon, ServiceEvent, ServiceInfo};

use crate::{error::Error, names::host_name};

const SERVICE: &str = "_bottega._tcp.local.";
/// The mDNS property with the server's pin.
const PIN: &str = "pin";
/// The time limit of a search for a farm.
const LOOK: Duration = Duration::from_secs(8);

/// Announces a farm on the local network until it is dropped.
pub(crate) struct Beacon(ServiceDaemon);

impl Beacon {
    /// Starts announcing a farm.
    ///
    /// - `port`: the port of the server, on all addresses of this machine.
    ///
    /// # Errors
    /// mDNS cannot be used, with the cause.
    pub(crate) fn light(pin: Pin, port: u16) -> Result<Self, mdns_sd::Error> {
        let daemon = ServiceDaemon::new()?;
        let pin = pin.to_string();
        let host = format!("{}.local.", host_name());
        let name = format!("bottega-{}", &pin[..8]);
        let service = ServiceInfo::new(SERVICE, &name, &host, "", port, &[(PIN, pin.as_str())][..])?.enable_addr_auto();
        daemon.register(service)?;
        Ok(Self(daemon))
    }
}

impl Drop for Beacon {
    fn drop(&mut self) {
        if let Err(error) = self.0.shutdown() {
            tracing::debug!(%error, "the network is not told that the farm ends");
        }
    }
}

/// Returns the address of the farm on the local network whose server has the given pin.
pub(crate) fn find(pin: Pin) -> Result<String, Error> {
    let failed = |error: mdns_sd::Error| nowhere(&format!("the network cannot be asked: {error}"));
    let daemon = ServiceDaemon::new().map_err(failed)?;
    let events = daemon.browse(SERVICE).map_err(failed)?;
    let until = Instant::now() + LOOK;
    let mut found = None;
    while let Some(left) = until.checked_duration_since(Instant::now())
        && found.is_none()
    {
        let Ok(event) = events.recv_timeout(left) else { break };
        if let ServiceEvent::ServiceResolved(service) = event
            && service.get_property_val_str(PIN) == Some(&pin.to_string())
        {
            let addresses = service.get_addresses().iter().map(mdns_sd::ScopedIp::to_ip_addr);
            // Any address works; prefer IPv4, which needs no zone.
            let address = addresses.min_by_key(IpAddr::is_ipv6);
            found = address.map(|ip| SocketAddr::new(ip, service.get_port()).to_string());
        }
    }
    if let Err(error) = daemon.shutdown() {
        tracing::debug!(%error, "the search did not end well");
    }
    found.ok_or_else(|| nowhere("no machine on the local network answers for it"))
}

fn nowhere(reason: &str) -> Error {
    Error::failed(
        format!("the farm was not found: {reason}"),
        "name its machine: bottega join bottega://WORD@HOST:4222, the whole line that `bottega up` printed",
    )
}
