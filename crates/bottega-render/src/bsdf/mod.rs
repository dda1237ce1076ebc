//! Scattering at one point of a surface.
//!
//! [`scattering`] looks up a material's textures and makes of them a [`Bsdf`], a small `Copy` value of one of a closed set of
//! kinds. Directions are unit length, in the local frame whose +z is the shading normal **on the side of wo**, and point
//! away from the surface.
//!
//! The layered material of glTF is made of [`SurfaceParams`] by [`Bsdf::new`]: GGX reflection and transmission of the base
//! (metal and dielectric share their facets), a cosine lobe for diffuse and multiply scattered light on either side, a
//! clear coat and sheen. The layers keep their books by tabulated directional albedos in symmetric forms, so that the
//! whole is reciprocal and reflects no more than it receives, and a white metal or a white plastic reflects all of it:
//!
//! - what a rough layer loses between its facets comes back as the lobe (1 − E(μo)) (1 − E(μi)) / (π (1 − E̅)) (Kulla and
//!   Conty 2017, Revisiting Physically Based Shading at Imageworks; for a boundary of a solid, on both sides; of facets
//!   that are stretched, with the E of their mean roughness);
//! - the diffuse base below a dielectric has the same form with the E of all that the dielectric reflects (Kelemen and
//!   Szirmay-Kalos 2001, A Microfacet Based Coupled Specular-Matte BRDF Model with Importance Sampling);
//! - coat and sheen weaken what lies below by min(1 − E(μo), 1 − E(μi)), as KHR_materials_sheen does: never too little,
//!   and up to 5 % too much for a diffuse base.
//!
//! The surfaces that Mitsuba and pbrt have beside it (`matte`, `conductor`, `dielectric`, `plastic`, `coated`, `principled`) have
//! their formulas, so that pictures of the same file agree: light that goes on between facets is lost there as it is in
//! these renderers.

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
mod interface;
mod layered;
mod matte;
mod microfacet;
mod params;
mod plastic;
pub mod precomputed;
mod principled;
mod scatter;
mod scattering;
mod sheen;
mod surface;
mod tables;
mod unevenness;
pub mod warp;

use bottega_scene::Spectrum;
use glam::Vec3;

pub use params::SurfaceParams;
pub use scattering::{Bsdf, BsdfAt};
pub(crate) use surface::anisotropy_at;
pub use surface::{SurfacePoint, scattering};

pub use crate::mapping::Spot;
pub use unevenness::LiftedNormal;

/// What is transported from wi to wo, against the direction of the walk or along it. They differ by η² in a
/// transmission, because radiance grows where light is squeezed into a denser medium.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TransportMode {
    /// Paths from the camera gather radiance.
    #[default]
    Radiance,
    /// Paths from the lights carry importance-weighted power: photons.
    Importance,
}

impl TransportMode {
    /// What a transmission into an index of refraction `eta` times that on the side of wo is multiplied by.
    fn radiance_scale(self, eta: f32) -> f32 {
        match self {
            Self::Radiance => 1.0 / (eta * eta),
            Self::Importance => 1.0,
        }
    }
}

/// The kind of lobe that a sample came from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LobeFlags(u8);

impl LobeFlags {
    /// Stays on the side of wo.
    pub const REFLECTION: Self = Self(1);
    /// Goes to the other side.
    pub const TRANSMISSION: Self = Self(2);
    /// Spread over the hemisphere: diffuse, multiply scattered, sheen.
    pub const DIFFUSE: Self = Self(4);
    /// A GGX lobe.
    pub const GLOSSY: Self = Self(8);
    /// A single direction.
    pub const DELTA: Self = Self(16);

    /// A bit for each flag.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// Whether all flags of `other` are set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The flags of both.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// A direction drawn by [`Bsdf::sample`]. The throughput of a path is multiplied by [`Self::weight`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where to go on.
    pub wi: Vec3,
    /// f(wo, wi) in sr⁻¹, without the cosine, of all lobes that `eval` sees. Of a Dirac lobe: its reflectance over |cos θi|,
    /// so that the weight has the same form.
    pub value: Spectrum,
    /// Density of `wi` in sr⁻¹, as `pdf` tells it. Of a Dirac lobe: the probability that it was chosen.
    pub pdf: f32,
    /// The lobe that was chosen.
    pub lobe: LobeFlags,
    /// Index of refraction on the side of wi over that on the side of wo; 1 unless light crossed into or out of a solid.
    pub eta: f32,
}

impl BsdfSample {
    /// f |cos θi| / pdf.
    pub fn weight(&self) -> Spectrum {
        self.value * (self.wi.z.abs() / self.pdf)
    }

    /// Whether `wi` was the only direction that the lobe could give: `pdf` is then no density.
    pub fn is_delta(&self) -> bool {
        self.lobe.contains(LobeFlags::DELTA)
    }
}
