//! The utilization of processors and devices during rendering.

use std::path::Path;

use bottega_hra::{CableUse, HraReport, timeline_json, timeline_svg};

use super::reporter::Reporter;
use crate::{
    builtin::BuiltinPainter,
    devices::GpuScenes,
    error::Error,
    events::{CableTraffic, Event, ResourceUse},
    text::shown,
};

/// The format of a timeline, chosen by the file extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TimelineForm {
    Svg,
    Json,
}

impl TimelineForm {
    fn of(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_str()?.to_ascii_lowercase();
        match &*end {
            "svg" => Some(Self::Svg),
            "json" => Some(Self::Json),
            _ => None,
        }
    }
}

/// Checks that the extension of a timeline's file is .svg or .json.
///
/// # Errors
/// The extension is another one.
pub(super) fn check_timeline(path: &Path) -> Result<(), Error> {
    TimelineForm::of(path).map(|_| ()).ok_or_else(|| {
        Error::usage(
            format!("the format of the timeline {} is unknown", path.display()),
            "end its name in .svg (a drawing) or .json (data)",
        )
    })
}

/// Reports the utilization, and writes the timeline if a file is given. If that file cannot be written, only warns.
pub(super) fn tell(painter: &BuiltinPainter, timeline: Option<&Path>, reporter: &Reporter) {
    let report = painter.engine.report();
    reporter.tell(resources_event(painter, &report));
    let Some((path, form)) = timeline.and_then(|path| Some((path, TimelineForm::of(path)?))) else { return };
    let text = match form {
        TimelineForm::Svg => timeline_svg(&report, None),
        TimelineForm::Json => timeline_json(&report),
    };
    match std::fs::write(path, text) {
        Ok(()) => reporter.tell(Event::Timeline { file: shown(path) }),
        Err(error) => reporter.warn(format!("the timeline {} is lost: {error}", path.display())),
    }
}

fn resources_event(painter: &BuiltinPainter, report: &HraReport) -> Event {
    let seconds = report.uptime.as_secs_f64().max(f64::MIN_POSITIVE);
    // The resources list the processors first, then the devices in the order of `devices.scenes`.
    let scenes = painter.devices.scenes.iter().map(Some);
    let scenes = std::iter::repeat_n(None, painter.devices.threads).chain(scenes).chain(std::iter::repeat(None));
    let resources = report.resources.iter().zip(scenes).map(|(resource, scenes)| ResourceUse {
        name: resource.descriptor.name.clone(),
        occupation: resource.occupation(),
        units: resource.units,
        failures: resource.failures,
        packets: resource.packets.packets,
        packet_largest: resource.packets.largest as u64,
        window: resource.packets.window as u64,
        round_trip: resource.packets.round_trip.map(|time| time.as_secs_f64()),
        memory_bytes: resource.descriptor.memory_bytes,
        resident_bytes: scenes.map(GpuScenes::resident_bytes),
        sent_bytes: scenes.map(GpuScenes::sent_bytes),
        cable: resource
            .cable
            .filter(|_| painter.devices.boards.iter().any(|board| board.name == resource.descriptor.name))
            .map(|cable| traffic(&cable)),
    });
    Event::Resources {
        resources: resources.collect(),
        seconds: report.uptime.as_secs_f64(),
        bin_waiting: report.bin.mean_waiting,
        bin_capacity: report.bin_capacity as u64,
        bin_full: report.bin.full.as_secs_f64() / seconds,
        bin_empty: report.bin.empty.as_secs_f64() / seconds,
        expired: report.expiries.count(),
    }
}

fn traffic(cable: &CableUse) -> CableTraffic {
    CableTraffic {
        sent_bytes: cable.sent_bytes,
        received_bytes: cable.received_bytes,
        bandwidth_there: cable.bandwidth_there,
        bandwidth_back: cable.bandwidth_back,
        packets: cable.packets,
        packet_seconds: cable.packet_time().map(|time| time.as_secs_f64()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_is_that_of_the_name() {
        for (name, right) in [("a.svg", true), ("a.JSON", true), ("a.png", false), ("svg", false), ("", false)] {
            assert_eq!(check_timeline(Path::new(name)).is_ok(), right, "{name}");
        }
    }
}
