//! Systems of lenses: rays from a film through spherical surfaces into the scene, as in pbrt's camera `realistic`.
//!
//! Source: Kolb, Mitchell and Hanrahan 1995, *A Realistic Camera Model for Computer Graphics*. The film is in the plane
//! z = 0 of camera space, and the scene lies towards −z.

mod pupil;
mod trace;

use std::sync::Arc;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

use self::pupil::Pupils;

/// The maximum number of surfaces of a [`LensSystem`].
pub const LENS_SURFACES_MAX: usize = 256;

/// A spherical surface of a lens, centred on the optical axis, or a stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LensSurface {
    /// Radius of curvature, in scene units: above 0 if the centre lies towards the film; 0: a stop, which only blocks rays.
    pub radius: f32,
    /// Distance along the axis to the next surface, or from the last one to the film, in scene units; 0 or more.
    pub thickness: f32,
    /// Refractive index between this surface and the next one, or the film; 1 for air.
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

/// The reason why a [`LensDescription`] cannot become a [`LensSystem`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LensError {
    /// No surfaces, or too many.
    #[error("{0} surfaces: 1 to {LENS_SURFACES_MAX} are allowed")]
    Count(usize),
    /// A surface with a number out of range.
    #[error("surface {0} has a number that is out of range")]
    Surface(usize),
    /// No film.
    #[error("the diagonal of the film is not above 0")]
    Film,
    /// Light from afar leaves the lenses divergent.
    #[error("the lenses do not collect light")]
    Diverging,
    /// A plane that the film cannot be moved to be in focus of.
    #[error("a plane {0} scene units from the film cannot be in focus")]
    Focus(f32),
    /// No ray from the film leaves the lenses.
    #[error("no light passes through the lenses to the film")]
    Opaque,
}

/// The paraxial behaviour of a system: the matrix that maps height and reduced angle at the first surface to those behind
/// the last surface.
#[derive(Clone, Copy, Debug)]
struct ParaxialMatrix {
    a: f64,
    b: f64,
    c: f64,
    d: f64,
}

impl LensDescription {
    fn check(&self) -> Result<(), LensError> {
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
    fn focused(&self) -> Result<Vec<LensSurface>, LensError> {
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
    fn paraxial(&self) -> ParaxialMatrix {
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

/// A system of lenses in focus, ready to trace rays from its film. Clones share the prepared data.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(try_from = "LensDescription", into = "LensDescription")]
pub struct LensSystem(Arc<PreparedLenses>);

#[derive(Debug)]
struct PreparedLenses {
    description: LensDescription,
    /// The surfaces with the film in place.
    surfaces: Vec<LensSurface>,
    pupils: Pupils,
}

/// A ray that leaves the lenses, in camera space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensRay {
    /// Origin, on the first surface.
    pub origin: Vec3,
    /// Direction, not of unit length.
    pub direction: Vec3,
    /// Irradiance on the film for a radiance of π along the ray, divided by π: cos⁴ of the angle on the film times the area
    /// that was sampled, over the squared distance to it.
    pub weight: f32,
}

impl LensSystem {
    /// Prepares a system: moves the film into focus, and finds the part of the last surface through which each place of
    /// the film sees the scene.
    ///
    /// # Errors
    /// A number is out of range, the plane cannot be in focus, or no light passes through the lenses.
    pub fn new(description: LensDescription) -> Result<Self, LensError> {
        description.check()?;
        let surfaces = description.focused()?;
        let pupils = Pupils::find(&surfaces, description.film_diagonal).ok_or(LensError::Opaque)?;
        Ok(Self(Arc::new(PreparedLenses { description, surfaces, pupils })))
    }

    /// Returns the distance of the film from the rear principal plane, in scene units: that of the film from a lens
    /// without thickness that has the same angle of view.
    pub fn image_distance(&self) -> f32 {
        let ParaxialMatrix { a, c, .. } = self.0.description.paraxial();
        let film = self.0.surfaces.last().map_or(0.0, |last| last.thickness);
        // The principal plane lies (1 − A) ∕ C behind the last surface; a lone stop is a pinhole
        if c == 0.0 { film } else { film - ((1.0 - a) / c) as f32 }
    }

    /// Returns the description from which the system was made.
    pub fn description(&self) -> &LensDescription {
        &self.0.description
    }

    /// Traces a ray from the film through the lenses. `None`: they block it.
    ///
    /// - `film`: x and y of a position on the film, camera space, in scene units; the axis is at 0.
    /// - `numbers`: uniform random numbers in [0, 1) for the place on the last surface.
    pub fn ray(&self, film: Vec2, numbers: [f32; 2]) -> Option<LensRay> {
        let PreparedLenses { surfaces, pupils, .. } = &*self.0;
        let (rear, area) = pupils.sample(film, numbers);
        let origin = film.extend(0.0);
        let direction = rear - origin;
        let (leaving, towards) = trace::through(surfaces, origin, direction)?;
        let cos_squared = direction.z * direction.z / direction.length_squared();
        let weight = cos_squared * cos_squared * area / (rear.z * rear.z);
        Some(LensRay { origin: leaving, direction: towards, weight })
    }
}

impl PartialEq for LensSystem {
    fn eq(&self, other: &Self) -> bool {
        self.0.description == other.0.description
    }
}

impl TryFrom<LensDescription> for LensSystem {
    type Error = LensError;

    fn try_from(description: LensDescription) -> Result<Self, LensError> {
        Self::new(description)
    }
}

impl From<LensSystem> for LensDescription {
    fn from(system: LensSystem) -> Self {
        system.0.description.clone()
    }
}

#[cfg(test)]
mod tests;
