//! Small test scenes.

use bottega_scene::{
    AlphaMode, Camera, Channel, ColorParam, Conductor, Dielectric, Environment, EnvironmentMapping, Facets, Image,
    ImageId, Light, LightKind, Material, Medium, Mesh, Projection, Relief, ReliefRule, ScalarParam, Scene, Surface,
    TextureMap,
};
use glam::{Affine3A, Mat3, Quat, Vec2, Vec3, Vec4};

fn camera(from: Vec3, to: Vec3) -> Camera {
    let back = (from - to).normalize();
    let right = Vec3::Y.cross(back).normalize();
    let world_from_camera = Affine3A::from_mat3_translation(Mat3::from_cols(right, back.cross(right), back), from);
    Camera { world_from_camera, projection: Projection::Perspective { vertical_fov: 0.7 }, ..Camera::default() }
}

/// A rectangle with a material of its own.
fn wall(scene: &mut Scene, corner: Vec3, x: Vec3, y: Vec3, material: Material) {
    let material = scene.push_material(material);
    scene.push_surface(Mesh { material, ..Mesh::quad(corner, x, y) });
}

/// A room of coloured walls, open to the camera, with a light in its ceiling and two spheres, one of which emits light.
pub(super) fn cornell() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.0, 4.2), Vec3::ZERO)], ..Scene::default() };
    let (x, y, z) = (2.0 * Vec3::X, 2.0 * Vec3::Y, 2.0 * Vec3::Z);
    let white = || Material::matte(Vec3::new(0.7, 0.71, 0.68));
    let corner = -Vec3::ONE;
    wall(&mut scene, corner, z, x, white());
    wall(&mut scene, corner + y, x, z, white());
    wall(&mut scene, corner, x, y, white());
    wall(&mut scene, corner, y, z, Material::matte(Vec3::new(0.6, 0.07, 0.05)));
    wall(&mut scene, corner + x, z, y, Material::matte(Vec3::new(0.1, 0.45, 0.09)));
    wall(
        &mut scene,
        Vec3::new(-0.35, 0.99, -0.35),
        0.7 * Vec3::X,
        0.7 * Vec3::Z,
        Material::emitter(Vec3::new(12.0, 10.0, 8.0)),
    );
    let ball = scene.push_material(white());
    scene.push_sphere(Vec3::new(-0.35, -0.6, -0.2), 0.4, ball);
    let lamp = scene
        .push_material(Material { emission: Vec3::new(0.5, 1.0, 2.0).into(), ..Material::matte(Vec3::splat(0.2)) });
    scene.push_sphere(Vec3::new(0.5, -0.8, 0.3), 0.2, lamp);
    scene
}

/// A floor and a ball under a sky, with a sun, a spot and a point.
pub(super) fn open() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 1.0, 5.0), Vec3::ZERO)], ..Scene::default() };
    wall(
        &mut scene,
        Vec3::new(-4.0, -1.0, -4.0),
        8.0 * Vec3::Z,
        8.0 * Vec3::X,
        Material::matte(Vec3::new(0.5, 0.4, 0.3)),
    );
    let ball = scene.push_material(Material::matte(Vec3::new(0.2, 0.4, 0.8)));
    scene.push_sphere(Vec3::ZERO, 1.0, ball);
    scene.environment = Some(Environment::uniform(Vec3::new(0.3, 0.4, 0.6)));
    let kinds = [
        LightKind::Point { position: Vec3::new(2.0, 1.0, 1.0), intensity: Vec3::splat(3.0) },
        LightKind::Spot {
            position: Vec3::new(-2.0, 2.0, 1.0),
            direction: Vec3::new(1.0, -1.0, -0.5).normalize(),
            intensity: Vec3::new(4.0, 1.0, 1.0),
            cos_inner: 0.95,
            cos_outer: 0.8,
            falloff: bottega_scene::SpotFalloff::default(),
        },
        LightKind::Directional {
            direction: Vec3::new(-0.3, -1.0, -0.2).normalize(),
            irradiance: Vec3::new(1.0, 0.9, 0.7),
            angle: 0.0,
        },
    ];
    scene.lights.extend(kinds.map(|kind| Light::new("", kind)));
    scene
}

