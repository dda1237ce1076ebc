//! Motion: the shutter of a picture, and keys of what moves while it is open.
//!
//! Times are in the unit of the file; for glTF and USD these are seconds. Before its first key and after its last one,
//! everything stands still. The parts themselves ([`Instance::world_from_object`](crate::Instance::world_from_object)
//! and others) are as they are when the shutter opens.

use glam::{Affine3A, Quat, Vec3};
use serde::{Deserialize, Serialize};

/// The span of time that a picture shows, and the light that the shutter lets pass in the course of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shutter {
    /// Time at which it opens, in the unit of the file.
    pub open: f64,
    /// Time at which it is closed, in the unit of the file, not before [`Self::open`]; equal: nothing moves.
    pub close: f64,
    /// Share of the time that it takes to open, and again to close, from 0 (at once) to 0.5 (it is never quite open).
    /// While it opens and closes, the light that it lets pass grows and falls linearly.
    #[serde(default)]
    pub ramp: f64,
}

/// A key of a motion: a transformation at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransformKey {
    /// Time of the key, in the unit of the file.
    pub time: f64,
    /// Transformation at that time.
    #[serde(with = "crate::numbers")]
    pub transform: Affine3A,
}

/// A key of a mesh's motion: its vertices at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshKey {
    /// Time of the key, in the unit of the file.
    pub time: f64,
    /// Vertex positions, object space: as many as those of the mesh.
    pub positions: Vec<Vec3>,
    /// Vertex normals of unit length; as many, or none if the mesh has none.
    pub normals: Vec<Vec3>,
}

/// A key of a sphere's motion: its place, size and rotation at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SphereKey {
    /// Time of the key, in the unit of the file.
    pub time: f64,
    /// Centre, world space.
    #[serde(with = "crate::numbers")]
    pub center: Vec3,
    /// Radius, above 0, in scene units.
    pub radius: f32,
    /// Rotation of the texture coordinates; see [`Sphere::world_from_object`](crate::Sphere::world_from_object).
    #[serde(with = "crate::numbers")]
    pub world_from_object: Quat,
}

impl Shutter {
    /// Returns a shutter without ramps, which is open from `open` to `close`, in the unit of the file. `None`: a time
    /// is not finite, or it closes before it opens.
    pub fn new(open: f64, close: f64) -> Option<Self> {
        Some(Self { open, close, ramp: 0.0 }).filter(Self::is_sound)
    }

    /// Returns true if the times are finite and in order, and the ramp is from 0 to 0.5.
    pub fn is_sound(&self) -> bool {
        self.open.is_finite()
            && self.close.is_finite()
            && (self.close - self.open).is_finite()
            && self.close >= self.open
            && (0.0..=0.5).contains(&self.ramp)
    }

    /// Returns true if the shutter is open for no time, so that nothing moves.
    pub fn is_instant(&self) -> bool {
        self.close <= self.open
    }

    /// Returns the share of the span that has passed at a time: 0 when the shutter opens, 1 when it is closed. Not
    /// finite, or not meaningful, if the shutter [is open for no time](Self::is_instant).
    pub fn share(&self, time: f64) -> f64 {
        (time - self.open) / (self.close - self.open)
    }

    /// Maps a number that is uniform in [0, 1) to a share of the span in [0, 1], with a density proportional to the
    /// light that the shutter lets pass.
    pub fn sample(&self, u: f32) -> f32 {
        let ramp = self.ramp as f32;
        // The area below the trapezoid; the area of each ramp is half its length
        let (whole, slope) = (1.0 - ramp, 0.5 * ramp);
        let area = u * whole;
        if area < slope {
            (2.0 * ramp * area).sqrt()
        } else if area > whole - slope {
            1.0 - (2.0 * ramp * (whole - area)).max(0.0).sqrt()
        } else {
            area + slope
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shutter_lets_light_pass_by_its_shape() {
        for ramp in [0.0, 0.2, 0.5] {
            let shutter = Shutter { open: 3.0, close: 5.0, ramp };
            let count = 20_000;
            let times: Vec<f32> = (0..count).map(|i| shutter.sample((i as f32 + 0.5) / count as f32)).collect();
            assert!(times.windows(2).all(|pair| pair[0] <= pair[1]) && times[0] >= 0.0 && times[count - 1] <= 1.0);
            // The share of times before x is the area of the trapezoid up to there
            for x in [0.05, 0.1, 0.2, 0.5, 0.7, 0.85, 0.95] {
                let found = times.iter().filter(|&&time| f64::from(time) < x).count() as f64 / count as f64;
                let ramp_area = |x: f64| if ramp > 0.0 { x * x / (2.0 * ramp) } else { 0.0 };
                let area = if x < ramp {
                    ramp_area(x)
                } else if x > 1.0 - ramp {
                    1.0 - ramp - ramp_area(1.0 - x)
                } else {
                    x - 0.5 * ramp
                };
                assert!((found - area / (1.0 - ramp)).abs() < 1e-3, "{ramp} {x}: {found}");
            }
        }
    }

    #[test]
    fn a_shutter_without_order_is_refused() {
        assert!(Shutter::new(1.0, 0.5).is_none() && Shutter::new(f64::NAN, 1.0).is_none());
        assert!(Shutter::new(-1e308, 1e308).is_none());
        assert!(!Shutter { ramp: 0.6, ..Shutter::default() }.is_sound());
        let instant = Shutter::new(1.0, 1.0).unwrap();
        assert!(instant.is_instant() && !Shutter::new(0.0, 1.0).unwrap().is_instant());
    }
}
