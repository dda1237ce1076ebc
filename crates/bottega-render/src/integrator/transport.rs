//! The terms that all integrators share: weights of light that is found in several ways, and the search for lights.

use bottega_kernels::Ray;
use bottega_scene::Spectrum;

use crate::{
    interaction::{Interaction, emitted, emitted_by_sphere},
    lights::LightSample,
    surfaces::Surfaces,
};

/// Greatest probability with which a path survives Russian roulette.
pub const ROULETTE_SURVIVAL_MAX: f32 = 0.95;
/// How far from its target a shadow ray ends, as a share of its length.
pub const SHADOW_MARGIN: f32 = 1e-4;
/// Growth of the beam after a scattering that spreads over one steradian.
pub const SCATTERED_SPREAD: f32 = 0.05;

/// Russian roulette: a path goes on with the square root of what it still carries as its probability, and carries as much
/// more. With that part itself, error times vertices is up to an eighth larger (`bench/runs/2026-11-21-paths.txt`).
///
/// - `scale`: by how much the throughput is smaller than what surfaces left of the light.
/// - `is_sure`: whether only paths end that carry nothing.
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

/// What the surface that was hit emits at a point, on whichever side.
#[inline(always)]
pub(super) fn emitted_at(surfaces: &Surfaces, point: &Interaction) -> Spectrum {
    let (scene, hit) = (&**surfaces.scene(), &point.hit);
    match hit.sphere() {
        Some(sphere) => emitted_by_sphere(scene, &scene.spheres[sphere as usize], point.ng, 0.0),
        None => emitted(scene, hit.instance, hit.primitive, (hit.u, hit.v), 0.0),
    }
}

/// The ray that asks whether a light is seen.
#[inline(always)]
pub(crate) fn shadow_ray(point: &Interaction, light: &LightSample) -> Ray {
    let origin = point.ray_origin(light.wi);
    if light.distance.is_infinite() {
        return Ray::new(origin, light.wi);
    }
    // Aim at the light's point itself: from the shifted origin it lies in a slightly different direction.
    let target = point.p_outside + light.wi * light.distance;
    Ray { origin, t_min: 0.0, direction: target - origin, t_max: 1.0 - SHADOW_MARGIN }
}

/// Weight of the strategy with density `chosen` against the one with density `other` (Veach 1997, eq. 9.13, β = 2).
#[inline(always)]
pub(in crate::integrator) fn power_heuristic(chosen: f32, other: f32) -> f32 {
    // By the ratio, so that squares of large densities do not overflow.
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
