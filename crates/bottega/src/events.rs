//! The events of a picture while it is painted, as they cross the process boundary. Version 1: fields and kinds may be added,
//! none changes its meaning.

mod society;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub(crate) use self::society::corners;
pub use self::society::{AgentEvent, AuctionEvent, ForecastEvent, RoundEvent, TheftEvent, Zone, ZoneChoice, ZoneEvent};

/// Something that happened in a job; one JSON object, told apart by its field `event`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Event {
    /// The scene is loaded and the work begins.
    Started {
        /// Version of this vocabulary.
        version: u32,
        /// The scene file.
        scene: String,
        /// The file that the picture goes to.
        output: String,
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
        /// The part that is painted: x0, y0, x1, y1.
        crop: [u32; 4],
        /// Samples per pixel; with `error` or `time` the most that a pixel gets.
        samples_per_pixel: u32,
        /// The estimated relative error at which a place is finished, where one was asked for.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<f64>,
        /// The time for all of it in seconds, where one was asked for.
        #[serde(skip_serializing_if = "Option::is_none")]
        time: Option<f64>,
        /// How light is followed: path, photon or ala.
        integrator: String,
        /// Whether by progressive photons.
        progressive: bool,
        /// Render Agents.
        agents: usize,
        /// Processors.
        threads: usize,
        /// GPUs that paint beside them, by name.
        gpus: Vec<String>,
        /// Triangles of the scene, where our own engine has read it.
        #[serde(skip_serializing_if = "Option::is_none")]
        triangles: Option<u64>,
        /// How the picture is painted, in words.
        method: String,
        /// Who paints, in words.
        painters: String,
        /// Seed of the picture.
        seed: u64,
    },
    /// The scene is on its way to a farm.
    Sending {
        /// What is there.
        bytes_sent: u64,
        /// What is to be sent in all.
        bytes: u64,
        /// Since it began.
        seconds: f64,
        /// Until it is there, at this pace.
        seconds_left: Option<f64>,
    },
    /// A farm has the job.
    Asked {
        /// Its number there; of an animation, that of the first frame.
        job: u32,
        /// Of an animation, the number of the last frame's job.
        #[serde(skip_serializing_if = "Option::is_none")]
        last_job: Option<u32>,
    },
    /// A frame of an animation is written.
    Frame {
        /// The file.
        output: String,
        /// Frames that are.
        done: usize,
        /// All frames that were asked for.
        all: usize,
    },
    /// Something that people may want to know.
    Note {
        /// What.
        message: String,
    },
    /// Something that the user should know; the work goes on.
    Warning {
        /// What.
        message: String,
    },
    /// The Analyst has cut the picture into zones.
    Analyzed {
        /// The zones.
        zones: Vec<Zone>,
        /// How long it took.
        seconds: f64,
    },
    /// A zone has a new state: its row on the Blackboard.
    Zone(Box<ZoneEvent>),
    /// An agent's row on the Blackboard has changed.
    Agent(AgentEvent),
    /// A round of the auction has ended.
    Round(RoundEvent),
    /// An agent has taken zones that waited in another's hand.
    Theft(TheftEvent),
    /// What all rounds of the auction came to.
    Auction(AuctionEvent),
    /// How well the times of zones were known before anybody had seen them.
    Forecast(ForecastEvent),
    /// How far the work is.
    Progress(Progress),
    /// There is a new preview, with a colour for every pixel: in the file of `--preview`, and as `/api/jobs/1/preview.png`
    /// where the dashboard is.
    Preview {
        /// How many there were, with this one. The first is coarse: a look at the whole picture before it is painted.
        number: u32,
        /// Seconds since the scene was loaded: its file read and its acceleration structures built.
        seconds: f64,
    },
    /// What the lighting agents of a picture were like, what they cost and what they were asked.
    LightingAgents(LightingAgents),
    /// A device compiles its kernels for the scene: told twice a second while it does. It paints nothing before; others do.
    Compiling {
        /// The device.
        device: String,
        /// For how long it has.
        seconds: f64,
    },
    /// How far a step is that comes after the painting.
    Step {
        /// Which, such as `denoising`.
        name: String,
        /// From 0 to 1.
        share: f64,
    },
    /// Two engines have painted the picture.
    Mixed {
        /// How often each of them painted a zone.
        engines: Vec<EngineShare>,
        /// Whether one sees the edges of the zones: how many standard deviations what differs there lies above the rest.
        seams_z: f64,
        /// How probable that is where there are no seams.
        seams_p: f64,
    },
    /// What each zone took is written down, for `bottega simulate`.
    Recorded {
        /// The file.
        file: String,
    },
    /// What the processors and devices of this machine did while the picture was painted.
    Resources {
        /// One after the other.
        resources: Vec<ResourceUse>,
        /// Since the scene was loaded.
        seconds: f64,
        /// Units that waited in the work bin, in the mean.
        bin_waiting: f64,
        /// Share of the time in which the work bin was full.
        bin_full: f64,
        /// Share of the time in which it was empty.
        bin_empty: f64,
        /// Units past their life time: of a view that nobody looks at any more.
        #[serde(default)]
        expired: u64,
    },
    /// The same is written as a drawing or as data.
    Timeline {
        /// The file.
        file: String,
    },
    /// The picture was led to its end by another machine, and is written here.
    Fetched {
        /// The file.
        output: String,
    },
    /// What noise was left in the picture is removed.
    Denoised {
        /// By what, of which layers.
        by: String,
        /// How long it took.
        seconds: f64,
    },
    /// The picture is written.
    Finished {
        /// The file.
        output: String,
        /// Wall-clock time of rendering, without loading.
        seconds: f64,
        /// Samples taken, all pixels together.
        samples: u64,
        /// Share of processors × time that was spent painting.
        utilization: f64,
        /// Share of the wall-clock time in which no sample was under way: analysis, auction, composition.
        overhead: f64,
        /// Share of all painted pixels that lie in bands beyond their zones.
        bands: f64,
        /// Share of the wall-clock time that composing the picture took.
        composition: f64,
    },
    /// The work was stopped; what is painted is written.
    Interrupted {
        /// The file.
        output: String,
        /// Wall-clock time of rendering so far.
        seconds: f64,
        /// Share of the samples that are taken.
        done: f64,
    },
}

