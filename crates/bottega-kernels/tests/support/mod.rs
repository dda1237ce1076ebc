//! Random numbers, a mesh, and rays that must not get out of meshes.
#![allow(dead_code, reason = "not every program needs all of it")]

mod leaks;

use std::f32::consts::{PI, TAU};

use bottega_kernels::{SplitMix64, math};
use glam::Vec3;

pub(crate) use self::leaks::leaks;

/// A stream of random numbers.
pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// A number in [0, 1).
    pub(crate) fn unit(&mut self) -> f32 {
        self.0.unit_f32()
    }

    /// A number between two.
    pub(crate) fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// A direction, all being equally likely.
    pub(crate) fn direction(&mut self) -> Vec3 {
        let (height, turn) = (self.between(-1.0, 1.0), TAU * self.unit());
        let (sin, cos) = math::sin_cos(turn);
        let radius = (1.0 - height * height).sqrt();
        Vec3::new(radius * cos, height, radius * sin)
    }
}

/// A closed ball of 69,168 triangles around the origin, whose surface is rough at all scales: its radius is from 0.85 to 1.17.
pub(crate) fn rough_ball() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    const AROUND: u32 = 264;
    const DOWN: u32 = 132;
    let mut random = Random::new(1);
    let mut point = |i: u32, j: u32| {
        let ((sin, cos), (radius, height)) =
            (math::sin_cos(TAU * i as f32 / AROUND as f32), math::sin_cos(PI * j as f32 / DOWN as f32));
        let d = Vec3::new(radius * cos, height, radius * sin);
        let wave = math::sin(d.x * 7.0) * math::sin(d.y * 9.0 + 1.0) * math::sin(d.z * 8.0 + 2.0);
        d * (1.0 + 0.15 * wave + 0.02 * random.unit())
    };
    let mut positions = vec![point(0, 0)];
    for j in 1..DOWN {
        positions.extend((0..AROUND).map(|i| point(i, j)));
    }
    positions.push(point(0, DOWN));
    let last = positions.len() as u32 - 1;
    let corner = |i: u32, j: u32| match j {
        0 => 0,
        DOWN => last,
        _ => 1 + (j - 1) * AROUND + i % AROUND,
    };
    let squares = (0..DOWN).flat_map(|j| (0..AROUND).map(move |i| (i, j)));
    let triangles = squares.flat_map(|(i, j)| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i, j + 1), corner(i + 1, j + 1)];
        // At a pole two corners of a square are one.
        [(j != 0).then_some([a, b, c]), (j != DOWN - 1).then_some([b, d, c])]
    });
    let triangles = triangles.flatten().collect();
    (positions, triangles)
}
