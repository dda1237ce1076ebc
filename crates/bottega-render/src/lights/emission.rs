//! Emission of photons by the lights: origin, direction and power.
//!
//! A source is chosen in proportion to its power, then a position and direction on it, such that the power per photon
//! varies little. Light from infinity starts on a disc that covers the scene's bounding sphere (Pharr, Jakob and
//! Humphreys 2023, *Physically Based Rendering*, §12.4 and 12.5), or on a portal. If the visible part is small compared
//! to the scene, an [`EmissionPlan`] prefers photons that may arrive there.

mod place;
mod plan;

#[cfg(test)]
mod tests;

use std::f32::consts::{FRAC_1_PI, PI};

use bottega_kernels::Ray;
use bottega_scene::{Environment, EnvironmentMapping, LightKind, Portal, Spectrum, TextureMap};
use glam::{Vec2, Vec3};

use super::{Light, NO_LIGHT, distribution::Cells, environment::EnvironmentLight, punctual, sun::Sun};
use crate::{
    color::luminance,
    density::{AreaPdf, SolidAnglePdf},
    extent::Extent,
    prepare::PreparedScene,
    sampler::Quad,
    sampling::uniform_sphere,
};
use place::{DirectionDensity, PhotonStart};
use plan::{AIMED, FIRST, STEP};
pub(crate) use plan::{AimCone, EmissionPlan};

/// Value added to every cell of a light's picture, as a fraction of the mean, so that light between the centres of texels
/// is not missed.
const FLOOR: f32 = 0.05;
/// Largest number of cells along a side of the table of a light's picture.
const SIDE_MAX: u32 = 256;
/// Number of steps over the cosine of a spot's cone.
const SPOT_STEPS: usize = 64;

/// A photon that leaves a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EmittedPhoton {
    /// Origin in world space, at the light's surface.
    pub(crate) origin: Vec3,
    /// Direction of travel, unit length.
    pub(crate) direction: Vec3,
    /// Power in watts if this is the only photon: its mean is the power of all lights.
    pub(crate) power: Spectrum,
    /// Number of the light in the tree; [`NO_LIGHT`] for a light at infinity.
    pub(crate) light: u32,
}

impl PhotonStart {
    /// Returns the photon's origin, direction and power; redirects it with probability [`AimCone::SHARE`] towards the visible
    /// part. The power accounts for both ways to draw the direction, by MIS.
    ///
    /// - `v`: direction (2), choice of the redirection (1), spare (1).
    fn aimed(self, plan: &EmissionPlan, v: Quad) -> (Vec3, Vec3, Spectrum) {
        let Self { origin, mut direction, power, spread } = self;
        let aim = if matches!(spread, DirectionDensity::AsDrawn) { None } else { plan.aim(origin) };
        let Some(aim) = aim else { return (origin, direction, power) };
        let mut is_within = v[2] < AimCone::SHARE;
        if is_within {
            direction = aim.sample([v[0], v[1]]);
        } else {
            is_within = aim.contains(direction);
        }
        let pdf = SolidAnglePdf::new(match spread {
            DirectionDensity::Cosine(n) => n.dot(direction).max(0.0) * FRAC_1_PI,
            _ => 0.25 * FRAC_1_PI,
        });
        (origin, direction, power * (pdf / aim.mixed(is_within, pdf)))
    }
}

/// All sources of photons in a scene.
pub(crate) struct Emission {
    sources: Vec<EmissionSource>,
    /// Cumulative shares of the sources in the total power, from 0 to 1.
    sums: Vec<f64>,
    /// The environment without portals.
    environment: Option<EnvironmentLight>,
    /// Centre of the scene's bounding sphere; `radius`: its radius, slightly enlarged.
    center: Vec3,
    radius: f32,
}

enum EmissionSource {
    /// A light with extent or a point light; number in the tree.
    Near(u32),
    /// Another light without extent: number in the tree, index in the scene, and its power distribution over a square.
    Pictured(u32, u32, Cells),
    /// A light at infinity with a direction.
    Sun(Sun),
    Environment,
    Portal(Portal),
}