/// A processor or a device, and what it did.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ResourceUse {
    /// Its name.
    pub name: String,
    /// Share of its time with work, from 0 to 1.
    pub occupation: f64,
    /// Units of work done.
    pub units: u64,
    /// Attempts that failed.
    pub failures: u64,
    /// Memory of its own for scenes, where it tells.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<u64>,
    /// Bytes of scenes that are in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub resident_bytes: Option<u64>,
    /// Bytes of scenes that it was sent since this program opened it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sent_bytes: Option<u64>,
    /// What passed on its cable, if it is a board behind one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cable: Option<CableTraffic>,
}

/// The traffic on a board's cable.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct CableTraffic {
    /// Bytes sent, scenes included.
    pub sent_bytes: u64,
    /// Bytes of answers.
    pub received_bytes: u64,
    /// Bytes a second that pass there, as measured last.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_there: Option<f64>,
    /// The same on the way back.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bandwidth_back: Option<f64>,
    /// Packets that were answered.
    pub packets: u64,
    /// Seconds between the sending of a packet and its answer, in the mean.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub packet_seconds: Option<f64>,
}

/// How often an engine painted a zone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EngineShare {
    /// The engine.
    pub engine: String,
    /// Passes over zones.
    pub zones: u64,
}

/// The lighting agents of a picture: their properties, their cost, and the questions they were asked on this machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct LightingAgents {
    /// Agents that the lights cast.
    pub cast: u32,
    /// Agents that are stored, clones and scouts among them.
    pub agents: u64,
    /// Those behind the first surface.
    pub clones: u64,
    /// Sensors of geometry, proximity, penumbra and irradiance.
    pub sensors: [u64; 4],
    /// Links of the proximity network.
    pub links: u64,
    /// Agents that answer "lit", "shaded" and "trace a ray".
    pub answers: [u64; 3],
    /// Mean distance between objects, in scene units.
    pub object_distance: f32,
    /// Of the photons that come to mirrors and glass, the shares whose light the camera sees: sent without asking lookouts, and sent
    /// by them. Missing where nobody was asked, or none comes there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub caustics_seen: Option<[f64; 2]>,
    /// Bytes of their maps.
    pub map_bytes: u64,
    /// Seconds that casting took.
    pub casting_seconds: f64,
    /// Seconds that sensing took.
    pub sensing_seconds: f64,
    /// Shadow rays that were traced.
    pub shadow_rays_traced: u64,
    /// Shadow rays that were not.
    pub shadow_rays_spared: u64,
    /// Times that indirect light was gathered.
    pub irradiance_computed: u64,
    /// Times that it was interpolated.
    pub irradiance_interpolated: u64,
}

/// The progress of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Progress {
    /// Zones painted.
    pub zones_done: usize,
    /// All zones.
    pub zones: usize,
    /// Samples taken, all pixels together.
    pub samples_done: u64,
    /// Samples that the picture will have.
    pub samples: u64,
    /// Samples a second, lately.
    pub samples_per_second: f64,
    /// Share of the predicted cost that is done.
    pub share: f64,
    /// Seconds since rendering began.
    pub seconds: f64,
    /// Seconds still to go, by the predicted cost of what is left.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seconds_left: Option<f64>,
}

impl Event {
    /// The event as one line of JSON.
    pub fn to_json(&self) -> String {
        // Nothing in here can fail to serialize: no maps with odd keys, no foreign types.
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
