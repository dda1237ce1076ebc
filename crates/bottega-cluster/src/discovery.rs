//! Farms on the local network, by mDNS: a server says where it is and how it is known, and no secret.

use std::{
    net::{IpAddr, SocketAddr},
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::Pin;
use mdns_sd::{ServiceDaemon, ServiceEvent, ServiceInfo};

use crate::error::Error;
use crate::names::host_name;

const SERVICE: &str = "_bottega._tcp.local.";
/// The property that says how the server is known.
const PIN: &str = "pin";
/// How long a farm is looked for.
const LOOK: Duration = Duration::from_secs(8);

/// Tells the local network where a farm is, until it is dropped.
pub(crate) struct Beacon(ServiceDaemon);

impl Beacon {
    /// - `port`: where the server listens, on all addresses of this machine.
    ///
    /// # Errors
    /// The network cannot be told, with the reason.
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

/// Where on the local network the farm is whose server is known so.
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
            // Any will do; those of the older protocol need no zone.
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
