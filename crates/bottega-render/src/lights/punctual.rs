//! Lights without extent: point, spot, goniometric and projector lights.
//!
//! Parameters: position; intensity in W/sr per channel; direction, inner and outer angle of a spot; the picture of a
//! goniometric or projector light. Lamps with a profile are goniometric lights. Their shadows are sharp, and only light
//! sampling finds them.
//!
//! Source: KHR_lights_punctual; the emitters `point`, `spot`, `projector` of Mitsuba 3 and `goniometric` of pbrt-v4.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::{LightKind, Scene, Spectrum, SpotFalloff, TextureMap, Visibility};
use glam::{Vec2, Vec3};

use super::{
    LightSample, NO_LIGHT,
    bounds::{Cone, LightBounds},
    direction_picture::DirectionLookup,
    environment::direction_of_square,
};
use crate::{color::luminance, density::SolidAnglePdf, sampling::around};

/// Smallest angle over which a light fades, in radians.
pub(super) const FADE_MIN: f32 = 0.01;

/// Returns the bounds of the light, for the light tree; `None` for a light at infinity.
pub(super) fn bounds(scene: &Scene, kind: &LightKind) -> Option<LightBounds> {
    let cone = |position, axis, angle: f32, fade: f32, intensity| LightBounds {
        cone: Cone { axis, angle },
        emission_angle: fade.max(FADE_MIN),
        ..LightBounds::point(position, intensity)
    };
    match *kind {
        LightKind::Point { position, intensity } => Some(LightBounds::point(position, luminance(intensity))),
        LightKind::Spot { position, direction, intensity, cos_inner, cos_outer, .. } => {
            let [inner, outer] = [cos_inner, cos_outer].map(math::acos);
            Some(cone(position, direction, inner, outer - inner, luminance(intensity)))
        }
        LightKind::Directional { .. } => None,
        LightKind::Goniometric { position, image, intensity, .. } => {
            let mean = scene.images[image.0 as usize].eval(&TextureMap::new(image), Vec2::splat(0.5), 1.0);
            Some(LightBounds::point(position, luminance(intensity) * mean.truncate().element_sum() / 3.0))
        }
        LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect } => {
            let image = picture.image;
            let mean = scene.images[image.0 as usize].eval(&TextureMap::new(image), Vec2::splat(0.5), 1.0);
            let axis = (world_from_light.matrix3 * glam::Vec3A::NEG_Z).normalize().into();
            let corner = math::tan(0.5 * vertical_fov) * (1.0 + aspect * aspect).sqrt();
            let angle = math::atan(corner);
            // Towards the corners, intensity grows by 1/cos³
            let peak = (1.0 + corner * corner).powi(3).sqrt();
            let intensity = luminance(mean.truncate() * intensity) * 0.5 * (1.0 + peak);
            Some(cone(world_from_light.translation.into(), axis, angle, 0.0, intensity))
        }
    }
}

/// Returns the position of the light; the origin for a light at infinity.
pub(super) fn position(kind: &LightKind) -> Vec3 {
    match *kind {
        LightKind::Point { position, .. }
        | LightKind::Spot { position, .. }
        | LightKind::Goniometric { position, .. } => position,
        LightKind::Directional { .. } => Vec3::ZERO,
        LightKind::Projector { world_from_light, .. } => world_from_light.translation.into(),
    }
}

