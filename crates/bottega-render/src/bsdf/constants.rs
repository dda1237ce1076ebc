//! Constants of scattering that GPU shaders share; each is documented where it is declared.

pub use super::base::DISPERSION_SCALE;
pub use super::beckmann::HALF_RSQRT_PI;
pub use super::coat::IOR as COAT_IOR;
pub use super::cover::COSINES as COVER_COSINES;
pub use super::dielectric::ETA_STEP_MIN as DIELECTRIC_ETA_STEP_MIN;
pub use super::film::{
    FADING as FILM_FADING, GAUSSIANS as FILM_GAUSSIANS, GAUSSIANS_NORM as FILM_GAUSSIANS_NORM,
    MEAN_STEPS as FILM_MEAN_STEPS, PEAK_STEPS as FILM_PEAK_STEPS, TERMS as FILM_TERMS,
};
pub use super::matte::{GAIN as ROUGH_MATTE_GAIN, LOSS as ROUGH_MATTE_LOSS};
pub use super::microfacet::ALPHA_MAX;
pub use super::plastic::MEAN_THROUGH as PLASTIC_MEAN_THROUGH;
pub use super::sheen::{NARROW as SHEEN_NARROW, ROUGHNESS_MIN as SHEEN_ROUGHNESS_MIN, WIDE as SHEEN_WIDE};
pub use super::surface::MAX_DEPTH as COATED_DEPTH_MAX;
pub use super::tables::{INDEX as TABLE_INDEX, MU as TABLE_MU, ROUGHNESS as TABLE_ROUGHNESS};
