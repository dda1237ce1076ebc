//! The events of a job as they cross the process boundary. Version 1: fields may be added, none changes its meaning.

use serde::Serialize;

/// Something that happened in a job; one JSON object, told apart by its field `event`.
#[derive(Clone, Debug, PartialEq, Serialize)]
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
        /// Samples a pixel.
        samples_per_pixel: u32,
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
        /// Its number there.
        job: u32,
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
    /// A zone has a new state.
    Zone {
        /// Which.
        id: u32,
        /// `open`, `profiled`, `awarded`, `done`, …
        state: String,
        /// Who has it or had it.
        #[serde(skip_serializing_if = "Option::is_none")]
        agent: Option<String>,
        /// Seconds of reference-machine time that it should take.
        #[serde(skip_serializing_if = "Option::is_none")]
        seconds_estimated: Option<f64>,
        /// Seconds of reference-machine time that it took.
        #[serde(skip_serializing_if = "Option::is_none")]
        seconds_measured: Option<f64>,
        /// Samples a pixel that it has.
        samples: u32,
        /// Its estimated relative error, where one was asked for.
        #[serde(skip_serializing_if = "Option::is_none")]
        error: Option<f64>,
    },
    /// How far the work is.
    Progress(Progress),
    /// There is a new preview, with a colour for every pixel: in the file of `--preview`, and as `/api/preview.png` where
    /// the dashboard is.
    Preview {
        /// How many there were, with this one. The first is coarse: a look at the whole picture before it is painted.
        number: u32,
        /// Seconds since the scene was loaded: its file read and its acceleration structures built.
        seconds: f64,
    },
    /// What the lighting agents of a picture were like, what they cost and what they were asked.
    LightingAgents(LightingAgents),
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

/// A zone of the picture.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Zone {
    /// Its number.
    pub id: u32,
    /// x0, y0, x1, y1.
    pub rect: [u32; 4],
    /// Complexity of an average pixel of it: predicted cost, 1 is the mean of the picture.
    pub complexity_density: f64,
}

/// What the lighting agents of a picture were like, what they cost, and what they were asked on this machine.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct LightingAgents {
    /// Agents that the lights cast.
    pub cast: u32,
    /// Agents that are stored, clones among them.
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

/// How far a job is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
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
