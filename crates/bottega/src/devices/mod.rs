//! The devices of this machine: processors and GPUs.

mod board;
mod choice;
pub mod costs;
mod gpu;
mod kept;
mod measure;
mod room;

use std::{sync::Arc, thread};

use bottega_hra::{HraReport, Incident, Lane};
use bottega_render::{PreparedScene, RenderWork};

pub(crate) use self::board::{are_worth_waves, left_alone};
pub use self::{
    board::ConnectedBoard,
    choice::{DeviceSet, PainterWish, beside_gpus, beside_processors},
    kept::release,
    measure::{DeviceCosts, PrimitiveCost, measure},
};
pub use crate::request::DeviceChoice;
use crate::{error::Error, request::Request};

/// Processors that this process may use.
pub fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Processors that a request allows.
pub fn threads(request: &Request) -> usize {
    request.devices.threads.map_or_else(processors, usize::from)
}

/// The GPU that was asked for, with the scene on it: it paints blocks of pixels.
///
/// # Errors
/// There is none of that name, or it cannot paint the scene.
pub fn painter(name: &str, scene: &Arc<PreparedScene>) -> Result<Lane<RenderWork>, Error> {
    Ok(gpu::open(Some(name.to_owned()), scene)?)
}

/// What went wrong with a device, for its user.
pub fn incident_line(report: &HraReport, incident: &Incident) -> String {
    let named = report.resources.iter().find(|resource| resource.id == incident.resource);
    let name = named.map_or_else(|| incident.resource.to_string(), |resource| resource.descriptor.name.clone());
    let times = if incident.count == 1 { String::new() } else { format!(", {} times", incident.count) };
    let reason = if incident.reason.is_empty() { String::new() } else { format!(" ({})", incident.reason) };
    format!("{name} {}{times}{reason}", incident.fault)
}
