//! Terms that all integrators share: MIS weights, Russian roulette, shadow rays.

use bottega_kernels::Ray;
use bottega_scene::Spectrum;

use crate::{
    interaction::{Interaction, emitted, emitted_by_sphere},
    lights::LightSample,
    surfaces::Surfaces,
};

/// Greatest survival probability of Russian roulette.
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

/// Returns the emission of the surface at a point, on the side that was hit.
#[inline(always)]
pub(super) fn emitted_at(surfaces: &Surfaces, point: &Interaction) -> Spectrum {
    let (scene, hit) = (&**surfaces.scene(), &point.hit);
    match hit.sphere() {
        Some(sphere) => emitted_by_sphere(scene, &scene.spheres[sphere as usize], point.ng, 0.0),
        None => emitted(scene, hit.instance, hit.primitive, (hit.u, hit.v), 0.0),
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

/// Returns the MIS weight of the strategy with density `chosen` against one with density `other` (Veach 1997, eq. 9.13,
/// β = 2).
#[inline(always)]
pub(in crate::integrator) fn power_heuristic(chosen: f32, other: f32) -> f32 {
    // Use the ratio: squares of large densities overflow
    let ratio = other / chosen;
    1.0 / (1.0 + ratio * ratio)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_two_strategies_add_up_to_one() {
        for (a, b) in [(1.0, 2.0), (1e30, 1e-3), (1e-20, 1e20), (3.0, 0.0)] {
            assert!((power_heuristic(a, b) + power_heuristic(b, a) - 1.0).abs() < 1e-6, "{a} {b}");
        }
        assert_eq!(power_heuristic(1.0, f32::INFINITY), 0.0);
    }
}
