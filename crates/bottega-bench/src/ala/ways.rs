//! The compared methods, and the measurement of each.

use std::{
    ops::Range,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_engines::{BuiltinEngine, BuiltinOptions, Devices, RenderEngine, Tunables};
use bottega_image::{AovSet, Film, Layout, Picture, Rect, Tile, USUAL_TRIM, rel_mse_trimmed};
use bottega_render::{
    AgentSettings, Filter, Oracle, PathSettings, PhotonSettings, PrepareOptions, PreparedScene, View, ala::AgentReport,
    photon::MapBytes,
};

use crate::{error::Error, files::shared_meshes, painting::paint_samples};

/// One method to render the scene.
#[derive(Clone, Debug)]
pub(super) struct LightMethod {
    pub(super) name: String,
    /// The settings of photons or agents; `None`: path tracing.
    pub(super) photons: Option<PhotonSettings>,
}

/// The error of an image, and the time spent on its samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mark {
    pub(super) samples: u32,
    /// Render time in seconds, without preparation.
    pub(super) seconds: f64,
    /// Relative mean squared error, without the worst 0.1 % of the pixels.
    pub(super) error: f64,
}

/// The times, memory and image of a method.
#[derive(Clone, Debug)]
pub(super) struct MethodResult {
    pub(super) way: LightMethod,
    /// Time of photons, agents and all preparation before the first sample, in seconds.
    pub(super) casting: f64,
    pub(super) bytes: MapBytes,
    pub(super) marks: Vec<Mark>,
    pub(super) agents: Option<AgentReport>,
    pub(super) picture: Picture,
}

/// The scene, and how it is rendered.
pub(super) struct PaintedScene<'a> {
    pub(super) path: &'a Path,
    /// Width and height of the picture, in pixels.
    pub(super) size: (u32, u32),
    pub(super) max_depth: u32,
    pub(super) threads: usize,
}

impl LightMethod {
    pub(super) fn paths() -> Self {
        Self { name: "paths".to_owned(), photons: None }
    }

    /// Returns photon mapping with final gathering.
    pub(super) fn photons(count: u32) -> Self {
        let photons = PhotonSettings { count, ..PhotonSettings::default() };
        Self { name: format!("{} photons", counted(count)), photons: Some(photons) }
    }

    /// Returns photon mapping as in the paper: also with shadow photons and an irradiance cache.
    pub(super) fn photons_as_in_the_paper(count: u32) -> Self {
        let photons = PhotonSettings {
            count,
            irradiance_cache: 0.15,
            lookouts: false,
            shadow_photons: true,
            gather_directions: false,
            ..PhotonSettings::default()
        };
        Self { name: format!("{} photons, cached", counted(count)), photons: Some(photons) }
    }

    /// Returns photon mapping with the paper's four maps: direct and indirect photons are separate and counted where rays end,
    /// and rays are directed to where indirect photons came from.
    pub(super) fn photons_in_four_maps(count: u32) -> Self {
        let Self { photons, .. } = Self::photons_as_in_the_paper(count);
        let photons = photons.map(|it| PhotonSettings { separate_maps: true, gather_directions: true, ..it });
        Self { name: format!("{} photons, four maps", counted(count)), photons }
    }

    /// Returns the method without indirect light, except over mirrors and through glass.
    pub(super) fn without_indirect(self) -> Self {
        let without = |photons: PhotonSettings| {
            let agents = photons.agents.map(|agents| AgentSettings { decides_irradiance: false, ..agents });
            PhotonSettings { indirect: false, agents, ..photons }
        };
        Self { name: format!("{}, no indirect light", self.name), photons: self.photons.map(without) }
    }

    /// Makes the method that uses lighting agents.
    ///
    /// - `decides_shadows`: `false` traces all shadow rays.
    pub(super) fn agents(oracle: Oracle, cast: u32, decides_shadows: bool) -> Self {
        let agents = AgentSettings { cast, oracle, decides_shadows, ..AgentSettings::default() };
        let lookouts = oracle == Oracle::Error;
        let photons = PhotonSettings { agents: Some(agents), lookouts, ..PhotonSettings::default() };
        let whose = if oracle == Oracle::Paper { " of the paper" } else { "" };
        Self { name: format!("{} agents{whose}", counted(cast)), photons: Some(photons) }
    }
}

impl MethodResult {
    /// Returns the render time until the error is not greater, interpolated linearly in logarithms between two marks. `None`: not
    /// reached.
    pub(super) fn seconds_to(&self, error: f64) -> Option<f64> {
        let next = self.marks.iter().position(|mark| mark.error <= error)?;
        let there = self.marks[next];
        let Some(before) = next.checked_sub(1).map(|before| self.marks[before]) else { return Some(there.seconds) };
        let share = (before.error / error).ln() / (before.error / there.error).ln();
        Some(before.seconds * (there.seconds / before.seconds).powf(share.clamp(0.0, 1.0)))
    }

    pub(super) fn error(&self) -> f64 {
        self.marks.last().map_or(f64::NAN, |mark| mark.error)
    }

