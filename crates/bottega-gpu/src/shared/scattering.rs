//! Constants of mathematics and of scattering.

use std::borrow::Cow;
use std::f32::consts;
use std::f64::consts::TAU as TAU_64;

use bottega_render::bsdf::{LobeFlags, constants as bsdf, fresnel, ggx, precomputed, warp};

use super::declare::{Constant, Value, constants};

constants! {
    /// Constants of mathematics, and of all surfaces except the layered one.
    CONSTANTS;
    PI: f32 = consts::PI;
    TAU: f32 = consts::TAU;
    FRAC_1_PI: f32 = consts::FRAC_1_PI;
    /// The largest float below 1: stretched uniform numbers are clamped to it.
    ONE_MINUS_EPSILON: f32 = warp::ONE_MINUS_EPSILON;
    WARP_UNIFORM_PDF: f32 = warp::UNIFORM_HEMISPHERE_PDF;

    BSDF_REFLECTION: u32 = LobeFlags::REFLECTION.bits() as u32;
    BSDF_TRANSMISSION: u32 = LobeFlags::TRANSMISSION.bits() as u32;
    BSDF_DIFFUSE: u32 = LobeFlags::DIFFUSE.bits() as u32;
    BSDF_GLOSSY: u32 = LobeFlags::GLOSSY.bits() as u32;
    BSDF_DELTA: u32 = LobeFlags::DELTA.bits() as u32;

    BSDF_KIND_BLACK: u32 = 0;
    BSDF_KIND_LAMBERT: u32 = 1;
    BSDF_KIND_ROUGH_MATTE: u32 = 2;
    BSDF_KIND_TRANSLUCENT: u32 = 3;
    BSDF_KIND_CONDUCTOR: u32 = 4;
    BSDF_KIND_DIELECTRIC: u32 = 5;
    BSDF_KIND_PLASTIC: u32 = 6;
    BSDF_KIND_STACK: u32 = 7;
    BSDF_KIND_PRINCIPLED: u32 = 8;
    BSDF_KIND_SHEET: u32 = 9;
    BSDF_KIND_LAYERED: u32 = 10;
    /// A surface that scatters, but nothing towards this wo.
    BSDF_KIND_NOTHING: u32 = 11;

    /// Properties of the lobes.
    BSDF_HAS_NON_DELTA: u32 = 1;
    BSDF_IS_TRANSMISSIVE: u32 = 2;

    BECKMANN_HALF_RSQRT_PI: f32 = bsdf::HALF_RSQRT_PI;
    GGX_SMOOTH_ALPHA: f32 = ggx::SMOOTH_ALPHA;
    FRESNEL_IOR_MAX: f32 = fresnel::IOR_MAX;
    FRESNEL_IOR_STEP_MIN: f32 = fresnel::IOR_STEP_MIN;
    ROUGH_MATTE_LOSS: f32 = bsdf::ROUGH_MATTE_LOSS;
    ROUGH_MATTE_GAIN: f32 = bsdf::ROUGH_MATTE_GAIN;
    DIELECTRIC_ETA_STEP_MIN: f32 = bsdf::DIELECTRIC_ETA_STEP_MIN;
    PLASTIC_MEAN_THROUGH: f32 = bsdf::PLASTIC_MEAN_THROUGH;

    /// In the words of a stack: the first bit of the metal's facets, above those of the boundary.
    STACK_METAL_SHIFT: u32 = 2;
    /// Flag: the stack lies on metal.
    STACK_IS_METAL: u32 = 16;

    COVER_COSINES: u32 = bsdf::COVER_COSINES as u32;
    COVER_CURVE: u32 = precomputed::COVER_CURVE as u32;
    COVER_NODES: u32 = precomputed::COVER_NODES as u32;
}