/// Returns the light that arrives at `p`. `None` if that is dark, and for light from infinity.
pub(super) fn sample(scene: &Scene, kind: &LightKind, p: Vec3) -> Option<LightSample> {
    match *kind {
        LightKind::Point { position, intensity } => from_point(position, p, |_| intensity),
        LightKind::Spot { position, direction, intensity, cos_inner, cos_outer, falloff } => {
            from_point(position, p, |wi| intensity * fall_off(falloff, -wi.dot(direction), cos_inner, cos_outer))
        }
        LightKind::Directional { .. } => None,
        LightKind::Goniometric { position, world_from_light, image, mapping, intensity } => {
            let lookup = DirectionLookup::with_mapping(scene, image, mapping, world_from_light);
            from_point(position, p, |wi| intensity * lookup.factor(-wi))
        }
        LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect } => {
            from_point(world_from_light.translation.into(), p, |wi| {
                let local = world_from_light.matrix3.transpose() * -wi;
                if local.z >= 0.0 {
                    return Spectrum::ZERO;
                }
                let half_height = math::tan(0.5 * vertical_fov);
                let place = Vec2::new(local.x / aspect, -local.y) / (-local.z * half_height);
                if place.abs().max_element() > 1.0 {
                    return Spectrum::ZERO;
                }
                let texel = projected(scene, &picture, place * 0.5 + 0.5);
                let cosine = -local.z;
                texel * intensity / (cosine * cosine * cosine)
            })
        }
    }
}

/// Returns a projector's colour at a position of its picture.
fn projected(scene: &Scene, picture: &TextureMap, place: Vec2) -> Spectrum {
    scene.images[picture.image.0 as usize].eval(picture, place, 0.0).truncate()
}

/// Returns the emission of a light whose directions are parametrized by the unit square: position of the light, direction
/// of `place`, and the power of the whole square if it has the same intensity everywhere. `None` for other lights.
pub(super) fn emitted(scene: &Scene, index: u32, place: Vec2) -> Option<(Vec3, Vec3, Spectrum)> {
    match scene.lights[index as usize].kind {
        LightKind::Spot { position, direction, intensity, cos_inner, cos_outer, falloff } => {
            // From the axis outwards, uniform in the cosine
            let one_minus_cos = place.x * (1.0 - cos_outer);
            let strength = fall_off(falloff, 1.0 - one_minus_cos, cos_inner, cos_outer);
            let power = intensity * (strength * 2.0 * PI * (1.0 - cos_outer));
            Some((position, around(direction, one_minus_cos, place.y), power))
        }
        LightKind::Goniometric { position, world_from_light, image, mapping, intensity } => {
            // A square of equal areas, whatever the layout of the picture
            let direction = world_from_light * direction_of_square(place);
            let lookup = DirectionLookup::with_mapping(scene, image, mapping, world_from_light);
            Some((position, direction, intensity * (4.0 * PI * lookup.factor(direction))))
        }
        LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect } => {
            // The solid angle of a picture element at distance 1 is its area times cos³, which cancels the 1/cos³ of the
            // intensity
            let half_height = math::tan(0.5 * vertical_fov);
            let on_plane = (place * 2.0 - 1.0) * Vec2::new(aspect, -1.0) * half_height;
            let direction = (world_from_light.matrix3 * on_plane.extend(-1.0)).normalize();
            let area = 4.0 * half_height * half_height * aspect;
            Some((world_from_light.translation.into(), direction, projected(scene, &picture, place) * intensity * area))
        }
        LightKind::Point { .. } | LightKind::Directional { .. } => None,
    }
}

/// Returns the relative intensity of a spot at an angle to its axis with this cosine, in [0, 1].
pub(super) fn fall_off(falloff: SpotFalloff, cosine: f32, cos_inner: f32, cos_outer: f32) -> f32 {
    if cosine >= cos_inner {
        return 1.0;
    }
    if cosine <= cos_outer {
        return 0.0;
    }
    let ramp = (cosine - cos_outer) / (cos_inner - cos_outer);
    match falloff {
        SpotFalloff::SquaredCosine => ramp * ramp,
        SpotFalloff::SmoothCosine => ramp * ramp * (3.0 - 2.0 * ramp),
        SpotFalloff::LinearAngle => {
            let [angle, inner, outer] = [cosine, cos_inner, cos_outer].map(math::acos);
            (outer - angle) / (outer - inner)
        }
    }
}

