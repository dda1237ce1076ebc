//! Points of curves that face each ray.

use bottega_kernels::Hit;
use bottega_scene::{CurveLook, CurveMeeting, FacingCurves, Scene, ray_in_object};
use glam::{Vec2, Vec3};

/// How far a ray must start off a round curve so that it does not meet it again, as a share of the radius.
const ROUND_CLEARANCE: f32 = 1e-3;

/// Where a ray meets a curve, having run into its hull; `None`: it passes by.
///
/// - `t_max`: how far the ray goes, in lengths of its direction.
pub(super) fn meeting(
    scene: &Scene,
    curves: &FacingCurves,
    hit: &Hit,
    (origin, direction): (Vec3, Vec3),
    t_max: f32,
) -> Option<CurveMeeting> {
    let instance = &scene.instances[hit.instance as usize];
    let (origin, direction) = ray_in_object(&instance.world_from_object, origin, direction);
    curves.meet(hit.primitive as usize, origin, direction, [hit.t, t_max])
}

/// The surface of a curve where a ray met it, world space.
pub(super) struct CurveSurface {
    pub(super) p: Vec3,
    /// Towards the origin of the ray, unit length.
    pub(super) normal: Vec3,
    /// Along the curve, unit length.
    pub(super) tangent: Vec3,
    pub(super) uv: Vec2,
    /// Length for each unit of the texture coordinate along the curve.
    pub(super) stretch: f32,
    /// How far a ray must start off it that leaves.
    pub(super) clearance: f32,
}

impl CurveSurface {
    /// Reconstructs it. The hit must have passed `opacity_of`, which tests whether the curve is met.
    pub(super) fn new(scene: &Scene, curves: &FacingCurves, hit: &Hit, (origin, direction): (Vec3, Vec3)) -> Self {
        let met = meeting(scene, curves, hit, (origin, direction), f32::INFINITY).unwrap_or(CurveMeeting {
            t: hit.t,
            tangent: Vec3::X,
            radius: 0.0,
            across: 0.0,
            along: 0.0,
            stretch: 1.0,
        });
        let world_from_object = &scene.instances[hit.instance as usize].world_from_object;
        let (_, looking) = ray_in_object(world_from_object, origin, direction);
        // In object space: to the edge where `across` is 1, and towards the origin of the ray.
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
