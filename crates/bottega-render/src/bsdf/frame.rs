//! Local frames, and the normals of normal maps.

use glam::{Vec2, Vec3};

/// A right-handed orthonormal basis; its z is the shading normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Tangent.
    pub x: Vec3,
    /// Bitangent.
    pub y: Vec3,
    /// Normal.
    pub z: Vec3,
}

impl Frame {
    /// Any frame around a unit normal.
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

    /// The frame around a unit normal whose x is as near to `tangent` as it can be; any frame where there is no such x.
    pub fn from_normal_and_tangent(normal: Vec3, tangent: Vec3) -> Self {
        let x = (tangent - normal * normal.dot(tangent)).normalize_or_zero();
        if x == Vec3::ZERO || !x.is_finite() {
            return Self::from_normal(normal);
        }
        Self { x, y: normal.cross(x), z: normal }
    }

    /// From the world into the frame.
    pub fn to_local(&self, v: Vec3) -> Vec3 {
        Vec3::new(self.x.dot(v), self.y.dot(v), self.z.dot(v))
    }

    /// From the frame into the world.
    pub fn to_world(&self, v: Vec3) -> Vec3 {
        self.x * v.x + self.y * v.y + self.z * v.z
    }
}

/// A texel of a normal map, in [0, 1], as a direction in tangent space (glTF: x and y are scaled).
pub fn decode_normal(texel: Vec3, scale: f32) -> Vec3 {
    let n = 2.0 * texel - 1.0;
    Vec3::new(n.x * scale, n.y * scale, n.z).try_normalize().unwrap_or(Vec3::Z)
}

/// Applies a tangent-space normal to a frame, and bends the result so far towards the viewer that it stays of use.
///
/// - `tangent_frame`: x along u, z the interpolated normal. `handedness`: −1 where the picture is mirrored.
/// - `normal`: in tangent space, unit length.
/// - `ng`: geometric normal; `wo`: to the viewer. Both on the same side (ng · wo > 0), unit length.
///
/// In the frame that comes back wo is above the surface, and so is its mirror image above the *geometric* surface: a
/// normal that would mirror wo into the surface is replaced by the nearest one that mirrors it along the surface. So no
/// direction that a mirror or a sharp gloss needs is lost, which would show as black spots. Source: Keller et al. 2017,
/// The Iray Light Transport Simulation and Rendering System, section on bump mapping.
pub fn perturbed_frame(tangent_frame: &Frame, handedness: f32, normal: Vec3, ng: Vec3, wo: Vec3) -> Frame {
    let local = Vec3::new(normal.x, normal.y * handedness, normal.z);
    let ns = tangent_frame.to_world(local).try_normalize().unwrap_or(tangent_frame.z);
    Frame::from_normal_and_tangent(bend(ns, ng, wo), tangent_frame.x)
}

/// The normal nearest to `ns` (in the plane of wo's mirror image) that mirrors `wo` to at least [`LIFT`] above the
/// surface. Requires ng · wo ≥ 0, all of unit length.
pub fn bend(ns: Vec3, ng: Vec3, wo: Vec3) -> Vec3 {
    let mirrored = 2.0 * ns.dot(wo) * ns - wo;
    let height = mirrored.dot(ng);
    // At grazing angles even the geometric normal mirrors wo no higher than wo itself is.
    let lift = LIFT.min(0.9 * ng.dot(wo).max(0.0));
    if height >= lift && ns.dot(wo) > 0.0 {
        return ns;
    }
    let lifted = (mirrored + ng * (lift - height).max(0.0)).normalize_or(ng);
    let bent = (lifted + wo).normalize_or(ng);
    // Only a mirror image opposite to wo leaves nothing to bend.
    if bent.dot(wo) > 0.0 { bent } else { ng }
}

/// Sine of the angle above the geometric surface to which a mirrored direction is lifted.
pub const LIFT: f32 = 0.01;

/// Tangent of a triangle along increasing u, not normalized; `None` where texture coordinates do not span it.
pub fn tangent(positions: [Vec3; 3], uvs: [Vec2; 3]) -> Option<Vec3> {
    let (e1, e2) = (positions[1] - positions[0], positions[2] - positions[0]);
    let (d1, d2) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let determinant = d1.perp_dot(d2);
    let tangent = (e1 * d2.y - e2 * d1.y) / determinant;
    (determinant != 0.0 && tangent.is_finite() && tangent != Vec3::ZERO).then_some(tangent)
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
            for frame in [Frame::from_normal(n), Frame::from_normal_and_tangent(n, t)] {
                prop_assert!(frame.x.dot(frame.y).abs() < 1e-5 && frame.x.dot(frame.z).abs() < 1e-5);
                prop_assert!((frame.x.cross(frame.y) - frame.z).length() < 1e-5);
                prop_assert!((frame.to_world(frame.to_local(t)) - t).length() < 1e-5);
            }
        }

        #[test]
        fn a_bent_normal_mirrors_the_viewer_out_of_the_surface(ns in direction(), ng in direction(), wo in direction()) {
            let wo = if wo.dot(ng) < 0.0 { -wo } else { wo };
            prop_assume!(wo.dot(ng) > 1e-3);
            let bent = bend(ns, ng, wo);
            prop_assert!((bent.length() - 1.0).abs() < 1e-5);
            prop_assert!(bent.dot(wo) > 0.0, "{bent}");
            let mirrored = 2.0 * bent.dot(wo) * bent - wo;
            prop_assert!(mirrored.dot(ng) > 0.0, "{}", mirrored.dot(ng));
        }

        #[test]
        fn a_normal_that_is_of_use_is_left_alone(ns in direction(), wo in direction()) {
            prop_assume!(ns.dot(wo) > 0.1);
            prop_assert_eq!(bend(ns, ns, wo), ns);
        }
    }

    #[test]
    fn a_neutral_texel_leaves_the_frame_as_it_is() {
        let frame = Frame::from_normal(Vec3::Y);
        let normal = decode_normal(Vec3::new(0.5, 0.5, 1.0), 1.0);
        let result = perturbed_frame(&frame, 1.0, normal, Vec3::Y, Vec3::new(0.6, 0.8, 0.0));
        assert!((result.z - Vec3::Y).length() < 1e-6);
    }

    #[test]
    fn tangents_point_along_u() {
        let positions = [Vec3::ZERO, Vec3::new(2.0, 0.0, 0.0), Vec3::new(0.0, 0.0, 3.0)];
        let along = tangent(positions, [Vec2::ZERO, Vec2::X, Vec2::Y]).unwrap();
        assert!((along.normalize() - Vec3::X).length() < 1e-6);
        assert_eq!(tangent(positions, [Vec2::ZERO; 3]), None);
    }
}