/// A ball of triangles with smooth normals, texture coordinates and vertex colours.
fn ball(rows: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let columns = 2 * rows;
    for row in 0..=rows {
        for column in 0..=columns {
            let (v, u) = (row as f32 / rows as f32, column as f32 / columns as f32);
            let (theta, phi) = (v * std::f32::consts::PI, u * std::f32::consts::TAU);
            let n = Vec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
            mesh.positions.push(n);
            mesh.normals.push(n);
            mesh.uvs[0].push(Vec2::new(2.0 * u, v));
            mesh.colors.push(Vec4::new(0.4 + 0.6 * u, 1.0, 0.3 + 0.7 * v, 0.5 + 0.5 * v));
        }
    }
    let at = |row: u32, column: u32| row * (columns + 1) + column;
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let [a, b, c, d] = [at(row, column), at(row + 1, column), at(row + 1, column + 1), at(row, column + 1)];
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
    mesh
}

/// An image of waves, with alpha as the last channel.
fn waves(scene: &mut Scene, width: u32, height: u32) -> ImageId {
    let texel = |i: u32| {
        let (x, y) = ((i % width) as f32, (i / width) as f32);
        let wave = |a: f32, b: f32| 0.5 + 0.5 * (a * x / width as f32 + b * y / height as f32).sin();
        [wave(9.0, 2.0), wave(3.0, 8.0), wave(5.0, -4.0), wave(20.0, 13.0)]
    };
    scene.images.push(Image::from_linear_rgba("waves", width, height, (0..width * height).map(texel).collect()));
    ImageId(scene.images.len() as u32 - 1)
}

fn floor(scene: &mut Scene, material: Material) {
    wall(scene, Vec3::new(-4.0, -1.0, -4.0), 8.0 * Vec3::Z, 8.0 * Vec3::X, material);
}

fn lamp(scene: &mut Scene) {
    let radiance = Vec3::new(12.0, 11.0, 9.0);
    wall(scene, Vec3::new(-1.0, 3.0, -1.0), 2.0 * Vec3::X, 2.0 * Vec3::Z, Material::emitter(radiance));
}

/// Instances of a mesh, one of them stretched and one mirrored, below an image of the sky, through a lens.
pub(super) fn placed() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 1.0, 5.0), Vec3::ZERO)], ..Scene::default() };
    scene.cameras[0].lens_radius = 0.1;
    scene.cameras[0].focus_distance = 5.0;
    floor(&mut scene, Material::matte(Vec3::splat(0.6)));
    let material = scene.push_material(Material::matte(Vec3::new(0.9, 0.8, 0.7)));
    let mesh = scene.push_mesh(Mesh { material, ..ball(12) });
    let turn = Quat::from_rotation_x(0.4) * Quat::from_rotation_y(0.8);
    for (scale, place) in [
        (Vec3::splat(0.8), Vec3::new(-1.2, 0.0, 0.0)),
        (Vec3::new(0.4, 1.1, 0.7), Vec3::new(0.6, 0.0, -0.3)),
        (Vec3::new(-0.5, 0.4, 0.5), Vec3::new(0.3, -0.6, 1.4)),
    ] {
        scene.push_instance(mesh, Affine3A::from_scale_rotation_translation(scale, turn, place));
    }
    let sky = waves(&mut scene, 32, 16);
    let sky = Environment::picture(sky, Vec3::new(1.0, 1.2, 1.5), Mat3::from_rotation_y(0.9));
    scene.environment = Some(Environment { mapping: EnvironmentMapping::LatitudeLongitudeToPoles, ..sky });
    scene
}

