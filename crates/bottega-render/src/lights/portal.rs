//! Portals through which an environment is seen: directions through them are sampled by the radiance beyond (Bitterli,
//! Novák and Jarosz 2015, *Portal-Masked Environment Map Sampling*).

use std::f32::consts::{FRAC_PI_2, PI};

use bottega_kernels::math;
use bottega_scene::{Portal, Spectrum};
use glam::{Mat3, Vec3};

use super::window::{UnitWindow, WindowTable};
use crate::{color::luminance, density::SolidAnglePdf, sampler::Quad};

/// Largest number of cells per side of the table, which covers directions within half a turn in both angles.
const SIDE_MAX: usize = 1024;

/// Value added to every cell, as a fraction of the mean, so that light between the sampled directions of a cell is not
/// missed.
const FLOOR: f32 = 0.02;

/// All portals of an environment.
#[derive(Clone, Debug)]
pub(super) struct Portals(Vec<PreparedPortal>);

/// One portal, with the environment's radiance in all directions through its plane.
///
/// Directions d are mapped to the unit square by the angles atan(d.x ∕ d.z) and atan(d.y ∕ d.z) in the portal's frame,
/// whose x and y run along its edges: from every point, the portal is an axis-parallel rectangle of that square.
#[derive(Clone, Debug)]
struct PreparedPortal {
    corner: Vec3,
    /// Orthonormal columns: along both edges, and outwards.
    world_from_local: Mat3,
    size: [f32; 2],
    table: WindowTable,
}

impl Portals {
    /// Creates the portals.
    ///
    /// - `side`: shorter side of the environment's picture, in texels.
    /// - `radiance`: radiance from a direction in world space, filtered with a footprint as a fraction of the picture.
    pub(super) fn new(portals: &[Portal], side: usize, radiance: impl Fn(Vec3, f32) -> Spectrum) -> Self {
        Self(portals.iter().map(|portal| PreparedPortal::new(portal, side.clamp(1, SIDE_MAX), &radiance)).collect())
    }

    pub(super) fn memory_bytes(&self) -> usize {
        self.0.iter().map(|opening| opening.table.memory_bytes()).sum()
    }

    /// Returns the number of portals that a direction of unit length from a point crosses.
    pub(super) fn count(&self, from: Vec3, direction: Vec3) -> u32 {
        self.0.iter().map(|opening| u32::from(opening.is_crossed(from, direction))).sum()
    }

    /// Returns the luminance at a point through all portals, integrated over their solid angles.
    pub(super) fn integral(&self, from: Vec3) -> f32 {
        self.0.iter().map(|opening| opening.integral(from)).sum::<f64>() as f32
    }

    /// Draws a direction from a point, with density [`pdf`](Self::pdf). `None`: no portal sends light to the point.
    pub(super) fn sample(&self, from: Vec3, u: Quad) -> Option<Vec3> {
        let total: f64 = self.0.iter().map(|opening| opening.integral(from)).sum();
        let mut rest = f64::from(u[0]) * total;
        for opening in &self.0 {
            let integral = opening.integral(from);
            if rest < integral {
                let place = opening.table.sample(opening.window(from)?, [u[1], u[2]])?;
                return Some(opening.direction(place).0);
            }
            rest -= integral;
        }
        None
    }

    /// Returns the density with which a direction is drawn. A portal is chosen by its integral; within it, the density is
    /// its value over its integral.
    pub(super) fn pdf(&self, from: Vec3, direction: Vec3) -> SolidAnglePdf {
        let crossed = self.0.iter().filter(|opening| opening.is_crossed(from, direction));
        let sum: f32 = crossed.map(|opening| opening.density(direction)).sum();
        SolidAnglePdf::new(if sum > 0.0 { sum / self.integral(from) } else { 0.0 })
    }
}

impl PreparedPortal {
    fn new(portal: &Portal, side: usize, radiance: impl Fn(Vec3, f32) -> Spectrum) -> Self {
        let [x, y] = portal.edges.map(Vec3::normalize_or_zero);
        let mut opening = Self {
            corner: portal.corner,
            world_from_local: Mat3::from_cols(x, y, x.cross(y)),
            size: portal.edges.map(Vec3::length),
            table: WindowTable::new(vec![1.0], 1, 1),
        };
        // Average four lookups per cell
        let footprint = 0.5 / side as f32;
        let at = |column: usize, row: usize, dx: f64, dy: f64| {
            let (direction, solid_angle) =
                opening.direction([(column as f64 + dx) / side as f64, (row as f64 + dy) / side as f64]);
            luminance(radiance(direction, footprint)).max(0.0) * solid_angle
        };
        let cell = |index: usize| {
            let (column, row) = (index % side, index / side);
            let looks = [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)];
            looks.map(|(dx, dy)| at(column, row, dx, dy)).iter().sum::<f32>() * 0.25
        };
        let mut values: Vec<f32> = (0..side * side).map(cell).collect();
        let mean = values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64;
        values.iter_mut().for_each(|value| *value += FLOOR * mean as f32);
        opening.table = WindowTable::new(values, side, side);
        opening
    }

    /// Returns the direction of a point of the square, and the solid angle per unit of area there.
    fn direction(&self, [u, v]: [f64; 2]) -> (Vec3, f32) {
        // Just short of the plane of the portal
        const STEEP: f32 = FRAC_PI_2 - 1e-4;
        let tan = |x: f64| math::tan((x as f32 * PI - FRAC_PI_2).clamp(-STEEP, STEEP));
        let local = Vec3::new(tan(u), tan(v), 1.0).normalize();
        (self.world_from_local * local, PI * PI * solid_angle_part(local))
    }

    /// Returns the point of the square for a direction in the portal's frame.
    fn place(&self, local: Vec3) -> [f64; 2] {
        [local.x, local.y].map(|x| (f64::from(math::atan2(x, local.z) / PI) + 0.5).clamp(0.0, 1.0))
    }

    /// Returns the window of the square that the portal covers, seen from a point; `None` if the point is outside.
    fn window(&self, from: Vec3) -> Option<UnitWindow> {
        let local = self.world_from_local.transpose() * (self.corner - from);
        if local.z <= 0.0 {
            return None;
        }
        let far = local + Vec3::new(self.size[0], self.size[1], 0.0);
        Some([self.place(local), self.place(far)])
    }

    fn integral(&self, from: Vec3) -> f64 {
        self.window(from).map_or(0.0, |window| self.table.integral(window))
    }

    /// Returns the table's luminance per solid angle for a direction that leads out.
    fn density(&self, direction: Vec3) -> f32 {
        let local = self.world_from_local.transpose() * direction;
        self.table.value(self.place(local)) / (PI * PI * solid_angle_part(local))
    }

    fn is_crossed(&self, from: Vec3, direction: Vec3) -> bool {
        let to_local = self.world_from_local.transpose();
        let (to_corner, local) = (to_local * (self.corner - from), to_local * direction);
        if to_corner.z <= 0.0 || local.z <= 0.0 {
            return false;
        }
        let hit = local * (to_corner.z / local.z) - to_corner;
        (0.0..=self.size[0]).contains(&hit.x) && (0.0..=self.size[1]).contains(&hit.y)
    }
}

