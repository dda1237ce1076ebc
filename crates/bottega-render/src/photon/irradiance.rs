//! Irradiance at places all over the surfaces, as many where photons are dense, from those near them (Christensen 1999,
//! *Faster Photon Map Global Illumination*).

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

/// For so many photons there is one place (Christensen 1999: one for four makes no visible difference).
const STEP: u32 = 4;
/// How far on in the tree another photon near by is.
const NEIGHBOUR: u32 = 8;

/// At how many places the irradiance is computed from so many photons.
pub(super) fn irradiance_count(all: &PhotonMap) -> u32 {
    (all.len() as u32).div_ceil(STEP)
}

/// Irradiance to be computed at places beside some photons.
pub(super) struct IrradianceAt<'a> {
    pub(super) prepared: &'a PreparedScene,
    pub(super) estimator: Estimator,
    pub(super) all: &'a PhotonMap,
    /// Which of the places: below [`irradiance_count`].
    pub(super) points: Range<u32>,
}

impl Task for IrradianceAt<'_> {
    type Output = IrradiancePlaces;

    #[inline(always)]
    fn run(self) -> IrradiancePlaces {
        let mut found = Nearest::new(self.estimator.gathered());
        let mut known = IrradiancePlaces::default();
        for point in self.points.clone() {
            // Numbers in the tree go from place to place, so that each step takes one photon of a neighbourhood.
            let place = self.beside(point * STEP);
            let mut sums = [Spectrum::ZERO; BOUNCES_KEPT];
            self.estimator.irradiance(self.all, &place, &mut found, |bounces, light| sums[kept(bounces)] += light);
            known.push(place, &sums);
        }
        known
    }
}

impl IrradianceAt<'_> {
    /// A place on the surface beside a photon, about as far from it as those that tell of the place are.
    ///
    /// At the photon itself the density is that of the others and one more, which is too much where photons lie by chance: by a
    /// twenty-fifth of fifty photons. Without it it is too little where they are spread evenly.
    fn beside(&self, index: u32) -> Photon {
        /// Turn from one place to the next: the golden section of a whole one, in 2⁻³² of it.
        const TURN: u32 = 0x9e37_79b9;
        let photon = self.all.photon(index);
        let neighbour = self.all.photon((index ^ NEIGHBOUR).min(self.all.len() as u32 - 1));
        let distance = 2.0 * photon.p.distance(neighbour.p);
        let (s, t) = orthonormal_basis(photon.mark().normal());
        let (sin, cos) = math::sin_cos(TAU * ((index / STEP).wrapping_mul(TURN) as f32 * 2.0_f32.powi(-32)));
        let away = (s * cos + t * sin) * distance;
        [away, -away].into_iter().find_map(|away| self.moved(&photon, away)).unwrap_or(photon)
    }

    /// A photon moved along its surface, if that goes on so far with nothing between.
    fn moved(&self, photon: &Photon, away: Vec3) -> Option<Photon> {
        let accel = self.prepared.accel();
        let normal = photon.mark().normal();
        let height = FLATNESS * away.length();
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
        let there = if point.front { point.ng } else { -point.ng };
        let is_same = is_alike(there, normal) && point.p.is_finite();
        is_same.then(|| Photon::new(point.p, photon.mark().to_light(), there, photon.mark().power()))
    }
}
