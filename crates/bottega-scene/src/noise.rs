//! Perlin's noise, and the textures that pbrt makes of it.
//!
//! Source: Perlin 2002, *Improving Noise*, with the permutation published there; its gradients and the sums of octaves as in
//! Pharr, Jakob and Humphreys 2016, *Physically Based Rendering*, third edition, section 10.6.

use std::ops::{Add, Mul, Neg, Sub};

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// The octaves of a sum of noise: each has 1.99 times the frequency of the one before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Octaves {
    /// Number of octaves, at most [`OCTAVES_MAX`].
    pub count: u32,
    /// Amplitude of an octave over that of the one before.
    pub roughness: f32,
}

/// The maximum of [`Octaves::count`].
pub const OCTAVES_MAX: u32 = 64;

/// A number that varies in space by noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Noise {
    /// The sum of octaves of noise: fractional Brownian motion.
    Fbm(Octaves),
    /// The sum of the absolute values of octaves of noise (pbrt's `wrinkled`).
    Turbulence(Octaves),
    /// Waves on water, higher where a slowly varying wind is strong (pbrt's `windy`).
    Waves,
}

impl Noise {
    /// Returns the value at a point.
    ///
    /// - `resolved`: number of octaves that a lookup resolves; finer ones fade to their mean. Infinity: all.
    pub fn value(&self, p: Vec3, resolved: f32) -> f32 {
        self.at(p.to_array(), resolved)
    }

    /// Returns the gradient of [`value`](Self::value), with the same arguments.
    pub fn gradient(&self, p: Vec3, resolved: f32) -> Vec3 {
        self.at(Sloped::axes(p), resolved).slope
    }

    /// Returns the least and the greatest value, approximately.
    pub fn range(&self) -> [f32; 2] {
        match self {
            Self::Fbm(octaves) => [-octaves.most(), octaves.most()],
            Self::Turbulence(octaves) if octaves.roughness >= 0.0 => [0.0, octaves.most() + HIDDEN_MEAN],
            Self::Turbulence(octaves) => [-octaves.most() - HIDDEN_MEAN, octaves.most() + HIDDEN_MEAN],
            Self::Waves => {
                let most = WIND.most() * WAVES.most();
                [-most, most]
            }
        }
    }

    fn at<N: Number>(&self, p: [N; 3], resolved: f32) -> N {
        match self {
            Self::Fbm(octaves) => octaves.fbm(p, resolved),
            Self::Turbulence(octaves) => octaves.turbulence(p, resolved),
            Self::Waves => {
                // Of wind and waves, the wind is ten times as large: it resolves log₂ 10 more octaves
                let wind = WIND.fbm(p.map(|x| N::constant(0.1) * x), resolved + std::f32::consts::LOG2_10);
                wind.abs() * WAVES.fbm(p, resolved)
            }
        }
    }
}

/// Octaves of the wind of [`Noise::Waves`].
const WIND: Octaves = Octaves { count: 3, roughness: 0.5 };
/// Octaves of the waves of [`Noise::Waves`].
const WAVES: Octaves = Octaves { count: 6, roughness: 0.5 };
/// Mean absolute value of noise, which stands for octaves that are not resolved.
const HIDDEN_MEAN: f32 = 0.2;
/// Frequency of an octave over that of the one before.
const LACUNARITY: f32 = 1.99;

impl Octaves {
    /// Returns true if the roughness is finite, and the number at most [`OCTAVES_MAX`].
    pub(crate) fn is_sound(&self) -> bool {
        self.roughness.is_finite() && self.count <= OCTAVES_MAX
    }

    /// Returns the largest sum of octaves of amplitude 1.
    fn most(&self) -> f32 {
        let amplitude = |octave: u32| self.roughness.abs().powi(octave as i32);
        1.1 * (0..self.count.min(OCTAVES_MAX)).map(amplitude).sum::<f32>().clamp(1e-3, 1e12)
    }

    /// Returns the number of whole octaves that are resolved, and the weight of the next one.
    fn split(&self, resolved: f32) -> (u32, f32) {
        let resolved = resolved.clamp(0.0, self.count.min(OCTAVES_MAX) as f32);
        let whole = resolved.floor();
        let part = ((resolved - whole - 0.3) / 0.4).clamp(0.0, 1.0);
        (whole as u32, part * part * (3.0 - 2.0 * part))
    }

