//! The density estimator of photons.

use std::f32::consts::PI;

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    map::{Nearest, PhotonMap},
    record::Photon,
    trace::is_alike,
};
use crate::{
    extent::Extent,
    settings::{PhotonFilter, PhotonSettings},
};

/// Greatest distance of a photon off the plane of the surface, as a share of the search radius.
pub(super) const FLATNESS: f32 = 0.25;

/// Returns `true` if a known place lies on the surface of a point, and not off it, such as on the floor below a shelf.
///
/// - `normal`: geometric normal at the point, on the lit side.
/// - `reach`: search radius of places.
#[inline(always)]
pub(super) fn is_on_surface(place: &Photon, p: Vec3, normal: Vec3, reach: f32) -> bool {
    let away = place.p - p;
    let off_plane = away.dot(normal);
    let is_flat = off_plane * off_plane <= FLATNESS * FLATNESS * (reach * reach).min(4.0 * away.length_squared());
    is_flat && is_alike(place.mark().normal(), normal)
}

/// The contribution of a photon to a point near it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PhotonContribution {
    /// Direction against the photon's flight; unit length.
    pub(crate) to_light: Vec3,
    /// `true` if the photon arrived on the side of the normal.
    pub(crate) is_before: bool,
    /// Number of scatterings before it arrived.
    pub(crate) bounces: u32,
    /// The photon's part of the irradiance.
    pub(crate) light: Spectrum,
}

/// The disc that photons are counted in.
#[derive(Clone, Copy)]
struct Disc {
    p: Vec3,
    normal: Vec3,
    radius_squared: f32,
    /// Factor of a photon's power in its center, before the filter.
    share: f32,
}

/// Settings of density estimation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimator {
    /// Factor of a photon's power.
    scale: f32,
    filter: PhotonFilter,
    /// Number of photons to find, and search radius as a share of the extent's length at the point.
    gather: u32,
    reach: f32,
    extent: Extent,
}

impl Estimator {
    /// Makes an estimator with the radius that the settings ask for.
    ///
    /// - `extent`: extent of the visible part of the scene.
    pub(crate) fn new(settings: &PhotonSettings, extent: Extent) -> Self {
        let scale = 1.0 / settings.count.max(1) as f32;
        let reach = settings.radius.clamp(0.0, 2.0);
        Self { scale, filter: settings.filter, gather: settings.gather, reach, extent }
    }

    /// Returns the search radius at a point, in scene units.
    #[inline(always)]
    pub(super) fn reach_at(&self, p: Vec3) -> f32 {
        self.reach * self.extent.length_at(p)
    }

    /// Returns the number of photons to find.
    pub(super) fn gathered(&self) -> usize {
        self.gather as usize
    }

    /// Estimates the irradiance at a photon, on the side where it arrived. Calls `add` with each contribution and its
    /// number of bounces.
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

    /// Finds the photons nearest to a point, and calls `take` with the contribution of each; their sum is the
    /// irradiance.
    ///
    /// - `found`: buffer; its size is the number of photons to find.
    /// - `normal`: geometric normal, on the lit side of opaque surfaces.
    /// - `reach`: search radius.
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
        // Find the nearest photons and the disc that they fill
        map.nearest(p, reach * reach, found);
        let radius_squared = if found.is_full() { found.farthest() } else { reach * reach };
        if found.is_empty() || radius_squared <= 0.0 {
            return;
        }
        let disc = Disc { p, normal, radius_squared, share: self.scale / (PI * radius_squared) };
        // The farthest photon only defines the radius: counting it biases the density upwards
        for (index, distance_squared) in found.iter().filter(|&(_, distance)| distance < radius_squared) {
            if let Some(arrived) = self.weighed(map, index, distance_squared, &disc) {
                take(&arrived);
            }
        }
    }

    /// Finds all photons within a radius, and calls `take` with the contribution of each.
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

    /// Returns the contribution of a photon by the filter; `None`: it is not on the surface.
    #[inline(always)]
    fn weighed(&self, map: &PhotonMap, index: u32, distance_squared: f32, disc: &Disc) -> Option<PhotonContribution> {
        let Disc { p, normal, radius_squared, share } = *disc;
        let photon = map.photon(index);
        // Reject photons on other surfaces
        let off_plane = (photon.p - p).dot(normal);
        // Photons on the other side are those of transmitted light: their normal is opposite
        let its_normal = photon.mark().normal();
        let is_before = is_alike(its_normal, normal);
        let is_behind = is_alike(-its_normal, normal);
        if !(is_before || is_behind) || off_plane * off_plane > FLATNESS * FLATNESS * radius_squared {
            return None;
        }
        // Weight by the filter
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

/// Parameter k of the cone filter.
const CONE: f32 = 1.1;
