//! Pictures whose zones are rendered by different techniques, paths or photons; and the trial that chooses them.
//!
//! Some pixels are rendered by both techniques, twice each. The difference of the two results is the random error of a
//! technique. Photons have another error, that of their maps, which no further sample reduces. It is assumed to be small
//! unless paths contradict: the product of the differences of both results from both results of paths, which are right on
//! average, has the square of that error as its mean. Paths that miss most of the light cannot contradict. Rules choose
//! the technique by error times work, for the number of samples of the picture. Work is counted, not timed, so the choice
//! is the same on every machine.

use std::sync::Arc;

use bottega_kernels::compiled;
use bottega_scene::Spectrum;
use rayon::prelude::*;

use super::{
    path::PathIntegrator,
    photon::PhotonIntegrator,
    record::{PathRecord, Wanted},
    turns::SampleBatch,
};
use crate::{
    error::RenderError,
    prepare::PreparedScene,
    prepass::Prepass,
    sampler::{DimensionSet, PixelSampler},
    settings::{PathSettings, PhotonSettings, View},
    technique::{TechniqueEvidence, TechniqueJudge, TechniquePlan, TriedPhotons},
};

/// Seed of the trial, which no picture uses.
const TRIAL_SEED: u64 = 0x7465_6368_6e69_7175;
/// Samples of the whole picture per sample of the trial.
const SAMPLES_PER_TRIED: u64 = 100;
/// Least and greatest number of pixels in the trial.
const PIXELS: [u64; 2] = [128, 4096];
/// Greatest number of samples per pixel, technique and repetition.
const SAMPLES_MAX: u32 = 8;
/// Pixels that one thread renders in a row.
const PIXELS_PER_CHUNK: usize = 16;
/// Pixels tried per zone of the plan, and greatest number of zones along a side.
const PIXELS_PER_ZONE: f64 = 48.0;
const ZONES_MAX: f64 = 8.0;
/// Weight of the result of all pixels in each zone, in pixels.
const COMMON_PIXELS: f64 = 48.0;
/// Relative squared error of paths in the trial from which the whole picture has one technique: where paths find rare
/// light, they look exact in zones that miss it.
const NOISY: f64 = 0.25;
/// Share of the pixels, those with the greatest errors of paths, that do not count unless paths are very noisy.
const OUTLIERS: f64 = 0.01;
/// Relative error of photon maps that is assumed unless paths contradict.
const MAP_ERROR: f64 = 0.012;
/// Share of the light of photons that paths must find to be believed.
const FOUND_MIN: f64 = 0.97;
/// Time of a unit of work of photons, with its lookups in maps, in that of paths: 1.2 to 2.4 in seven scenes.
const PHOTON_WORK: f64 = 1.9;

/// The integrators of a picture whose zones are rendered by different techniques.
pub(crate) struct ByZone<'a> {
    paths: PathIntegrator<'a>,
    photons: PhotonIntegrator<'a>,
    plan: Arc<TechniquePlan>,
}

impl ByZone<'_> {
    /// Returns the integrator of paths.
    pub(crate) fn paths(&self) -> &PathIntegrator<'_> {
        &self.paths
    }

    /// Returns the integrator of photons.
    pub(crate) fn photons(&self) -> &PhotonIntegrator<'_> {
        &self.photons
    }

    /// Traces samples, given as (x, y, sample index), each by the technique of its zone. Replaces the contents of
    /// `records` with their records, in the same order.
    pub(super) fn paint(&self, samples: &[(u32, u32, u32)], records: &mut Vec<PathRecord>) {
        let is_by_photons = |&(x, y, _): &(u32, u32, u32)| self.plan.is_by_photons(self.paths.place(x, y));
        let first = samples.first().is_some_and(is_by_photons);
        // Most blocks lie within one zone
        if samples.iter().all(|sample| is_by_photons(sample) == first) {
            return self.paint_by(first, samples, records);
        }
        let mut of_both = [false, true].map(|by_photons| {
            let own: Vec<_> = samples.iter().copied().filter(|it| is_by_photons(it) == by_photons).collect();
            let mut found = Vec::new();
            self.paint_by(by_photons, &own, &mut found);
            found.into_iter()
        });
        records.clear();
        records.extend(samples.iter().filter_map(|it| of_both[usize::from(is_by_photons(it))].next()));
    }

    fn paint_by(&self, by_photons: bool, samples: &[(u32, u32, u32)], records: &mut Vec<PathRecord>) {
        if by_photons {
            self.photons.paint(samples, records);
        } else {
            compiled::run(SampleBatch { integrator: &self.paths, samples, records, groups: None });
        }
    }
}

