//! Lights without extent.

use std::f32::consts::PI;

use bottega_scene::{LightKind, Spectrum};
use glam::Vec3;

use super::LightSample;
use crate::luminance;

/// Luminous power, for the choice of a light; `disk` is the area of the scene's cross-section.
pub(super) fn power(light: &LightKind, disk: f32) -> f32 {
    match *light {
        LightKind::Point { intensity, .. } => 4.0 * PI * luminance(intensity),
        LightKind::Spot { intensity, cos_inner, cos_outer, .. } => {
            2.0 * PI * (1.0 - 0.5 * (cos_inner + cos_outer)) * luminance(intensity)
        }
        LightKind::Directional { irradiance, .. } => disk * luminance(irradiance),
    }
}

/// The light at `p`. `None` where it shines not.
pub(super) fn sample(light: &LightKind, p: Vec3) -> Option<LightSample> {
    match *light {
        LightKind::Point { position, intensity } => from_point(position, p, |_| intensity),
        LightKind::Spot { position, direction, intensity, cos_inner, cos_outer } => from_point(position, p, |wi| {
            let cosine = -wi.dot(direction);
            let ramp = ((cosine - cos_outer) / (cos_inner - cos_outer).max(1e-6)).clamp(0.0, 1.0);
            intensity * (ramp * ramp)
        }),
        LightKind::Directional { direction, irradiance } => Some(LightSample {
            wi: -direction,
            distance: f32::INFINITY,
            radiance: irradiance,
            pdf: 1.0,
            is_delta: true,
        }),
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
    (radiance != Spectrum::ZERO).then_some(LightSample { wi, distance, radiance, pdf: 1.0, is_delta: true })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_light_falls_off_with_the_square_of_the_distance() {
        let light = LightKind::Point { position: Vec3::new(0.0, 4.0, 0.0), intensity: Vec3::splat(8.0) };
        let sample = sample(&light, Vec3::new(0.0, 2.0, 0.0)).unwrap();
        assert_eq!((sample.wi, sample.distance, sample.radiance), (Vec3::Y, 2.0, Vec3::splat(2.0)));
        assert!(super::sample(&light, Vec3::new(0.0, 4.0, 0.0)).is_none());
    }

    #[test]
    fn a_spot_fades_between_its_angles_as_the_square_of_the_ramp() {
        let light = LightKind::Spot {
            position: Vec3::ZERO,
            direction: Vec3::NEG_Y,
            intensity: Vec3::ONE,
            cos_inner: 0.9,
            cos_outer: 0.7,
        };
        let at = |cosine: f32| {
            let p = Vec3::new((1.0 - cosine * cosine).sqrt(), -cosine, 0.0);
            sample(&light, p).map_or(0.0, |sample| sample.radiance.x)
        };
        assert!((at(0.95) - 1.0).abs() < 1e-5 && (at(0.8) - 0.25).abs() < 1e-4 && at(0.6) == 0.0);
    }
}
