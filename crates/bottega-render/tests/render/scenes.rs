//! Scenes made by hand, and functions that render them.

use std::{ops::Range, sync::Arc};

use bottega_image::{Layout, Rect, Tile};
use bottega_render::{BlockWork, PathSettings, PrepareOptions, PreparedScene, Prepass, View};
use bottega_scene::{
    Camera, Environment, Image, ImageId, Instance, Layered, Material, Mesh, Projection, Scene, Spectrum,
};
use glam::{Affine3A, Vec3};

/// A Lambertian surface.
pub(crate) fn matte(albedo: Vec3) -> Material {
    Material::matte(albedo)
}

/// A black surface that emits on both sides.
pub(crate) fn lamp(radiance: Vec3) -> Material {
    Material { emission: radiance.into(), ..matte(Vec3::ZERO) }
}

/// Smooth clear glass.
pub(crate) fn glass() -> Material {
    Layered { roughness: 0.0.into(), transmission: 1.0.into(), ..Layered::default() }.into()
}

/// A camera at `eye` that looks at `target`.
pub(crate) fn camera(eye: Vec3, target: Vec3, vertical_fov: f32) -> Camera {
    let up = if (target - eye).normalize().y.abs() > 0.99 { Vec3::Z } else { Vec3::Y };
    Camera {
        world_from_camera: Affine3A::from_mat4(glam::camera::rh::view::look_at_mat4(eye, target, up).inverse()),
        projection: Projection::Perspective { vertical_fov },
        ..Camera::default()
    }
}

/// Adds a parallelogram with corner `a` and edges `u`, `v`; its front is where u × v points.
pub(crate) fn add_quad(scene: &mut Scene, a: Vec3, u: Vec3, v: Vec3, material: Material) {
    add_mesh(scene, vec![a, a + u, a + u + v, a + v], vec![[0, 1, 2], [0, 2, 3]], material);
}

pub(crate) fn add_mesh(scene: &mut Scene, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: Material) {
    let material_index = scene.materials.len() as u32;
    scene.materials.push(material);
    let mesh = scene.meshes.len() as u32;
    scene.meshes.push(Mesh { positions, triangles, material: material_index, ..Mesh::default() });
    scene.instances.push(Instance::new(mesh, Affine3A::IDENTITY));
}

pub(crate) fn add_sphere(scene: &mut Scene, center: Vec3, radius: f32, material: Material) {
    let material_index = scene.materials.len() as u32;
    scene.materials.push(material);
    scene.push_sphere(center, radius, material_index);
}

/// A box around the origin with these half sides, seen from inside.
pub(crate) fn add_room(scene: &mut Scene, half: Vec3, material: &Material) {
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut a = -half;
            a[axis] = side * half[axis];
            let mut u = Vec3::ZERO;
            u[(axis + 1) % 3] = 2.0 * half[(axis + 1) % 3];
            let mut v = Vec3::ZERO;
            v[(axis + 2) % 3] = 2.0 * half[(axis + 2) % 3];
            add_quad(scene, a, u, v, material.clone());
        }
    }
}

/// The room of Cornell with a lamp below its ceiling, a matte box-like sphere and a glass one.
pub(crate) fn cornell() -> Scene {
    let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.0, 3.9), Vec3::ZERO, 0.68)], ..Scene::default() };
    let white = matte(Vec3::new(0.73, 0.71, 0.68));
    let (x, y, z) = (Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, -1.0), z, x, white.clone());
    add_quad(&mut scene, Vec3::new(-1.0, 1.0, -1.0), x, z, white.clone());
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, -1.0), x, y, white.clone());
    add_quad(&mut scene, Vec3::new(-1.0, -1.0, -1.0), y, z, matte(Vec3::new(0.63, 0.065, 0.05)));
    add_quad(&mut scene, Vec3::new(1.0, -1.0, -1.0), z, y, matte(Vec3::new(0.14, 0.45, 0.091)));
    let light = Material::emitter(Vec3::new(17.0, 12.0, 4.0));
    add_quad(&mut scene, Vec3::new(-0.25, 0.99, -0.2), Vec3::X * 0.5, Vec3::Z * 0.4, light);
    add_sphere(&mut scene, Vec3::new(-0.4, -0.55, -0.3), 0.45, white);
    add_sphere(&mut scene, Vec3::new(0.4, -0.65, 0.3), 0.35, glass());
    scene
}

