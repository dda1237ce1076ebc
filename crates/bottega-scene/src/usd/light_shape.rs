//! Lights placed in the world: surfaces that emit, lights without extent, and the environment.

use std::f64::consts::{PI, TAU};

use glam::{Affine2, DAffine3, DMat3, DVec3, Mat3, Vec2, Vec3};

use super::light::{LightShape, LightSpec, area};
use super::material::Materials;
use super::placement::{ThingPlacement, even_scale};
use super::shaping::Cone;
use super::source::StageSource;
use super::values;
use crate::emission::{DirectionPicture, EmissionProfile};
use crate::light::{Environment, EnvironmentMapping, Light, LightKind, SpotFalloff};
use crate::material::Material;
use crate::model::{COORDINATE_MAX, Instance, Mesh, Scene};
use crate::param::ColorParam;
use crate::surface::Surface;
use crate::texture::{TextureMap, Wrap};
use crate::values::FACTOR_MAX;
use crate::visibility::Visibility;

/// Corners of the polygons that stand for circles.
const CORNERS: u32 = 64;

/// Adds a light to the scene. One that cannot be placed is left out, with a warning.
pub(super) fn place(
    source: &StageSource<'_>,
    scene: &mut Scene,
    materials: &mut Materials<'_, '_>,
    spec: &LightSpec,
    placement: &ThingPlacement,
) {
    let world = &placement.world_from_object;
    let path = &*placement.path;
    if !world.is_finite() || world.translation.abs().max_element() > COORDINATE_MAX.into() {
        source.warn(path, "its place is not finite, or out of reach; the light is left out");
        return;
    }
    let toward = |axis: DVec3| (world.matrix3 * axis).try_normalize();
    match spec.shape {
        LightShape::Dome { turn } => {
            if scene.environment.is_some() {
                source.unsupported(path, "a second environment is left out");
                return;
            }
            scene.environment = Some(environment(spec, world, turn));
        }
        LightShape::Distant { angle } => {
            let Some(direction) = toward(DVec3::NEG_Z) else {
                source.warn(path, "its transformation is singular; the light is left out");
                return;
            };
            // The projected solid angle: the integral of the cosine over the light's directions
            let sin = (0.5 * angle).sin();
            let size = if angle > 0.0 { PI * sin * sin } else { 1.0 };
            let irradiance = spec.strength.of_size(size) * size as f32;
            let direction = direction.as_vec3().normalize();
            let kind = LightKind::Directional { direction, irradiance, angle: angle as f32 };
            let visibility = Visibility::ALL.without(Visibility::CAMERA);
            scene.lights.push(Light { visibility, ..Light::new(name_of(path), kind) });
        }
        LightShape::Point { radius } => {
            let scale = even_scale(&world.matrix3).map_or_else(|| world.matrix3.determinant().abs().cbrt(), |it| it.0);
            let disk = PI * (radius * scale) * (radius * scale);
            // A sphere has four times the area of its disk, so the intensity of a normalized light is a quarter, also of a point
            let size = if disk > 0.0 { disk } else { 1.0 };
            let intensity = spec.strength.of_size(4.0 * size) * size as f32;
            let position = world.translation.as_vec3();
            let kind = match (spec.cone, toward(DVec3::NEG_Z)) {
                _ if let Some(profile) = &spec.profile => {
                    let DirectionPicture { image, world_from_light } = profile.placed(&world.matrix3);
                    let mapping = EnvironmentMapping::LatitudeLongitudeToPoles;
                    let intensity = (intensity * profile.scale).min(Vec3::splat(FACTOR_MAX));
                    LightKind::Goniometric { position, world_from_light, image, mapping, intensity }
                }
                (Some(cone), Some(direction)) => {
                    let (cos_inner, cos_outer) = cosines(cone);
                    let direction = direction.as_vec3().normalize();
                    let falloff = SpotFalloff::SmoothCosine;
                    LightKind::Spot { position, direction, intensity, cos_inner, cos_outer, falloff }
                }
                _ => LightKind::Point { position, intensity },
            };
            scene.lights.push(Light::new(name_of(path), kind));
        }
        shape => place_surface(source, scene, materials, spec, placement, shape),
    }
}