    pub(super) fn seconds(&self) -> f64 {
        self.marks.last().map_or(f64::NAN, |mark| mark.seconds)
    }

    /// Returns the size of all maps, in megabytes.
    pub(super) fn megabytes(&self) -> f64 {
        self.by_map().iter().map(|(_, bytes)| *bytes as f64 / 1e6).sum()
    }

    /// Returns the bytes of each map, with its name.
    pub(super) fn by_map(&self) -> [(&'static str, usize); 8] {
        let MapBytes { seen, irradiance, direct, indirect, arrivals, shadow, cache, agents } = self.bytes;
        [
            ("direct", direct),
            ("indirect", indirect),
            ("caustic", seen),
            ("shadow", shadow),
            ("irradiance", irradiance),
            ("directions", arrivals),
            ("cache", cache),
            ("agents", agents),
        ]
    }

    /// Returns the share of shadow rays that were traced.
    pub(super) fn traced(&self) -> Option<f64> {
        let tally = self.agents?.tally;
        Some(tally.shadow_traced as f64 / (tally.shadow_traced + tally.shadow_spared).max(1) as f64)
    }
}

impl PaintedScene<'_> {
    /// Renders a converged image.
    pub(super) fn reference(&self, samples: u32) -> Result<Picture, Error> {
        let engine = self.engine(&LightMethod::paths(), 0x7265_6665, samples)?;
        engine.prepare()?;
        Ok(picture(&self.samples(&engine, 0..samples, None)?.0))
    }

    /// Renders with 1, 2, 4, … samples per pixel.
    pub(super) fn paint(&self, way: LightMethod, samples: u32, reference: &Picture) -> Result<MethodResult, Error> {
        let engine = self.engine(&way, 0, samples)?;
        let begun = Instant::now();
        engine.prepare()?;
        let casting = begun.elapsed().as_secs_f64();
        let (mut marks, mut time, mut tile, mut taken) = (Vec::new(), Duration::ZERO, None, 0);
        while taken < samples {
            let next = (2 * taken).clamp(1, samples);
            let (painted, took) = self.samples(&engine, taken..next, tile.take())?;
            time += took;
            let error = rel_mse_trimmed(reference, &picture(&painted), USUAL_TRIM)?;
            marks.push(Mark { samples: next, seconds: time.as_secs_f64(), error });
            (taken, tile) = (next, Some(painted));
        }
        let (bytes, agents) = (engine.map_bytes(), engine.lighting_agents());
        let picture = tile.map_or_else(|| reference.clone(), |tile| picture(&tile));
        Ok(MethodResult { casting, bytes, marks, agents, picture, way })
    }

    fn engine(&self, way: &LightMethod, seed: u64, planned: u32) -> Result<BuiltinEngine, Error> {
        // Prepare again each time: existing maps cost nothing.
        let prepared = self.prepared()?;
        let photons = way.photons.map(|photons| PhotonSettings { bounces: self.max_depth, ..photons });
        let settings = PathSettings {
            seed,
            max_depth: self.max_depth,
            filter: Filter::PIXEL,
            planned_samples: planned,
            photons,
            ..PathSettings::default()
        };
        let layout = Layout::new(AovSet::NONE);
        let view = self.view(&prepared)?;
        let options = BuiltinOptions { view, settings, layout, threads: self.threads, wavefront: false };
        Ok(BuiltinEngine::new(prepared, options, Devices::default()))
    }

    pub(super) fn prepared(&self) -> Result<Arc<PreparedScene>, Error> {
        let loaded = bottega_scene::load(self.path, &shared_meshes())?;
        let options = PrepareOptions { threads: self.threads, ..PrepareOptions::default() };
        Ok(Arc::new(PreparedScene::new(Arc::new(loaded.scene), &options)?))
    }

    /// Returns the picture of the first camera.
    pub(super) fn view(&self, prepared: &PreparedScene) -> Result<View, Error> {
        Ok(View::of_scene(prepared.scene(), 0, self.size.0, self.size.1)?)
    }

    fn samples(
        &self,
        engine: &BuiltinEngine,
        samples: Range<u32>,
        tile: Option<Tile>,
    ) -> Result<(Tile, Duration), Error> {
        let rect = Rect::of_size(self.size.0, self.size.1);
        let tunables = Tunables { max_depth: self.max_depth, light_samples: 1 };
        paint_samples(engine, rect, tunables, samples, tile)
    }
}

fn picture(tile: &Tile) -> Picture {
    let mut film = Film::new(tile.rect(), tile.layout().clone());
    film.add_tile(tile, |_, _| 1.0);
    film.to_picture()
}

/// Formats a count with a unit for thousands or millions.
fn counted(count: u32) -> String {
    match count {
        1_000_000.. if count.is_multiple_of(100_000) => format!("{} M", f64::from(count) / 1e6),
        1_000.. => format!("{} k", f64::from(count) / 1e3),
        _ => count.to_string(),
    }
}
