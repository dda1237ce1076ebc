//! Precomputed irradiance at points all over the surfaces, denser where photons are (Christensen 1999, *Faster Photon
//! Map Global Illumination*).

use std::{f32::consts::TAU, ops::Range};

use bottega_kernels::{Ray, compiled::Task, math};
use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    bounces::{BOUNCES_KEPT, IrradiancePlaces, kept},
    estimator::{Estimator, FLATNESS},
    map::{Nearest, PhotonMap},
    record::Photon,
    trace::is_alike,
};
use crate::{camera::RayCone, interaction::Interaction, prepare::PreparedScene, sampling::orthonormal_basis};

/// Photons per point (Christensen 1999: one point per four photons makes no visible difference).
const STEP: u32 = 4;
/// Offset in the tree's order to another photon nearby.
const NEIGHBOUR: u32 = 8;

/// Returns the number of points for a map of photons.
pub(super) fn irradiance_count(all: &PhotonMap) -> u32 {
    (all.len() as u32).div_ceil(STEP)
}

/// A range of points at which to compute the irradiance.
pub(super) struct IrradianceAt<'a> {
    /// The prepared scene.
    pub(super) prepared: &'a PreparedScene,
    /// Density estimator of the picture.
    pub(super) estimator: Estimator,
    /// All photons of the picture.
    pub(super) all: &'a PhotonMap,
    /// Indices of the points, below [`irradiance_count`].
    pub(super) points: Range<u32>,
}

impl Task for IrradianceAt<'_> {
    type Output = IrradiancePlaces;

    #[inline(always)]
    fn run(self) -> IrradiancePlaces {
        let mut found = Nearest::new(self.estimator.gathered());
        let mut known = IrradiancePlaces::default();
        for point in self.points.clone() {
            // Photons are numbered by position, so a stride of [`STEP`] takes one per neighbourhood
            let place = self.beside(point * STEP);
            let mut sums = [Spectrum::ZERO; BOUNCES_KEPT];
            self.estimator.irradiance(self.all, &place, &mut found, |bounces, light| sums[kept(bounces)] += light);
            known.push(place, &sums);
        }
        known
    }
}

impl IrradianceAt<'_> {
    /// Returns a point on the surface beside a photon, about as far away as the photons that are gathered there.
    ///
    /// At the photon itself the density counts one photon too many where photons are random: a twenty-fifth of fifty
    /// photons. Leaving it out counts too few where they are stratified.
    fn beside(&self, index: u32) -> Photon {
        /// Turn from one point to the next: the golden ratio of a whole turn, in units of 2⁻³².
        const TURN: u32 = 0x9e37_79b9;
        let photon = self.all.photon(index);
        let neighbour = self.all.photon((index ^ NEIGHBOUR).min(self.all.len() as u32 - 1));
        let distance = 2.0 * photon.p.distance(neighbour.p);
        let (s, t) = orthonormal_basis(photon.mark().normal());
        let (sin, cos) = math::sin_cos(TAU * ((index / STEP).wrapping_mul(TURN) as f32 * 2.0_f32.powi(-32)));
        let away = (s * cos + t * sin) * distance;
        [away, -away].into_iter().find_map(|away| self.moved(&photon, away)).unwrap_or(photon)
    }

    /// Returns the photon moved along its surface; `None`: the surface ends before, or something is in between.
    fn moved(&self, photon: &Photon, away: Vec3) -> Option<Photon> {
        let accel = self.prepared.accel();
        let normal = photon.mark().normal();
        let height = FLATNESS * away.length();
        // Test that the way above the surface is free, then find the surface below its end
        let above = photon.p + normal * height;
        if accel.occluded(&Ray { t_max: 1.0, ..Ray::new(above, away) }) {
            return None;
        }
        let origin = above + away;
        let hit = accel.intersect(&Ray { t_max: 2.0 * height, ..Ray::new(origin, -normal) });
        if hit.is_none() {
            return None;
        }
        let point = Interaction::new(self.prepared, &hit, origin, -normal, RayCone::default());
        let there = point.facing_ng();
        let is_same = is_alike(there, normal) && point.p.is_finite();
        is_same.then(|| Photon::new(point.p, photon.mark().to_light(), there, photon.mark().power()))
    }
}
