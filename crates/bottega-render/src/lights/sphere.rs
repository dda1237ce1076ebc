//! Emitting spheres, sampled uniformly in the solid angle that they subtend.
//!
//! Parameters: centre, radius, radiance in W/(sr m²) per channel, a texture, the cone of a spot or the profile of a lamp, which
//! is a factor by direction. Of a spot, the radiance falls off by the angle between the direction of light and the axis: full
//! within the inner angle, 0 outside the outer one. With `smooth_cosine`, a smoothstep of the cosine, and an inner angle by the
//! blend, this is the falloff of Blender's spots.
//!
//! Source: Shirley, Wang and Zimmerman 1996, *Monte Carlo Techniques for Direct Lighting Calculations*.

use std::f32::consts::PI;

use bottega_kernels::{Aabb, math};
use bottega_scene::{AlphaMode, Scene, Spectrum, Sphere, Visibility};
use glam::Vec3;

use super::{LightSample, NO_LIGHT, Profile, bounds::LightBounds};
use crate::{
    color::luminance,
    density::{AreaPdf, SolidAnglePdf},
    interaction::{emitted_by_sphere, opacity_of_sphere},
    sampling::{orthonormal_basis, uniform_sphere},
    surfaces::Surfaces,
};

/// Returns the bounds of the sphere's light, for the light tree.
pub(super) fn bounds(scene: &Scene, sphere: &Sphere) -> LightBounds {
    const STEPS: u32 = 8;
    let material = &scene.materials[sphere.material as usize];
    let mean = if material.emission.texture.is_some() {
        let normals = (0..STEPS * STEPS).map(|i| {
            uniform_sphere([((i % STEPS) as f32 + 0.5) / STEPS as f32, ((i / STEPS) as f32 + 0.5) / STEPS as f32])
        });
        let footprint = 1.0 / STEPS as f32;
        normals.map(|n| emitted_by_sphere(scene, sphere, n, footprint)).sum::<Spectrum>() / (STEPS * STEPS) as f32
    } else {
        material.emission.factor
    };
    let disk = PI * sphere.radius * sphere.radius;
    Profile::new(&material.emission_profile).bounds(
        scene,
        LightBounds {
            bounds: Aabb::around(sphere.center, sphere.radius),
            ..LightBounds::point(sphere.center, disk * luminance(mean).max(0.0))
        },
    )
}

/// The cone of directions that a sphere covers, seen from outside.
struct VisibleCone {
    axis: Vec3,
    distance: f32,
    /// 1 − cos of the half-angle, without cancellation.
    one_minus_cos: f32,
}

impl VisibleCone {
    /// Returns the cone; `None` for a point at or below the sphere's surface.
    fn new(sphere: &Sphere, from: Vec3) -> Option<Self> {
        let to_center = sphere.center - from;
        let distance = to_center.length();
        let sine = sphere.radius / distance;
        let sine_squared = sine * sine;
        // Just above the surface, where the cone is almost a half space, single precision fails
        (distance > sphere.radius && sine_squared < 0.9999).then(|| Self {
            axis: to_center / distance,
            distance,
            one_minus_cos: sine_squared / (1.0 + (1.0 - sine_squared).sqrt()),
        })
    }

    fn pdf(&self) -> SolidAnglePdf {
        SolidAnglePdf::uniform(2.0 * PI * self.one_minus_cos)
    }
}

/// Samples a point on the sphere for the point `from`. `None`: no light arrives from there.
pub(super) fn sample(surfaces: &Surfaces, sphere: &Sphere, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
    let scene = &**surfaces.scene();
    let (wi, distance, pdf) = match VisibleCone::new(sphere, from) {
        Some(cone) => {
            let (direction, distance) = sample_cone(&cone, sphere.radius, u);
            (direction, distance, cone.pdf())
        }
        None => {
            let n = uniform_sphere(u);
            let to_light = sphere.center + sphere.radius * n - from;
            let distance = to_light.length();
            if distance <= 0.0 {
                return None;
            }
            let wi = to_light / distance;
            (wi, distance, pdf_by_area(sphere, wi, distance, n)?)
        }
    };
    let n = (from + distance * wi - sphere.center).normalize_or_zero();
    let (material, known) = surfaces.material(sphere.material);
    if !material.emission_sides.has(wi.dot(n) < 0.0) {
        return None;
    }
    let mut radiance = radiance_at(scene, sphere, n);
    if known.profile != Profile::Diffuse {
        radiance *= known.profile.factor(scene, -wi, wi.dot(n));
    }
    // Rays do not hit surfaces that are absent, so BSDF sampling cannot find this light
    let is_delta = material.alpha_mode == AlphaMode::Absent;
    let (light, sun, visibility) = (NO_LIGHT, NO_LIGHT, Visibility::ALL);
    Some(LightSample { wi, distance, radiance, pdf, is_delta, light, sun, pmf: 1.0, visibility })
}

/// Returns the radiance emitted at outward normal `n`, times the opacity there.
pub(super) fn radiance_at(scene: &Scene, sphere: &Sphere, n: Vec3) -> Spectrum {
    let radiance = emitted_by_sphere(scene, sphere, n, 0.0);
    let dims = scene.materials[sphere.material as usize].dims_emission();
    if dims { radiance * opacity_of_sphere(scene, sphere, n) } else { radiance }
}

