//! All lights as words: see [`crate::flat`].

use bottega_kernels::math;
use bottega_scene::{LightKind, Scene, Spectrum, SpotFalloff, TextureMap};
use glam::{Mat3, Vec3};

use super::{Light, Lights};
use crate::flat::{LIGHT_WORDS, NONE, Words, header};

/// The first word of a light's record.
mod kind {
    pub(super) const SURFACE: u32 = 0;
    pub(super) const SPHERE: u32 = 1;
    pub(super) const POINT: u32 = 2;
    pub(super) const SPOT: u32 = 3;
    pub(super) const GONIOMETRIC: u32 = 4;
    pub(super) const PROJECTOR: u32 = 5;
    /// Gives no light.
    pub(super) const DARK: u32 = 6;
}

impl Lights {
    /// Writes down all but where spheres and instances have theirs.
    pub(crate) fn write(&self, scene: &Scene, words: &mut Words) {
        words.head(header::HAS_FAR, u32::from(self.has_far()));
        self.tree.write(words);
        words.head(header::LIGHTS, words.place());
        for light in &self.lights {
            let start = words.place();
            match light {
                Light::Surface(surface) => {
                    words.word(kind::SURFACE);
                    surface.write(words);
                }
                Light::Sphere(index) => words.words(&[kind::SPHERE, *index]),
                Light::Punctual(index) => write_punctual(scene.lights[*index as usize].kind, words),
            }
            words.fill(start, LIGHT_WORDS);
        }
        let parts = words.place();
        words.words(&self.parts);
        words.head(header::SHINING, words.place());
        for triangle in &self.triangles {
            let first = parts + triangle.first_part;
            words.words(&[first, triangle.shape.code(), u32::from(triangle.is_second), triangle.grid.side()]);
        }
        words.head(header::PARALLEL, words.place());
        words.head(header::PARALLEL_COUNT, self.parallel.len() as u32);
        for light in &self.parallel {
            let LightKind::Directional { irradiance, .. } = scene.lights[light.light as usize].kind else { continue };
            words.vec3(light.to_light);
            words.vec3(irradiance);
            words.number(light.illuminance);
        }
        let environment = self.environment.as_ref().map_or(NONE, |environment| environment.write(words));
        words.head(header::ENVIRONMENT, environment);
    }
}

/// Kind, position, intensity, and what belongs to the kind.
fn write_punctual(light: LightKind, words: &mut Words) {
    let mut common = |kind: u32, position: Vec3, intensity: Spectrum| {
        words.word(kind);
        words.vec3(position);
        words.vec3(intensity);
    };
    match light {
        LightKind::Point { position, intensity } => common(kind::POINT, position, intensity),
        LightKind::Spot { position, direction, intensity, cos_inner, cos_outer, falloff } => {
            common(kind::SPOT, position, intensity);
            words.vec3(direction);
            words.numbers(&[cos_inner, cos_outer]);
            words.word(match falloff {
                SpotFalloff::SquaredCosine => 0,
                SpotFalloff::SmoothCosine => 1,
                SpotFalloff::LinearAngle => 2,
            });
        }
        LightKind::Goniometric { position, world_from_light, image, intensity } => {
            common(kind::GONIOMETRIC, position, intensity);
            words.mat3(world_from_light);
            words.picture(Some(TextureMap { smooth: false, ..TextureMap::new(image) }));
        }
        LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect } => {
            common(kind::PROJECTOR, world_from_light.translation.into(), intensity);
            words.mat3(Mat3::from(world_from_light.matrix3));
            words.picture(Some(picture));
            words.numbers(&[math::tan(0.5 * vertical_fov), aspect]);
        }
        LightKind::Directional { .. } => words.word(kind::DARK),
    }
}
