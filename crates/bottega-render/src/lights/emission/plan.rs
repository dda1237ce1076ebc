//! The plan of photons: to what a camera sees, and less and less often to what is farther from it.
//!
//! In a wide scene photons that go everywhere would hardly ever come to what is seen. Parallel light and light of the sky leave
//! discs around it, each twice as wide as the one before; other sources are chosen also by what can come from them, and
//! send half of what they emit towards it. Whatever is preferred, all else is left possible, and a photon stands for as much
//! more as it is rarer: the mean is right.

use std::f32::consts::PI;

use glam::Vec3;

use crate::{
    extent::Extent,
    sampling::{around, orthonormal_basis, uniform_disk},
};

/// How much wider each disc is than the one before.
pub(super) const STEP: f32 = 2.0;
/// The share of the photons that leaves the first disc.
pub(super) const FIRST: f32 = 0.3;
/// The share of the sources that is chosen by what can come from them, and of the directions that lead to what is seen.
pub(super) const AIMED: f32 = 0.5;
/// How much farther off than the radius of what is seen a place must be for directions to be aimed.
const FAR: f32 = 2.0;

/// How photons of a scene are sent to what is seen.
#[derive(Clone, Debug)]
pub(crate) struct EmissionPlan {
    pub(super) extent: Extent,
    /// Sums of the probabilities of the sources, from 0 to 1.
    pub(super) sums: Vec<f64>,
    /// Radii of discs around what is seen, and their probabilities; the last one covers the scene.
    pub(super) discs: Vec<(f32, f32)>,
}

/// Directions from a place to what is seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aim {
    axis: Vec3,
    one_minus_cos: f32,
}

impl EmissionPlan {
    /// Around what photons are sent.
    pub(crate) fn extent(&self) -> &Extent {
        &self.extent
    }

    /// A place before the scene from where light goes in `direction`, and the inverse of its density by area.
    pub(super) fn on_disc(
        &self,
        (center, radius): (Vec3, f32),
        direction: Vec3,
        choice: f32,
        u: [f32; 2],
    ) -> (Vec3, f32) {
        let (s, t) = orthonormal_basis(direction);
        let disc = uniform_disk(u);
        let across = |disc_radius: f32| (s * disc.x + t * disc.y) * disc_radius;
        if self.discs.len() == 1 {
            return (center + across(radius) - direction * radius, PI * radius * radius);
        }
        let mut rest = choice;
        let chosen = self.discs.iter().position(|&(_, probability)| {
            rest -= probability;
            rest < 0.0
        });
        let last = self.discs.len() - 1;
        let chosen = chosen.unwrap_or(last);
        let middle = if chosen == last { center } else { self.extent.center };
        let place = middle + across(self.discs[chosen].0);
        // All start before the whole scene.
        let origin = place - direction * (direction.dot(place - center) + radius);
        let off = |middle: Vec3| {
            let way = place - middle;
            (way - direction * direction.dot(way)).length_squared()
        };
        let covers = |(number, &(radius, probability)): (usize, &(f32, f32))| {
            let middle = if number == last { center } else { self.extent.center };
            // What was chosen covers its own places, whatever is rounded.
            let is_there = number == chosen || off(middle) <= radius * radius;
            if is_there { probability / (PI * radius * radius) } else { 0.0 }
        };
        let density: f32 = self.discs.iter().enumerate().map(covers).sum();
        (origin, density.recip())
    }

    /// Directions from a far place to what is seen; `None`: from there all directions are as good.
    #[inline(always)]
    pub(crate) fn aim(&self, from: Vec3) -> Option<Aim> {
        if self.extent.is_whole() {
            return None;
        }
        let way = self.extent.center - from;
        let distance = way.length();
        if distance <= FAR * self.extent.radius {
            return None;
        }
        let sine = self.extent.radius / distance;
        // 1 − cos, without the loss of a difference.
        let one_minus_cos = sine * sine / (1.0 + (1.0 - sine * sine).sqrt());
        Some(Aim { axis: way / distance, one_minus_cos })
    }
}

impl Aim {
    /// The probability with which a direction is aimed.
    pub(crate) const SHARE: f32 = AIMED;

    /// Draws a direction.
    pub(crate) fn sample(&self, u: [f32; 2]) -> Vec3 {
        around(self.axis, self.one_minus_cos * u[0], u[1])
    }

    /// Whether a direction leads to what is seen.
    pub(crate) fn contains(&self, w: Vec3) -> bool {
        (w - self.axis).length_squared() <= 2.0 * self.one_minus_cos
    }

    /// The density of a direction that is aimed with the probability [`Self::SHARE`], and else drawn with density `pdf`.
    ///
    /// - `is_within`: whether it leads to what is seen: of one that was aimed, whatever rounding says.
    pub(crate) fn mixed(&self, is_within: bool, pdf: f32) -> f32 {
        let own = if is_within { 1.0 / (2.0 * PI * self.one_minus_cos) } else { 0.0 };
        Self::SHARE * own + (1.0 - Self::SHARE) * pdf
    }
}