impl Emission {
    /// Collects all sources. Omits those that are black or whose power is not finite.
    pub(crate) fn new(prepared: &PreparedScene) -> Self {
        let scene = &**prepared.scene();
        let Extent { center, radius, .. } = Extent::whole(prepared);
        // Without surfaces, light from infinity hits nothing
        let has_scene = radius > 0.0;
        let mut emission =
            Self { sources: Vec::new(), sums: vec![0.0], environment: None, center, radius: radius * 1.001 };
        let mut powers = Vec::new();
        let disc = PI * emission.radius * emission.radius;
        let mut push = |emission: &mut Self, source: EmissionSource, power: f32| {
            if power > 0.0 && power.is_finite() {
                emission.sources.push(source);
                powers.push(f64::from(power));
            }
        };
        // Collect the lights of the tree
        for (number, light) in prepared.lights().lights.iter().enumerate() {
            let (source, power) = match light {
                Light::Surface(surface) => (EmissionSource::Near(number as u32), surface.power(scene)),
                Light::Sphere(index) => (EmissionSource::Near(number as u32), place::power_of_sphere(scene, *index)),
                Light::Punctual(index) => near_source(prepared, number as u32, *index),
            };
            push(&mut emission, source, power);
        }
        if !has_scene {
            emission.sum(&powers);
            return emission;
        }
        // Collect suns and the environment
        for sun in &prepared.lights().suns {
            push(&mut emission, EmissionSource::Sun(*sun), disc * sun.illuminance);
        }
        if let Some(environment) = &scene.environment {
            let whole = Environment { portals: Vec::new(), ..environment.clone() };
            let light = EnvironmentLight::new(scene, &whole, false);
            // The mean over all orientations is a quarter of the integral
            let integral = 4.0 * light.illuminance(center);
            if environment.portals.is_empty() {
                push(&mut emission, EmissionSource::Environment, integral * disc);
            }
            for portal in &environment.portals {
                let area = portal.edges[0].cross(portal.edges[1]).length();
                push(&mut emission, EmissionSource::Portal(*portal), 0.25 * integral * area);
            }
            emission.environment = Some(light);
        }
        emission.sum(&powers);
        emission
    }

    fn sum(&mut self, powers: &[f64]) {
        let total: f64 = powers.iter().sum();
        let mut sum = 0.0;
        self.sums.extend(powers.iter().map(|power| {
            sum += power;
            sum / total
        }));
        if let Some(last) = self.sums.last_mut().filter(|_| !powers.is_empty()) {
            *last = 1.0;
        }
    }

