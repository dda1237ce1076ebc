//! Scenes that grow, and the render of one of them.

use std::{sync::Arc, time::Instant};

use bottega_render::{PathSettings, PrepareOptions, PreparedScene};
use bottega_scene::{
    Camera, ColorParam, Diffuse, Environment, Image, ImageId, Material, Mesh, Projection, Scene, Spectrum, Surface,
    TextureMap,
};
use glam::{Vec2, Vec3};

use crate::{error::Error, painting::paint_zone, random::Random};

/// A picture of a scene.
#[derive(Clone, Copy)]
pub(super) struct SizedRender {
    /// Width and height in pixels.
    pub(super) side: u32,
    /// Samples per pixel.
    pub(super) samples: u32,
    /// Number of threads.
    pub(super) threads: usize,
}

impl SizedRender {
    /// Prepares and renders a scene. Returns seconds of both, and the prepared memory in MB.
    pub(super) fn of(self, scene: Scene) -> Result<[f64; 3], Error> {
        let Self { side, samples, threads } = self;
        let begun = Instant::now();
        let options = PrepareOptions { threads, ..PrepareOptions::default() };
        let prepared = Arc::new(PreparedScene::new(Arc::new(scene), &options)?);
        let prepare = begun.elapsed().as_secs_f64();
        // What agents learn has a cost of its own, which other measurements show.
        let settings =
            PathSettings { guiding: false, agents: Default::default(), max_depth: 4, ..PathSettings::default() };
        let (_, time) = paint_zone((&prepared, &Arc::default()), (side, side), settings, threads, samples)?;
        Ok([prepare, time.as_secs_f64(), prepared.memory_bytes() as f64 / 1e6])
    }
}

/// Returns an empty scene under a dim sky, seen from above at an angle.
fn empty() -> Scene {
    let camera = Camera {
        world_from_camera: Camera::looking(Vec3::new(0.0, 6.0, 9.0), Vec3::ZERO, Vec3::Y).unwrap_or_default(),
        projection: Projection::Perspective { vertical_fov: 0.9 },
        ..Camera::default()
    };
    Scene { environment: Some(Environment::uniform(Spectrum::splat(0.1))), cameras: vec![camera], ..Scene::default() }
}

/// Adds a grid of squares over [-5, 5]², with a height.
fn add_grid(scene: &mut Scene, side: u32, material: Material, mut height: impl FnMut(f32, f32) -> f32) {
    let material = scene.push_material(material);
    let at = |i: u32| 10.0 * i as f32 / side as f32 - 5.0;
    let mut mesh = Mesh { name: "grid".to_owned(), material, ..Mesh::default() };
    for j in 0..=side {
        for i in 0..=side {
            let (x, z) = (at(i), at(j));
            mesh.positions.push(Vec3::new(x, height(x, z), z));
        }
    }
    for j in 0..side {
        for i in 0..side {
            let a = j * (side + 1) + i;
            mesh.triangles.extend([[a, a + side + 1, a + 1], [a + 1, a + side + 1, a + side + 2]]);
        }
    }
    scene.push_surface(mesh);
}

/// Returns a hilly terrain of about this many triangles.
pub(super) fn terrain(triangles: u64) -> Scene {
    let mut scene = empty();
    let mut random = Random::new(3);
    let side = ((triangles / 2) as f64).sqrt().round().max(1.0) as u32;
    let matte = Material::matte(Spectrum::splat(0.6));
    add_grid(&mut scene, side, matte, |x, z| 0.5 * (x.sin() * z.cos()) + 0.01 * random.unit());
    scene
}

/// Returns a floor below small square lights, whose power is the same in sum.
pub(super) fn lit_floor(lights: u64) -> Scene {
    let mut scene = empty();
    add_grid(&mut scene, 8, Material::matte(Spectrum::splat(0.6)), |_, _| 0.0);
    let mut random = Random::new(5);
    let side = 0.4 / (lights as f32).sqrt();
    let material = scene.push_material(Material::emitter(Spectrum::splat(40.0)));
    for _ in 0..lights {
        let corner = Vec3::new(random.between(-4.0, 4.0), random.between(1.0, 3.0), random.between(-4.0, 4.0));
        let [x, z] = [Vec3::X * side, Vec3::Z * side];
        scene.push_surface(Mesh {
            name: "light".to_owned(),
            positions: vec![corner, corner + x, corner + x + z, corner + z],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material,
            ..Mesh::default()
        });
    }
    scene
}

/// Returns tiles below a sky, each with a texture of its own.
pub(super) fn tiles(count: u64) -> Scene {
    /// Width and height of a texture in texels.
    const SIDE: u32 = 128;
    let mut scene = empty();
    let across = (count as f64).sqrt().ceil().max(1.0) as u64;
    let tile = 10.0 / across as f32;
    for index in 0..count {
        let mut random = Random::new(index);
        let texels = (0..SIDE * SIDE).map(|_| [random.unit(), random.unit(), random.unit()]);
        scene.images.push(Image::from_linear_rgb("tile", SIDE, SIDE, texels.collect()));
        let texture = Some(TextureMap::new(ImageId(index as u32)));
        let reflectance = ColorParam { factor: Spectrum::ONE, texture };
        let matte = Surface::Diffuse(Diffuse { reflectance, roughness: 0.0.into() });
        let material = scene.push_material(matte.into());
        let corner = Vec3::new((index % across) as f32 * tile - 5.0, 0.0, (index / across) as f32 * tile - 5.0);
        let [x, z] = [Vec3::X * tile, Vec3::Z * tile];
        scene.push_surface(Mesh {
            name: "tile".to_owned(),
            positions: vec![corner, corner + z, corner + z + x, corner + x],
            uvs: [vec![Vec2::ZERO, Vec2::Y, Vec2::ONE, Vec2::X], Vec::new()],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material,
            ..Mesh::default()
        });
    }
    scene
}
