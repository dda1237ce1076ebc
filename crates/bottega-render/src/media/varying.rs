//! Media that vary in space, by delta tracking: a ray samples collisions with a medium of constant bounding density, and
//! a random number decides whether each collision is real.
//!
//! Sources: Woodcock et al. 1965, *Techniques used in the GEM code for Monte Carlo neutronics calculations* (delta
//! tracking); Novák, Selle and Jarosz 2014, *Residual Ratio Tracking for Estimating Attenuation in Participating Media*;
//! Kutz, Habel, Li and Novák 2017, *Spectral and Decomposition Tracking for Rendering Heterogeneous Volumes*, section 4
//! (the kind of a collision is chosen by the throughput of all channels).

use bottega_kernels::math;
use bottega_scene::{Coefficients, Medium, Spectrum, Variation};
use glam::{Affine3A, Vec3};

use super::Phase;

/// Number of grid cells per majorant, along an axis.
const CELLS_A_BOUND: u32 = 8;
/// Largest number of majorants along an axis.
const BOUNDS_MAX: u32 = 64;
/// Largest number of collisions on a segment. It is reached only where a majorant is far above most of the medium; the
/// remaining light is lost.
const COLLISIONS_MAX: u32 = 1 << 16;
/// Least number of tentative collisions, in the mean, across a piece of a medium that emits.
const COLLISIONS_WHERE_LIT: f32 = 2.0;
/// Transmittance below which Russian roulette may terminate the estimate.
const TRANSMITTANCE_MIN: f32 = 0.1;

/// A coarse grid of majorants: upper bounds of the extinction of a medium that varies in space, and enough to find its light.
#[derive(Clone, Debug)]
pub(crate) struct Majorants {
    /// Number of majorants along each axis.
    size: [u32; 3],
    /// Majorants per unit of length; x varies fastest.
    values: Vec<f32>,
}

/// A medium that varies in space, prepared for rendering.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Varying<'a> {
    medium: &'a Medium,
    variation: &'a Variation,
    majorants: &'a Majorants,
    /// Henyey-Greenstein phase function.
    pub(crate) phase: Phase,
}

/// A segment of a path, in world space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// Start of the segment.
    pub(crate) origin: Vec3,
    /// Direction, unit length.
    pub(crate) direction: Vec3,
    /// Length; may be infinite.
    pub(crate) length: f32,
}

/// A scattering event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Collision {
    /// Distance along the segment.
    pub(crate) distance: f32,
    /// Albedo σ_s / (σ_a + σ_s) at that point.
    pub(crate) albedo: Spectrum,
}

/// Throughput and radiance of a path through a medium.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CarriedLight {
    /// Throughput of the path per channel.
    pub(crate) throughput: Spectrum,
    /// Radiance collected so far, per channel.
    pub(crate) radiance: Spectrum,
}