/// Lights that project images, and lights textured by them, below an equal-area sky.
pub(super) fn pictures() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 2.0, 5.0), Vec3::ZERO)], ..Scene::default() };
    scene.cameras[0].projection = Projection::Orthographic { height: 5.0 };
    floor(&mut scene, Material::matte(Vec3::splat(0.7)));
    let picture = waves(&mut scene, 24, 24);
    let map = TextureMap::new(picture);
    let shining = Material {
        emission: ColorParam { factor: Vec3::splat(2.0), texture: Some(map) },
        ..Material::matte(Vec3::splat(0.3))
    };
    wall(&mut scene, Vec3::new(-2.5, -0.8, -2.0), 2.0 * Vec3::X, 1.5 * Vec3::Y, shining.clone());
    let material = scene.push_material(shining);
    scene.push_sphere(Vec3::new(1.5, -0.2, 0.0), 0.5, material);
    let mut corner = Mesh::quad(Vec3::new(1.0, -0.9, -2.0), 1.5 * Vec3::X, 1.2 * Vec3::Y);
    corner.triangles.truncate(1);
    scene.push_surface(Mesh { material, ..corner });
    let place = Affine3A::from_translation(Vec3::new(0.5, 2.5, 1.0));
    let kinds = [
        LightKind::Goniometric {
            mapping: bottega_scene::EnvironmentMapping::EqualArea,
            position: Vec3::new(-1.5, 1.5, 1.5),
            world_from_light: Mat3::from_rotation_x(0.5),
            image: picture,
            intensity: Vec3::splat(4.0),
        },
        LightKind::Projector {
            world_from_light: place * Affine3A::from_rotation_x(-1.3),
            picture: TextureMap::new(picture),
            intensity: Vec3::new(9.0, 8.0, 5.0),
            vertical_fov: 0.9,
            aspect: 1.4,
        },
    ];
    scene.lights.extend(kinds.map(|kind| Light::new("", kind)));
    let mut sky = Environment::picture(picture, Vec3::new(0.2, 0.3, 0.5), Mat3::from_rotation_x(0.7));
    sky.mapping = EnvironmentMapping::EqualArea;
    scene.environment = Some(sky);
    scene
}

/// Surfaces with holes, half-transparent ones, and an invisible one, before lights that have them, too.
pub(super) fn cut_outs() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.5, 5.0), Vec3::ZERO)], ..Scene::default() };
    floor(&mut scene, Material::matte(Vec3::splat(0.6)));
    lamp(&mut scene);
    let map = TextureMap::new(waves(&mut scene, 24, 24));
    let alpha = ScalarParam { factor: 0.9, texture: Some((map, Channel::A)) };
    let masked = Material {
        opacity: alpha.clone(),
        alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::matte(Vec3::new(0.8, 0.3, 0.3))
    };
    let blended =
        Material { opacity: alpha, alpha_mode: AlphaMode::Blend, ..Material::matte(Vec3::new(0.3, 0.3, 0.8)) };
    wall(&mut scene, Vec3::new(-2.0, -1.0, 0.0), 1.5 * Vec3::X, 1.8 * Vec3::Y, masked);
    let shining = Material { emission: Vec3::new(1.0, 3.0, 1.0).into(), ..blended.clone() };
    wall(&mut scene, Vec3::new(0.6, -0.9, -1.5), 1.2 * Vec3::X, 1.2 * Vec3::Y, shining);
    let material = scene.push_material(blended);
    scene.push_sphere(Vec3::new(0.8, -0.3, 0.8), 0.6, material);
    let mesh = scene.push_mesh(Mesh { material, ..ball(8) });
    scene.push_instance(
        mesh,
        Affine3A::from_scale_rotation_translation(Vec3::splat(0.5), Quat::IDENTITY, Vec3::new(-0.3, -0.5, 1.5)),
    );
    let nothing = scene.push_material(Surface::Null.into());
    scene.push_sphere(Vec3::ZERO, 1.5, nothing);
    scene
}

/// A clear solid that absorbs, a sheet, mirrors, and an unlit surface.
pub(super) fn glass() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.5, 5.0), Vec3::ZERO)], ..Scene::default() };
    floor(&mut scene, Material::matte(Vec3::splat(0.6)));
    lamp(&mut scene);
    let glass = |thin| Dielectric {
        eta: 1.5,
        reflectance: Vec3::ONE.into(),
        transmittance: Vec3::ONE.into(),
        facets: Facets::smooth(),
        thin,
    };
    let tint = scene.push_medium(Medium::absorbing(Vec3::new(0.2, 1.0, 2.0)));
    let solid = Material { interior: Some(tint), ..Surface::Dielectric(glass(false)).into() };
    let solid = scene.push_material(solid);
    scene.push_sphere(Vec3::new(-0.9, -0.3, 0.5), 0.7, solid);
    let mesh = scene.push_mesh(Mesh { material: solid, ..ball(10) });
    scene.push_instance(
        mesh,
        Affine3A::from_scale_rotation_translation(Vec3::splat(0.5), Quat::IDENTITY, Vec3::new(0.6, -0.5, 1.2)),
    );
    wall(&mut scene, Vec3::new(0.8, -1.0, -0.5), Vec3::X, 1.8 * Vec3::Y, Surface::Dielectric(glass(true)).into());
    let metal = |alpha: f32| {
        Surface::Conductor(Conductor {
            eta: Vec3::new(0.2, 0.9, 1.1).into(),
            k: Vec3::new(3.9, 2.4, 2.1).into(),
            reflectance: Vec3::ONE.into(),
            facets: alpha.into(),
        })
    };
    wall(&mut scene, Vec3::new(-2.5, -1.0, -1.5), 2.4 * Vec3::X, 2.0 * Vec3::Y, metal(0.0).into());
    let rough = scene.push_material(metal(0.3).into());
    scene.push_sphere(Vec3::new(1.6, -0.5, 0.4), 0.5, rough);
    wall(
        &mut scene,
        Vec3::new(1.0, 0.2, -2.5),
        Vec3::X,
        Vec3::Y,
        Surface::Unlit(Vec3::new(0.2, 0.9, 0.4).into()).into(),
    );
    scene
}

