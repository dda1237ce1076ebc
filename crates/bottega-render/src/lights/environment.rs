//! Light from infinitely far away, all around.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::{Environment, Scene, Spectrum, TextureMap, Wrap};
use glam::{Affine2, Mat3, Vec2, Vec3};

use crate::{luminance, sampling::uniform_sphere};

/// Largest size of the sampling table, in cells.
const TABLE_SIZE_MAX: (usize, usize) = (1024, 512);

/// The environment with a table to draw directions from.
#[derive(Clone, Debug)]
pub(crate) struct EnvironmentLight {
    picture: Option<TextureMap>,
    factor: Spectrum,
    world_from_environment: Mat3,
    /// `None` where there is no picture, or where its compensated density is 0 everywhere: then directions are
    /// uniform, or not sampled at all.
    table: Option<Distribution2d>,
    /// Luminance integrated over the sphere.
    integral: f32,
    compensated: bool,
}

impl EnvironmentLight {
    /// Builds the sampling table.
    ///
    /// - `compensate`: leave those directions to BSDF sampling which it samples well enough, all that is below the
    ///   mean (Karlík et al. 2019, *MIS Compensation*, §5.1). Right only where both strategies are combined.
    pub(crate) fn new(scene: &Scene, environment: &Environment, compensate: bool) -> Self {
        let picture = environment.image.map(|image| TextureMap {
            image,
            uv_set: 0,
            picture_from_uv: Affine2::IDENTITY,
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Clamp,
            smooth: true,
        });
        let mut light = Self {
            picture,
            factor: environment.factor,
            world_from_environment: environment.world_from_environment,
            table: None,
            integral: 4.0 * PI * luminance(environment.factor),
            compensated: compensate,
        };
        if let Some(map) = &light.picture {
            let (width, height) = scene.images[map.image.0 as usize].size();
            let (columns, rows) =
                ((width as usize).clamp(1, TABLE_SIZE_MAX.0), (height as usize).clamp(1, TABLE_SIZE_MAX.1));
            let cells = light.luminance_times_sine(scene, columns, rows);
            let mean = cells.iter().sum::<f32>() / cells.len() as f32;
            // ∫ L sin θ dθ dφ over 2π × π.
            light.integral = mean * 2.0 * PI * PI;
            light.table = Distribution2d::new(&light.compensate(cells, columns, rows), columns, rows);
        }
        light
    }

    fn luminance_times_sine(&self, scene: &Scene, columns: usize, rows: usize) -> Vec<f32> {
        // A lookup a little wider than the cell, so that no light at its border is missed.
        let footprint = 1.5 / columns as f32;
        let mut cells = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            let v = (row as f32 + 0.5) / rows as f32;
            let sine = math::sin(PI * v);
            for column in 0..columns {
                let uv = Vec2::new((column as f32 + 0.5) / columns as f32, v);
                cells.push(luminance(self.lookup(scene, uv, footprint)).max(0.0) * sine);
            }
        }
        cells
    }

    fn compensate(&self, mut cells: Vec<f32>, columns: usize, rows: usize) -> Vec<f32> {
        if self.compensated {
            let mean_luminance = self.integral / (4.0 * PI);
            for row in 0..rows {
                let floor = mean_luminance * math::sin(PI * (row as f32 + 0.5) / rows as f32);
                for cell in &mut cells[row * columns..(row + 1) * columns] {
                    *cell = (*cell - floor).max(0.0);
                }
            }
        }
        cells
    }

    /// Luminance integrated over the sphere of directions.
    pub(crate) fn integral(&self) -> f32 {
        self.integral
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        self.table.as_ref().map_or(0, |table| size_of_val(&*table.conditional) + size_of_val(&*table.marginal))
    }

    /// Whether [`Self::sample`] ever gives a direction.
    pub(crate) fn is_sampled(&self) -> bool {
        self.table.is_some() || !self.compensated
    }

    /// The radiance that comes from a direction of unit length.
    pub(crate) fn radiance(&self, scene: &Scene, direction: Vec3) -> Spectrum {
        if self.picture.is_none() {
            return self.factor;
        }
        let local = self.world_from_environment.transpose() * direction;
        self.lookup(scene, uv_of(local), 0.0)
    }

    fn lookup(&self, scene: &Scene, uv: Vec2, footprint: f32) -> Spectrum {
        self.picture.as_ref().map_or(self.factor, |map| {
            let image = &scene.images[map.image.0 as usize];
            image.eval(map, uv, footprint).truncate() * self.factor
        })
    }

    /// Draws a direction: it, its radiance, and its density per solid angle.
    pub(crate) fn sample(&self, scene: &Scene, u: [f32; 2]) -> Option<(Vec3, Spectrum, f32)> {
        let Some(table) = &self.table else {
            if self.compensated {
                return None;
            }
            let direction = uniform_sphere(u);
            return Some((direction, self.radiance(scene, direction), 1.0 / (4.0 * PI)));
        };
        let (uv, density) = table.sample(u);
        let (sin_theta, cos_theta) = math::sin_cos(PI * uv.y);
        let (sin_phi, cos_phi) = math::sin_cos(2.0 * PI * (uv.x - 0.5));
        if sin_theta <= 0.0 {
            return None;
        }
        let local = Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
        let pdf = density / (2.0 * PI * PI * sin_theta);
        Some((self.world_from_environment * local, self.lookup(scene, uv, 0.0), pdf))
    }

    /// The density per solid angle with which [`Self::sample`] draws a direction.
    pub(crate) fn pdf(&self, direction: Vec3) -> f32 {
        let Some(table) = &self.table else {
            return if self.compensated { 0.0 } else { 1.0 / (4.0 * PI) };
        };
        let local = self.world_from_environment.transpose() * direction;
        let sin_theta = (local.x * local.x + local.z * local.z).sqrt();
        if sin_theta <= 0.0 {
            return 0.0;
        }
        table.density(uv_of(local)) / (2.0 * PI * PI * sin_theta)
    }
}