impl Majorants {
    /// Computes the majorants over the variation's grid.
    pub(crate) fn new(medium: &Medium, variation: &Variation) -> Self {
        let size = variation.resolution().map(|side| side.div_ceil(CELLS_A_BOUND).clamp(1, BOUNDS_MAX));
        let corner =
            |x: u32, y: u32, z: u32| Vec3::new(x as f32, y as f32, z as f32) / glam::UVec3::from_array(size).as_vec3();
        // Where the medium emits, tentative collisions are drawn even if there is little else to collide with
        let world_from_grid = variation.grid_from_world.inverse();
        let sides = [0, 1, 2].map(|axis| world_from_grid.matrix3.col(axis).length() / size[axis] as f32);
        let emission_rate = COLLISIONS_WHERE_LIT / sides.into_iter().fold(0.0, f32::max).max(f32::MIN_POSITIVE);
        let mut values = Vec::with_capacity(size.iter().map(|&side| side as usize).product());
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let corners = [corner(x, y, z), corner(x + 1, y + 1, z + 1)];
                    let extinction = medium.extinction_max(variation, corners);
                    let is_lit = medium.may_emit(variation, corners);
                    values.push(if is_lit { extinction.max(emission_rate) } else { extinction });
                }
            }
        }
        Self { size, values }
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.values)
    }

    /// Traverses the cells along a line through the unit cube and calls `visit` with start, end and majorant of each
    /// piece whose majorant is above 0, until it returns false.
    fn visit(&self, line: &Line, grid_from_world: &Affine3A, mut visit: impl FnMut(f32, f32, f32) -> bool) {
        let size = Vec3::from_array(self.size.map(|side| side as f32));
        let origin = grid_from_world.transform_point3(line.origin) * size;
        let direction = grid_from_world.transform_vector3(line.direction) * size;
        let inverse = 1.0 / direction;
        // Clip the line to the grid; along an axis without movement it is either always or never inside
        let (a, b) = (-origin * inverse, (size - origin) * inverse);
        let (mut start, mut end) = (0.0_f32, line.length);
        for axis in 0..3 {
            if direction[axis] == 0.0 {
                if !(origin[axis] >= 0.0 && origin[axis] <= size[axis]) {
                    return;
                }
            } else {
                start = start.max(a[axis].min(b[axis]));
                end = end.min(a[axis].max(b[axis]));
            }
        }
        if start >= end {
            return;
        }
        let first = origin + direction * start;
        let mut cell = [0, 1, 2].map(|axis| (first[axis].floor() as i32).clamp(0, self.size[axis] as i32 - 1));
        loop {
            // Find where the line leaves the cell, and through which face
            let leave = [0, 1, 2].map(|axis| {
                let face = cell[axis] + i32::from(direction[axis] > 0.0);
                if direction[axis] == 0.0 { f32::INFINITY } else { (face as f32 - origin[axis]) * inverse[axis] }
            });
            let axis = if leave[0] <= leave[1] && leave[0] <= leave[2] {
                0
            } else if leave[1] <= leave[2] {
                1
            } else {
                2
            };
            let piece_end = leave[axis].clamp(start, end);
            let [x, y, z] = cell.map(|index| index as usize);
            let [width, height, _] = self.size.map(|side| side as usize);
            let bound = self.values[(z * height + y) * width + x];
            if piece_end > start && bound > 0.0 && !visit(start, piece_end, bound) {
                return;
            }
            start = piece_end;
            cell[axis] += if direction[axis] > 0.0 { 1 } else { -1 };
            // Each step leaves a cell for good, which bounds the number of steps
            if leave[axis] >= end || cell[axis] < 0 || cell[axis] >= self.size[axis] as i32 {
                return;
            }
        }
    }
}

impl<'a> Varying<'a> {
    pub(crate) fn new(medium: &'a Medium, variation: &'a Variation, majorants: &'a Majorants) -> Self {
        Self { medium, variation, majorants, phase: Phase { g: medium.g } }
    }

    /// Follows a path along a line to its next scattering event; `None`: there is none. Updates `carried` by absorption
    /// and emission.
    ///
    /// - `first`: two random numbers for the first collision; `number` returns those for all others.
    pub(crate) fn track(
        &self,
        line: &Line,
        carried: &mut CarriedLight,
        first: [f32; 2],
        mut number: impl FnMut() -> f32,
    ) -> Option<Collision> {
        let mut scattered = None;
        let mut first = Some(first);
        let mut next = || first.take().unwrap_or_else(|| [number(), number()]);
        let [mut u_kind, u] = next();
        let mut collisions = 0;
        self.for_each_collision(line, u, |distance, bound, here| {
            // Add emission
            carried.radiance += carried.throughput * here.emission / bound;
            // Choose a real or null collision by the throughput of all channels
            let nothing = (Spectrum::splat(bound) - here.absorption - here.scattering).max(Spectrum::ZERO);
            let (scatters, passes) = (carried.throughput.dot(here.scattering), carried.throughput.dot(nothing));
            let chance = scatters / (scatters + passes);
            collisions += 1;
            if u_kind < chance {
                carried.throughput *= here.scattering / (bound * chance);
                let extinction = (here.absorption + here.scattering).max(Spectrum::splat(f32::MIN_POSITIVE));
                scattered = Some(Collision { distance, albedo: here.scattering / extinction });
                return None;
            }
            // Stop if all light is absorbed
            if passes <= 0.0 || collisions == COLLISIONS_MAX {
                carried.throughput = Spectrum::ZERO;
                return None;
            }
            carried.throughput *= nothing / (bound * (1.0 - chance));
            let [kind, u] = next();
            u_kind = kind;
            Some(u)
        });
        scattered
    }

    /// Estimates the transmittance along a line, by ratio tracking.
    pub(crate) fn transmittance(&self, line: &Line, mut number: impl FnMut() -> f32) -> Spectrum {
        let mut left = Spectrum::ONE;
        let mut collisions = 0;
        self.for_each_collision(line, number(), |_, bound, here| {
            left *= (Spectrum::ONE - (here.absorption + here.scattering) / bound).max(Spectrum::ZERO);
            collisions += 1;
            // Terminate with Russian roulette
            let most = left.max_element();
            if most < TRANSMITTANCE_MIN {
                let survives = most > 0.0 && number() < 0.5 && collisions < COLLISIONS_MAX;
                if !survives {
                    left = Spectrum::ZERO;
                    return None;
                }
                left *= 2.0;
            }
            Some(number())
        });
        left
    }

