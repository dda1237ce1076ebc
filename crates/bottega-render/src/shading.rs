//! Scattering at a point of a surface, and what can be said of it beforehand.

use bottega_kernels::math;
use glam::Vec3;

use crate::{
    bsdf::{Bsdf, BsdfSample, SurfacePoint, scattering},
    interaction::Interaction,
    surfaces::Surfaces,
};

/// Sets the numbers that choose between blended surfaces apart from those that decide on opacity.
pub const BLEND: u64 = 0x9e37_79b9_7f4a_7c15;
/// Where the depth of a vertex begins in the keys of both.
pub const DEPTH_SHIFT: u32 = 56;
/// Density in sr⁻¹ below which a direction counts as drawn broadly: a lobe as sharp covers some six of the cells in which
/// records know directions.
const SHARPEST: f32 = 1.0;

/// The scattering at a point; `chance` is asked for a number in [0, 1) where surfaces are blended. It is put into `place` if it was not known before.
#[inline(always)]
pub(crate) fn bsdf_at<'a>(
    surfaces: &'a Surfaces,
    point: &Interaction,
    chance: impl FnOnce() -> f32,
    place: &'a mut Option<Bsdf>,
) -> &'a Bsdf {
    let (material, known) = surfaces.material(point.material);
    if let Some(sides) = &known.bsdfs
        && !point.is_colored
    {
        return &sides[usize::from(point.front)];
    }
    let point = SurfacePoint {
        uvs: point.uvs,
        spot: point.spot(),
        footprint: point.footprint,
        vertex_color: point.color,
        front: point.front,
        coat_normal: point.coat_normal,
        lifted: point.lifted,
        chance: if material.is_blended() { chance() } else { 0.0 },
    };
    place.insert(scattering(surfaces.scene(), material, &point))
}

#[inline(always)]
pub(crate) fn exp(v: Vec3) -> Vec3 {
    Vec3::new(math::exp(v.x), math::exp(v.y), math::exp(v.z))
}

/// Whether light leaves a surface the same in all directions, and on one side.
pub(crate) fn is_matte(bsdf: &Bsdf) -> bool {
    bsdf.roughness() >= 1.0 && !bsdf.is_transmissive()
}

/// Whether a direction was drawn so broadly that light from around it can stand for light from there.
#[inline(always)]
pub(crate) fn is_broad_sample(sample: &BsdfSample) -> bool {
    !sample.is_delta() && sample.pdf < SHARPEST
}

/// Whether a surface that is not matte sends back an eighth or more of the light, or of the samples at least, broadly.
pub(crate) fn is_broad(bsdf: &Bsdf, wo: Vec3) -> bool {
    const TRIED: u32 = 16;
    if is_matte(bsdf) || bsdf.is_transmissive() {
        return false;
    }
    let bsdf = bsdf.at(wo);
    let number = |i: u32, prime: u32| ((i * prime % TRIED) as f32 + 0.5) / TRIED as f32;
    let sample = |i: u32| bsdf.sample(number(i, 1), [number(i, 5), number(i, 11)]);
    (0..TRIED).filter_map(sample).filter(is_broad_sample).count() as u32 >= TRIED / 8
}
