//! The BSDF at a point of a surface, and its classification.

use glam::Vec3;

use crate::{
    bsdf::{Bsdf, BsdfSample, Interior, SurfacePoint, interior_at, leaving, scattering},
    interaction::Interaction,
    surfaces::Surfaces,
};

/// Key that separates the random numbers of blended surfaces from those of opacity.
pub const BLEND: u64 = 0x9e37_79b9_7f4a_7c15;
/// Shift of a vertex's depth in the keys of blending and opacity.
pub const DEPTH_SHIFT: u32 = 56;
/// Density in sr⁻¹ below which a sampled direction counts as broad: a lobe of this density covers about six of the cells
/// by which records distinguish directions.
const SHARPEST: f32 = 1.0;

/// Returns the BSDF at a point. `chance` returns a random number in [0, 1) and is called only for blended surfaces. A
/// BSDF that is not precomputed is stored in `place`.
#[inline(always)]
pub(crate) fn bsdf_at<'a>(
    surfaces: &'a Surfaces,
    point: &Interaction,
    chance: impl FnOnce() -> f32,
    place: &'a mut Option<Bsdf<'a>>,
) -> &'a Bsdf<'a> {
    let (material, known) = surfaces.material(point.material);
    if let Some(sides) = &known.bsdfs
        && !point.is_colored
    {
        return &sides[usize::from(point.front)];
    }
    let chance = if material.is_blended() { chance() } else { 0.0 };
    place.insert(scattering(surfaces.scene(), material, &surface_point(point, chance)))
}

/// Returns a point as the evaluation of materials sees it.
#[inline(always)]
fn surface_point(point: &Interaction, chance: f32) -> SurfacePoint {
    SurfacePoint {
        uvs: point.uvs,
        mapping_point: point.mapping_point(),
        footprint: point.footprint,
        vertex_color: point.color,
        front: point.front,
        coat_normal: point.coat_normal,
        lifted: point.lifted,
        chance,
        lets_in: false,
    }
}

/// Returns the BSDF at a point of a surface that lets light in, and the medium below; `None`: the chosen part of a blend
/// lets none in.
///
/// - `chance`: random number in [0, 1) that chooses between blended surfaces.
pub(crate) fn entered_bsdf<'s>(
    surfaces: &'s Surfaces,
    point: &Interaction,
    chance: f32,
) -> (Bsdf<'s>, Option<Interior>) {
    let (scene, material) = (surfaces.scene(), surfaces.material(point.material).0);
    let point = SurfacePoint { lets_in: true, ..surface_point(point, chance) };
    (scattering(scene, material, &point), interior_at(scene, material, &point))
}

/// Returns the BSDF of light that leaves a surface from below, at a point seen from outside.
///
/// - `chance`: as for [`entered_bsdf`].
pub(crate) fn left_bsdf(surfaces: &Surfaces, point: &Interaction, chance: f32) -> Bsdf<'static> {
    leaving(surfaces.scene(), surfaces.material(point.material).0, &surface_point(point, chance))
}

/// Returns true if light is scattered equally in all directions, on one side.
pub(crate) fn is_matte(bsdf: &Bsdf<'_>) -> bool {
    bsdf.roughness() >= 1.0 && !bsdf.is_transmissive()
}

/// Returns true if a direction was drawn so broadly that light from nearby directions can replace its light.
#[inline(always)]
pub(crate) fn is_broad_sample(sample: &BsdfSample) -> bool {
    !sample.is_delta() && sample.pdf < SHARPEST
}

/// Returns true if a surface that is not matte reflects an eighth or more of 16 samples broadly.
pub(crate) fn is_broad(bsdf: &Bsdf<'_>, wo: Vec3) -> bool {
    const TRIED: u32 = 16;
    if is_matte(bsdf) || bsdf.is_transmissive() {
        return false;
    }
    let bsdf = bsdf.at(wo);
    let number = |i: u32, prime: u32| ((i * prime % TRIED) as f32 + 0.5) / TRIED as f32;
    let sample = |i: u32| bsdf.sample(number(i, 1), [number(i, 5), number(i, 11)]);
    (0..TRIED).filter_map(sample).filter(is_broad_sample).count() as u32 >= TRIED / 8
}