/// Adds a light that is a surface: it emits, casts no shadow, and neither hides anything nor is seen by the camera, as in
/// Arnold and Karma.
fn place_surface(
    source: &StageSource<'_>,
    scene: &mut Scene,
    materials: &mut Materials<'_, '_>,
    spec: &LightSpec,
    placement: &ThingPlacement,
    shape: LightShape,
) {
    let (world, path) = (&placement.world_from_object, &*placement.path);
    let local = match shape {
        LightShape::Rect { width, height } => rectangle(width, height),
        LightShape::Disk { radius } => disk(radius),
        LightShape::Cylinder { radius, length } => tube(radius, length),
        LightShape::Sphere { radius } => Mesh::uv_sphere(Vec3::ZERO, radius as f32, CORNERS),
        LightShape::Distant { .. } | LightShape::Dome { .. } | LightShape::Point { .. } => return,
    };
    let even = even_scale(&world.matrix3).map(|(scale, _)| scale);
    let size = match (shape, even) {
        (LightShape::Sphere { radius }, Some(scale)) => 4.0 * PI * (radius * scale) * (radius * scale),
        _ => area(&local, world),
    };
    if !(size > 0.0 && size.is_finite()) {
        source.warn(path, "it has no area; the light is left out");
        return;
    }
    let scale = spec.profile.as_ref().map_or(1.0, |profile| profile.scale);
    let radiance = (spec.strength.of_size(size) * scale).min(Vec3::splat(FACTOR_MAX));
    let axis = (world.matrix3 * DVec3::NEG_Z).try_normalize();
    let emission_profile = match (spec.cone, axis) {
        _ if let Some(profile) = &spec.profile => EmissionProfile::Picture(profile.placed(&world.matrix3)),
        (Some(cone), Some(axis)) => {
            let (cos_inner, cos_outer) = cosines(cone);
            let axis = axis.as_vec3().normalize();
            EmissionProfile::Spot { axis, cos_inner, cos_outer, falloff: SpotFalloff::SmoothCosine }
        }
        _ => EmissionProfile::Diffuse,
    };
    let texture = spec.texture.map(|image| TextureMap {
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        picture_from_uv: Affine2::IDENTITY,
        ..TextureMap::new(image)
    });
    let material = materials.push(Material {
        surface: Surface::clear_sheet(Vec3::ONE.into()),
        see_through: true,
        culls_back: true,
        emission: ColorParam { factor: radiance, texture },
        emission_profile,
        name: name_of(path),
        ..Material::emitter(radiance)
    });
    let visibility = Visibility::ALL.without(Visibility::SHADOW).without(Visibility::CAMERA);
    if let (LightShape::Sphere { radius }, Some(scale)) = (shape, even) {
        scene.push_sphere(world.translation.as_vec3(), (radius * scale) as f32, material);
        if let Some(sphere) = scene.spheres.last_mut() {
            sphere.visibility = visibility;
        }
        return;
    }
    // The vertices are in world space, so that the light may also be stretched or flat
    let mirrors = world.matrix3.determinant() < 0.0;
    let mut mesh = Mesh { name: name_of(path), material, normals: Vec::new(), ..local };
    if spec.texture.is_none() {
        mesh.uvs = Default::default();
    }
    mesh.positions.iter_mut().for_each(|p| *p = world.transform_point3(p.as_dvec3()).as_vec3());
    if mirrors {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    if mesh.positions.iter().any(|p| !values::is_reachable(p)) {
        source.warn(path, "it is out of reach; the light is left out");
        return;
    }
    let mesh = scene.push_mesh(mesh);
    scene.instances.push(Instance { visibility, ..Instance::new(mesh, glam::Affine3A::IDENTITY) });
}

fn name_of(path: &str) -> String {
    path.rsplit('/').next().unwrap_or_default().to_owned()
}

fn cosines(cone: Cone) -> (f32, f32) {
    let (inner, outer) = (cone.inner.cos() as f32, cone.outer.cos() as f32);
    (inner.min(1.0), outer.min(inner - 1e-6))
}

fn environment(spec: &LightSpec, world: &DAffine3, turn: DMat3) -> Environment {
    // The centre of a picture of OpenEXR is +z; that of ours is −z
    let matrix = world.matrix3 * turn * DMat3::from_rotation_y(PI);
    let x = matrix.x_axis.try_normalize().unwrap_or(DVec3::X);
    let y = matrix.y_axis.reject_from_normalized(x).try_normalize().unwrap_or(x.any_orthonormal_vector());
    // A mirrored dome stays mirrored
    let side = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    let rotation = DMat3::from_cols(x, y, x.cross(y) * side);
    let columns = [rotation.x_axis, rotation.y_axis, rotation.z_axis].map(DVec3::as_vec3);
    let world_from_environment = Mat3::from_cols(columns[0], columns[1], columns[2]);
    let radiance = spec.strength.of_size(1.0);
    match spec.texture {
        Some(image) => Environment::picture(image, radiance, world_from_environment),
        None => Environment { world_from_environment, ..Environment::uniform(radiance) },
    }
}

/// Returns a rectangle that faces −z, with the upper left corner of a picture at (+x, +y).
fn rectangle(width: f64, height: f64) -> Mesh {
    let half = Vec2::new(0.5 * width as f32, 0.5 * height as f32);
    let corner = |x: f32, y: f32| Vec3::new(x * half.x, y * half.y, 0.0);
    Mesh {
        positions: vec![corner(1.0, -1.0), corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0)],
        uvs: [vec![Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO], Vec::new()],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..Mesh::default()
    }
}