/// Texture coordinates of a direction in environment space: the upper edge is +y, the center column −z.
fn uv_of(direction: Vec3) -> Vec2 {
    let u = 0.5 + math::atan2(direction.x, -direction.z) / (2.0 * PI);
    Vec2::new(u, math::acos(direction.y) / PI)
}

/// A density on the unit square that is constant within each cell of a grid.
#[derive(Clone, Debug)]
struct Distribution2d {
    columns: usize,
    rows: usize,
    /// Cumulative sums along each row, `[rows × (columns + 1)]`, from 0 to 1.
    conditional: Vec<f32>,
    /// Cumulative sums of the rows, `[rows + 1]`, from 0 to 1.
    marginal: Vec<f32>,
}

impl Distribution2d {
    /// `None` when all cells are 0.
    fn new(cells: &[f32], columns: usize, rows: usize) -> Option<Self> {
        let mut conditional = Vec::with_capacity(rows * (columns + 1));
        let mut row_sums = Vec::with_capacity(rows);
        for row in cells.chunks_exact(columns) {
            row_sums.push(push_cumulative(&mut conditional, row));
        }
        let mut marginal = Vec::with_capacity(rows + 1);
        let row_sums: Vec<f32> = row_sums.into_iter().map(|sum| sum as f32).collect();
        let total = push_cumulative(&mut marginal, &row_sums);
        (total > 0.0 && total.is_finite()).then_some(Self { columns, rows, conditional, marginal })
    }

    fn row(&self, row: usize) -> &[f32] {
        &self.conditional[row * (self.columns + 1)..(row + 1) * (self.columns + 1)]
    }

    fn sample(&self, u: [f32; 2]) -> (Vec2, f32) {
        let (row, y, row_density) = invert(&self.marginal, u[1]);
        let (_, x, column_density) = invert(self.row(row), u[0]);
        (Vec2::new(x, y), row_density * column_density)
    }

    fn density(&self, uv: Vec2) -> f32 {
        let row = ((uv.y * self.rows as f32) as usize).min(self.rows - 1);
        let column = ((uv.x * self.columns as f32) as usize).min(self.columns - 1);
        let share = |sums: &[f32], i: usize| sums[i + 1] - sums[i];
        share(&self.marginal, row) * self.rows as f32 * share(self.row(row), column) * self.columns as f32
    }
}

/// Appends the cumulative sums of `values`, from 0 to 1, and returns the sum. Values that are all 0 count as equal.
fn push_cumulative(sums: &mut Vec<f32>, values: &[f32]) -> f64 {
    let total: f64 = values.iter().map(|&v| f64::from(v)).sum();
    let mut sum = 0.0;
    sums.push(0.0);
    for (i, &value) in values.iter().enumerate() {
        sum += f64::from(value);
        let share = if total > 0.0 { sum / total } else { (i + 1) as f64 / values.len() as f64 };
        sums.push(share as f32);
    }
    if let Some(last) = sums.last_mut() {
        *last = 1.0;
    }
    total
}