/// Returns the Jacobian of the mapping: solid angle per unit of both angles in the unit direction d, (1 − d.x²)(1 − d.y²)
/// ∕ d.z.
fn solid_angle_part(d: Vec3) -> f32 {
    (1.0 - d.x * d.x) * (1.0 - d.y * d.y) / d.z.max(1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::uniform_sphere;

    fn sky(direction: Vec3, _: f32) -> Spectrum {
        let sun = Vec3::new(0.3, 0.9, 0.2).normalize();
        Spectrum::splat(if direction.dot(sun) > 0.99 { 50.0 } else { 0.5 + direction.y * direction.y })
    }

    /// Two rotated portals, in a wall and a ceiling.
    fn portals() -> (Portals, Mat3) {
        let turn = Mat3::from_rotation_z(0.3) * Mat3::from_rotation_x(0.2);
        let portal = |corner: Vec3, a: Vec3, b: Vec3| Portal { corner: turn * corner, edges: [turn * a, turn * b] };
        let list = [
            portal(Vec3::new(-1.0, 2.0, 1.0), 2.0 * Vec3::Z, 1.5 * Vec3::X),
            portal(Vec3::new(2.0, -1.0, -1.0), Vec3::Y, 2.0 * Vec3::Z),
        ];
        (Portals::new(&list, 128, sky), turn)
    }

    #[test]
    fn light_comes_through_the_windows_alone_and_all_of_it_is_sampled() {
        let (portals, _) = portals();
        let from = Vec3::new(0.2, -0.3, 0.1);
        let mut by_portals = 0.0;
        const SIDE: u16 = 256;
        for i in 0..SIDE {
            for j in 0..SIDE {
                let u = [(f32::from(i) + 0.5) / 256.0, (f32::from(j) + 0.5) / 256.0];
                // The choice of the portal uses the first number
                let choice = (u[0] * 61.0 + u[1] * 17.0).fract();
                let Some(direction) = portals.sample(from, [choice, u[0], u[1], 0.0]) else { continue };
                assert!((direction.length() - 1.0).abs() < 1e-5);
                let pdf = portals.pdf(from, direction).per_sr();
                // Rounding moves a few directions out of their portal
                if pdf > 0.0 {
                    let count = portals.count(from, direction) as f32;
                    by_portals += f64::from(sky(direction, 0.0).x * count / pdf) / 65536.0;
                }
            }
        }
        let mut by_sphere = 0.0;
        for i in 0..1024u16 {
            for j in 0..1024u16 {
                let direction = uniform_sphere([(f32::from(i) + 0.5) / 1024.0, (f32::from(j) + 0.5) / 1024.0]);
                let seen = sky(direction, 0.0).x * portals.count(from, direction) as f32;
                by_sphere += f64::from(seen) * 4.0 * std::f64::consts::PI / 1_048_576.0;
            }
        }
        assert!((by_portals / by_sphere - 1.0).abs() < 0.02, "{by_portals} {by_sphere}");
        assert!((f64::from(portals.integral(from)) / by_sphere - 1.0).abs() < 0.05);
    }

    #[test]
    fn the_density_integrates_to_one_over_the_sphere() {
        let (portals, _) = portals();
        let from = Vec3::new(-0.5, 0.4, 0.0);
        let mut sum = 0.0;
        for i in 0..1024u16 {
            for j in 0..1024u16 {
                let direction = uniform_sphere([(f32::from(i) + 0.5) / 1024.0, (f32::from(j) + 0.5) / 1024.0]);
                sum += f64::from(portals.pdf(from, direction).per_sr()) * 4.0 * std::f64::consts::PI / 1_048_576.0;
            }
        }
        assert!((sum - 1.0).abs() < 0.01, "{sum}");
    }

    #[test]
    fn from_outside_nothing_comes_in() {
        let (portals, turn) = portals();
        // Beyond both portals, looking outwards and back in
        let from = turn * Vec3::new(5.0, 5.0, 0.0);
        assert_eq!(portals.integral(from), 0.0);
        assert!(portals.sample(from, [0.5; 4]).is_none());
        for u in [[0.1, 0.2], [0.7, 0.4], [0.4, 0.9]] {
            assert_eq!(portals.count(from, uniform_sphere(u)), 0);
        }
    }
}
