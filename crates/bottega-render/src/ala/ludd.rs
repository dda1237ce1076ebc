//! Local useful data density: the variation of samples around a point (§3, equations 1 and 2).
//!
//! Where all samples are alike, one is enough: their density of useful data is 0.

use std::{fmt, str::FromStr};

use bottega_kernels::Ray;
use bottega_scene::Spectrum;
use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::Agents;
use crate::{
    color::luminance,
    error::RenderError,
    integrator::{PathIntegrator, PhotonIntegrator},
    photon::{Estimator, Nearest, Photon, PhotonMap, traced, tracer},
    prepare::PreparedScene,
    prepass::Prepass,
    sampler::PixelSampler,
    settings::{PathSettings, PhotonSettings, View},
};

/// Number of visible points that the importance of a point is estimated from.
const SEEN: usize = 8;
/// Number of photons that the irradiance at a photon is estimated from, and their greatest distance as a share of the
/// visible radius.
const GATHERED: usize = 60;
const REACH: f32 = 0.05;

/// A property by which samples differ: k of equation 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Criterion {
    /// Geometric normal of the surface.
    Normal,
    /// Power: the luminance of a photon; for an agent, the visibility of its light.
    Power,
    /// Direction that the light comes from.
    Direction,
    /// Irradiance, as luminance: at a photon, the estimate by photon density; for agents, the readings of their
    /// sensors.
    Irradiance,
    /// Density of the points that the camera sees.
    Importance,
}

/// The error of a text that is not the name of a [`Criterion`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is not a criterion; there are normal, power, direction, irradiance and importance")]
pub struct UnknownCriterion(String);

/// Samples of one map with the values of some criteria.
#[derive(Debug)]
struct MapSamples {
    map: PhotonMap,
    /// Values by number in the map; scalars are in the first coordinate.
    values: Vec<(Criterion, Vec<Vec3>)>,
}

/// The sphere around a point, in which samples are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LocalSphere {
    /// Sphere of this radius, as a share of the radius of the visible part of the scene: measures the light's variation
    /// over a distance.
    Radius(f32),
    /// Sphere that contains this many samples, at most [`NEAREST_MAX`](crate::photon::NEAREST_MAX): the N of equation
    /// 1.
    Count(usize),
}

/// Samples of a picture's light, photons or lighting agents, from which densities of useful data are computed.
#[derive(Debug)]
pub struct Samples {
    layers: Vec<MapSamples>,
    /// Visible radius, in scene units.
    extent: f32,
}

/// The density of useful data δ at a point, by criterion.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Density {
    /// δ_k of each criterion; `None`: fewer than two samples in the sphere.
    pub by_criterion: Vec<(Criterion, Option<f32>)>,
    /// Number of samples in the sphere, by the criterion that has the most.
    pub sample_count: u32,
}

/// The local useful data density of a picture: δ at what each pixel shows.
#[derive(Clone, Debug, Default)]
pub struct Ludd {
    /// Densities, row-major; `None`: the camera sees nothing there.
    pub pixels: Vec<Option<Density>>,
    /// Number of all samples.
    pub sample_count: u64,
}

/// The kinds of samples that densities of useful data are computed from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleSet {
    /// All photons of a picture.
    Photons,
    /// Photons that scattered at least once.
    IndirectPhotons,
    /// Lighting agents; for irradiance, their sensors.
    Agents,
}

impl Criterion {
    /// All criteria, in the order of their declaration.
    pub const ALL: [Self; 5] = [Self::Normal, Self::Power, Self::Direction, Self::Irradiance, Self::Importance];

    /// Returns the name of the criterion in options and reports; [`FromStr`] reads it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::Power => "power",
            Self::Direction => "direction",
            Self::Irradiance => "irradiance",
            Self::Importance => "importance",
        }
    }
}

impl fmt::Display for Criterion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Criterion {
    type Err = UnknownCriterion;

