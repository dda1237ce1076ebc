//! Local orthonormal frames around a normal.

use glam::Vec3;

/// A right-handed orthonormal basis; its z is the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Tangent, unit length.
    pub x: Vec3,
    /// Bitangent, unit length.
    pub y: Vec3,
    /// Normal, unit length.
    pub z: Vec3,
}

impl Frame {
    /// Returns an arbitrary frame whose z is a unit normal.
    ///
    /// Source: Duff et al. 2017, Building an Orthonormal Basis, Revisited, listing 3.
    pub fn from_normal(normal: Vec3) -> Self {
        let n = normal;
        let sign = if n.z < 0.0 { -1.0 } else { 1.0 };
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            x: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            y: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            z: n,
        }
    }

    /// Returns the coordinates of a world-space vector in the frame.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// Returns the world-space vector with these coordinates in the frame.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn direction() -> impl Strategy<Value = Vec3> {
        (-1.0f32..1.0, -1.0f32..1.0, -1.0f32..1.0)
            .prop_map(|(x, y, z)| Vec3::new(x, y, z))
            .prop_filter_map("too short", Vec3::try_normalize)
    }

    proptest! {
        #[test]
        fn frames_are_right_handed_and_orthonormal(n in direction(), t in direction()) {
            let frame = Frame::from_normal(n);
            prop_assert!(frame.x.dot(frame.y).abs() < 1e-5 && frame.x.dot(frame.z).abs() < 1e-5);
            prop_assert!((frame.x.cross(frame.y) - frame.z).length() < 1e-5);
            prop_assert!((frame.to_world(frame.to_local(t)) - t).length() < 1e-5);
        }
    }
}
