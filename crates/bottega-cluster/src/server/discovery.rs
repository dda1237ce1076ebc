//! Discovery of farms on the local network by mDNS: a server announces its address and its pin, and no secret.

use std::{
    collections::BTreeMap,
    net::{IpAddr, SocketAddr},
    ops::ControlFlow,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::Pin;
use mdns_sd::{ServiceDaemon, ServiceEvent, ServiceInfo};
use serde::Serialize;

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
            tracing::debug!(%error, "cannot withdraw the farm from the local network");
        }
    }
}

/// A farm on the local network. Joining it needs its word, which it does not announce.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct FoundFarm {
    /// The name of the machine that runs its server.
    pub host: String,
    /// The address and port of its server.
    pub address: String,
    /// The digest of its server's certificate, which its word ends with.
    pub pin: String,
}

/// Listens on the local network for the time `within`. Returns the farms that announced themselves, sorted by host.
///
/// # Errors
/// mDNS cannot be used.
pub fn farms(within: Duration) -> Result<Vec<FoundFarm>, Error> {
    let mut found: BTreeMap<String, FoundFarm> = BTreeMap::new();
    browse(within, |farm| {
        // A farm announces all addresses of its machine: keep the best one.
        match found.get(&farm.pin) {
            Some(known) if rank(&known.address) <= rank(&farm.address) => {}
            _ => _ = found.insert(farm.pin.clone(), farm),
        }
        ControlFlow::Continue(())
    })?;
    let mut farms: Vec<FoundFarm> = found.into_values().collect();
    farms.sort();
    Ok(farms)
}

/// Returns the address of the farm on the local network whose server has the given pin. Searches for at most 8 s.
///
/// # Errors
/// mDNS cannot be used, or no such farm announces itself.
pub(crate) fn find(pin: Pin) -> Result<String, Error> {
    let pin = pin.to_string();
    let mut found = None;
    browse(LOOK, |farm| {
        if farm.pin != pin {
            return ControlFlow::Continue(());
        }
        found = Some(farm.address);
        ControlFlow::Break(())
    })?;
    found.ok_or_else(|| not_found("no machine on the local network answers for it"))
}

/// Ranks addresses of one machine, the best one first: those that other machines can use, and IPv4, which needs no zone.
fn rank(address: &str) -> (bool, bool) {
    let ip = address.parse::<SocketAddr>().map(|address| address.ip());
    ip.map_or((true, true), |ip| (ip.is_loopback(), ip.is_ipv6()))
}

/// Reports farms as they announce themselves, until a time has passed or `tell` breaks off.
fn browse(within: Duration, mut tell: impl FnMut(FoundFarm) -> ControlFlow<()>) -> Result<(), Error> {
    let failed = |error: mdns_sd::Error| not_found(&format!("cannot search the local network: {error}"));
    let daemon = ServiceDaemon::new().map_err(failed)?;
    let events = daemon.browse(SERVICE).map_err(failed)?;
    let until = Instant::now() + within;
    while let Some(left) = until.checked_duration_since(Instant::now()) {
        let Ok(event) = events.recv_timeout(left) else { break };
        let ServiceEvent::ServiceResolved(service) = event else { continue };
        let addresses = service.get_addresses().iter().map(mdns_sd::ScopedIp::to_ip_addr);
        // Any address works; prefer IPv4, which needs no zone.
        let address = addresses.min_by_key(IpAddr::is_ipv6);
        let (Some(ip), Some(pin)) = (address, service.get_property_val_str(PIN)) else { continue };
        let host = service.get_hostname().trim_end_matches('.').trim_end_matches(".local").to_owned();
        let address = SocketAddr::new(ip, service.get_port()).to_string();
        if tell(FoundFarm { host, address, pin: pin.to_owned() }).is_break() {
            break;
        }
    }
    if let Err(error) = daemon.shutdown() {
        tracing::debug!(%error, "cannot end the search");
    }
    Ok(())
}

fn not_found(reason: &str) -> Error {
    Error::failed(
        format!("the farm was not found: {reason}"),
        "name its machine: bottega join bottega://WORD@HOST:4222, the whole line that `bottega up` printed",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_that_other_machines_can_use_come_first() {
        let mut addresses = ["[::1]:1", "127.0.0.1:1", "nonsense", "[fd00::2]:1", "192.0.2.2:1"];
        addresses.sort_by_key(|address| rank(address));
        assert_eq!(addresses[..4], ["192.0.2.2:1", "[fd00::2]:1", "127.0.0.1:1", "[::1]:1"]);
    }
}
