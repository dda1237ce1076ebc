//! The events of a rendering job, as they cross the process boundary. Version 1: later versions may add fields and kinds of
//! events; existing ones keep their meaning.

mod society;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use self::society::corners;
pub use self::society::{AgentEvent, AuctionEvent, ForecastEvent, RoundEvent, TheftEvent, Zone, ZoneChoice, ZoneEvent};

/// An event of a job. In JSON one object; its field `event` names the kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The scene is loaded and rendering begins.
    Started {
        /// Version of the event format: 1.
        version: u32,
        /// Path of the scene file.
        scene: String,
        /// The output file; empty if no file is written.
        output: String,
        /// Width of the picture, in pixels.
        width: u32,
        /// Height of the picture, in pixels.
        height: u32,
        /// The part that is rendered, in pixels: x0, y0, x1, y1.
        crop: [u32; 4],
        /// Samples per pixel; with `error` or `time` the maximum per pixel.
        samples_per_pixel: u32,
        /// The requested relative error at which a cell of the picture stops; missing if none was requested.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<f64>,
        /// The requested time limit in seconds, loading included; missing if none was requested.
        #[serde(skip_serializing_if = "Option::is_none")]
        time: Option<f64>,
        /// The integrator: `path`, `photon`, `ala` or `auto`; with an external engine, its title.
        integrator: String,
        /// True if the integrator is progressive photon mapping.
        progressive: bool,
        /// Number of Render Agents.
        agents: usize,
        /// Number of CPU threads.
        threads: usize,
        /// Names of the GPUs that render together with the CPU threads.
        gpus: Vec<String>,
        /// Number of triangles in the scene; missing with an external engine.
        #[serde(skip_serializing_if = "Option::is_none")]
        triangles: Option<u64>,
        /// The integrator as a readable name, such as `path tracing (--integrator path)`.
        method: String,
        /// The devices as readable text, such as `8 processors and H200`; with an external engine, its title.
        painters: String,
        /// Seed of the random numbers.
        seed: u64,
    },
    /// The scene is being uploaded to a farm.
    Sending {
        /// Bytes uploaded so far.
        bytes_sent: u64,
        /// Bytes to upload in total.
        bytes: u64,
        /// Seconds since the upload began.
        seconds: f64,
        /// Seconds until the upload ends at the current rate; `null`: unknown.
        seconds_left: Option<f64>,
    },
    /// A farm has accepted the job.
    #[serde(rename = "asked")]
    Submitted {
        /// The job number on the farm; for an animation, that of the first frame.
        job: u32,
        /// For an animation, the job number of the last frame.
        #[serde(skip_serializing_if = "Option::is_none")]
        last_job: Option<u32>,
    },
    /// A frame of an animation is written.
    Frame {
        /// The output file of the frame.
        output: String,
        /// Frames written so far.
        done: usize,
        /// Frames requested in total.
        all: usize,
    },
    /// An informative message for the user.
    Note {
        /// The text of the message.
        message: String,
    },
    /// A warning; rendering continues.
    Warning {
        /// The text of the warning.
        message: String,
    },
    /// The Analyst has divided the picture into zones.
    Analyzed {
        /// All zones of the picture, in the order of their numbers.
        zones: Vec<Zone>,
        /// Seconds from the start of the job until the zones were known.
        seconds: f64,
    },
    /// The state of a zone has changed: its row on the Blackboard.
    Zone(Box<ZoneEvent>),
    /// An agent's row on the Blackboard has changed.
    Agent(AgentEvent),
    /// A round of the auction has ended.
    Round(RoundEvent),
    /// An agent has taken zones that were waiting in another agent's queue.
    Theft(TheftEvent),
    /// Totals over all rounds of the auction.
    Auction(AuctionEvent),
    /// The accuracy of the estimated zone times, compared with the measured ones.
    Forecast(ForecastEvent),
    /// The progress of rendering.
    Progress(Progress),
    /// A new preview is available, with a color for every pixel: in the file of `--preview`, and at `/api/jobs/1/preview.png`
    /// of the dashboard.
    Preview {
        /// Number of the preview, from 1. The first is coarse: it shows the survey, made before zones are painted.
        number: u32,
        /// Seconds since the scene was loaded (file read and acceleration structures built).
        seconds: f64,
    },
    /// Properties, cost and answers of the lighting agents of a picture.
    LightingAgents(LightingAgents),
    /// A device is compiling its kernels for the scene; repeated twice a second. The device renders nothing until it ends;
    /// other devices do.
    Compiling {
        /// The name of the device.
        device: String,
        /// Seconds since compiling began.
        seconds: f64,
    },
    /// The progress of a step after rendering.
    Step {
        /// The name of the step, such as `denoising`.
        name: String,
        /// The share that is done, 0 to 1.
        share: f64,
    },
    /// Two engines have rendered the picture together.
    Mixed {
        /// The share of each engine, as its number of passes over zones.
        engines: Vec<EngineShare>,
        /// Visibility of zone edges: by how many standard deviations the differences at edges exceed those elsewhere.
        seams_z: f64,
        /// The p-value of `seams_z`: its probability if there were no seams.
        seams_p: f64,
    },
    /// The record of zone times for `bottega simulate` is written.
    Recorded {
        /// Path of the record file.
        file: String,
    },
    /// Utilization of the processors and devices of this machine.
    Resources {
        /// One entry per processor or device.
        resources: Vec<ResourceUse>,
        /// Seconds since the scene was loaded.
        seconds: f64,
        /// Mean number of units waiting in the work bin.
        bin_waiting: f64,
        /// Number of units for which the work bin has room at the end.
        #[serde(default)]
        bin_capacity: u64,
        /// Share of the time during which the work bin was full, 0 to 1.
        bin_full: f64,
        /// Share of the time during which the work bin was empty, 0 to 1.
        bin_empty: f64,
        /// Number of units that expired before they were done, because their view was no longer needed.
        #[serde(default)]
        expired: u64,
    },
    /// The timeline of processors and devices is written, as SVG or JSON.
    Timeline {
        /// Path of the timeline file.
        file: String,
    },
    /// The picture, completed under the lead of another machine, is written here.
    Fetched {
        /// Path of the output file.
        output: String,
    },
    /// The picture is denoised.
    Denoised {
        /// The denoiser and the layers that it used, such as `Open Image Denoise 2.3.0 of color, albedo`.
        by: String,
        /// Seconds that denoising took.
        seconds: f64,
    },
    /// The picture is complete and written.
    Finished {
        /// The output file; empty if no file is written.
        output: String,
        /// Wall-clock seconds of rendering, without loading.
        seconds: f64,
        /// Samples taken over all pixels.
        samples: u64,
        /// Share of processors × time spent rendering, 0 to 1.
        utilization: f64,
        /// Share of processors × time not spent rendering (analysis, auction, composition), 0 to 1.
        overhead: f64,
        /// Share of all painted pixels that lie in interpolation bands beyond their zones.
        bands: f64,
        /// Share of the wall-clock time spent on composing the picture.
        composition: f64,
    },
    /// Rendering was stopped; the pixels painted so far are written.
    Interrupted {
        /// The output file; empty if no file is written.
        output: String,
        /// Wall-clock seconds of rendering so far.
        seconds: f64,
        /// Share of the requested samples that are taken, 0 to 1.
        done: f64,
    },
}