    fn from_str(text: &str) -> Result<Self, UnknownCriterion> {
        let wanted = text.trim();
        Self::ALL.into_iter().find(|it| it.name() == wanted).ok_or_else(|| UnknownCriterion(wanted.to_owned()))
    }
}

/// Running sums for δ_k.
#[derive(Clone, Copy, Debug, Default)]
struct Moments {
    count: u32,
    sum: DVec3,
    squares: f64,
    lengths: f64,
}

impl Moments {
    /// Adds a value.
    fn add(&mut self, value: Vec3) {
        let value = value.as_dvec3();
        self.count += 1;
        self.sum += value;
        self.squares += value.length_squared();
        self.lengths += value.length();
    }

    /// Returns δ_k; `None`: fewer than two values.
    fn density(&self) -> Option<f32> {
        if self.count < 2 {
            return None;
        }
        let count = f64::from(self.count);
        let variance = (self.squares - self.sum.length_squared() / count).max(0.0) / (count - 1.0);
        // Treat rounding errors as no difference
        let variance = if variance < 1e-12 * self.squares / count { 0.0 } else { variance };
        let mean = self.lengths / count;
        Some(if mean > 0.0 { (variance.sqrt() / mean) as f32 } else { 0.0 })
    }
}

/// Returns δ_k of equation 1 for the samples in one local sphere: their standard deviation divided by the mean of their
/// lengths, which is the mean for nonnegative values; 0 if all are 0. `None`: fewer than two samples.
///
/// - `values`: one per sample; scalars are in the first coordinate.
pub fn useful_data_density(values: &[Vec3]) -> Option<f32> {
    let mut moments = Moments::default();
    values.iter().for_each(|&value| moments.add(value));
    moments.density()
}

impl Density {
    /// Returns δ of equation 2: the mean over the criteria whose δ_k is known; `None`: none is known.
    pub fn all(&self) -> Option<f32> {
        let known: Vec<f32> = self.by_criterion.iter().filter_map(|&(_, density)| density).collect();
        (!known.is_empty()).then(|| known.iter().sum::<f32>() / known.len() as f32)
    }
}

impl Samples {
    /// Traces the photons of a picture, or casts its agents, in the way that its rendering does. Returns them with
    /// their values by each criterion.
    ///
    /// - `prepass`: belongs to `scene`; it keeps the agents.
    /// - `settings`: with the settings of photons and agents; defaults take the place of missing ones.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`], [`RenderError::PhotonsInMedia`].
    pub fn new(
        scene: &PreparedScene,
        prepass: &Prepass,
        view: &View,
        settings: &PathSettings,
        set: SampleSet,
        criteria: &[Criterion],
    ) -> Result<Self, RenderError> {
        let photons = settings.photons.unwrap_or_default();
        let photons = PhotonSettings {
            agents: (set == SampleSet::Agents).then(|| photons.agents.unwrap_or_default()),
            ..photons
        };
        let settings = PathSettings { photons: Some(photons), ..*settings };
        let integrator = PhotonIntegrator::new(scene, prepass, view, &settings, photons)?;
        let plan = prepass.photon_plan(scene, view);
        let importance = criteria
            .contains(&Criterion::Importance)
            .then(|| scene.on_threads(|| seen(scene, integrator.base(), view)));
        let layers = match set {
            SampleSet::Agents => {
                integrator.cast(0..1);
                let known = prepass.passes(scene, view, photons, settings.seed, 1);
                known.known_agents().map_or_else(Vec::new, |agents| of_agents(agents, criteria, importance.as_ref()))
            }
            _ => scene.on_threads(|| {
                let traced = traced(tracer(scene, &plan, &photons, settings.seed, 0), photons.count);
                let map = match set {
                    SampleSet::IndirectPhotons => PhotonMap::new(traced.indirect),
                    _ => PhotonMap::new([&*traced.direct, &traced.indirect, &traced.caustic].concat()),
                };
                let photons = PhotonSettings { radius: REACH, ..photons };
                let estimator = Estimator::new(&photons, *plan.extent());
                let same = map.clone();
                let irradiance = |photon: &Photon, found: &mut Nearest| {
                    let mut sum = Spectrum::ZERO;
                    estimator.irradiance(&same, photon, found, |_, light| sum += light);
                    luminance(sum)
                };
                vec![layer(map, criteria, importance.as_ref(), |photon| luminance(photon.mark().power()), irradiance)]
            }),
        };
        Ok(Self { layers, extent: plan.extent().radius })
    }

