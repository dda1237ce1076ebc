//! Hits on curves that face each ray.

use bottega_kernels::Hit;
use bottega_scene::{CurveLook, CurveMeeting, FacingCurves, ray_in_object};
use glam::{Affine3A, Vec2, Vec3};

/// Clearance of new rays from a round curve, as a share of its radius.
const ROUND_CLEARANCE: f32 = 1e-3;

/// Returns the hit on a curve, given the hit on its hull; `None`: the ray passes by.
///
/// - `t_max`: length of the ray, in lengths of its direction.
pub(super) fn meeting(
    curves: &FacingCurves,
    world_from_object: &Affine3A,
    hit: &Hit,
    (origin, direction): (Vec3, Vec3),
    t_max: f32,
) -> Option<CurveMeeting> {
    let (origin, direction) = ray_in_object(world_from_object, origin, direction);
    curves.meet(hit.primitive as usize, origin, direction, [hit.t, t_max])
}

/// The surface of a curve at a hit, in world space.
pub(super) struct CurveSurface {
    /// Position on the curve.
    pub(super) p: Vec3,
    /// Normal towards the origin of the ray; unit length.
    pub(super) normal: Vec3,
    /// Tangent along the curve; unit length.
    pub(super) tangent: Vec3,
    /// Texture coordinates: along the curve, and across it.
    pub(super) uv: Vec2,
    /// Length per unit of the texture coordinate along the curve.
    pub(super) stretch: f32,
    /// Distance that new rays keep from the surface.
    pub(super) clearance: f32,
}

impl CurveSurface {
    /// Reconstructs the surface at a hit. `opacity_of` must have accepted the hit: it tests whether the curve itself is
    /// hit.
    pub(super) fn new(
        curves: &FacingCurves,
        world_from_object: &Affine3A,
        hit: &Hit,
        (origin, direction): (Vec3, Vec3),
    ) -> Self {
        let met = meeting(curves, world_from_object, hit, (origin, direction), f32::INFINITY).unwrap_or(CurveMeeting {
            t: hit.t,
            tangent: Vec3::X,
            radius: 0.0,
            across: 0.0,
            along: 0.0,
            stretch: 1.0,
        });
        let (_, looking) = ray_in_object(world_from_object, origin, direction);
        // In object space: `side` to the edge where `across` is 1, `towards` to the origin of the ray
        let side = looking.cross(met.tangent).normalize_or_zero();
        let towards = side.cross(met.tangent);
        let (across, up) = match curves.look {
            CurveLook::Flat => (side, towards),
            CurveLook::Round => {
                let height = (1.0 - met.across * met.across).max(0.0).sqrt();
                (side * height - towards * met.across, towards * height + side * met.across)
            }
        };
        let to_world = |v: Vec3| world_from_object.transform_vector3(v);
        let along = to_world(met.tangent);
        let (tangent, across) = (along.normalize_or(Vec3::X), to_world(across));
        let normal = tangent.cross(across).normalize_or(-direction);
        let off = match curves.look {
            CurveLook::Flat => FacingCurves::CLEARANCE,
            CurveLook::Round => ROUND_CLEARANCE,
        };
        Self {
            p: origin + direction * met.t,
            normal: if normal.dot(to_world(up)) < 0.0 { -normal } else { normal },
            tangent,
            uv: Vec2::new(met.along, 0.5 - 0.5 * met.across),
            stretch: met.stretch * along.length(),
            clearance: met.radius * across.length() * off,
        }
    }
}