    /// Returns true if nothing emits light.
    pub(crate) fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }

    /// Plans the emission of photons towards the visible part of the scene.
    pub(crate) fn plan(&self, prepared: &PreparedScene, extent: Extent) -> EmissionPlan {
        let mut plan = EmissionPlan { extent, sums: self.sums.clone(), discs: vec![(self.radius, 1.0)] };
        if extent.is_whole() {
            return plan;
        }
        // Discs around the visible part, each wider by STEP, up to the scene's
        let mut radii: Vec<f32> = std::iter::successors(Some(extent.radius), |radius| Some(radius * STEP))
            .take_while(|&radius| radius < extent.whole)
            .collect();
        radii.push(self.radius);
        let others = (1.0 - FIRST) / (radii.len() - 1).max(1) as f32;
        plan.discs = radii.iter().zip(0..).map(|(&radius, i)| (radius, if i == 0 { FIRST } else { others })).collect();
        // Mix probabilities by power with those by arriving power
        let source = |index: usize| {
            let power = self.sums[index + 1] - self.sums[index];
            (power, power * self.arriving(prepared, &extent, &self.sources[index]))
        };
        let powers: Vec<(f64, f64)> = (0..self.sources.len()).map(source).collect();
        let arriving: f64 = powers.iter().map(|(_, arriving)| arriving).sum();
        if arriving > 0.0 {
            let mut sum = 0.0;
            let aimed = f64::from(AIMED);
            let mut add = |(power, part): &(f64, f64)| {
                sum += (1.0 - aimed) * power + aimed * part / arriving;
                sum
            };
            plan.sums = std::iter::once(0.0).chain(powers.iter().map(&mut add)).collect();
            if let Some(last) = plan.sums.last_mut() {
                *last = 1.0;
            }
        }
        plan
    }

    /// Estimates the share of a source's power that may arrive at the visible part.
    fn arriving(&self, prepared: &PreparedScene, extent: &Extent, source: &EmissionSource) -> f64 {
        let near = |p: Vec3| f64::from((extent.radius / p.distance(extent.center)).min(1.0)).powi(2);
        let scene = &**prepared.scene();
        match source {
            EmissionSource::Near(number) | EmissionSource::Pictured(number, ..) => {
                match &prepared.lights().lights[*number as usize] {
                    Light::Surface(surface) => near(surface.ball().0),
                    Light::Sphere(index) => near(scene.spheres[*index as usize].center),
                    Light::Punctual(index) => near(punctual::position(&scene.lights[*index as usize].kind)),
                }
            }
            EmissionSource::Portal(portal) => near(portal.corner + 0.5 * (portal.edges[0] + portal.edges[1])),
            EmissionSource::Sun(_) | EmissionSource::Environment => f64::from(extent.radius / self.radius).powi(2),
        }
    }

    /// Emits a photon. `None`: no photon for these random numbers; it counts as one without power.
    ///
    /// - `plan`: created by [`Self::plan`].
    /// - `u`: choice of the source (1), choice on it (1), position on it (2).
    /// - `v`: direction (2), choice of redirection (1), spare (1).
    pub(crate) fn emit(
        &self,
        prepared: &PreparedScene,
        plan: &EmissionPlan,
        u: Quad,
        v: Quad,
    ) -> Option<EmittedPhoton> {
        if self.is_empty() {
            return None;
        }
        let choice = f64::from(u[0]);
        // Choose a source by its power
        let index = plan.sums.partition_point(|&sum| sum <= choice).clamp(1, self.sources.len()) - 1;
        let pmf = (plan.sums[index + 1] - plan.sums[index]) as f32;
        // Sample position and direction on it
        let (origin, direction, power) = self.leave(prepared, plan, index, u, [v[0], v[1]])?.aimed(plan, v);
        let power = power / pmf;
        let is_sound = power.is_finite() && power.cmpge(Vec3::ZERO).all() && power != Vec3::ZERO;
        let is_sound = is_sound && origin.is_finite() && direction.is_finite();
        is_sound.then_some(EmittedPhoton { origin, direction, power, light: self.light_of(index) })
    }

    /// Returns the number of sources.
    pub(crate) fn source_count(&self) -> usize {
        self.sources.len()
    }

    /// Returns the start of an agent of the `ala` integrator: sources are chosen uniformly, positions uniformly over the
    /// source, directions uniformly over the sphere, or as the light shines for lights at infinity. `power` is that of a
    /// photon from there.
    ///
    /// - `u`, `v`: as for [`Self::emit`].
    pub(crate) fn cast(
        &self,
        prepared: &PreparedScene,
        plan: &EmissionPlan,
        u: Quad,
        v: Quad,
    ) -> Option<EmittedPhoton> {
        let index = ((u[0] * self.sources.len() as f32) as usize).min(self.sources.len().checked_sub(1)?);
        let towards = [v[0], v[1]];
        let PhotonStart { origin, direction, power, .. } = self.leave(prepared, plan, index, u, towards)?;
        let is_far = self.light_of(index) == NO_LIGHT;
        let aim = plan.aim(origin).filter(|_| v[2] < AimCone::SHARE);
        let direction = match aim {
            _ if is_far => direction,
            Some(aim) => aim.sample(towards),
            None => uniform_sphere(towards),
        };
        let is_sound = origin.is_finite() && direction.is_finite();
        is_sound.then_some(EmittedPhoton { origin, direction, power, light: self.light_of(index) })
    }

    /// Returns the number of a source in the tree of lights; [`NO_LIGHT`] for lights at infinity.
    fn light_of(&self, index: usize) -> u32 {
        match &self.sources[index] {
            EmissionSource::Near(number) | EmissionSource::Pictured(number, ..) => *number,
            EmissionSource::Sun(_) | EmissionSource::Environment | EmissionSource::Portal(_) => NO_LIGHT,
        }
    }

    /// Samples position and direction on one source; returns them with the power that they represent.
    fn leave(
        &self,
        prepared: &PreparedScene,
        plan: &EmissionPlan,
        index: usize,
        u: Quad,
        towards: [f32; 2],
    ) -> Option<PhotonStart> {
        let place = [u[2], u[3]];
        Some(match &self.sources[index] {
            EmissionSource::Near(number) => match &prepared.lights().lights[*number as usize] {
                Light::Surface(surface) => surface.emit(prepared, u[1], place, towards)?,
                Light::Sphere(index) => place::emit_from_sphere(prepared, *index, u[1], place, towards)?,
                Light::Punctual(index) => {
                    let light = &prepared.scene().lights[*index as usize];
                    let LightKind::Point { position, intensity } = light.kind else { return None };
                    let direction = uniform_sphere(place);
                    PhotonStart {
                        origin: position,
                        direction,
                        power: 4.0 * PI * intensity,
                        spread: DirectionDensity::Everywhere,
                    }
                }
            },
            EmissionSource::Pictured(_, light, table) => {
                let (place, density) = table.sample(place);
                let (origin, direction, power) =
                    punctual::emitted(prepared.scene(), *light, place.into()).filter(|_| density > 0.0)?;
                PhotonStart::as_drawn(origin, direction, power / density)
            }
            EmissionSource::Sun(sun) => {
                let (wi, radiance, pdf, _) = sun.sample(towards);
                let (origin, by_area) = plan.on_disc((self.center, self.radius), -wi, u[1], place);
                PhotonStart::as_drawn(origin, -wi, radiance * by_area.etendue(pdf))
            }
            EmissionSource::Environment => {
                let (wi, radiance, pdf) = self.far(prepared, towards)?;
                let (origin, by_area) = plan.on_disc((self.center, self.radius), -wi, u[1], place);
                PhotonStart::as_drawn(origin, -wi, radiance * by_area.etendue(pdf))
            }
            EmissionSource::Portal(portal) => self.through(prepared, portal, place, towards)?,
        })
    }

    /// Samples a direction towards the environment; returns it with its radiance and its density.
    fn far(&self, prepared: &PreparedScene, u: [f32; 2]) -> Option<(Vec3, Spectrum, SolidAnglePdf)> {
        self.environment.as_ref()?.sample_at(prepared.scene(), self.center, [0.0, u[0], u[1], 0.0])
    }

    /// Samples a photon that enters through a portal; `None` if a surface behind the portal blocks it.
    fn through(
        &self,
        prepared: &PreparedScene,
        portal: &Portal,
        [x, y]: [f32; 2],
        towards: [f32; 2],
    ) -> Option<PhotonStart> {
        let outwards = portal.edges[0].cross(portal.edges[1]);
        let (wi, radiance, pdf) = self.far(prepared, towards)?;
        let projected = outwards.dot(wi);
        if projected <= 0.0 {
            return None;
        }
        let origin = portal.corner + portal.edges[0] * x + portal.edges[1] * y;
        let hidden = prepared.accel().occluded(&Ray::new(origin, wi));
        (!hidden).then(|| PhotonStart::as_drawn(origin, -wi, radiance * AreaPdf::uniform(projected).etendue(pdf)))
    }
}