    /// Returns the number of samples.
    pub fn len(&self) -> usize {
        self.layers.iter().map(|layer| layer.map.len()).sum()
    }

    /// Returns `true` if there are no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns δ of each criterion for the samples in the local sphere around `p`, in world space.
    pub fn density_at(&self, p: Vec3, sphere: LocalSphere) -> Density {
        let mut density = Density::default();
        for layer in &self.layers {
            let mut moments = vec![Moments::default(); layer.values.len()];
            let mut add = |number: u32| {
                for ((_, values), moments) in layer.values.iter().zip(&mut moments) {
                    moments.add(values[number as usize]);
                }
            };
            match sphere {
                LocalSphere::Radius(share) => {
                    layer.map.within(p, (share * self.extent).powi(2), |number, _| add(number));
                }
                LocalSphere::Count(count) => {
                    let mut found = Nearest::new(count);
                    layer.map.nearest(p, f32::INFINITY, &mut found);
                    found.iter().for_each(|(number, _)| add(number));
                }
            }
            for (&(criterion, _), moments) in layer.values.iter().zip(&moments) {
                density.sample_count = density.sample_count.max(moments.count);
                density.by_criterion.push((criterion, moments.density()));
            }
        }
        density
    }

    /// Draws the samples as dots, at what the camera sees in the middle of each pixel (the maps of figure 1). Returns
    /// one dot per pixel, row-major.
    ///
    /// - `scene`: the scene of the samples.
    /// - `radius`: radius of a dot, as a share of the visible radius.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`].
    pub fn dots(&self, scene: &PreparedScene, view: &View, radius: f32) -> Result<Vec<Dot>, RenderError> {
        let settings = PathSettings::default();
        let camera = PathIntegrator::unguided(scene, view, &settings)?;
        let reach = (radius * self.extent).powi(2);
        let dot = |index: u32| {
            let Some(p) = first_place(scene, &camera, index % view.width, index / view.width) else {
                return Dot::Nothing;
            };
            let Some(layer) = self.layers.last() else { return Dot::Free };
            let value = |number: u32| layer.values.last().map_or(0.0, |(_, values)| values[number as usize].length());
            layer.map.nearest_where(p, reach, |_| true).map_or(Dot::Free, |number| Dot::Sample(value(number)))
        };
        let all = 0..view.width * view.height;
        Ok(scene.on_threads(|| all.into_par_iter().map(dot).collect()))
    }

    /// Returns δ at what the camera sees in the middle of each pixel.
    ///
    /// - `scene`: the scene of the samples.
    /// - `sphere`: the local sphere around each of these points.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`].
    pub fn over(&self, scene: &PreparedScene, view: &View, sphere: LocalSphere) -> Result<Ludd, RenderError> {
        let settings = PathSettings::default();
        let camera = PathIntegrator::unguided(scene, view, &settings)?;
        let place = |index: u32| {
            let p = first_place(scene, &camera, index % view.width, index / view.width)?;
            Some(self.density_at(p, sphere))
        };
        let all = 0..view.width * view.height;
        let pixels = scene.on_threads(|| all.into_par_iter().map(place).collect());
        Ok(Ludd { pixels, sample_count: self.len() as u64 })
    }
}

/// A pixel of a drawing of samples or agents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Dot {
    /// The camera sees nothing.
    Nothing,
    /// No sample is near.
    Free,
    /// A sample, with the length of its value by the last criterion; in a drawing of agents, an agent or a link, with
    /// its answer as for [`network_dots`](super::network_dots).
    Sample(f32),
}