constants! {
    /// Constants of the layered surface.
    LAYERS;
    COAT_IOR: f32 = bsdf::COAT_IOR;
    DISPERSION_SCALE: f32 = bsdf::DISPERSION_SCALE;
    FILM_TERMS: u32 = bsdf::FILM_TERMS as u32;
    FILM_FADING: f32 = bsdf::FILM_FADING;
    FILM_MEAN_STEPS: u32 = bsdf::FILM_MEAN_STEPS as u32;
    FILM_PEAK_STEPS: u32 = bsdf::FILM_PEAK_STEPS as u32;

    SHEEN_ROUGHNESS_MIN: f32 = bsdf::SHEEN_ROUGHNESS_MIN;
    SHEEN_NARROW: [f32; 4] = first_four(bsdf::SHEEN_NARROW);
    SHEEN_NARROW_LAST: f32 = bsdf::SHEEN_NARROW[4];
    SHEEN_WIDE: [f32; 4] = first_four(bsdf::SHEEN_WIDE);
    SHEEN_WIDE_LAST: f32 = bsdf::SHEEN_WIDE[4];

    /// Numbers per curve of albedos; after the nodes of √μ come the mean over the hemisphere and the peak.
    TABLE_CURVE: u32 = precomputed::ALBEDO_CURVE as u32;
    TABLE_MU: u32 = bsdf::TABLE_MU as u32;
    TABLE_PEAK: u32 = TABLE_MU + 1;
    TABLE_ROUGH: u32 = bsdf::TABLE_ROUGHNESS as u32;
    TABLE_INDEX: u32 = bsdf::TABLE_INDEX as u32;
    /// The first curve of each table.
    TABLE_SINGLE: u32 = 0;
    TABLE_SCHLICK: u32 = TABLE_SINGLE + TABLE_ROUGH;
    TABLE_RISE: u32 = TABLE_SCHLICK + TABLE_ROUGH;
    TABLE_OUTSIDE: u32 = TABLE_RISE + TABLE_INDEX * TABLE_ROUGH;
    TABLE_INSIDE: u32 = TABLE_OUTSIDE + TABLE_INDEX * TABLE_ROUGH;
    TABLE_SHEEN: u32 = TABLE_INSIDE + TABLE_INDEX * TABLE_ROUGH;

    /// Kinds of transmission: none, through a thin sheet, into a solid.
    THROUGH_NOTHING: u32 = 0;
    THROUGH_SHEET: u32 = 1;
    THROUGH_SOLID: u32 = 2;

    /// The tables that the cosine lobes use.
    LAYERED_USES_SINGLE: u32 = 1;
    LAYERED_USES_RISE: u32 = 2;
    LAYERED_USES_BOUNDARY: u32 = 4;
    LAYERED_INSIDE: u32 = 8;
    LAYERED_THROUGH_SHIFT: u32 = 4;

    LAYERED_LOBE_INTERFACE: u32 = 0;
    LAYERED_LOBE_COSINE: u32 = 1;
    LAYERED_LOBE_COSINE_THROUGH: u32 = 2;
    LAYERED_LOBE_COAT: u32 = 3;
    LAYERED_LOBE_UNIFORM: u32 = 4;
    LAYERED_LOBES: u32 = 5;
}

const fn first_four([a, b, c, d, _]: [f32; 5]) -> [f32; 4] {
    [a, b, c, d]
}

/// Returns the Gaussians of a thin film: height, frequency in turns per nanometre, variance per square nanometre.
pub(super) fn film_gaussians() -> impl Iterator<Item = Constant> {
    let names = ["FILM_X0", "FILM_X1", "FILM_Y", "FILM_Z"];
    names.into_iter().zip(bsdf::FILM_GAUSSIANS).map(|(name, [height, position, variance])| {
        let nanometres = TAU_64 * 1e-9;
        let height = height * (TAU_64 * variance).sqrt() / bsdf::FILM_GAUSSIANS_NORM;
        let gaussian = [height, position * 1e-9, variance * (nanometres * nanometres)].map(|number| number as f32);
        Constant { name: Cow::Borrowed(name), docs: &[], value: Value::Floats(Cow::Owned(gaussian.to_vec())) }
    })
}