    /// Returns the sum of octaves at a point.
    pub(crate) fn fbm<N: Number>(&self, p: [N; 3], resolved: f32) -> N {
        let (whole, rest) = self.split(resolved);
        let (mut sum, mut frequency, mut amplitude) = (N::constant(0.0), 1.0, 1.0);
        for _ in 0..whole {
            sum = sum + N::constant(amplitude) * noise(p.map(|x| N::constant(frequency) * x));
            frequency *= LACUNARITY;
            amplitude *= self.roughness;
        }
        if rest > 0.0 {
            sum = sum + N::constant(amplitude * rest) * noise(p.map(|x| N::constant(frequency) * x));
        }
        sum
    }

    fn turbulence<N: Number>(&self, p: [N; 3], resolved: f32) -> N {
        let (whole, rest) = self.split(resolved);
        let (mut sum, mut frequency, mut amplitude) = (N::constant(0.0), 1.0, 1.0);
        for _ in 0..whole {
            sum = sum + N::constant(amplitude) * noise(p.map(|x| N::constant(frequency) * x)).abs();
            frequency *= LACUNARITY;
            amplitude *= self.roughness;
        }
        // Octaves that are not resolved have their mean; the one after the last is always hidden
        let mut hidden = amplitude * HIDDEN_MEAN * (1.0 - rest);
        if rest > 0.0 {
            let next = noise(p.map(|x| N::constant(frequency) * x)).abs();
            sum = sum + N::constant(amplitude * rest) * next;
        }
        for _ in whole..self.count.min(OCTAVES_MAX) {
            hidden += amplitude * HIDDEN_MEAN;
            amplitude *= self.roughness;
        }
        sum + N::constant(hidden)
    }

    /// Returns fractional Brownian motion at a point, and its gradient; `resolved` as for [`Noise::value`].
    pub fn fbm_and_gradient(&self, p: Vec3, resolved: f32) -> (f32, Vec3) {
        let sum = self.fbm(Sloped::axes(p), resolved);
        (sum.value, sum.slope)
    }
}

/// Returns true if a point of the plane lies within one of pbrt's dots: of radius 0.35, in about half of the unit cells,
/// moved within their cells.
pub fn is_within_dot(s: f32, t: f32) -> bool {
    const RADIUS: f32 = 0.35;
    let (s_cell, t_cell) = ((s + 0.5).floor(), (t + 0.5).floor());
    let noise = |ds: f32, dt: f32| noise([s_cell + ds, t_cell + dt, 0.5]);
    if noise(0.5, 0.5) <= 0.0 {
        return false;
    }
    let shift = 0.5 - RADIUS;
    let (ds, dt) = (s - (s_cell + shift * noise(1.5, 2.8)), t - (t_cell + shift * noise(4.5, 9.8)));
    ds * ds + dt * dt < RADIUS * RADIUS
}

/// Arithmetic on values, or on values with their gradients.
pub(crate) trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Neg<Output = Self>
{
    fn constant(x: f32) -> Self;
    fn value(self) -> f32;

    fn abs(self) -> Self {
        if self.value() < 0.0 { -self } else { self }
    }
}

impl Number for f32 {
    fn constant(x: f32) -> Self {
        x
    }

    fn value(self) -> f32 {
        self
    }
}

/// A value and its gradient.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sloped {
    value: f32,
    slope: Vec3,
}

impl Sloped {
    fn axes(p: Vec3) -> [Self; 3] {
        [0, 1, 2].map(|axis| Self { value: p[axis], slope: Vec3::AXES[axis] })
    }
}

impl Add for Sloped {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: self.slope + other.slope }
    }
}

impl Sub for Sloped {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: self.slope - other.slope }
    }
}

impl Mul for Sloped {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self { value: self.value * other.value, slope: self.slope * other.value + other.slope * self.value }
    }
}

impl Neg for Sloped {
    type Output = Self;

    fn neg(self) -> Self {
        Self { value: -self.value, slope: -self.slope }
    }
}

impl Number for Sloped {
    fn constant(x: f32) -> Self {
        Self { value: x, slope: Vec3::ZERO }
    }

    fn value(self) -> f32 {
        self.value
    }
}