/// The cell of `u` in cumulative sums, the place in [0, 1), and the density there.
fn invert(sums: &[f32], u: f32) -> (usize, f32, f32) {
    let cells = sums.len() - 1;
    // The last cell that starts at or below u: its share is above 0, for the next one starts above u.
    let cell = sums.partition_point(|&sum| sum <= u).clamp(1, cells) - 1;
    let share = sums[cell + 1] - sums[cell];
    let part = if share > 0.0 { (u - sums[cell]) / share } else { 0.5 };
    let place = ((cell as f32 + part) / cells as f32).min(ONE_BELOW);
    (cell, place, share * cells as f32)
}

/// The largest number below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;
    use bottega_scene::{EnvironmentMapping, Image, ImageId};

    fn scene_with(environment_size: (u32, u32), texel: impl Fn(u32, u32) -> [f32; 3]) -> Scene {
        let (width, height) = environment_size;
        let data = (0..width * height).map(|i| texel(i % width, i / width)).collect();
        Scene { images: vec![Image::from_linear_rgb("environment", width, height, data)], ..Scene::default() }
    }

    fn environment() -> Environment {
        Environment {
            image: Some(ImageId(0)),
            factor: Spectrum::new(2.0, 1.0, 0.5),
            mapping: EnvironmentMapping::LatitudeLongitude,
            world_from_environment: Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(0.3),
        }
    }

    fn grid(side: u32) -> impl Iterator<Item = [f32; 2]> {
        (0..side * side)
            .map(move |i| [((i % side) as f32 + 0.5) / side as f32, ((i / side) as f32 + 0.5) / side as f32])
    }

    #[test]
    fn the_sampled_density_is_the_stated_one_and_the_estimate_that_of_uniform_directions() {
        let scene = scene_with((32, 16), |x, y| [0.1 + (x % 5) as f32, (y * y) as f32 * 0.1, 0.3]);
        let light = EnvironmentLight::new(&scene, &environment(), false);
        let mut by_light = Spectrum::ZERO;
        for u in grid(128) {
            let (direction, radiance, pdf) = light.sample(&scene, u).unwrap();
            assert!(direction.is_normalized());
            let again = light.pdf(direction);
            // Rounding moves some directions into the next cell.
            if (again - pdf).abs() < 1e-3 * pdf {
                assert!((light.radiance(&scene, direction) - radiance).length() < 0.05 * radiance.length());
            }
            by_light += radiance / pdf / (128.0 * 128.0);
        }
        let by_uniform =
            grid(256).map(|u| light.radiance(&scene, uniform_sphere(u))).sum::<Spectrum>() * (4.0 * PI / 65536.0);
        assert!((by_light / by_uniform - 1.0).abs().max_element() < 0.02, "{by_light} {by_uniform}");
        assert!((light.integral() / luminance(by_uniform) - 1.0).abs() < 0.02);
    }

    #[test]
    fn nearly_all_stated_densities_are_found_again() {
        let scene = scene_with((64, 32), |x, y| [((x * 7 + y * 13) % 11) as f32; 3]);
        for compensate in [false, true] {
            let light = EnvironmentLight::new(&scene, &environment(), compensate);
            let same = grid(64).filter(|&u| {
                light.sample(&scene, u).is_some_and(|(d, _, pdf)| (light.pdf(d) - pdf).abs() < 1e-3 * pdf)
            });
            assert!(same.count() > 4000);
        }
    }

    #[test]
    fn the_density_integrates_to_one() {
        let scene = scene_with((16, 8), |x, y| [(x + y) as f32; 3]);
        let light = EnvironmentLight::new(&scene, &environment(), true);
        let integral: f32 = grid(256).map(|u| light.pdf(uniform_sphere(u))).sum::<f32>() * 4.0 * PI / 65536.0;
        assert!((integral - 1.0).abs() < 0.02, "{integral}");
    }

    #[test]
    fn directions_and_texture_coordinates_follow_the_model() {
        assert!((uv_of(Vec3::NEG_Z) - Vec2::new(0.5, 0.5)).length() < 1e-6);
        assert!((uv_of(Vec3::X) - Vec2::new(0.75, 0.5)).length() < 1e-6);
        assert!(uv_of(Vec3::Y).y.abs() < 1e-6);
    }

    #[test]
    fn a_uniform_environment_is_left_to_bsdf_sampling_when_compensated() {
        let light = EnvironmentLight::new(&Scene::default(), &Environment { image: None, ..environment() }, true);
        assert!(!light.is_sampled() && light.sample(&Scene::default(), [0.5; 2]).is_none());
        let light = EnvironmentLight::new(&Scene::default(), &Environment { image: None, ..environment() }, false);
        assert!(light.is_sampled() && light.pdf(Vec3::X) == 1.0 / (4.0 * PI));
    }
}
