//! Descriptions of systems of lenses: their surfaces, checks, and where the film is in focus.

use serde::{Deserialize, Serialize};

/// The maximum number of surfaces of a [`LensSystem`](super::LensSystem).
pub const LENS_SURFACES_MAX: usize = 256;

/// A spherical surface of a lens, centred on the optical axis, or a stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensSurface {
    /// Radius of curvature, in scene units: above 0 if the centre lies towards the film; 0: a stop, which only blocks rays.
    pub radius: f32,
    /// Distance along the axis to the next surface, or from the last one to the film, in scene units; 0 or more.
    pub thickness: f32,
    /// Refractive index between this surface and the next one, or the film, from 1 to 10; 1 for air.
    pub eta: f32,
    /// Radius of the opening, in scene units, above 0.
    pub aperture_radius: f32,
}

/// The description of a system of lenses: its surfaces, and its film.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensDescription {
    /// The surfaces from the scene to the film.
    pub surfaces: Vec<LensSurface>,
    /// Diagonal of the film, in scene units, above 0.
    pub film_diagonal: f32,
    /// Distance from the film to the plane in focus, in scene units: the film is moved there, whatever the last thickness
    /// is. `None`: the film stays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus_distance: Option<f32>,
}

/// The reason why a [`LensDescription`] cannot become a [`LensSystem`](super::LensSystem).
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LensError {
    /// The number of surfaces is 0 or above [`LENS_SURFACES_MAX`].
    #[error("{0} surfaces: 1 to {LENS_SURFACES_MAX} are allowed")]
    Count(usize),
    /// A number of the surface with this index is out of range.
    #[error("surface {0} has a number that is out of range")]
    Surface(usize),
    /// The diagonal of the film is not above 0, or is above 1e6 scene units.
    #[error("the diagonal of the film is not above 0")]
    Film,
    /// Light from afar leaves the lenses parallel or divergent, so a focus distance has no effect.
    #[error("the lenses do not collect light")]
    Diverging,
    /// No place of the film brings a plane at this distance, in scene units, into focus.
    #[error("a plane {0} scene units from the film cannot be in focus")]
    Focus(f32),
    /// No ray from the film leaves the lenses.
    #[error("no light passes through the lenses to the film")]
    Opaque,
}

/// The paraxial behaviour of a system: the matrix that maps height and reduced angle at the first surface to those behind
/// the last surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct ParaxialMatrix {
    pub(super) a: f64,
    b: f64,
    pub(super) c: f64,
    d: f64,
}

impl LensDescription {
    pub(super) fn check(&self) -> Result<(), LensError> {
        if !(1..=LENS_SURFACES_MAX).contains(&self.surfaces.len()) {
            return Err(LensError::Count(self.surfaces.len()));
        }
        /// Largest length, in scene units.
        const LENGTH_MAX: f32 = 1e6;
        let is_sound = |surface: &LensSurface| {
            let LensSurface { radius, thickness, eta, aperture_radius } = *surface;
            radius.abs() <= LENGTH_MAX
                && (0.0..=LENGTH_MAX).contains(&thickness)
                && (1.0..=10.0).contains(&eta)
                && aperture_radius > 0.0
                && aperture_radius <= LENGTH_MAX
        };
        match self.surfaces.iter().position(|surface| !is_sound(surface)) {
            Some(wrong) => Err(LensError::Surface(wrong)),
            None if !(self.film_diagonal > 0.0 && self.film_diagonal <= LENGTH_MAX) => Err(LensError::Film),
            None => Ok(()),
        }
    }

    /// Returns the surfaces with the film where the plane in focus is imaged.
    pub(super) fn focused(&self) -> Result<Vec<LensSurface>, LensError> {
        let mut surfaces = self.surfaces.clone();
        let Some(distance) = self.focus_distance else { return Ok(surfaces) };
        let ParaxialMatrix { a, b, c, d } = self.paraxial();
        if c >= 0.0 {
            return Err(LensError::Diverging);
        }
        // A plane s before the first surface is imaged s' = −(A s + B) ∕ (C s + D) behind the last one, and
        // s + s' = k: a quadratic equation for s'
        let length: f32 = surfaces.iter().rev().skip(1).map(|surface| surface.thickness).sum();
        let k = f64::from(distance - length);
        let (quadratic, linear, constant) = (-c, c * k + d - a, a * k + b);
        let root = (linear * linear - 4.0 * quadratic * constant).sqrt();
        // The smaller distance of the two conjugate ones
        let film = (-linear - root) / (2.0 * quadratic);
        match surfaces.last_mut() {
            Some(last) if film > 0.0 && film < k => last.thickness = film as f32,
            // Not a number for planes that are too near
            _ => return Err(LensError::Focus(distance)),
        }
        Ok(surfaces)
    }

    /// Returns the focal length in scene units: below 0 if the system spreads light, infinite if it does not bend
    /// light. The surfaces are not checked.
    pub fn focal_length(&self) -> f32 {
        (-1.0 / self.paraxial().c) as f32
    }

    /// Multiplies the matrices of all surfaces and of the distances between them (Hecht, *Optics*, §6.2).
    pub(super) fn paraxial(&self) -> ParaxialMatrix {
        let mut whole = ParaxialMatrix { a: 1.0, b: 0.0, c: 0.0, d: 1.0 };
        let mut eta = 1.0;
        for (index, surface) in self.surfaces.iter().enumerate() {
            let behind = f64::from(surface.eta);
            if surface.radius != 0.0 {
                let power = (behind - eta) / f64::from(surface.radius);
                (whole.c, whole.d) = (whole.c - power * whole.a, whole.d - power * whole.b);
            }
            eta = behind;
            if index + 1 < self.surfaces.len() {
                let gap = f64::from(surface.thickness) / eta;
                (whole.a, whole.b) = (whole.a + gap * whole.c, whole.b + gap * whole.d);
            }
        }
        whole
    }
}
