//! The plan of photon emission: most photons towards the visible part of a scene, fewer to regions farther from it.
//!
//! In a wide scene, photons emitted in all directions rarely reach the visible part. Parallel light and the environment
//! start on concentric discs around it, each twice as wide as the one before; other sources are also chosen by the light
//! that may arrive from them, and half of their directions are aimed. All other photons remain possible, and the power of
//! a photon is divided by its probability, so the mean stays right.

use std::f32::consts::PI;

use glam::Vec3;

use crate::{
    density::{AreaPdf, SolidAnglePdf},
    extent::Extent,
    sampling::{around, orthonormal_basis, uniform_disk},
};

/// Ratio of the radii of consecutive discs.
pub(super) const STEP: f32 = 2.0;
/// Share of the photons that start on the first disc.
pub(super) const FIRST: f32 = 0.3;
/// Share of the sources chosen by the light that may arrive from them; also the share of aimed directions.
pub(super) const AIMED: f32 = 0.5;
/// Smallest distance of a place, in radii of the visible part, from which directions are aimed.
const FAR: f32 = 2.0;

/// The probabilities by which photons are emitted towards the visible part.
#[derive(Clone, Debug)]
pub(crate) struct EmissionPlan {
    /// Visible part of the scene.
    pub(super) extent: Extent,
    /// Cumulative probabilities of the sources, from 0 to 1.
    pub(super) sums: Vec<f64>,
    /// Radii and probabilities of discs around the visible part; the last one covers the scene.
    pub(super) discs: Vec<(f32, f32)>,
}

/// The cone of directions from a place to the visible part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AimCone {
    axis: Vec3,
    one_minus_cos: f32,
}

impl EmissionPlan {
    /// Returns the visible part of the scene.
    pub(crate) fn extent(&self) -> &Extent {
        &self.extent
    }

    /// Draws a point outside the scene from which light travels in `direction`; returns it with its density.
    pub(super) fn on_disc(
        &self,
        (center, radius): (Vec3, f32),
        direction: Vec3,
        choice: f32,
        u: [f32; 2],
    ) -> (Vec3, AreaPdf) {
        let (s, t) = orthonormal_basis(direction);
        let disc = uniform_disk(u);
        let across = |disc_radius: f32| (s * disc.x + t * disc.y) * disc_radius;
        if self.discs.len() == 1 {
            return (center + across(radius) - direction * radius, AreaPdf::uniform(PI * radius * radius));
        }
        // Choose a disc
        let mut rest = choice;
        let chosen = self.discs.iter().position(|&(_, probability)| {
            rest -= probability;
            rest < 0.0
        });
        let last = self.discs.len() - 1;
        let chosen = chosen.unwrap_or(last);
        let middle = if chosen == last { center } else { self.extent.center };
        let place = middle + across(self.discs[chosen].0);
        // Start outside the whole scene
        let origin = place - direction * (direction.dot(place - center) + radius);
        let off = |middle: Vec3| {
            let way = place - middle;
            (way - direction * direction.dot(way)).length_squared()
        };
        let covers = |(number, &(radius, probability)): (usize, &(f32, f32))| {
            let middle = if number == last { center } else { self.extent.center };
            // The chosen disc covers its own points, regardless of rounding
            let is_there = number == chosen || off(middle) <= radius * radius;
            if is_there { probability / (PI * radius * radius) } else { 0.0 }
        };
        // Sum the densities of all discs that cover the point
        let density: f32 = self.discs.iter().enumerate().map(covers).sum();
        (origin, AreaPdf::new(density))
    }

    /// Returns the cone of directions from a distant place to the visible part; `None` if the place is near or everything
    /// is visible.
    #[inline(always)]
    pub(crate) fn aim(&self, from: Vec3) -> Option<AimCone> {
        if self.extent.is_whole() {
            return None;
        }
        let way = self.extent.center - from;
        let distance = way.length();
        if distance <= FAR * self.extent.radius {
            return None;
        }
        let sine = self.extent.radius / distance;
        // 1 − cos, without cancellation
        let one_minus_cos = sine * sine / (1.0 + (1.0 - sine * sine).sqrt());
        Some(AimCone { axis: way / distance, one_minus_cos })
    }
}

impl AimCone {
    /// Probability of aiming a direction.
    pub(crate) const SHARE: f32 = AIMED;

    /// Draws a direction, uniform over the cone.
    pub(crate) fn sample(&self, u: [f32; 2]) -> Vec3 {
        around(self.axis, self.one_minus_cos * u[0], u[1])
    }

    /// Returns true if a direction is within the cone.
    pub(crate) fn contains(&self, w: Vec3) -> bool {
        (w - self.axis).length_squared() <= 2.0 * self.one_minus_cos
    }

    /// Returns the density of a direction that is aimed with the probability [`Self::SHARE`], and else drawn with density
    /// `pdf`.
    ///
    /// - `is_within`: `true` if the direction is within the cone; for an aimed one, regardless of rounding.
    pub(crate) fn mixed(&self, is_within: bool, pdf: SolidAnglePdf) -> SolidAnglePdf {
        let own = if is_within { 1.0 / (2.0 * PI * self.one_minus_cos) } else { 0.0 };
        SolidAnglePdf::new(Self::SHARE * own + (1.0 - Self::SHARE) * pdf.per_sr())
    }
}