/// The integrators that a picture needs after its trial.
pub(super) enum Chosen<'a> {
    Paths(PathIntegrator<'a>),
    Photons(PhotonIntegrator<'a>),
    ByZone(Box<ByZone<'a>>),
}

impl<'a> Chosen<'a> {
    /// Creates the integrators of a picture that tries photons.
    ///
    /// - `wanted`: optional values of each sample.
    ///
    /// # Errors
    /// [`RenderError::PhotonsInMedia`], [`RenderError::EmptyPicture`]; [`RenderError::Untried`]: `prepass` has no plan yet.
    pub(super) fn new(
        prepared: &'a PreparedScene,
        prepass: &Prepass,
        view: &View,
        settings: &'a PathSettings,
        wanted: Wanted,
    ) -> Result<Self, RenderError> {
        let paths = PathIntegrator::new(prepared, prepass, view, settings)?.with_wanted(wanted);
        let Some(tried) = TriedPhotons::of(view, settings) else { return Ok(Self::Paths(paths)) };
        let plan = prepass.known_technique(view, settings).ok_or(RenderError::Untried)?;
        if plan.only() == Some(false) {
            return Ok(Self::Paths(paths));
        }
        let photons = PhotonIntegrator::new(prepared, prepass, view, settings, tried.zones)?.with_wanted(wanted);
        Ok(match plan.only() {
            Some(_) => Self::Photons(photons),
            None => Self::ByZone(Box::new(ByZone { paths, photons, plan })),
        })
    }
}

/// Returns the techniques of a picture's zones, and chooses them if `prepass` has no plan yet.
///
/// - `photons`: those of the trial, which must have been cast unless paths cannot judge them.
///
/// # Errors
/// [`RenderError::PhotonsInMedia`], [`RenderError::EmptyPicture`].
pub(crate) fn choose_techniques(
    prepared: &PreparedScene,
    prepass: &Prepass,
    view: &View,
    settings: &PathSettings,
    (photons, judge): (PhotonSettings, &dyn TechniqueJudge),
) -> Result<Arc<TechniquePlan>, RenderError> {
    if let Some(known) = prepass.known_technique(view, settings) {
        return Ok(known);
    }
    let paths = PathIntegrator::new(prepared, prepass, view, settings)?;
    let photons = PhotonIntegrator::new(prepared, prepass, view, settings, photons)?;
    Ok(prepass.technique(view, settings, || TechniqueTrial::new(&paths, &photons, view).plan(judge)))
}

/// A trial of both techniques.
struct TechniqueTrial<'a, 'b> {
    paths: &'a PathIntegrator<'b>,
    photons: &'a PhotonIntegrator<'b>,
    pixels: Vec<(u32, u32)>,
    /// Samples per pixel, per technique and repetition.
    samples: u32,
}

/// The mean radiance of a pixel by one technique, twice, and the work of both.
#[derive(Clone, Copy, Default)]
struct Tried {
    radiance: [Spectrum; 2],
    work: f64,
}

/// Errors and work of a pixel.
#[derive(Clone, Copy, Debug)]
struct PixelErrors {
    /// Squared random error of paths and of photons: relative, and as a display shows it.
    random: [[f64; 2]; 2],
    /// Squared error of the photon maps: relative, and as a display shows it. It may be negative by chance.
    of_maps: [f64; 2],
    /// The assumed squared error of the photon maps.
    assumed: [f64; 2],
    /// Brightness by paths and by photons.
    brightness: [f64; 2],
    /// Work of paths and of photons, in vertices.
    work: [f64; 2],
}

impl PixelErrors {
    fn new(paths: &Tried, photons: &Tried) -> Self {
        /// Brightness below which a display's curve counts as straight.
        const DARK: f32 = 0.01;
        let brightness = (paths.radiance.iter().chain(&photons.radiance).sum::<Spectrum>() / 4.0).max_element();
        // Relative errors; and the slope of the square root, which stands for a display's curve
        let relative = 1.0 / (brightness * brightness + 1e-2);
        let shown = if brightness < 1.0 { 0.25 / brightness.max(DARK) } else { 0.0 };
        let weighed = |squared: f32| [relative, shown].map(|weight| f64::from(weight * squared));
        let random = |tried: &Tried| weighed(0.5 * (tried.radiance[0] - tried.radiance[1]).length_squared());
        let [first, second] = [0, 1].map(|again: usize| photons.radiance[again] - paths.radiance[again]);
        Self {
            random: [random(paths), random(photons)],
            of_maps: weighed(first.dot(second)),
            assumed: weighed(brightness * brightness).map(|squared| squared * MAP_ERROR * MAP_ERROR),
            brightness: [paths, photons].map(|tried| f64::from((tried.radiance[0] + tried.radiance[1]).max_element())),
            work: [paths.work, photons.work],
        }
    }
}

impl<'a, 'b> TechniqueTrial<'a, 'b> {
    /// Draws the pixels of the trial evenly over the picture.
    fn new(paths: &'a PathIntegrator<'b>, photons: &'a PhotonIntegrator<'b>, view: &View) -> Self {
        let planned = paths.settings().planned_samples;
        let samples = planned.clamp(1, SAMPLES_MAX);
        let tried = view.pixel_count() * u64::from(planned) / SAMPLES_PER_TRIED;
        let count = (tried / (4 * u64::from(samples))).clamp(PIXELS[0], PIXELS[1]) as u32;
        let pixel = |index| {
            let [x, y] = PixelSampler::new(TRIAL_SEED, 0, 0, index).get_2d(DimensionSet::CAMERA).to_array();
            ((x * view.width as f32) as u32, (y * view.height as f32) as u32)
        };
        Self { paths, photons, pixels: (0..count).map(pixel).collect(), samples }
    }

    /// Renders the pixels, and returns the plan.
    fn plan(&self, judge: &dyn TechniqueJudge) -> TechniquePlan {
        let prepared = self.paths.prepared();
        // Paths find no light of point lights over mirrors and through glass, so they cannot judge photons
        if prepared.hides_light() {
            return TechniquePlan::whole(true);
        }
        self.photons.cast(0..1);
        let errors = prepared.on_threads(|| self.tried());
        let is_preferred = |evidence: &TechniqueEvidence| judge.preference(evidence) > 0.0;
        let noise = mean(&errors, |it| it.random[0][0]);
        if noise > NOISY || !are_believed(&errors) {
            let evidence = self.evidence(&errors, false);
            return TechniquePlan::whole(is_preferred(&evidence));
        }
        let whole = self.evidence(without_outliers(&mut errors.clone()), true);
        let usual = is_preferred(&whole);
        // Sort the pixels into the zones of the plan
        let side = (errors.len() as f64 / PIXELS_PER_ZONE).sqrt().floor().clamp(1.0, ZONES_MAX) as u32;
        let mut by_zone = vec![Vec::new(); (side * side) as usize];
        for (&(x, y), errors) in self.pixels.iter().zip(&errors) {
            by_zone[TechniquePlan::zone([side, side], self.paths.place(x, y))].push(*errors);
        }
        // Judge each zone, with the result of all pixels beside its own few
        let is_by_photons = |zone: &Vec<PixelErrors>| {
            let own = self.evidence(zone, true);
            if !own.gain.is_finite() || !are_believed(zone) {
                return usual;
            }
            let share = zone.len() as f64 / (zone.len() as f64 + COMMON_PIXELS);
            let blended = |own: f64, common: f64| common + share * (own - common);
            is_preferred(&TechniqueEvidence {
                gain: blended(own.gain, whole.gain),
                worse_gain: blended(own.worse_gain, whole.worse_gain),
                picture: Some(usual),
                ..own
            })
        };
        let plan = TechniquePlan::new(side, side, by_zone.iter().map(is_by_photons).collect());
        plan.unwrap_or_else(|| TechniquePlan::whole(usual))
    }

    /// Returns the evidence of some pixels, for a judgment of the whole picture.
    ///
    /// - `believes`: `true`: paths may contradict photons.
    fn evidence(&self, errors: &[PixelErrors], believes: bool) -> TechniqueEvidence {
        let gains = self.ratios(errors, believes).map(|ratio| -ratio.log2());
        TechniqueEvidence {
            gain: 0.5 * (gains[0] + gains[1]),
            worse_gain: gains[0].min(gains[1]),
            found: share_found(errors),
            noise: mean(errors, |it| it.random[0][0]),
            picture: None,
        }
    }

    /// Returns error times work of photons over that of paths, by both measures, at the samples of the picture.
    ///
    /// - `believes`: `true`: paths may contradict photons.
    fn ratios(&self, errors: &[PixelErrors], believes: bool) -> [f64; 2] {
        let mean = |value: &dyn Fn(&PixelErrors) -> f64| mean(errors, value);
        let [path_work, photon_work] = [0, 1].map(|technique: usize| mean(&|it| it.work[technique]));
        // The error of the maps stays, while random errors fall by the number of samples
        let planned = f64::from(self.paths.settings().planned_samples.max(1)) / f64::from(self.samples);
        [0, 1].map(|measure: usize| {
            let of_paths = mean(&|it| it.random[0][measure]) * path_work;
            // Believe paths that find the light, as far as they contradict by more than chance
            let (found, assumed) = (mean(&|it| it.of_maps[measure]), mean(&|it| it.assumed[measure]));
            let spread = mean(&|it| (it.of_maps[measure] - found).powi(2)).sqrt() / (errors.len().max(1) as f64).sqrt();
            let of_maps = if believes && are_believed(errors) { assumed.max(found - 2.0 * spread) } else { assumed };
            (mean(&|it| it.random[1][measure]) + of_maps * planned) * photon_work / of_paths
        })
    }

    /// Renders all pixels by both techniques.
    fn tried(&self) -> Vec<PixelErrors> {
        let seeds = [1, 2].map(|seed| PathSettings { seed: TRIAL_SEED + seed, ..*self.paths.settings() });
        let of_chunk = |pixels: &[(u32, u32)]| {
            let samples: Vec<_> =
                pixels.iter().flat_map(|&(x, y)| (0..self.samples).map(move |sample| (x, y, sample))).collect();
            let mut tried = vec![[Tried::default(); 2]; pixels.len()];
            let mut records = Vec::new();
            for (settings, again) in seeds.iter().zip(0..) {
                let paths = self.paths.with_settings(settings);
                compiled::run(SampleBatch {
                    integrator: &paths,
                    samples: &samples,
                    records: &mut records,
                    groups: None,
                });
                let is_guided = paths.is_guided();
                self.take(&records, &mut tried, (0, again), |record| record.work(is_guided));
                self.photons.with_settings(settings).paint(&samples, &mut records);
                self.take(&records, &mut tried, (1, again), |record| PHOTON_WORK * record.work(false));
            }
            tried.into_iter().map(|[paths, photons]| PixelErrors::new(&paths, &photons)).collect::<Vec<_>>()
        };
        self.pixels.par_chunks(PIXELS_PER_CHUNK).map(of_chunk).flatten_iter().collect()
    }

    /// Adds the records of all pixels of a chunk.
    fn take(
        &self,
        records: &[PathRecord],
        tried: &mut [[Tried; 2]],
        (technique, again): (usize, usize),
        work: impl Fn(&PathRecord) -> f64,
    ) {
        for (tried, records) in tried.iter_mut().zip(records.chunks_exact(self.samples as usize)) {
            let tried = &mut tried[technique];
            tried.radiance[again] =
                records.iter().map(|it| Spectrum::from(it.values.radiance)).sum::<Spectrum>() / self.samples as f32;
            tried.work += records.iter().map(&work).sum::<f64>();
        }
    }
}

/// Returns the pixels without those of the greatest errors of paths, which few pixels miss.
fn without_outliers(errors: &mut [PixelErrors]) -> &[PixelErrors] {
    errors.sort_by(|a, b| a.random[0][0].total_cmp(&b.random[0][0]));
    let kept = errors.len() - (errors.len() as f64 * OUTLIERS).ceil() as usize;
    &errors[..kept]
}

/// Returns the light that paths find over the light that photons find, at most 1.
fn share_found(errors: &[PixelErrors]) -> f64 {
    let [by_paths, by_photons] = [0, 1].map(|technique: usize| mean(errors, |it| it.brightness[technique]));
    if by_paths < by_photons { by_paths / by_photons } else { 1.0 }
}

/// Returns `true` if paths find the light of photons, so that they can contradict them.
fn are_believed(errors: &[PixelErrors]) -> bool {
    share_found(errors) >= FOUND_MIN
}

fn mean(errors: &[PixelErrors], value: impl Fn(&PixelErrors) -> f64) -> f64 {
    errors.iter().map(value).sum::<f64>() / errors.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use bottega_scene::{Camera, Environment, Material, Mesh, Projection, Scene};
    use glam::Vec3;

    use super::*;
    use crate::{integrator::Integrator, prepare::PrepareOptions};

    /// A floor with a wall under a sky.
    fn scene() -> PreparedScene {
        let mut scene = Scene {
            environment: Some(Environment::uniform(Spectrum::ONE)),
            cameras: vec![Camera {
                world_from_camera: Camera::looking(Vec3::new(0.0, 1.5, 4.0), Vec3::Y * 0.5, Vec3::Y).unwrap(),
                projection: Projection::Perspective { vertical_fov: 0.9 },
                ..Camera::default()
            }],
            ..Scene::default()
        };
        let material = scene.push_material(Material::matte(Spectrum::splat(0.7)));
        for [u, v] in [[Vec3::Z, Vec3::X], [Vec3::X, Vec3::Y]] {
            let corner = (u + v) * -3.0 * Vec3::new(1.0, 0.0, 1.0);
            let positions = vec![corner, corner + 6.0 * u, corner + 6.0 * (u + v), corner + 6.0 * v];
            let triangles = vec![[0, 1, 2], [0, 2, 3]];
            scene.push_surface(Mesh { positions, triangles, material, ..Mesh::default() });
        }
        PreparedScene::new(Arc::new(scene), &PrepareOptions { threads: 1, ..PrepareOptions::default() }).unwrap()
    }

    fn settings() -> PathSettings {
        let photons = Some(PhotonSettings { count: 2000, ..PhotonSettings::default() });
        PathSettings { photons, tries_photons: true, planned_samples: 512, ..PathSettings::default() }
    }

    fn traced(integrator: &Integrator<'_>, samples: &[(u32, u32, u32)]) -> Vec<[f32; 3]> {
        let mut records = Vec::new();
        integrator.paint(samples, &mut records, None);
        records.iter().map(|record| record.values.radiance).collect()
    }

    #[test]
    fn each_zone_has_the_samples_of_its_technique_here_and_on_another_machine() {
        let scene = scene();
        let view = View::of_scene(scene.scene(), 0, 64, 48).unwrap();
        let settings = settings();
        let prepass = Prepass::default();
        let plan = prepass.technique(&view, &settings, || TechniquePlan::new(2, 1, vec![true, false]).unwrap());
        let samples: Vec<_> = (24..40).flat_map(|x| (0..3).map(move |sample| (x, 30, sample))).collect();
        let photons = TriedPhotons::of(&view, &settings).unwrap().zones;
        let by_photons = PathSettings { photons: Some(photons), tries_photons: false, ..settings };
        let by_paths = PathSettings { photons: None, tries_photons: false, ..settings };
        let [mixed, photons, paths] = [&settings, &by_photons, &by_paths].map(|settings| {
            traced(&Integrator::new(&scene, &prepass, &view, settings, Wanted::default()).unwrap(), &samples)
        });
        assert_ne!(photons, paths);
        for (index, (x, ..)) in samples.iter().enumerate() {
            let expected = if *x < 32 { photons[index] } else { paths[index] };
            assert_eq!(mixed[index], expected, "{x}");
        }
        // A picture that is too small to try photons has learnt nothing without a guide
        let small = PathSettings { planned_samples: 4, ..settings };
        assert!(TriedPhotons::of(&view, &small).is_none() && prepass.learnt(&scene, &view, &small).is_none());
        // Plan, guide and maps of another machine
        let bytes = prepass.learnt(&scene, &view, &settings).unwrap();
        let other = Prepass::default();
        other.learn_from(&scene, &view, &settings, &bytes).unwrap();
        assert_eq!(other.zones_by_photons(&view, &settings), Some(plan.counts()));
        let again = traced(&Integrator::new(&scene, &other, &view, &settings, Wanted::default()).unwrap(), &samples);
        assert_eq!(again, mixed);
        for damaged in [&bytes[..bytes.len() - 1], &bytes[..7], &[]] {
            assert!(Prepass::default().learn_from(&scene, &view, &settings, damaged).is_err());
        }
    }

    #[test]
    fn maps_count_as_wrong_where_paths_contradict_them() {
        let tried = |first: f32, second: f32| Tried { radiance: [first, second].map(Spectrum::splat), work: 1.0 };
        let errors = PixelErrors::new(&tried(1.0, 1.1), &tried(1.5, 1.5));
        assert!(errors.of_maps[0] > 10.0 * errors.assumed[0] && errors.random[1] == [0.0; 2], "{errors:?}");
    }
}