/// Returns the first hit of a camera ray; `None`: it hits nothing.
pub(super) fn first_place(scene: &PreparedScene, camera: &PathIntegrator<'_>, x: u32, y: u32) -> Option<Vec3> {
    let (ray, _) = camera.camera_ray(&PixelSampler::new(0, x, y, 0), x, y);
    let hit = scene.accel().intersect(&Ray { t_max: ray.reach, ..Ray::new(ray.origin, ray.direction) });
    hit.is_some().then(|| ray.origin + ray.direction * hit.t)
}

/// Returns the points that a camera sees.
fn seen(scene: &PreparedScene, camera: &PathIntegrator<'_>, view: &View) -> PhotonMap {
    let all = 0..view.width * view.height;
    let place = |index: u32| first_place(scene, camera, index % view.width, index / view.width);
    let places: Vec<Vec3> = all.into_par_iter().filter_map(place).collect();
    PhotonMap::new(places.into_iter().map(|p| Photon::new(p, Vec3::Z, Vec3::Z, Spectrum::ZERO)).collect())
}

/// Returns the density of visible points around a point, up to a constant factor.
fn importance_at(seen: &PhotonMap, p: Vec3, found: &mut Nearest) -> f32 {
    seen.nearest(p, f32::INFINITY, found);
    if found.is_full() { found.len() as f32 / found.farthest().max(f32::MIN_POSITIVE) } else { 0.0 }
}

/// Computes the values of a map's samples by each criterion.
fn layer(
    map: PhotonMap,
    criteria: &[Criterion],
    seen: Option<&PhotonMap>,
    power: impl Fn(&Photon) -> f32 + Sync,
    irradiance: impl Fn(&Photon, &mut Nearest) -> f32 + Sync,
) -> MapSamples {
    let scalar = |value: f32| Vec3::new(value, 0.0, 0.0);
    let value = |criterion: Criterion, number: u32, found: &mut [Nearest; 2]| {
        let photon = map.photon(number);
        let mark = photon.mark();
        match criterion {
            Criterion::Normal => mark.normal(),
            Criterion::Direction => mark.to_light(),
            Criterion::Power => scalar(power(&photon)),
            Criterion::Irradiance => scalar(irradiance(&photon, &mut found[1])),
            Criterion::Importance => scalar(seen.map_or(0.0, |seen| importance_at(seen, photon.p, &mut found[0]))),
        }
    };
    let all = |criterion: Criterion| {
        let numbers = 0..map.len() as u32;
        let values = numbers
            .into_par_iter()
            .map_init(|| [Nearest::new(SEEN), Nearest::new(GATHERED)], |found, number| value(criterion, number, found));
        (criterion, values.collect())
    };
    let values = criteria.iter().map(|&criterion| all(criterion)).collect();
    MapSamples { map, values }
}