/// The utilization of one processor or device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResourceUse {
    /// The name of the processor or device.
    pub name: String,
    /// Share of the time spent working, 0 to 1.
    pub occupation: f64,
    /// Number of work units done.
    pub units: u64,
    /// Number of attempts that failed.
    pub failures: u64,
    /// Number of packets in which it got these units.
    #[serde(default)]
    pub packets: u64,
    /// Number of units of the largest packet since the device was opened.
    #[serde(default)]
    pub packet_largest: u64,
    /// Largest number of packets in flight at once since the device was opened; 1 for a processor.
    #[serde(default)]
    pub window: u64,
    /// Seconds between sending a packet that does not wait and its answer; missing for a processor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub round_trip: Option<f64>,
    /// Total device memory in bytes; missing if the device does not report it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<u64>,
    /// Bytes of scenes in the device memory; missing if the device is not a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resident_bytes: Option<u64>,
    /// Bytes of scenes sent to the device since this program opened it; missing if the device is not a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sent_bytes: Option<u64>,
    /// The traffic on the cable; missing if the device is not a board.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cable: Option<CableTraffic>,
}

/// The traffic on a board's cable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CableTraffic {
    /// Bytes sent to the board, scenes included.
    pub sent_bytes: u64,
    /// Bytes received from the board.
    pub received_bytes: u64,
    /// Bandwidth to the board in bytes per second, as last measured; missing if it was not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_there: Option<f64>,
    /// Bandwidth from the board in bytes per second, as last measured; missing if it was not measured.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_back: Option<f64>,
    /// Number of packets that were answered.
    pub packets: u64,
    /// Mean seconds between sending a packet and receiving its answer; missing without answers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub packet_seconds: Option<f64>,
}