/// Returns the source of a light without extent, and its power.
fn near_source(prepared: &PreparedScene, number: u32, index: u32) -> (EmissionSource, f32) {
    let scene = &**prepared.scene();
    let (columns, rows) = match scene.lights[index as usize].kind {
        LightKind::Point { intensity, .. } => return (EmissionSource::Near(number), 4.0 * PI * luminance(intensity)),
        LightKind::Spot { .. } => (SPOT_STEPS, 1),
        LightKind::Goniometric { mapping, .. } if mapping != EnvironmentMapping::EqualArea => {
            (SIDE_MAX as usize, SIDE_MAX as usize)
        }
        LightKind::Goniometric { image, .. } | LightKind::Projector { picture: TextureMap { image, .. }, .. } => {
            let (width, height) = scene.images[image.0 as usize].size();
            (width.clamp(1, SIDE_MAX) as usize, height.clamp(1, SIDE_MAX) as usize)
        }
        LightKind::Directional { .. } => return (EmissionSource::Near(number), 0.0),
    };
    let at = |column: usize, row: usize| {
        let place = Vec2::new((column as f32 + 0.5) / columns as f32, (row as f32 + 0.5) / rows as f32);
        punctual::emitted(scene, index, place).map_or(0.0, |(_, _, power)| luminance(power).max(0.0))
    };
    let mut cells: Vec<f32> = (0..columns * rows).map(|i| at(i % columns, i / columns)).collect();
    let mean = cells.iter().sum::<f32>() / cells.len() as f32;
    cells.iter_mut().for_each(|cell| *cell += FLOOR * mean);
    match Cells::new(&cells, columns, rows) {
        Some(table) => (EmissionSource::Pictured(number, index, table), mean),
        None => (EmissionSource::Near(number), 0.0),
    }
}
