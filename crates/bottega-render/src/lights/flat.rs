//! Flattening of all lights for GPUs, see [`crate::flat`].

use bottega_kernels::math;
use bottega_scene::{LightKind, Scene, Spectrum, SpotFalloff, TextureMap};
use glam::{Mat3, Vec3};

use super::{Light, Lights, sun::Sun};
use crate::flat::{
    NONE, ParallelRecord, PictureLightRecord, PointLightRecord, Record as _, ShiningRecord, SphereLightRecord,
    SpotLightRecord, WordBuffer, code, header, place_of,
};

impl Lights {
    /// Writes all lights, except the lights' numbers of spheres and instances.
    pub(crate) fn write(&self, scene: &Scene, words: &mut WordBuffer) {
        words.head(header::HAS_FAR, u32::from(self.has_far()));
        self.tree.write(words);
        words.head(header::LIGHTS, words.place());
        for light in &self.lights {
            match light {
                Light::Surface(surface) => _ = words.record(&surface.record()),
                Light::Sphere(sphere) => {
                    words.record(&SphereLightRecord { kind: code::LIGHT_SPHERE, sphere: *sphere });
                }
                Light::Punctual(index) => write_punctual(scene.lights[*index as usize].kind, words),
            }
        }
        let parts = words.place();
        words.words(&self.parts);
        words.head(header::SHINING, words.place());
        for triangle in &self.triangles {
            words.record(&ShiningRecord {
                parts: parts + triangle.first_part,
                shape: triangle.shape.code(),
                is_second: triangle.is_second,
                side: triangle.grid.side(),
            });
        }
        words.head(header::PARALLEL, words.place());
        words.head(header::PARALLEL_COUNT, self.suns.len() as u32);
        for &Sun { to_light, irradiance, illuminance, .. } in &self.suns {
            words.record(&ParallelRecord { to_light, irradiance, illuminance });
        }
        let environment = self.environment.as_ref().map_or(NONE, |environment| environment.write(words));
        words.head(header::ENVIRONMENT, environment);
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
        LightKind::Goniometric { position, world_from_light, image, intensity } => {
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
