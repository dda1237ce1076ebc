//! Flattening of the lights: their tree, the records of all lights, emitting triangles, and suns.

use bottega_kernels::math;
use bottega_scene::{LightKind, Scene, Spectrum, SpotFalloff, TextureMap};
use glam::{Mat3, Vec3};

use super::{
    NONE, ParallelRecord, PictureLightRecord, PointLightRecord, Record as _, ShiningRecord, SphereLightRecord,
    SpotLightRecord, SurfaceLightRecord, TreeNodeRecord, WordBuffer, code, environment, header, place_of,
};
use crate::lights::{
    Light, LightNode, LightTree, Lights, Panel, PanelPart, PanelShape, Sun, SurfaceLight, TriangleLight,
};

/// Writes all lights, and their offsets into the header. Spheres and instances refer to their lights themselves.
pub(super) fn write(lights: &Lights, scene: &Scene, words: &mut WordBuffer) {
    words.head(header::HAS_FAR, u32::from(lights.has_far()));
    write_tree(&lights.tree, words);
    words.head(header::LIGHTS, words.place());
    for light in &lights.lights {
        match light {
            Light::Surface(surface) => _ = words.record(&surface_record(surface)),
            Light::Sphere(sphere) => {
                words.record(&SphereLightRecord { kind: code::LIGHT_SPHERE, sphere: *sphere });
            }
            Light::Punctual(index) => write_punctual(scene.lights[*index as usize].kind, words),
        }
    }
    let parts = words.place();
    words.words(&lights.parts);
    words.head(header::SHINING, words.place());
    for &TriangleLight { first_part, shape, is_second, grid } in &lights.triangles {
        let (shape, side) = (shape_code(shape), grid.side());
        words.record(&ShiningRecord { parts: parts + first_part, shape, is_second, side });
    }
    words.head(header::PARALLEL, words.place());
    words.head(header::PARALLEL_COUNT, lights.suns.len() as u32);
    for &Sun { to_light, irradiance, illuminance, .. } in &lights.suns {
        words.record(&ParallelRecord { to_light, irradiance, illuminance });
    }
    let environment = lights.environment.as_ref().map_or(NONE, |light| environment::write(light, words));
    words.head(header::ENVIRONMENT, environment);
}

/// Writes the nodes of the tree.
fn write_tree(tree: &LightTree, words: &mut WordBuffer) {
    let LightTree { nodes, light_count, intensity } = tree;
    words.head(header::TREE, words.place());
    words.head(header::LIGHT_COUNT, *light_count);
    words.head(header::TREE_INTENSITY, intensity.to_bits());
    for node in nodes {
        words.record(&node_record(node));
    }
}

fn node_record(node: &LightNode) -> TreeNodeRecord {
    let LightNode {
        center: [center_x, center_y, center_z],
        half: [half_x, half_y, half_z],
        radius,
        axis: [axis_x, axis_y, axis_z],
        cos_spread,
        sin_spread,
        cos_emission,
        two_sided,
        intensity,
        child,
        end,
    } = *node;
    TreeNodeRecord {
        center_x,
        center_y,
        center_z,
        half_x,
        half_y,
        half_z,
        axis_x,
        axis_y,
        axis_z,
        radius,
        cos_spread,
        sin_spread,
        cos_emission,
        two_sided,
        intensity,
        child,
        end,
    }
}

fn surface_record(light: &SurfaceLight) -> SurfaceLightRecord {
    // Nothing flat moves
    let Panel { instance, triangle, corner, x, y, shape, moves: _ } = *light.panel();
    let PanelPart { s, t, size } = light.part();
    let (kind, shape, part) = (code::LIGHT_SURFACE, shape_code(shape), Vec3::new(s, t, size));
    SurfaceLightRecord { kind, instance, triangle, shape, corner, x, y, part, material: light.material() }
}

/// Returns the code of a panel's shape, see [`code::PANEL_TRIANGLE`].
fn shape_code(shape: PanelShape) -> u32 {
    match shape {
        PanelShape::Triangle => code::PANEL_TRIANGLE,
        PanelShape::Rectangle { corner, opposite } => {
            code::PANEL_RECTANGLE | u32::from(corner) | u32::from(opposite) << code::PANEL_OPPOSITE_SHIFT
        }
    }
}

/// Writes a light without extent.
fn write_punctual(light: LightKind, words: &mut WordBuffer) {
    let point = |kind: u32, position: Vec3, intensity: Spectrum| PointLightRecord { kind, position, intensity };
    let no_spot = |point| SpotLightRecord { point, direction: Vec3::ZERO, cos_inner: 0.0, cos_outer: 0.0, falloff: 0 };
    match light {
        LightKind::Point { position, intensity } => {
            words.record(&no_spot(point(code::LIGHT_POINT, position, intensity)));
        }
        LightKind::Spot { position, direction, intensity, cos_inner, cos_outer, falloff } => {
            let falloff = match falloff {
                SpotFalloff::SquaredCosine => code::SPOT_SQUARED_COSINE,
                SpotFalloff::SmoothCosine => code::SPOT_SMOOTH_COSINE,
                SpotFalloff::LinearAngle => code::SPOT_LINEAR_ANGLE,
            };
            let point = point(code::LIGHT_SPOT, position, intensity);
            words.record(&SpotLightRecord { point, direction, cos_inner, cos_outer, falloff });
        }
        // Others are declined: see `NotFlat::Profiles`
        LightKind::Goniometric { position, world_from_light, image, intensity, .. } => {
            let point = point(code::LIGHT_GONIOMETRIC, position, intensity);
            let picture = TextureMap { smooth: false, ..TextureMap::new(image) };
            write_picture_light(point, world_from_light, picture, [0.0; 2], words);
        }
        LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect } => {
            let point = point(code::LIGHT_PROJECTOR, world_from_light.translation.into(), intensity);
            let size = [math::tan(0.5 * vertical_fov), aspect];
            write_picture_light(point, Mat3::from(world_from_light.matrix3), picture, size, words);
        }
        LightKind::Directional { .. } => {
            words.record(&no_spot(point(code::LIGHT_DARK, Vec3::ZERO, Spectrum::ZERO)));
        }
    }
}

fn write_picture_light(
    point: PointLightRecord,
    world_from_light: Mat3,
    picture: TextureMap,
    [half_height, aspect]: [f32; 2],
    words: &mut WordBuffer,
) {
    const PICTURE: u32 = place_of(PictureLightRecord::FIELDS, "picture");
    let place = words.record(&PictureLightRecord { point, world_from_light, picture: NONE, half_height, aspect });
    words.picture(place + PICTURE, picture);
}