/// The Cornell box without its lamp, lit by a sky that is bright above and not black below.
pub(crate) fn room_under_sky() -> Scene {
    let mut scene = cornell();
    scene.meshes.pop();
    scene.instances.pop();
    let texels = [[1.5, 1.5, 1.6], [0.5, 0.5, 0.5]].map(|texel| [texel; 4]).concat();
    scene.images.push(Image::from_linear_rgb("sky", 4, 2, texels));
    let image = Some(ImageId(scene.images.len() as u32 - 1));
    scene.environment = Some(Environment { image, ..Environment::uniform(Vec3::ONE) });
    scene
}

/// Prepares a scene in which each strategy alone can find all light.
pub(crate) fn prepare(scene: Scene) -> Subject {
    let options = PrepareOptions { threads: 1, compensate_environment: false };
    Subject::new(PreparedScene::new(Arc::new(scene), &options).expect("a sound scene"))
}

/// A scene with its preparation and prepass.
pub(crate) struct Subject {
    pub(crate) scene: Arc<PreparedScene>,
    pub(crate) prepass: Arc<Prepass>,
}

impl Subject {
    pub(crate) fn new(scene: PreparedScene) -> Self {
        Self { scene: Arc::new(scene), prepass: Arc::default() }
    }

    /// The view of the scene's first camera.
    pub(crate) fn view(&self, (width, height): (u32, u32)) -> View {
        View::of_scene(self.scene.scene(), 0, width, height).expect("a camera")
    }

    /// The work of rendering a picture of the scene.
    pub(crate) fn block(&self, view: &View, settings: PathSettings, tile: Tile, samples: Range<u32>) -> BlockWork {
        let (scene, prepass, view) = (Arc::clone(&self.scene), Arc::clone(&self.prepass), view.clone());
        BlockWork {
            scene,
            prepass,
            view,
            settings: Arc::new(settings),
            tile,
            samples,
            light_groups: None,
            catchers: None,
        }
    }
}

/// Renders samples 0 to `spp` of a whole picture.
pub(crate) fn paint(scene: &Subject, size: (u32, u32), spp: u32, settings: PathSettings) -> Tile {
    let tile = Tile::new(Rect::of_size(size.0, size.1), Layout::new(bottega_image::AovSet::NONE));
    scene.block(&scene.view(size), settings, tile, 0..spp).perform().expect("a picture").tile
}

/// Mean radiance of a pixel.
pub(crate) fn color(tile: &Tile, x: u32, y: u32) -> Spectrum {
    let sums = tile.pixel(x, y);
    Vec3::new(sums[0], sums[1], sums[2]) / sums[Layout::SAMPLE_COUNT]
}

/// Mean radiance of all pixels.
pub(crate) fn mean_color(tile: &Tile) -> Spectrum {
    tile.rect().pixels().map(|(x, y)| color(tile, x, y)).sum::<Vec3>() / tile.rect().area() as f32
}

/// Scales a scene by a factor, with the distance from its camera.
pub(crate) fn grow(scene: &mut Scene, size: f32) {
    let grown = Affine3A::from_scale(Vec3::splat(size));
    scene.instances.iter_mut().for_each(|instance| instance.world_from_object = grown * instance.world_from_object);
    for sphere in &mut scene.spheres {
        (sphere.center, sphere.radius) = (sphere.center * size, sphere.radius * size);
    }
    scene.cameras[0].world_from_camera.translation *= size;
}
