//! The quantity that a colour of a scene file describes.

/// The quantity that a colour describes. It determines which white a spectrum is relative to, and its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ColorRole {
    /// A reflectance or transmittance, in [0, 1]; white is the white of its colour space.
    Reflectance,
    /// Radiance or another measure of emission.
    Emission,
    /// An absorption, an index of refraction or the like, which may exceed 1.
    Unbounded,
}