fn from_point(position: Vec3, p: Vec3, intensity: impl Fn(Vec3) -> Spectrum) -> Option<LightSample> {
    let to_light = position - p;
    let distance = to_light.length();
    if distance <= 0.0 {
        return None;
    }
    let wi = to_light / distance;
    let radiance = intensity(wi) / (distance * distance);
    (radiance != Spectrum::ZERO).then_some(LightSample {
        wi,
        distance,
        radiance,
        pdf: SolidAnglePdf::ONLY,
        is_delta: true,
        light: NO_LIGHT,
        sun: NO_LIGHT,
        pmf: 1.0,
        visibility: Visibility::ALL,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bottega_scene::Light;

    fn with(kind: LightKind) -> Scene {
        Scene { lights: vec![Light::new("", kind)], ..Scene::default() }
    }

    #[test]
    fn a_point_light_falls_off_with_the_square_of_the_distance() {
        let light = LightKind::Point { position: Vec3::new(0.0, 4.0, 0.0), intensity: Vec3::splat(8.0) };
        let scene = with(light);
        let sample = sample(&scene, &scene.lights[0].kind, Vec3::new(0.0, 2.0, 0.0)).unwrap();
        assert_eq!((sample.wi, sample.distance, sample.radiance), (Vec3::Y, 2.0, Vec3::splat(2.0)));
        assert!(super::sample(&scene, &scene.lights[0].kind, Vec3::new(0.0, 4.0, 0.0)).is_none());
    }

    #[test]
    fn a_goniometric_light_is_as_strong_as_its_picture_says() {
        // Bright in the middle, which is +z of the light, rotated to +x of the world
        let texels = (0..64u32)
            .map(|i| if (3..5).contains(&(i % 8)) && (3..5).contains(&(i / 8)) { [6.0; 3] } else { [0.0; 3] });
        let kind = LightKind::Goniometric {
            position: Vec3::ZERO,
            world_from_light: glam::Mat3::from_rotation_y(std::f32::consts::FRAC_PI_2),
            image: bottega_scene::ImageId(0),
            mapping: bottega_scene::EnvironmentMapping::EqualArea,
            intensity: Vec3::splat(2.0),
        };
        let image = bottega_scene::Image::from_linear_rgb("lamp", 8, 8, texels.collect());
        let scene = Scene { images: vec![image].into(), ..with(kind) };
        assert_eq!(sample(&scene, &scene.lights[0].kind, 2.0 * Vec3::X).unwrap().radiance, Vec3::splat(3.0));
        assert!(
            sample(&scene, &scene.lights[0].kind, 2.0 * Vec3::Y).is_none()
                && sample(&scene, &scene.lights[0].kind, 2.0 * Vec3::NEG_X).is_none()
        );
        let bounds = bounds(&scene, &scene.lights[0].kind).unwrap();
        assert!((bounds.intensity - 12.0 / 16.0).abs() < 0.01, "{}", bounds.intensity);
    }

    #[test]
    fn a_spot_fades_between_its_angles_as_its_format_says() {
        let at = |falloff: SpotFalloff, cosine: f32| {
            let scene = with(LightKind::Spot {
                position: Vec3::ZERO,
                direction: Vec3::NEG_Y,
                intensity: Vec3::ONE,
                cos_inner: 0.9,
                cos_outer: 0.7,
                falloff,
            });
            let p = Vec3::new((1.0 - cosine * cosine).sqrt(), -cosine, 0.0);
            sample(&scene, &scene.lights[0].kind, p).map_or(0.0, |sample| sample.radiance.x)
        };
        let linear = (0.7f32.acos() - 0.8f32.acos()) / (0.7f32.acos() - 0.9f32.acos());
        for (falloff, middle) in
            [(SpotFalloff::SquaredCosine, 0.25), (SpotFalloff::SmoothCosine, 0.5), (SpotFalloff::LinearAngle, linear)]
        {
            assert!((at(falloff, 0.95) - 1.0).abs() < 1e-5 && at(falloff, 0.6) == 0.0);
            assert!((at(falloff, 0.8) - middle).abs() < 1e-4, "{falloff:?}");
        }
    }
}
