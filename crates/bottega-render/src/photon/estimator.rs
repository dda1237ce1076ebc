//! The estimator of light that photons bring to a point near them.

use std::f32::consts::PI;

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    map::{Nearest, PhotonMap},
    record::Photon,
    trace::is_alike,
};
use crate::{PhotonSettings, extent::Extent, settings::PhotonFilter};

/// How far off the plane of a surface photons count that lie on it, as a share of how far they may be in all.
pub(super) const FLATNESS: f32 = 0.25;

/// Whether a place that is known lies on the surface of a point, and not beside it, such as the floor below a shelf.
///
/// - `normal`: of the surface, on the side that is asked for.
/// - `reach`: how far such places may be.
#[inline(always)]
pub(super) fn is_on_surface(place: &Photon, p: Vec3, normal: Vec3, reach: f32) -> bool {
    let away = place.p - p;
    let off_plane = away.dot(normal);
    let is_flat = off_plane * off_plane <= FLATNESS * FLATNESS * (reach * reach).min(4.0 * away.length_squared());
    is_flat && is_alike(place.mark().normal(), normal)
}

/// What a photon brings to a point near it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PhotonContribution {
    /// Back along the way that it came.
    pub(crate) to_light: Vec3,
    /// Whether it arrived on the side of the normal.
    pub(crate) is_before: bool,
    /// How often it was scattered before.
    pub(crate) bounces: u32,
    /// Its share of the irradiance.
    pub(crate) light: Spectrum,
}

/// Where photons count.
#[derive(Clone, Copy)]
struct Disc {
    p: Vec3,
    normal: Vec3,
    radius_squared: f32,
    /// What a photon's power counts in its middle.
    share: f32,
}

/// How the density of photons is estimated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimator {
    /// What a photon's power counts.
    scale: f32,
    filter: PhotonFilter,
    /// How many photons are looked for, and how far, as a share of the length that counts there.
    gather: u32,
    reach: f32,
    extent: Extent,
}

impl Estimator {
    /// - `extent`: of what is seen.
    pub(crate) fn new(settings: &PhotonSettings, extent: Extent) -> Self {
        let scale = 1.0 / settings.count.max(1) as f32;
        let reach = settings.radius.clamp(0.0, 2.0);
        Self { scale, filter: settings.filter, gather: settings.gather, reach, extent }
    }

    /// How far photons may be from a place.
    #[inline(always)]
    pub(super) fn reach_at(&self, p: Vec3) -> f32 {
        self.reach * self.extent.length_at(p)
    }

    /// How many photons are looked for.
    pub(super) fn gathered(&self) -> usize {
        self.gather as usize
    }

    /// Irradiance on the side of a surface where a photon arrived, by those near it: `add` takes it apart, with the number of
    /// bounces.
    pub(crate) fn irradiance(
        &self,
        map: &PhotonMap,
        photon: &Photon,
        found: &mut Nearest,
        mut add: impl FnMut(u32, Spectrum),
    ) {
        let on_this_side =
            |arrived: &PhotonContribution| if arrived.is_before { Spectrum::ONE } else { Spectrum::ZERO };
        let on_this_side = |arrived: &PhotonContribution| add(arrived.bounces, arrived.light * on_this_side(arrived));
        self.gather(map, photon.p, photon.mark().normal(), self.reach_at(photon.p), found, on_this_side);
    }

    /// Looks for the photons near a point, and tells `take` what each brings to it: all of it together is the irradiance.
    ///
    /// - `map`: where to look; `found` says for how many of them.
    /// - `normal`: of the surface, on the side that is lit if light cannot go through.
    #[inline(always)]
    pub(crate) fn gather(
        &self,
        map: &PhotonMap,
        p: Vec3,
        normal: Vec3,
        reach: f32,
        found: &mut Nearest,
        mut take: impl FnMut(&PhotonContribution),
    ) {
        map.nearest(p, reach * reach, found);
        let radius_squared = if found.is_full() { found.farthest() } else { reach * reach };
        if found.is_empty() || radius_squared <= 0.0 {
            return;
        }
        let disc = Disc { p, normal, radius_squared, share: self.scale / (PI * radius_squared) };
        // The farthest only says how large the disc is: counted, it would make all a little too bright.
        for (index, distance_squared) in found.iter().filter(|&(_, distance)| distance < radius_squared) {
            if let Some(arrived) = self.weighed(map, index, distance_squared, &disc) {
                take(&arrived);
            }
        }
    }

    /// The same for all photons within a radius, however many.
    #[inline(always)]
    pub(crate) fn gather_within(
        &self,
        map: &PhotonMap,
        p: Vec3,
        normal: Vec3,
        reach: f32,
        mut take: impl FnMut(&PhotonContribution),
    ) {
        let radius_squared = reach * reach;
        if radius_squared <= 0.0 {
            return;
        }
        let disc = Disc { p, normal, radius_squared, share: self.scale / (PI * radius_squared) };
        map.within(p, radius_squared, |index, distance_squared| {
            if let Some(arrived) = self.weighed(map, index, distance_squared, &disc) {
                take(&arrived);
            }
        });
    }

    #[inline(always)]
    fn weighed(&self, map: &PhotonMap, index: u32, distance_squared: f32, disc: &Disc) -> Option<PhotonContribution> {
        let Disc { p, normal, radius_squared, share } = *disc;
        let photon = map.photon(index);
        let off_plane = (photon.p - p).dot(normal);
        // Photons on the other side of the surface are those of light that goes through: their normal is the opposite.
        let its_normal = photon.mark().normal();
        let is_before = is_alike(its_normal, normal);
        let is_behind = is_alike(-its_normal, normal);
        if !(is_before || is_behind) || off_plane * off_plane > FLATNESS * FLATNESS * radius_squared {
            return None;
        }
        let part = distance_squared / radius_squared;
        let weight = match self.filter {
            PhotonFilter::Epanechnikov => 2.0 * (1.0 - part),
            PhotonFilter::Cone => (1.0 - part.sqrt() / CONE) / (1.0 - 2.0 / (3.0 * CONE)),
        };
        let light = photon.mark().power() * (weight * share);
        Some(PhotonContribution {
            to_light: photon.mark().to_light(),
            is_before,
            bounces: photon.mark().bounces(),
            light,
        })
    }
}

/// k of the cone filter.
const CONE: f32 = 1.1;