/// Computes the values of agents and of their sensors.
fn of_agents(agents: &Agents, criteria: &[Criterion], seen: Option<&PhotonMap>) -> Vec<MapSamples> {
    let (by_sensors, by_agents): (Vec<_>, Vec<_>) =
        criteria.iter().copied().partition(|&criterion| criterion == Criterion::Irradiance);
    let [places, sensors] = agents.maps();
    let mut layers = Vec::new();
    if !by_agents.is_empty() {
        layers.push(layer(places, &by_agents, seen, Agents::lit_share, |_, _| 0.0));
    }
    if !by_sensors.is_empty() {
        let measured = |sensor: &Photon, _: &mut Nearest| luminance(sensor.mark().power());
        layers.push(layer(sensors, &by_sensors, seen, |_| 0.0, measured));
    }
    layers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn densities_are_those_computed_by_hand() {
        let of = |values: &[f32]| {
            let values: Vec<Vec3> = values.iter().map(|&value| Vec3::new(value, 0.0, 0.0)).collect();
            useful_data_density(&values)
        };
        // Mean 4, deviations −2, 0, 2: √(8 ∕ 2) ∕ 4.
        assert_eq!(of(&[2.0, 4.0, 6.0]), Some(0.5));
        assert_eq!(of(&[3.0; 9]), Some(0.0));
        assert_eq!(of(&[0.0; 4]), Some(0.0));
        assert_eq!((of(&[]), of(&[1.0])), (None, None));
        // Opposite directions: the mean vector is 0, each is one away from it, √(2 ∕ 1) ∕ 1.
        let density = useful_data_density(&[Vec3::X, Vec3::NEG_X]).unwrap();
        assert!((density - 2.0_f32.sqrt()).abs() < 1e-6, "{density}");
        let halves = Density {
            by_criterion: vec![
                (Criterion::Normal, Some(0.5)),
                (Criterion::Power, Some(0.25)),
                (Criterion::Direction, None),
            ],
            sample_count: 3,
        };
        assert_eq!(halves.all(), Some(0.375));
        assert_eq!(Density::default().all(), None);
    }

    #[test]
    fn local_spheres_equal_those_of_an_exhaustive_search() {
        let photons: Vec<Photon> = (0..3000)
            .map(|i| {
                let sampler = PixelSampler::new(8, i, 0, 0);
                let u = [0, 1, 2, 3, 4].map(|key| sampler.hashed(key));
                let normal = if u[3] < 0.5 { Vec3::X } else { Vec3::Y };
                Photon::new(Vec3::new(u[0], u[1], u[2]), Vec3::Z, normal, Vec3::splat(u[4]))
            })
            .collect();
        let criteria = [Criterion::Normal, Criterion::Power, Criterion::Irradiance];
        let by_place = |photon: &Photon, _: &mut Nearest| photon.p.x + 0.5;
        let power = |photon: &Photon| luminance(photon.mark().power());
        let layer = layer(PhotonMap::new(photons.clone()), &criteria, None, power, by_place);
        let samples = Samples { layers: vec![layer], extent: 1.0 };
        for i in 0..30 {
            let sampler = PixelSampler::new(9, i, 0, 0);
            let p = Vec3::new(sampler.hashed(0), sampler.hashed(1), sampler.hashed(2)) * 1.3;
            let near: Vec<&Photon> = photons.iter().filter(|it| it.p.distance_squared(p) < 0.04).collect();
            let found = samples.density_at(p, LocalSphere::Radius(0.2));
            assert_eq!(found.sample_count as usize, near.len());
            if near.len() > 1 {
                // As many of the nearest are the same ones.
                let same = samples.density_at(p, LocalSphere::Count(near.len()));
                assert_eq!(same.sample_count, found.sample_count);
                for ((_, a), (_, b)) in same.by_criterion.iter().zip(&found.by_criterion) {
                    assert!((a.unwrap() - b.unwrap()).abs() < 1e-5, "{a:?} {b:?}");
                }
            }
            let expected = [
                near.iter().map(|it| it.mark().normal()).collect::<Vec<_>>(),
                near.iter().map(|it| Vec3::new(power(it), 0.0, 0.0)).collect(),
                near.iter().map(|it| Vec3::new(it.p.x + 0.5, 0.0, 0.0)).collect(),
            ];
            for ((_, found), expected) in found.by_criterion.iter().zip(&expected) {
                // By the formula as it stands.
                let mean = expected.iter().sum::<Vec3>() / expected.len() as f32;
                let variance: f32 = expected.iter().map(|it| it.distance_squared(mean)).sum::<f32>();
                let size = expected.iter().map(|it| it.length()).sum::<f32>() / expected.len() as f32;
                let by_formula = (variance / (expected.len() as f32 - 1.0)).sqrt() / size;
                match found {
                    Some(found) => assert!((found - by_formula).abs() < 1e-4, "{found} {by_formula}"),
                    None => assert!(expected.len() < 2),
                }
            }
        }
    }
}
