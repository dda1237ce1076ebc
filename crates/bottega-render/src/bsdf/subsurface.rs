//! Subsurface scattering at one point: the medium inside, and the light that leaves.
//!
//! Parameters: see [`bottega_scene::Subsurface`]. A diffuse boundary replaces refraction. Light enters by the cosine lobe
//! below the layers, and leaves by the lobe (1 − E(μi)) / (π (1 − E̅)), where E is the albedo of the dielectric above. Both
//! together are reciprocal, and return all light of a substance that absorbs nothing.
//!
//! The medium follows from the diffuse reflectance of a flat, thick slab by van de Hulst's formula, which Kulla and Conty
//! 2017 (*Revisiting Physically Based Shading at Imageworks*) inverted.

use bottega_kernels::math;
use bottega_scene::{RadiusMeaning, Spectrum, Substance, Subsurface};
use glam::Vec3;

use super::base::LayeredBase;
use super::scatter::{Lobes, Scatter, within_range};
use super::{BsdfSample, LobeFlags, SurfaceParams, TransportMode, fresnel, warp};

/// Longest mean free path, and the inverse of the greatest extinction.
const LONGEST: f32 = 1e15;

/// The substance below one point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interior {
    /// Absorption coefficient σ_a, per scene unit.
    pub(crate) absorption: Spectrum,
    /// Scattering coefficient σ_s, per scene unit.
    pub(crate) scattering: Spectrum,
    /// Henyey-Greenstein asymmetry.
    pub(crate) g: f32,
    /// Share of the light that the surface reflects back inside, diffusely.
    pub(crate) inner_reflectance: f32,
}

impl Interior {
    /// Returns the interior at a point.
    ///
    /// - `color`: diffuse reflectance of a flat, thick slab, in [0, 1].
    /// - `lookup`: evaluates a parameter of the substance at the point.
    pub(super) fn new(
        below: &Subsurface,
        color: Spectrum,
        lookup: impl Fn(&bottega_scene::ColorParam) -> Spectrum,
    ) -> Self {
        let eta = within_range(below.inner_eta, 1.0, fresnel::IOR_MAX);
        // The fit is not 0 where nothing is reflected
        let inner_reflectance = if eta > 1.0 { fresnel::mean_internal_reflectance(eta) } else { 0.0 };
        let (absorption, scattering) = match &below.substance {
            Substance::Coefficients { absorption, scattering } => {
                [absorption, scattering].map(|param| lookup(param).map(|x| within_range(x, 0.0, LONGEST))).into()
            }
            Substance::Colored { radius, meaning } => {
                let albedo = color.map(|color| albedo_of_reflectance(color, below.g, inner_reflectance));
                let radius = lookup(radius).map(|radius| within_range(radius, 0.0, LONGEST));
                let path = match *meaning {
                    RadiusMeaning::MeanFreePath => radius,
                    RadiusMeaning::DiffuseMeanFreePath(eta) => radius * color.map(|color| diffuse_ratio(color, eta)),
                };
                let extinction = path.map(|path| 1.0 / path.max(1.0 / LONGEST));
                (extinction * (Spectrum::ONE - albedo), extinction * albedo)
            }
        };
        Self { absorption, scattering, g: below.g, inner_reflectance }
    }
}

/// Returns the single-scattering albedo of the medium of which a flat, thick slab returns `reflectance` of the light that
/// enters it.
///
/// - `inner`: share of the light that the surface reflects back inside.
fn albedo_of_reflectance(reflectance: f32, g: f32, inner: f32) -> f32 {
    let reflectance = within_range(reflectance, 0.0, 1.0);
    // Without inner reflection: R = (1 − ρ) B / (1 − ρ B)
    let bare = reflectance / (1.0 - inner + inner * reflectance);
    // Kulla and Conty's inverse of van de Hulst's formula
    let s = 4.09712 + 4.20863 * bare - (9.59217 + 41.6808 * bare + 17.7126 * bare * bare).sqrt();
    let s2 = within_range(s, 0.0, 1.0).powi(2);
    within_range((1.0 - s2) / (1.0 - g * s2), 0.0, 1.0)
}

/// Returns the mean free path over the diffuse one, √(3 (1 − α′)), of the dipole whose reflectance is `color` (Jensen et al.
/// 2001, section 2.3).
fn diffuse_ratio(color: f32, eta: f32) -> f32 {
    /// Number of halvings of the interval of albedos.
    const HALVINGS: u32 = 24;
    let eta = within_range(eta, 1.0, fresnel::IOR_MAX);
    let fresnel = fresnel::mean_internal_reflectance(eta);
    let boundary = 4.0 / 3.0 * (1.0 + fresnel) / (1.0 - fresnel).max(1e-3);
    let reflectance = |albedo: f32| {
        let s = (3.0 * (1.0 - albedo)).sqrt();
        0.5 * albedo * (1.0 + math::exp(-boundary * s)) * math::exp(-s)
    };
    // The reflectance grows with the albedo
    let (mut low, mut high) = (0.0f32, 1.0f32);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *if reflectance(middle) < color { &mut low } else { &mut high } = middle;
    }
    (3.0 * (1.0 - 0.5 * (low + high))).sqrt()
}

/// Light that leaves a surface from below, independent of its direction there: the lobe (1 − E(μi)) / (π (1 − E̅)) of white light.
#[derive(Clone, Copy, Debug)]
pub(super) struct SubsurfaceExit {
    base: LayeredBase,
}

impl SubsurfaceExit {
    /// Creates the lobe below the dielectric of a layered surface; the caller clamps `p`.
    pub(super) fn new(p: &SurfaceParams) -> Self {
        let params = SurfaceParams {
            base_color: Spectrum::ONE,
            metallic: 0.0,
            transmission: 0.0,
            diffuse_transmission: 1.0,
            diffuse_transmission_color: Spectrum::ONE,
            ..*p
        };
        Self { base: LayeredBase::new(&params) }
    }
}

impl Scatter for SubsurfaceExit {
    fn eval_pdf(&self, _wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        if wi.z <= 0.0 {
            return (Spectrum::ZERO, 0.0);
        }
        (self.base.leaving(wi.z), warp::cosine_hemisphere_pdf(wi.z))
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        self.spread(wo, warp::cosine_hemisphere(u), mode, LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE), 1.0)
    }

    fn diffuse_pdf(&self, _wo: Vec3, wi: Vec3) -> f32 {
        warp::cosine_hemisphere_pdf(wi.z)
    }

    fn albedo(&self, _wo: Vec3) -> Spectrum {
        Spectrum::ONE
    }

    fn lobes(&self) -> Lobes {
        Lobes { has_non_delta: true, is_transmissive: false, roughness: 1.0 }
    }
}