/// The share of one engine in a picture by two engines.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EngineShare {
    /// The name of the engine.
    pub engine: String,
    /// Number of passes over zones that the engine rendered.
    pub zones: u64,
}

/// Statistics of the lighting agents of a picture on this machine: their properties, cost and answers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LightingAgents {
    /// Number of agents sent out by all lights together, without clones and scouts.
    pub cast: u32,
    /// Number of stored agents, clones and scouts included.
    pub agents: u64,
    /// Number of clones: agents behind the first surface.
    pub clones: u64,
    /// Number of sensors: geometry, proximity, penumbra, irradiance.
    pub sensors: [u64; 4],
    /// Number of links in the proximity network.
    pub links: u64,
    /// Number of agents that answer "lit", "shaded" and "trace a ray".
    pub answers: [u64; 3],
    /// Mean distance between objects, in scene units.
    pub object_distance: f32,
    /// The share, 0 to 1, of the photons that reach mirrors and glass whose light the camera sees: those sent without lookouts,
    /// then those that lookouts send. Missing if lookouts were not used or no photon reaches such surfaces.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub caustics_seen: Option<[f64; 2]>,
    /// Memory of the agent maps, in bytes.
    pub map_bytes: u64,
    /// Seconds that casting took.
    pub casting_seconds: f64,
    /// Seconds that sensing took.
    pub sensing_seconds: f64,
    /// Number of shadow rays traced.
    pub shadow_rays_traced: u64,
    /// Number of shadow rays that the agents' answers made unnecessary.
    pub shadow_rays_spared: u64,
    /// Number of points where indirect light was gathered.
    pub irradiance_computed: u64,
    /// Number of points where indirect light was interpolated.
    pub irradiance_interpolated: u64,
}

/// The progress of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Progress {
    /// Number of finished zones.
    pub zones_done: usize,
    /// Number of zones in total.
    pub zones: usize,
    /// Samples taken so far, over all pixels.
    pub samples_done: u64,
    /// Samples of the complete picture, over all pixels.
    pub samples: u64,
    /// Samples per second over the last few seconds.
    pub samples_per_second: f64,
    /// Share of the predicted cost that is done, 0 to 1.
    pub share: f64,
    /// Seconds since rendering began.
    pub seconds: f64,
    /// Estimated seconds left, from the predicted cost of the remaining work; missing if unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_left: Option<f64>,
}

impl Event {
    /// Returns the event as one line of JSON.
    pub fn to_json(&self) -> String {
        // Events cannot fail to serialize: they hold no maps with non-string keys and no foreign types.
        serde_json::to_string(self).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_is_one_object_with_its_kind() {
        let event = Event::Progress(Progress { zones: 4, ..Progress::default() });
        let value: serde_json::Value = serde_json::from_str(&event.to_json()).expect("valid JSON");
        assert_eq!(value["event"], "progress");
        assert_eq!(value["zones"], 4);
        assert!(value.get("seconds_left").is_none());
    }
}