/// Returns Perlin's noise, about in [−1, 1].
fn noise<N: Number>(p: [N; 3]) -> N {
    let cells = p.map(|x| {
        // Coordinates beyond a whole number's range are wrapped
        let wrapped = x.value() % PERIOD_MAX;
        (wrapped.floor(), wrapped)
    });
    let d: [N; 3] = std::array::from_fn(|axis| {
        let (cell, wrapped) = cells[axis];
        p[axis] - N::constant(p[axis].value() - wrapped) - N::constant(cell)
    });
    let at = |axis: usize, step: usize| (cells[axis].0 as i32).wrapping_add(step as i32) as usize & 255;
    let one = N::constant(1.0);
    let offset = |axis: usize, step: usize| if step == 0 { d[axis] } else { d[axis] - one };
    let corner = |i: usize, j: usize, k: usize| {
        let hash = hash(at(0, i), at(1, j), at(2, k));
        along_gradient(hash, [offset(0, i), offset(1, j), offset(2, k)])
    };
    let weights = d.map(fade);
    let mix = |axis: usize, a: N, b: N| (one - weights[axis]) * a + weights[axis] * b;
    let row = |j: usize, k: usize| mix(0, corner(0, j, k), corner(1, j, k));
    let layer = |k: usize| mix(1, row(0, k), row(1, k));
    mix(2, layer(0), layer(1))
}

/// Largest coordinate that is not wrapped.
const PERIOD_MAX: f32 = (1 << 30) as f32;

/// Returns 6 t⁵ − 15 t⁴ + 10 t³.
fn fade<N: Number>(t: N) -> N {
    let (c, t3) = (N::constant, t * t * t);
    c(6.0) * (t3 * (t * t)) - c(15.0) * (t3 * t) + c(10.0) * t3
}

/// Returns the product of a corner's gradient, one of the 16 of pbrt, and the way from the corner.
fn along_gradient<N: Number>(hash: u8, [x, y, z]: [N; 3]) -> N {
    let hash = hash & 15;
    let is_flat = hash == 12 || hash == 13;
    let u = if hash < 8 || is_flat { x } else { y };
    let v = if hash < 4 || is_flat { y } else { z };
    (if hash & 1 != 0 { -u } else { u }) + (if hash & 2 != 0 { -v } else { v })
}

fn hash(x: usize, y: usize, z: usize) -> u8 {
    let next = |above: u8, index: usize| PERMUTATION[(usize::from(above) + index) & 255];
    next(next(PERMUTATION[x], y), z)
}

