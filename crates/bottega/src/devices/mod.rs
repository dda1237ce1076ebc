//! The devices of this machine: processors and GPUs.

#[cfg(feature = "board")]
mod board;
pub(crate) mod board_address;
mod board_worth;
mod choice;
pub mod costs;
#[cfg(feature = "gpu")]
mod gpu;
mod kept;
#[cfg(feature = "gpu")]
mod measure;
#[cfg(feature = "gpu")]
mod room;
#[cfg(not(feature = "board"))]
mod without_board;
#[cfg(not(feature = "gpu"))]
mod without_gpu;

use std::thread;

use bottega_hra::{HraReport, Incident};

pub(crate) use self::board_worth::{are_worth_waves, unused_boards_warning};
#[cfg(not(feature = "board"))]
use self::without_board as board;
#[cfg(not(feature = "gpu"))]
use self::without_gpu as gpu;
pub use self::{
    board_worth::ConnectedBoard,
    choice::{DeviceSet, PainterWish, beside_gpus, beside_processors},
    gpu::{GpuScenes, compiling},
    kept::release,
};
#[cfg(feature = "gpu")]
pub use self::{
    gpu::painter,
    measure::{DeviceCosts, PrimitiveCost, measure},
};
pub use crate::request::DeviceChoice;
use crate::request::Request;

/// Returns the number of processors that this process may use; 1 if it is unknown.
pub fn processors() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// Returns the number of CPU threads of a request; by default all processors.
pub fn threads(request: &Request) -> usize {
    request.devices.threads.map_or_else(processors, usize::from)
}

/// Returns a fault of a device as one line of text.
///
/// - `report`: the report of the run, which has the name of the device.
pub fn incident_line(report: &HraReport, incident: &Incident) -> String {
    let named = report.resources.iter().find(|resource| resource.id == incident.resource);
    let name = named.map_or_else(|| incident.resource.to_string(), |resource| resource.descriptor.name.clone());
    let times = if incident.count == 1 { String::new() } else { format!(", {} times", incident.count) };
    let reason = if incident.reason.is_empty() { String::new() } else { format!(" ({})", incident.reason) };
    format!("{name} {}{times}{reason}", incident.fault)
}
