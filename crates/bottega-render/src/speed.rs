//! A benchmark picture: the time to render it measures the speed of path tracing on a CPU.

use std::sync::Arc;

use bottega_image::Rect;
use bottega_scene::{
    Camera, Dielectric, Environment, Facets, Instance, Material, Mesh, Projection, Scene, Spectrum, Surface,
};
use glam::{Affine3A, Vec3};

use crate::{
    error::RenderError,
    filter::Filter,
    prepare::{PrepareOptions, PreparedScene},
    settings::{PathSettings, View},
    survey::probe,
};

/// Side of the picture in pixels.
const SIDE: u32 = 24;
/// Number of samples per pixel.
const SAMPLES: u32 = 16;
/// Largest number of bounces.
const MAX_DEPTH: u32 = 8;
/// Side of the ground in squares of two triangles.
const GROUND: u32 = 48;
/// Number of balls per row and column; half of the balls are glass.
const ROW: u32 = 4;
/// Index of the ground's material; [`CLAY`], [`GLASS`] and [`LAMP`]: of the balls'.
const EARTH: u32 = 0;
const CLAY: u32 = 1;
const GLASS: u32 = 2;
const LAMP: u32 = 3;

/// A small benchmark picture of balls, half of them glass, on uneven ground: the time to render it measures the speed
/// of path tracing.
pub struct SpeedProbe {
    scene: PreparedScene,
    settings: PathSettings,
}

impl SpeedProbe {
    /// Prepares the scene of the benchmark.
    ///
    /// # Errors
    /// [`RenderError::Accel`]: the acceleration structure cannot be built.
    pub fn new() -> Result<Self, RenderError> {
        let settings =
            PathSettings { max_depth: MAX_DEPTH, filter: Filter::PIXEL, guiding: false, ..PathSettings::default() };
        Ok(Self { scene: PreparedScene::new(Arc::new(scene()), &PrepareOptions::default())?, settings })
    }

    /// Renders the picture on the calling thread, about ten thousand paths. Returns the mean luminance, the same each
    /// time.
    ///
    /// # Errors
    /// Those of [`View::of_scene`] and of rendering; the scene of the benchmark causes none.
    pub fn paint(&self) -> Result<f32, RenderError> {
        let view = View::of_scene(self.scene.scene(), 0, SIDE, SIDE)?;
        let pixels = probe(&self.scene, &view, &self.settings, Rect::of_size(SIDE, SIDE), SAMPLES)?;
        let sum: f32 = pixels.iter().map(|pixel| crate::color::luminance(Vec3::from(pixel.color))).sum();
        Ok(sum / pixels.len() as f32)
    }
}

fn scene() -> Scene {
    let (eye, target) = (Vec3::new(0.5, 3.0, 6.0), Vec3::new(0.0, 0.3, 0.0));
    let glass = Dielectric {
        eta: 1.5,
        reflectance: Spectrum::ONE.into(),
        transmittance: Spectrum::ONE.into(),
        facets: Facets::default(),
        thin: false,
    };
    let mut scene = Scene {
        meshes: vec![ground()].into(),
        instances: vec![Instance::new(0, Affine3A::IDENTITY)],
        materials: vec![
            Material::matte(Spectrum::new(0.5, 0.45, 0.4)),
            Material::matte(Spectrum::new(0.7, 0.3, 0.2)),
            Surface::Dielectric(glass).into(),
            Material::emitter(Spectrum::splat(20.0)),
        ],
        environment: Some(Environment::uniform(Spectrum::splat(0.4))),
        cameras: vec![Camera {
            world_from_camera: Camera::looking(eye, target, Vec3::Y).unwrap_or_default(),
            projection: Projection::Perspective { vertical_fov: 0.7 },
            ..Camera::default()
        }],
        ..Scene::default()
    };
    for place in 0..ROW * ROW {
        let (column, row) = (place % ROW, place / ROW);
        let center = Vec3::new(column as f32 - 1.5, 0.5, row as f32 - 1.5);
        scene.push_sphere(center, 0.4, if (column + row) % 2 == 0 { CLAY } else { GLASS });
    }
    scene.push_sphere(Vec3::new(2.0, 5.0, 2.0), 0.5, LAMP);
    scene
}

/// Builds the uneven ground.
fn ground() -> Mesh {
    let at = |i: u32, j: u32| {
        let [x, z] = [i, j].map(|k| 12.0 * (k as f32 / GROUND as f32 - 0.5));
        // An arbitrary hash of the position
        let height = 0.1 * ((i * 7919 + j * 104_729) % 97) as f32 / 97.0;
        Vec3::new(x, height, z)
    };
    let corners = GROUND + 1;
    let positions = (0..corners * corners).map(|k| at(k % corners, k / corners)).collect();
    let triangles = (0..GROUND * GROUND).flat_map(|square| {
        let corner = square / GROUND * corners + square % GROUND;
        [[corner, corner + corners, corner + 1], [corner + 1, corner + corners, corner + corners + 1]]
    });
    Mesh { name: "ground".to_owned(), positions, triangles: triangles.collect(), material: EARTH, ..Mesh::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_is_lit_and_the_same_each_time() {
        let probe = SpeedProbe::new().unwrap();
        let mean = probe.paint().unwrap();
        assert!((0.1..2.0).contains(&mean), "{mean}");
        assert_eq!(mean, probe.paint().unwrap());
    }
}