/// Perlin's permutation of the numbers from 0 to 255.
#[rustfmt::skip]
const PERMUTATION: [u8; 256] = [
    151, 160, 137, 91, 90, 15, 131, 13, 201, 95, 96, 53, 194, 233, 7, 225,
    140, 36, 103, 30, 69, 142, 8, 99, 37, 240, 21, 10, 23, 190, 6, 148,
    247, 120, 234, 75, 0, 26, 197, 62, 94, 252, 219, 203, 117, 35, 11, 32,
    57, 177, 33, 88, 237, 149, 56, 87, 174, 20, 125, 136, 171, 168, 68, 175,
    74, 165, 71, 134, 139, 48, 27, 166, 77, 146, 158, 231, 83, 111, 229, 122,
    60, 211, 133, 230, 220, 105, 92, 41, 55, 46, 245, 40, 244, 102, 143, 54,
    65, 25, 63, 161, 1, 216, 80, 73, 209, 76, 132, 187, 208, 89, 18, 169,
    200, 196, 135, 130, 116, 188, 159, 86, 164, 100, 109, 198, 173, 186, 3, 64,
    52, 217, 226, 250, 124, 123, 5, 202, 38, 147, 118, 126, 255, 82, 85, 212,
    207, 206, 59, 227, 47, 16, 58, 17, 182, 189, 28, 42, 223, 183, 170, 213,
    119, 248, 152, 2, 44, 154, 163, 70, 221, 153, 101, 155, 167, 43, 172, 9,
    129, 22, 39, 253, 19, 98, 108, 110, 79, 113, 224, 232, 178, 185, 112, 104,
    218, 246, 97, 228, 251, 34, 242, 193, 238, 210, 144, 12, 191, 179, 162, 241,
    81, 51, 145, 235, 249, 14, 239, 107, 49, 192, 214, 31, 181, 199, 106, 157,
    184, 84, 204, 176, 115, 121, 50, 45, 127, 4, 150, 254, 138, 236, 205, 93,
    222, 114, 67, 29, 24, 72, 243, 141, 128, 195, 78, 66, 215, 61, 156, 180,
];

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [Vec3; 4] = [
        Vec3::new(0.3, 0.7, 0.2),
        Vec3::new(-3.4, 12.25, 7.9),
        Vec3::new(101.6, -55.3, 0.75),
        Vec3::new(2.5, 2.5, 255.75),
    ];

    fn octaves(count: u32, roughness: f32) -> Octaves {
        Octaves { count, roughness }
    }

    #[test]
    fn values_are_those_of_pbrt() {
        // Computed in double precision by pbrt's formulas.
        let kinds = [
            (Noise::Fbm(octaves(1, 0.5)), [-0.057007, -0.029514, -0.146670, -0.277954]),
            (Noise::Fbm(octaves(8, 0.5)), [0.161819, 0.280489, -0.163299, -0.227329]),
            (Noise::Turbulence(octaves(6, 0.7)), [0.591760, 0.581036, 0.352631, 0.859438]),
            (Noise::Waves, [0.016597, 0.023382, -0.023097, -0.030358]),
        ];
        for (noise, expected) in kinds {
            for (p, expected) in POINTS.into_iter().zip(expected) {
                let value = noise.value(p, f32::INFINITY);
                assert!((value - expected).abs() < 2e-4, "{noise:?} {p}: {value} {expected}");
                let [least, most] = noise.range();
                assert!((least..=most).contains(&value), "{noise:?}: {value}");
            }
        }
    }

    #[test]
    fn noise_is_zero_at_whole_numbers_and_has_a_period() {
        for p in [Vec3::new(3.0, -7.0, 12.0), Vec3::new(0.0, 255.0, -256.0)] {
            assert_eq!(noise(p.to_array()), 0.0);
        }
        let p = Vec3::new(0.25, 0.5, 0.625);
        let (here, there) = (noise(p.to_array()), noise((p + Vec3::new(256.0, -512.0, 768.0)).to_array()));
        assert!((here - there).abs() < 1e-4 && here != 0.0, "{here} {there}");
    }

    #[test]
    fn gradients_are_those_of_the_values() {
        for noise in [Noise::Fbm(octaves(3, 0.5)), Noise::Turbulence(octaves(2, 0.6)), Noise::Waves] {
            for p in POINTS {
                let gradient = noise.gradient(p, f32::INFINITY);
                for axis in Vec3::AXES {
                    const STEP: f32 = 2e-3;
                    let rise =
                        noise.value(p + axis * STEP, f32::INFINITY) - noise.value(p - axis * STEP, f32::INFINITY);
                    let (found, expected) = (gradient.dot(axis), rise / (2.0 * STEP));
                    assert!((found - expected).abs() < 0.03, "{noise:?} {p} {axis}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn octaves_that_are_not_resolved_fade_to_their_mean() {
        let (fbm, wrinkles) = (Noise::Fbm(octaves(6, 0.5)), Noise::Turbulence(octaves(2, 0.5)));
        for p in POINTS {
            assert_eq!(fbm.value(p, 2.0), Noise::Fbm(octaves(2, 0.5)).value(p, 9.0));
            assert_eq!(fbm.value(p, 0.0), 0.0);
            assert!((wrinkles.value(p, 0.0) - 0.2 * (1.0 + 1.0 + 0.5)).abs() < 1e-6, "pbrt counts the first twice");
        }
    }

    #[test]
    fn dots_fill_about_a_fifth_of_the_plane() {
        let side = 400;
        let at = |i: i32| -20.0 + 40.0 * (i as f32 + 0.5) / side as f32;
        let count = (0..side * side).filter(|i| is_within_dot(at(i % side), at(i / side))).count();
        let share = count as f32 / (side * side) as f32;
        assert!((0.15..0.24).contains(&share), "{share}");
        assert!(DOTS.iter().all(|&(s, t, expected)| is_within_dot(s, t) == expected));
    }

    /// Points within and outside of dots, by pbrt's formula in double precision.
    const DOTS: [(f32, f32, bool); 6] = [
        (-4.72, 0.8, true),
        (-2.34, 1.87, false),
        (2.26, -7.82, true),
        (-8.76, 6.07, false),
        (6.82, -7.25, true),
        (-6.55, -5.09, false),
    ];

    #[test]
    fn everything_has_a_value() {
        for p in [Vec3::splat(1e30), Vec3::splat(-1e18), Vec3::splat(f32::MAX), Vec3::ZERO] {
            for noise in [Noise::Fbm(octaves(64, 2.0)), Noise::Turbulence(octaves(64, -1.0)), Noise::Waves] {
                // What is too large has no noise; nothing panics
                let _ = (noise.value(p, f32::INFINITY), noise.gradient(p, f32::NAN), noise.range());
            }
        }
    }
}
