//! A surface vertex of a path, and the steps that every integrator takes there: arrive, evaluate the BSDF, sample a light,
//! scatter.

use bottega_scene::Spectrum;
use glam::Vec3;

use crate::{
    bsdf::{Bsdf, BsdfAt, BsdfSample, Interior},
    color::exp,
    density::SolidAnglePdf,
    interaction::Interaction,
    lights::{LightSample, Receiver},
    sampler::PixelSampler,
    shading::{BLEND, DEPTH_SHIFT, bsdf_at, entered_bsdf},
    surfaces::{PreparedMaterial, Surfaces},
};

/// A surface vertex of a path.
pub(crate) struct SurfaceVertex<'a> {
    /// The interaction at the vertex.
    pub(crate) point: &'a Interaction,
    /// The BSDF at the vertex, for `wo` and the light that the path carries.
    pub(crate) bsdf: &'a BsdfAt<'a>,
    /// The point as light sampling sees it.
    pub(crate) receiver: Receiver,
    /// Direction towards the previous vertex, in the shading frame.
    pub(crate) wo: Vec3,
}

/// The part of a light sample that a vertex reflects or transmits: multiply both with the light's radiance.
pub(crate) struct LightWeight {
    /// Value of the BSDF, in sr⁻¹.
    pub(crate) value: Spectrum,
    /// |cos θ| times the MIS weight, over the density of the sample.
    pub(crate) factor: f32,
}

impl SurfaceVertex<'_> {
    /// Computes the weight of a light sample; `None`: nothing is scattered towards the path.
    ///
    /// - `count`: number of light samples at this vertex.
    /// - `mis_weight`: returns the MIS weight of the light sample, given its density with all `count` samples, and the
    ///   density of its direction by the BSDF.
    #[inline(always)]
    pub(crate) fn light_weight(
        &self,
        light: &LightSample,
        count: f32,
        mis_weight: impl FnOnce(SolidAnglePdf, SolidAnglePdf) -> f32,
    ) -> Option<LightWeight> {
        let wi = self.point.to_local(light.wi);
        // Prevent light leaks by the shading normal
        if (wi.z > 0.0) != self.point.is_reflection(light.wi) {
            return None;
        }
        // Evaluate the BSDF, and weight by MIS
        let (value, bsdf_pdf) = self.bsdf.eval_pdf(wi);
        if value == Spectrum::ZERO {
            return None;
        }
        let expected = count * light.pdf;
        let weight = mis_weight(expected, SolidAnglePdf::new(bsdf_pdf));
        Some(LightWeight { value, factor: wi.z.abs() * weight / expected.per_sr() })
    }
}

/// A direction that leaves a vertex.
pub(crate) struct LeavingDirection {
    /// The direction in world space; unit length.
    pub(crate) wi: Vec3,
    /// `true`: the direction is on the side of the surface that the path came from.
    pub(crate) is_reflection: bool,
}

/// Returns the direction of a BSDF sample in world space; `None` where shading normal and surface disagree on its side.
#[inline(always)]
pub(crate) fn leaving_direction(point: &Interaction, sample: &BsdfSample) -> Option<LeavingDirection> {
    let wi = point.to_world(sample.wi);
    let is_reflection = point.is_reflection(wi);
    ((sample.wi.z > 0.0) == is_reflection).then_some(LeavingDirection { wi, is_reflection })
}

/// Attenuates the light that a path carries through a solid, by Beer's law.
///
/// - `absorption`: absorption coefficient of the solid, per length.
#[inline(always)]
pub(crate) fn attenuate(carried: &mut Spectrum, absorption: Spectrum, distance: f32) {
    if absorption != Spectrum::ZERO {
        *carried *= exp(-absorption * distance);
    }
}

/// Returns the absorption coefficient behind the surface that a path transmits through: that of the solid when the path
/// came from outside, else that of the outside. Surfaces that separate no media keep `absorption`.
#[inline(always)]
pub(crate) fn absorption_behind(point: &Interaction, known: &PreparedMaterial, absorption: Spectrum) -> Spectrum {
    if known.parts_media { known.absorption[usize::from(point.front)] } else { absorption }
}

/// Returns a point as light sampling sees it.
#[inline(always)]
pub(crate) fn receiver_at(point: &Interaction, known: &PreparedMaterial) -> Receiver {
    let n = if known.transmits { Vec3::ZERO } else { point.frame[2] };
    Receiver { p: point.p_outside, n }
}

/// Returns the BSDF at a vertex. A stochastic blend of materials is decided by the vertex and the material alone.
///
/// - `vertex`: index of the vertex on its path.
/// - `storage`: receives a BSDF that is not precomputed.
#[inline(always)]
pub(crate) fn bsdf_at_vertex<'a>(
    surfaces: &'a Surfaces,
    point: &Interaction,
    sampler: &PixelSampler,
    vertex: u32,
    storage: &'a mut Option<Bsdf<'a>>,
) -> &'a Bsdf<'a> {
    bsdf_at(surfaces, point, || part_chance(point, sampler, vertex), storage)
}

/// Returns the BSDF at a vertex on a surface that lets light in, and the medium below the part of a blend that
/// [`bsdf_at_vertex`] chooses; `None`: that part lets none in.
pub(crate) fn entered_bsdf_at_vertex<'s>(
    surfaces: &'s Surfaces,
    point: &Interaction,
    sampler: &PixelSampler,
    vertex: u32,
) -> (Bsdf<'s>, Option<Interior>) {
    entered_bsdf(surfaces, point, part_chance(point, sampler, vertex))
}

/// Returns the random number in [0, 1) that chooses between the parts of a blend at a vertex.
#[inline(always)]
fn part_chance(point: &Interaction, sampler: &PixelSampler, vertex: u32) -> f32 {
    sampler.hashed(BLEND ^ u64::from(vertex) << DEPTH_SHIFT ^ u64::from(point.material))
}
