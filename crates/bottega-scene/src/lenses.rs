//! Systems of lenses: rays from a film through spherical surfaces into the scene, as in pbrt's camera `realistic`.
//!
//! Source: Kolb, Mitchell and Hanrahan 1995, *A Realistic Camera Model for Computer Graphics*. The film is in the plane
//! z = 0 of camera space, and the scene lies towards −z.

mod description;
mod pupil;
mod trace;

use std::sync::Arc;

use glam::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

pub use self::description::{LENS_SURFACES_MAX, LensDescription, LensError, LensSurface};
use self::{description::ParaxialMatrix, pupil::Pupils};

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
    /// Origin, on the front surface: the one farthest from the film.
    pub origin: Vec3,
    /// Direction, not of unit length.
    pub direction: Vec3,
    /// Irradiance on the film per radiance along the ray, in sr: cos⁴ of the angle at the film × the area of the exit
    /// pupil ∕ the squared distance of its plane from the film.
    pub weight: f32,
}

impl LensSystem {
    /// Prepares a system: moves the film into focus, and finds the exit pupil of each place of the film: the rectangle,
    /// in the plane of the surface next to the film, through which it sees the scene.
    ///
    /// # Errors
    /// The number of surfaces or one of their numbers is out of range, the lenses do not collect light although a focus
    /// distance is given, the plane at that distance cannot be in focus, or no light passes through the lenses.
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

    /// Traces a ray from the film through the lenses into the scene. Returns the ray that leaves the front surface,
    /// with its weight; `None`: the lenses block it.
    ///
    /// - `film`: position on the film, camera space, in scene units; (0, 0) is on the optical axis.
    /// - `numbers`: uniform random numbers in [0, 1) that choose a point of the exit pupil, in the plane of the surface
    ///   next to the film.
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
