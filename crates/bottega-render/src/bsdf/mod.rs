//! BSDFs: scattering at one point of a surface.
//!
//! [`scattering`] looks up a material's textures and returns its [`Bsdf`], a small `Copy` value of one of a closed set of
//! kinds. Directions are unit length, in the local frame whose +z is the shading normal **on the side of wo**, and point
//! away from the surface.
//!
//! [`Bsdf::new`] builds glTF's layered material from [`SurfaceParams`]: GGX reflection and transmission of the base
//! (metal and dielectric share their facets), a cosine lobe for diffuse and multiply scattered light on either side, a
//! clear coat and sheen. Tabulated directional albedos in symmetric forms balance the energy of the layers. The sum is
//! therefore reciprocal and never reflects more than it receives; a white metal or white plastic reflects everything:
//!
//! - energy lost between the facets of a rough layer returns as the lobe (1 − E(μo)) (1 − E(μi)) / (π (1 − E̅)) (Kulla
//!   and Conty 2017, Revisiting Physically Based Shading at Imageworks); the boundary of a solid has this lobe on both
//!   sides, anisotropic facets use the E of their mean roughness;
//! - the diffuse base below a dielectric has the same form, with E the albedo of everything that the dielectric reflects
//!   (Kelemen and Szirmay-Kalos 2001, A Microfacet Based Coupled Specular-Matte BRDF Model with Importance Sampling);
//! - coat and sheen attenuate the layers below by min(1 − E(μo), 1 − E(μi)), as in KHR_materials_sheen: never too little,
//!   and up to 5 % too much over a diffuse base.
//!
//! The surfaces of Mitsuba and pbrt (`matte`, `conductor`, `dielectric`, `plastic`, `coated`, `varnish`, `gloss`,
//! `principled`) use the formulas of those renderers, so that pictures of the same file agree; `hair` and `measured` are those
//! of both. Like there, light scattered more than once between facets is lost.

mod base;
mod beckmann;
mod coat;
mod coated;
mod conductor;
pub mod constants;
mod cover;
mod dielectric;
mod diffuse;
mod film;
pub mod frame;
pub mod fresnel;
pub mod ggx;
mod gloss;
mod hair;
mod interface;
mod layered;
mod matte;
mod measured;
mod microfacet;
mod params;
mod plastic;
pub mod precomputed;
mod principled;
mod scatter;
mod scattering;
mod sheen;
mod subsurface;
mod surface;
mod tables;
mod unevenness;
mod varnish;
pub mod warp;

use bottega_scene::Spectrum;
use glam::Vec3;

pub use params::SurfaceParams;
pub use scattering::{Bsdf, BsdfAt};
pub(crate) use subsurface::Interior;
pub use surface::{SurfacePoint, scattering};
pub(crate) use surface::{anisotropy_at, interior_at, leaving};

pub use crate::mapping::MappingPoint;
pub use unevenness::LiftedNormal;

/// The quantity that a path transports from wi to wo. The two modes differ by a factor η² in transmission, because
/// radiance grows where light is compressed into a denser medium.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TransportMode {
    /// Radiance: paths from the camera.
    #[default]
    Radiance,
    /// Importance-weighted power: paths from the lights, which carry photons.
    Importance,
}

impl TransportMode {
    /// Returns the factor for a transmission; `eta` is the index of refraction beyond the boundary over that on the side
    /// of wo.
    fn radiance_scale(self, eta: f32) -> f32 {
        match self {
            Self::Radiance => 1.0 / (eta * eta),
            Self::Importance => 1.0,
        }
    }
}

/// The kind of lobe that a sample was drawn from, as a set of flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LobeFlags(u8);

impl LobeFlags {
    /// Flag of a sample on the side of wo.
    pub const REFLECTION: Self = Self(1);
    /// Flag of a sample on the other side than wo.
    pub const TRANSMISSION: Self = Self(2);
    /// Flag of a lobe spread over the hemisphere: diffuse, multiple scattering or sheen.
    pub const DIFFUSE: Self = Self(4);
    /// Flag of a microfacet lobe.
    pub const GLOSSY: Self = Self(8);
    /// Flag of a Dirac lobe: a single direction.
    pub const DELTA: Self = Self(16);

    /// Returns the flags as bits, one per flag.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Returns true if all flags of `other` are set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Returns the union of both sets.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// A direction drawn by [`Bsdf::sample`], with the value and the density of the BSDF there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// The sampled direction, unit length, in the local frame.
    pub wi: Vec3,
    /// f(wo, wi) in sr⁻¹, without the cosine, summed over all lobes that `eval` covers. For a Dirac lobe: its reflectance
    /// over |cos θi|, so that the weight has the same form.
    pub value: Spectrum,
    /// Density of `wi` in sr⁻¹, as returned by `pdf`. For a Dirac lobe: the probability of choosing it.
    pub pdf: f32,
    /// Flags of the chosen lobe.
    pub lobe: LobeFlags,
    /// Index of refraction on the side of wi over that on the side of wo; 1 unless the sample enters or leaves a solid.
    pub eta: f32,
}

impl BsdfSample {
    /// Returns f |cos θi| / pdf, the factor for the path's throughput.
    pub fn weight(&self) -> Spectrum {
        self.value * (self.wi.z.abs() / self.pdf)
    }

    /// Returns true if `wi` is the only direction of its lobe; `pdf` is then a probability, not a density.
    pub fn is_delta(&self) -> bool {
        self.lobe.contains(LobeFlags::DELTA)
    }
}