/// Draws a direction, uniform over the cone; returns it with the distance to the sphere.
fn sample_cone(cone: &VisibleCone, radius: f32, u: [f32; 2]) -> (Vec3, f32) {
    let one_minus_cos = u[0] * cone.one_minus_cos;
    let sine_squared = one_minus_cos * (2.0 - one_minus_cos);
    let (sin_phi, cos_phi) = math::sin_cos_of_turns(u[1]);
    let (s, t) = orthonormal_basis(cone.axis);
    let sine = sine_squared.sqrt();
    let wi = (s * (sine * cos_phi) + t * (sine * sin_phi) + cone.axis * (1.0 - one_minus_cos)).normalize();
    let half_chord = (radius * radius - cone.distance * cone.distance * sine_squared).max(0.0).sqrt();
    (wi, cone.distance * (1.0 - one_minus_cos) - half_chord)
}

/// Returns the density of the direction `wi` to a point that is drawn uniformly by area, `distance` away.
fn pdf_by_area(sphere: &Sphere, wi: Vec3, distance: f32, n: Vec3) -> Option<SolidAnglePdf> {
    let cosine = wi.dot(n).abs();
    let by_area = AreaPdf::uniform(cosine * 4.0 * PI * sphere.radius * sphere.radius);
    let pdf = by_area.per_solid_angle(distance * distance);
    (cosine > 0.0 && pdf.is_finite()).then_some(pdf)
}

/// Returns the density with which [`sample`] draws the direction from `from` to the point `p`.
pub(super) fn pdf(sphere: &Sphere, from: Vec3, p: Vec3) -> SolidAnglePdf {
    if let Some(cone) = VisibleCone::new(sphere, from) {
        return cone.pdf();
    }
    let to_light = p - from;
    let distance = to_light.length();
    if distance <= 0.0 {
        return SolidAnglePdf::ZERO;
    }
    let n = (p - sphere.center).normalize_or_zero();
    pdf_by_area(sphere, to_light / distance, distance, n).unwrap_or(SolidAnglePdf::ZERO)
}

#[cfg(test)]
mod tests {
    use bottega_scene::Sides;
    use glam::Quat;

    use super::*;
    use bottega_scene::Material;
    use proptest::prelude::*;

    fn scene(radius: f32, double_sided: bool) -> Surfaces {
        let emission_sides = if double_sided { Sides::Both } else { Sides::Front };
        let material = Material { emission: Vec3::splat(3.0).into(), emission_sides, ..Material::default() };
        let scene = Scene {
            spheres: vec![Sphere {
                center: Vec3::new(1.0, 2.0, 3.0),
                radius,
                world_from_object: Quat::IDENTITY,
                material: 0,
                visibility: Visibility::ALL,
                motion: Vec::new(),
            }],
            materials: vec![material],
            ..Scene::default()
        };
        Surfaces::new(std::sync::Arc::new(scene))
    }

    /// Samples the only sphere of a scene.
    fn sample(surfaces: &Surfaces, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
        super::sample(surfaces, &surfaces.scene().spheres[0], from, u)
    }

    proptest! {
        #[test]
        fn every_sample_lies_on_the_sphere_and_has_the_density_stated(
            distance in 1e-3_f32..1e4, azimuth in 0.0_f32..6.2, u in 0.0_f32..1.0, v in 0.0_f32..1.0,
        ) {
            let scene = scene(0.5, true);
            let from = Vec3::new(1.0, 2.0, 3.0) + distance * Vec3::new(azimuth.cos(), 0.6, azimuth.sin());
            if let Some(sample) = sample(&scene, from, [u, v]) {
                let p = from + sample.wi * sample.distance;
                prop_assert!(((p - Vec3::new(1.0, 2.0, 3.0)).length() - 0.5).abs() < 1e-3 + 1e-5 * distance);
                let again = pdf(&scene.scene().spheres[0], from, p);
                prop_assert!((again / sample.pdf - 1.0).abs() < 2e-2, "{again:?} {:?}", sample.pdf);
            }
        }
    }

    #[test]
    fn irradiance_below_a_sphere_is_that_of_the_formula_however_near_or_far() {
        // E = π L sin²θ for a sphere straight above, with sin θ = radius / distance.
        for distance in [1.01, 1.5, 3.0, 1000.0] {
            let scene = scene(1.0, false);
            let from = Vec3::new(1.0, 2.0 - distance, 3.0);
            let steps = 64;
            let mut irradiance = 0.0;
            for i in 0..steps * steps {
                let u = [((i % steps) as f32 + 0.5) / steps as f32, ((i / steps) as f32 + 0.5) / steps as f32];
                if let Some(sample) = sample(&scene, from, u) {
                    irradiance +=
                        sample.radiance.x * sample.wi.y.max(0.0) / sample.pdf.per_sr() / (steps * steps) as f32;
                }
            }
            let exact = PI * 3.0 / (distance * distance);
            assert!((irradiance / exact - 1.0).abs() < 2e-3, "{distance}: {irradiance} {exact}");
        }
    }

    #[test]
    fn from_inside_only_a_double_sided_sphere_is_seen() {
        let inside = Vec3::new(1.2, 2.0, 3.0);
        assert!(sample(&scene(1.0, false), inside, [0.3, 0.4]).is_none());
        let scene = scene(1.0, true);
        let steps = 100;
        let sum: f32 = (0..steps * steps)
            .map(|i| [((i % steps) as f32 + 0.5) / steps as f32, ((i / steps) as f32 + 0.5) / steps as f32])
            .filter_map(|u| sample(&scene, inside, u))
            .map(|sample| 1.0 / sample.pdf.per_sr())
            .sum();
        assert!((sum / (steps * steps) as f32 - 4.0 * PI).abs() < 0.02);
    }
}
