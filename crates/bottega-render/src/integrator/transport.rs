//! Terms that all integrators share: MIS weights, Russian roulette, shadow rays, ray cones.

use bottega_kernels::Ray;
use bottega_scene::Spectrum;

use crate::{
    camera::RayCone,
    density::SolidAnglePdf,
    interaction::{Interaction, emitted, emitted_by_sphere},
    lights::{LightSample, Profile},
    settings::DirectLight,
    surfaces::Surfaces,
};

/// Greatest probability with which a path survives Russian roulette.
pub const ROULETTE_SURVIVAL_MAX: f32 = 0.95;
/// Gap between a shadow ray's end and its target, as a share of its length.
pub const SHADOW_MARGIN: f32 = 1e-4;
/// Growth of the ray cone after scattering into one steradian, as a ratio of width to distance.
pub const SCATTERED_SPREAD: f32 = 0.05;

/// Applies Russian roulette: the path survives with the square root of the light that it still carries, and its
/// throughput is divided by that. With the carried light itself as probability, error times vertices is up to an eighth
/// larger (`bench/runs/2026-11-21-paths.txt`). Returns `true` if the path survives.
///
/// - `scale`: factor by which the throughput is smaller than the light that surfaces passed on.
/// - `is_sure`: `true`: only paths that carry nothing end.
/// - `u`: uniform random number.
#[inline(always)]
pub(super) fn survives(throughput: &mut Spectrum, scale: f32, is_sure: bool, u: f32) -> bool {
    let carried = throughput.max_element() * scale;
    if carried <= 0.0 || carried.is_nan() {
        return false;
    }
    if is_sure {
        return true;
    }
    let survival = carried.sqrt().min(ROULETTE_SURVIVAL_MAX);
    *throughput /= survival;
    u < survival
}

/// Returns the emission of the surface at a point and a time, on the side that was hit.
#[inline(always)]
pub(super) fn emitted_at(surfaces: &Surfaces, point: &Interaction, time: f32) -> Spectrum {
    let (scene, hit) = (&**surfaces.scene(), &point.hit);
    let radiance = match hit.sphere() {
        Some(index) => {
            let moved = surfaces.moved_sphere(index, time);
            let sphere = moved.as_ref().unwrap_or(&scene.spheres[index as usize]);
            emitted_by_sphere(scene, sphere, point.ng, 0.0)
        }
        None => emitted(scene, hit.instance, hit.primitive, (hit.u, hit.v), 0.0),
    };
    match surfaces.material(point.material).1.profile {
        Profile::Diffuse => radiance,
        profile => radiance * profile.factor(scene, point.wo, point.wo.dot(point.ng)),
    }
}

/// Returns the shadow ray from a point to a light sample.
#[inline(always)]
pub(crate) fn shadow_ray(point: &Interaction, light: &LightSample) -> Ray {
    let origin = point.ray_origin(light.wi);
    if light.distance.is_infinite() {
        return Ray::new(origin, light.wi);
    }
    // Aim at the sampled point itself: its direction from the shifted origin differs slightly
    let target = point.p_outside + light.wi * light.distance;
    Ray { origin, t_min: 0.0, direction: target - origin, t_max: 1.0 - SHADOW_MARGIN }
}

/// Returns the MIS weight of the strategy with density `chosen` against those with densities `others` (Veach 1997,
/// eq. 9.13, β = 2).
#[inline(always)]
pub(in crate::integrator) fn power_heuristic<const N: usize>(chosen: SolidAnglePdf, others: [SolidAnglePdf; N]) -> f32 {
    // Use the ratios: squares of large densities overflow
    let mut sum = 1.0;
    for other in others {
        let ratio = other / chosen;
        sum += ratio * ratio;
    }
    1.0 / sum
}

/// Returns the MIS weight of an emitter that a path hit.
///
/// - `strategy`: the picture's strategy for direct light.
/// - `pdf`: density of the path's direction; `None`: no other strategy finds the light.
/// - `light_pdfs`: returns the densities with which the other strategies find it; called only if they count.
#[inline(always)]
pub(in crate::integrator) fn weight_of_hit<const N: usize>(
    strategy: DirectLight,
    pdf: Option<SolidAnglePdf>,
    light_pdfs: impl FnOnce() -> [SolidAnglePdf; N],
) -> f32 {
    let Some(pdf) = pdf else { return 1.0 };
    match strategy {
        DirectLight::LightSampling => 0.0,
        DirectLight::BsdfSampling => 1.0,
        DirectLight::Combined => power_heuristic(pdf, light_pdfs()),
    }
}

/// Widens a ray cone by the spread of the lobe that its direction was drawn from.
///
/// - `pdf`: density of the direction, in sr⁻¹; infinite for specular lobes, which keep the cone.
#[inline(always)]
pub(in crate::integrator) fn widen(cone: &mut RayCone, pdf: f32) {
    cone.spread = cone.spread.max(SCATTERED_SPREAD / pdf.sqrt());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_two_strategies_add_up_to_one() {
        let weight = |a, b| power_heuristic(SolidAnglePdf::new(a), [SolidAnglePdf::new(b)]);
        for (a, b) in [(1.0, 2.0), (1e30, 1e-3), (1e-20, 1e20), (3.0, 0.0)] {
            assert!((weight(a, b) + weight(b, a) - 1.0).abs() < 1e-6, "{a} {b}");
        }
        assert_eq!(weight(1.0, f32::INFINITY), 0.0);
    }
}
