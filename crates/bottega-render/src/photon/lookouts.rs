//! Lookouts: agents that the camera casts, which say where photons matter.
//!
//! Sources: Herubel, Biri and Deverly 2009, §6: agents "could also force photon casting in importance direction";
//! importance from the camera as in Peter and Pietrek 1998, *Importance driven construction of photon maps*.

use bottega_kernels::Ray;
use glam::Vec3;

use super::{
    map::{Nearest, PhotonMap},
    record::Photon,
    trace::is_alike,
};
use crate::{
    camera::RayCone,
    integrator::PathIntegrator,
    interaction::Interaction,
    prepare::PreparedScene,
    sampler::{DimensionSet, PixelSampler},
    settings::{PathSettings, View},
    shading::{is_broad, is_matte},
    vertex::bsdf_at_vertex,
};

/// Camera rays along a side of the picture.
const SIDE: u32 = 64;
/// Greatest number of mirrors and panes along a camera ray.
const MIRRORS_MAX: u32 = 8;
/// Number of neighbours that a lookout's radius is measured by, and the factor on their distance.
const NEIGHBORS: usize = 4;
const REACH: f32 = 2.0;

/// A point that the camera sees, over mirrors and through glass, on a surface that is not specular.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lookout {
    /// Position, in world space.
    pub(crate) p: Vec3,
    /// Geometric normal on the visible side; unit length.
    pub(crate) normal: Vec3,
    /// Direction from which the point is seen; unit length.
    pub(crate) wo: Vec3,
    /// `true`: the surface is matte.
    pub(crate) is_matte: bool,
    /// `true`: the surface is not matte, but scatters so much light broadly that directions of the light matter.
    pub(crate) is_glossy: bool,
}

/// The lookouts of a view.
#[derive(Debug)]
pub(super) struct Lookouts {
    /// Positions; the tag holds the bits of the radius.
    tree: PhotonMap,
    reach_max: f32,
    reach_median: f32,
}

impl Lookouts {
    /// Casts the lookouts of a view, and builds the tree on the current thread pool.
    pub(super) fn of_view(prepared: &PreparedScene, view: &View) -> Self {
        let seen = places_seen(prepared, view, SIDE);
        let tagged = |(it, index): (&Lookout, u32)| Photon::tagged(it.p, it.normal, it.normal, index);
        let tree = PhotonMap::new(seen.iter().zip(0..).map(tagged).collect());
        let mut found = Nearest::new(NEIGHBORS + 1);
        let reach = |it: &Lookout| {
            tree.nearest(it.p, f32::INFINITY, &mut found);
            REACH * found.iter().map(|(_, squared)| squared).fold(0.0, f32::max).sqrt()
        };
        let mut reaches: Vec<f32> = seen.iter().map(reach).collect();
        let tree = tree.retagged(|index| reaches[index as usize].to_bits());
        reaches.sort_unstable_by(f32::total_cmp);
        let reach_median = reaches.get(reaches.len() / 2).copied().unwrap_or_default();
        Self { tree, reach_max: reaches.last().copied().unwrap_or_default(), reach_median }
    }

    /// Returns the visible importance of a photon, in [0, 1]: 1 where lookouts are at least as dense as their median,
    /// or where there are none at all.
    pub(super) fn importance(&self, photon: &Photon) -> f64 {
        let normal = photon.mark().normal();
        let reach_of = |number| f32::from_bits(self.tree.mark(number).tag());
        let is_theirs = |number| {
            let lookout = self.tree.photon(number);
            is_alike(lookout.mark().normal(), normal) && lookout.p.distance(photon.p) <= reach_of(number)
        };
        if self.tree.is_empty() {
            return 1.0;
        }
        let nearest = self.tree.nearest_where(photon.p, self.reach_max.powi(2), is_theirs);
        nearest.map_or(0.0, |number| f64::from(self.reach_median / reach_of(number)).powi(2).min(1.0))
    }
}

/// Returns the first points along camera rays on surfaces that are not specular, over mirrors and through glass.
///
/// - `side`: rays along a side of the picture.
pub(crate) fn places_seen(prepared: &PreparedScene, view: &View, side: u32) -> Vec<Lookout> {
    let settings = PathSettings::default();
    let Ok(integrator) = PathIntegrator::unguided(prepared, view, &settings) else { return Vec::new() };
    let pixel = |i: u32, count: u32| ((2 * i + 1) * count / (2 * side)).min(count.saturating_sub(1));
    let all = (0..side * side).map(|i| (pixel(i % side, view.width), pixel(i / side, view.height), i));
    let seen = all.filter_map(|(x, y, i)| {
        let sampler = PixelSampler::new(0, x, y, i);
        let ray = integrator.camera_ray(&sampler, x, y).0;
        place_seen(prepared, &sampler, ray.origin, ray.direction)
    });
    seen.filter(|it| it.p.is_finite()).collect()
}

/// Returns the first such point along one ray.
fn place_seen(
    prepared: &PreparedScene,
    sampler: &PixelSampler,
    mut origin: Vec3,
    mut direction: Vec3,
) -> Option<Lookout> {
    for vertex in 0..=MIRRORS_MAX {
        let hit = prepared.accel().intersect(&Ray::new(origin, direction));
        if hit.is_none() {
            return None;
        }
        let point = Interaction::new(prepared, &hit, origin, direction, RayCone::default());
        // Evaluate the BSDF, and stop at the first surface that is not specular
        let mut storage = None;
        let bsdf = bsdf_at_vertex(prepared, &point, sampler, vertex, &mut storage);
        if bsdf.has_non_delta() {
            let (is_matte, is_glossy) = (is_matte(bsdf), is_broad(bsdf, point.to_local(point.wo)));
            return Some(Lookout { p: point.p, normal: point.facing_ng(), wo: point.wo, is_matte, is_glossy });
        }
        // Follow the mirror or the glass
        let u = sampler.quad(DimensionSet::scattering(vertex));
        let sample = bsdf.sample(point.to_local(point.wo), u[0], [u[1], u[2]])?;
        direction = point.to_world(sample.wi);
        origin = point.ray_origin(direction);
    }
    None
}