/// Normal and height maps, by both rules, on a wall, a sphere and a mesh.
pub(super) fn reliefs() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.5, 5.0), Vec3::ZERO)], ..Scene::default() };
    floor(&mut scene, Material::matte(Vec3::splat(0.6)));
    lamp(&mut scene);
    let map = TextureMap::new(waves(&mut scene, 16, 16));
    let heights = Relief::heights(ScalarParam { factor: 0.1, texture: Some((map, Channel::G)) });
    let mitsuba = |turns, shadows, mirrored| ReliefRule::Mitsuba { turns, shadows, mirrored };
    let reliefs = [
        Relief::normals(map, 0.7),
        heights.clone(),
        Relief { rule: mitsuba(true, true, false), ..heights.clone() },
        Relief { rule: mitsuba(false, false, true), ..Relief::normals(map, 0.5) },
    ];
    let white = || Material::matte(Vec3::splat(0.8));
    for (relief, x) in reliefs.into_iter().zip(-2..) {
        let material = scene.push_material(Material { relief: Some(relief), ..white() });
        let x = x as f32;
        let quad = Mesh::quad(Vec3::new(x, -0.9, -1.0), Vec3::X, 1.4 * Vec3::Y);
        scene.push_surface(Mesh { material, ..quad });
        scene.push_sphere(Vec3::new(x + 0.5, 0.9, -0.8), 0.4, material);
        let mesh = scene.push_mesh(Mesh { material, colors: Vec::new(), ..ball(10) });
        let place = Affine3A::from_scale_rotation_translation(
            Vec3::new(0.4, 0.3, 0.4),
            Quat::IDENTITY,
            Vec3::new(x + 0.5, -0.6, 1.0),
        );
        scene.push_instance(mesh, place);
    }
    scene
}

/// Lights of all shapes, so many that the tree has several levels.
pub(super) fn many_lights() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 2.0, 6.0), Vec3::ZERO)], ..Scene::default() };
    floor(&mut scene, Material::matte(Vec3::splat(0.7)));
    let mut number = 7_u32;
    let mut next = || {
        number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (number >> 8) as f32 / (1 << 24) as f32
    };
    for i in 0..60 {
        let place = Vec3::new(6.0 * next() - 3.0, 1.5 * next() - 0.8, 6.0 * next() - 3.0);
        let radiance = Vec3::new(next(), next(), next()) * 4.0;
        let x = Vec3::new(next() - 0.5, next() - 0.5, next() - 0.5) * 0.4;
        let y = x.cross(Vec3::new(next(), next(), 1.0));
        match i % 4 {
            0 => wall(&mut scene, place, x, y, Material::emitter(radiance)),
            1 => {
                let material =
                    scene.push_material(Material { emission: radiance.into(), ..Material::matte(Vec3::ZERO) });
                scene.push_sphere(place, 0.05 + 0.1 * next(), material);
            }
            2 => {
                let mut mesh = Mesh::quad(place, x, y);
                mesh.triangles.truncate(1);
                let material =
                    scene.push_material(Material { emission: radiance.into(), ..Material::matte(Vec3::ZERO) });
                scene.push_surface(Mesh { material, ..mesh });
            }
            _ => {
                let kind = LightKind::Point { position: place, intensity: 0.05 * radiance };
                scene.lights.push(Light::new("", kind));
            }
        }
    }
    scene
}