    /// Samples collisions along a line, with the majorants as extinction.
    ///
    /// - `u`: random number for the distance to the first collision.
    /// - `collide`: receives the distance along the line, the majorant and the coefficients there. Returns the random
    ///   number for the distance to the next collision; `None`: stops.
    #[inline(always)]
    fn for_each_collision(&self, line: &Line, u: f32, mut collide: impl FnMut(f32, f32, &Coefficients) -> Option<f32>) {
        let mut depth = -math::ln(1.0 - u);
        self.majorants.visit(line, &self.variation.grid_from_world, |start, end, bound| {
            let mut t = start;
            loop {
                let step = depth / bound;
                if t + step >= end {
                    depth -= (end - t) * bound;
                    return true;
                }
                t += step;
                let Some(u) = collide(t, bound, &self.at(line, t)) else { return false };
                depth = -math::ln(1.0 - u);
            }
        });
    }

    fn at(&self, line: &Line, distance: f32) -> Coefficients {
        let p = self.variation.grid_from_world.transform_point3(line.origin + line.direction * distance);
        // Keep rounding from leaving the grid
        self.medium.coefficients(self.variation, p.clamp(Vec3::ZERO, Vec3::ONE))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bottega_scene::{Blackbody, Blend, Density, EmissionVariation, Grid};

    use super::*;
    use crate::sampler::PixelSampler;

    /// A density that increases along x, from 0 to twice the mean, in a box from −1 to 1.
    fn wedge() -> Medium {
        let values = (0..20).map(|i| (i % 20) as f32 / 9.5).collect();
        let density = Density::Both(Grid::new([20, 1, 1], values, Blend::Nearest).unwrap());
        let grid_from_world =
            Affine3A::from_scale_rotation_translation(Vec3::splat(0.5), glam::Quat::IDENTITY, Vec3::splat(0.5));
        Medium {
            scattering: Spectrum::new(0.5, 1.5, 0.0),
            emission: Spectrum::new(1.0, 0.0, 2.0),
            variation: Some(Arc::new(Variation { density, emission: None, grid_from_world })),
            ..Medium::absorbing(Spectrum::new(0.25, 0.0, 1.0))
        }
    }

    fn lines() -> [(Line, f32); 4] {
        let line = |origin: Vec3, direction: Vec3, length| Line { origin, direction, length };
        // Lines with the integral of the density along each
        [
            (line(Vec3::new(-3.0, 0.1, 0.2), Vec3::X, f32::INFINITY), 2.0),
            (line(Vec3::new(3.0, -0.4, 0.2), Vec3::NEG_X, 3.0), 14.5 / 9.5),
            (line(Vec3::new(0.85, 0.0, -2.0), Vec3::Z, 100.0), 2.0 * 18.0 / 9.5),
            (line(Vec3::new(0.0, 5.0, 0.0), Vec3::X, 100.0), 0.0),
        ]
    }

    #[test]
    fn transmittance_follows_beer_and_lambert() {
        let medium = wedge();
        let variation = medium.variation.as_ref().unwrap();
        let majorants = Majorants::new(&medium, variation);
        assert_eq!(majorants.size, [3, 1, 1]);
        let varying = Varying::new(&medium, variation, &majorants);
        for (line, integral) in lines() {
            const COUNT: u32 = 40_000;
            let (mut through, mut passed, mut emitted) = (Spectrum::ZERO, Spectrum::ZERO, Spectrum::ZERO);
            for i in 0..COUNT {
                let sampler = PixelSampler::new(1, i, 0, 0);
                let mut count = 0;
                let mut number = || {
                    count += 1;
                    sampler.hashed(count)
                };
                through += varying.transmittance(&line, &mut number) / COUNT as f32;
                let mut carried = CarriedLight { throughput: Spectrum::ONE, radiance: Spectrum::ZERO };
                let first = [number(), number()];
                if varying.track(&line, &mut carried, first, &mut number).is_none() {
                    passed += carried.throughput / COUNT as f32;
                }
                emitted += carried.radiance / COUNT as f32;
            }
            let extinction = medium.absorption + medium.scattering;
            let exact = extinction.to_array().map(|sigma| (-sigma * integral).exp());
            let exact = Spectrum::from_array(exact);
            assert!((through - exact).abs().max_element() < 0.01, "{line:?}: {through} {exact}");
            assert!((passed - exact).abs().max_element() < 0.02, "{line:?}: {passed} {exact}");
            // In a channel without scattering, the emitted radiance is ∫ j e^(−τ) = j/σ (1 − e^(−τ))
            let sent = medium.emission.z / extinction.z * (1.0 - exact.z);
            assert!((emitted.z - sent).abs() < 0.03 * sent.max(0.1), "{line:?}: {emitted} {sent}");
        }
    }

    #[test]
    fn a_medium_that_only_emits_is_seen() {
        let temperatures = Grid::new([20, 1, 1], vec![1500.0; 20], Blend::Nearest).unwrap();
        let blackbody = Blackbody::of_power(temperatures, 2.0, 0.0);
        let radiance = blackbody.color(3000.0);
        let Medium { emission, variation, .. } = wedge();
        let empty = Density::Both(Grid::new([20, 1, 1], vec![0.0; 20], Blend::Nearest).unwrap());
        let grid_from_world = variation.unwrap().grid_from_world;
        let variation =
            Variation { density: empty, emission: Some(EmissionVariation::Blackbody(blackbody)), grid_from_world };
        let medium = Medium { emission, ..Medium::absorbing(Spectrum::ONE) };
        let majorants = Majorants::new(&medium, &variation);
        let varying = Varying::new(&medium, &variation, &majorants);
        let line = Line { origin: Vec3::new(-3.0, 0.1, 0.2), direction: Vec3::X, length: f32::INFINITY };
        let mut emitted = Spectrum::ZERO;
        const COUNT: u32 = 40_000;
        for i in 0..COUNT {
            let sampler = PixelSampler::new(3, i, 0, 0);
            let mut count = 0;
            let mut number = || {
                count += 1;
                sampler.hashed(count)
            };
            let mut carried = CarriedLight { throughput: Spectrum::ONE, radiance: Spectrum::ZERO };
            let first = [number(), number()];
            assert!(varying.track(&line, &mut carried, first, &mut number).is_none());
            assert_eq!(carried.throughput, Spectrum::ONE);
            emitted += carried.radiance / COUNT as f32;
        }
        let exact = 2.0 * medium.emission * radiance;
        assert!(((emitted - exact) / exact.max_element()).abs().max_element() < 0.015, "{emitted} {exact}");
    }

    #[test]
    fn pieces_cover_the_line_within_the_grid_and_no_more() {
        let majorants = Majorants { size: [4, 3, 5], values: (0..60).map(|i| (i + 1) as f32).collect() };
        for i in 0..500 {
            let sampler = PixelSampler::new(5, i, 0, 0);
            let mut count = 0;
            let mut number = || {
                count += 1;
                sampler.hashed(count)
            };
            let mut point = || Vec3::new(number(), number(), number()) * 3.0 - 1.0;
            let (origin, target) = (point(), point());
            let Some(mut direction) = (target - origin).try_normalize() else { continue };
            if i % 7 == 0 {
                direction = Vec3::AXES[i as usize % 3];
            }
            let line = Line { origin, direction, length: if i % 2 == 0 { f32::INFINITY } else { 1.5 } };
            let (mut last, mut covered) = (0.0_f32, 0.0);
            majorants.visit(&line, &Affine3A::IDENTITY, |start, end, bound| {
                assert!(start >= last && end > start && end <= line.length);
                let middle = (origin + direction * (0.5 * (start + end))) * Vec3::new(4.0, 3.0, 5.0);
                let cell = middle.floor().as_ivec3();
                if (middle - middle.round()).abs().min_element() > 1e-4 {
                    assert_eq!(bound, (cell.z * 12 + cell.y * 4 + cell.x + 1) as f32, "{line:?} {middle}");
                }
                (last, covered) = (end, covered + end - start);
                true
            });
            let steps = 2000;
            let reach = line.length.min(10.0);
            let inside = (0..steps)
                .map(|step| origin + direction * (reach * (step as f32 + 0.5) / steps as f32))
                .filter(|p| p.cmpge(Vec3::ZERO).all() && p.cmple(Vec3::ONE).all());
            let expected = inside.count() as f32 * reach / steps as f32;
            assert!((covered - expected).abs() < 0.012, "{line:?}: {covered} {expected}");
        }
    }
}