/// Returns the corners of a polygon with the area of a circle, counter-clockwise.
fn circle(radius: f64) -> impl Iterator<Item = [f64; 2]> {
    let turn = TAU / f64::from(CORNERS);
    let radius = radius * (turn / turn.sin()).sqrt();
    (0..CORNERS).map(move |corner| {
        let (sin, cos) = (turn * f64::from(corner)).sin_cos();
        [radius * cos, radius * sin]
    })
}

/// Returns a disk that faces −z.
fn disk(radius: f64) -> Mesh {
    let mut positions = vec![Vec3::ZERO];
    positions.extend(circle(radius).map(|[x, y]| Vec3::new(x as f32, y as f32, 0.0)));
    let triangles = (0..CORNERS).map(|i| [0, 1 + (i + 1) % CORNERS, 1 + i]).collect();
    Mesh { positions, triangles, ..Mesh::default() }
}

/// Returns the side of a cylinder along x, front outside, with the area of a round one.
fn tube(radius: f64, length: f64) -> Mesh {
    let turn = TAU / f64::from(CORNERS);
    // A polygon's perimeter is that of the circle
    let radius = radius * 0.5 * turn / (0.5 * turn).sin();
    let mut mesh = Mesh::default();
    for corner in 0..CORNERS {
        let (sin, cos) = (turn * f64::from(corner)).sin_cos();
        for x in [-0.5 * length, 0.5 * length] {
            mesh.positions.push(DVec3::new(x, radius * cos, radius * sin).as_vec3());
        }
        let (a, b) = (2 * corner, 2 * ((corner + 1) % CORNERS));
        mesh.triangles.extend([[a, b + 1, a + 1], [a, b, b + 1]]);
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_have_their_area_and_face_their_side() {
        for (mesh, size, front) in [
            (rectangle(2.0, 3.0), 6.0, Some(Vec3::NEG_Z)),
            (disk(0.5), PI * 0.25, Some(Vec3::NEG_Z)),
            (tube(0.5, 3.0), PI * 3.0, None),
        ] {
            assert!((area(&mesh, &DAffine3::IDENTITY) / size - 1.0).abs() < 1e-6);
            for triangle in &mesh.triangles {
                let middle = triangle.iter().map(|&vertex| mesh.positions[vertex as usize]).sum::<Vec3>();
                let out = front.unwrap_or(Vec3::new(0.0, middle.y, middle.z));
                assert!(mesh.cross(*triangle).dot(out) > 0.0);
            }
        }
    }
}
