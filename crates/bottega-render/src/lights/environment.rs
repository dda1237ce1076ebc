//! The environment: light at infinity from all directions.
//!
//! Parameters: a picture or a constant radiance, with its mapping (latitude and longitude, or equal areas), a factor, a
//! rotation; optional portals. Directions are drawn from a table of the picture's luminance, less its mean, which BSDF
//! sampling finds by itself.
//!
//! Source: Karlík et al. 2019, *MIS Compensation: Optimizing Sampling Techniques in Multiple Importance Sampling*.

use std::f32::consts::{FRAC_2_PI, FRAC_PI_4, PI};

use bottega_kernels::math;
use bottega_scene::{Environment, EnvironmentMapping, Scene, Spectrum, TextureMap, Visibility, Wrap};
use glam::{Mat3, Vec2, Vec3};

use super::distribution::{Bilinear, Cells};
use super::portal::Portals;
use crate::{color::luminance, density::SolidAnglePdf, sampler::Quad, sampling::uniform_sphere};

/// Largest size of the sampling table, in cells (columns, rows).
const TABLE_SIZE_MAX: (usize, usize) = (4096, 2048);

/// The environment with a table for sampling directions.
#[derive(Clone, Debug)]
pub(crate) struct EnvironmentLight {
    /// The picture; `None`: the radiance is `factor` everywhere.
    pub(crate) picture: Option<TextureMap>,
    pub(crate) mapping: EnvironmentMapping,
    pub(crate) rows: EnvironmentRows,
    pub(crate) factor: Spectrum,
    /// Rotation from environment space to world space.
    pub(crate) world_from_environment: Mat3,
    pub(crate) table: EnvironmentTable,
    /// Luminance integrated over the sphere, of the part that the table represents.
    pub(crate) integral: f32,
    /// `true`: the table leaves a part to BSDF sampling.
    is_compensated: bool,
    /// Portals through which alone the environment is seen; they replace the table.
    portals: Option<Portals>,
    /// Kinds of ray that find it.
    pub(super) visibility: Visibility,
}

/// The mapping from latitudes (0 to 1, pole to pole) to rows of a picture (0 to 1, top to bottom).
#[derive(Clone, Copy, Debug)]
pub(crate) struct EnvironmentRows {
    /// Factor of the latitude.
    pub(crate) scale: f32,
    /// Row of latitude 0.
    pub(crate) offset: f32,
}

impl EnvironmentRows {
    /// Creates the mapping.
    ///
    /// - `height`: height of the picture in texels.
    pub(super) fn new(mapping: EnvironmentMapping, height: u32) -> Self {
        if mapping != EnvironmentMapping::LatitudeLongitudeToPoles || height < 2 {
            return Self { scale: 1.0, offset: 0.0 };
        }
        Self { scale: (height - 1) as f32 / height as f32, offset: 0.5 / height as f32 }
    }

    /// Returns the position on the picture of a longitude and a latitude, 0 to 1.
    pub(super) fn place(self, place: Vec2) -> Vec2 {
        Vec2::new(place.x, self.picture_from_latitude(place.y))
    }

    fn picture_from_latitude(self, latitude: f32) -> f32 {
        latitude * self.scale + self.offset
    }

    /// Returns the latitude, outside [0, 1] where the picture extends past the poles.
    fn latitude_from_picture(self, place: f32) -> f32 {
        (place - self.offset) / self.scale
    }
}

/// The sampling of directions.
#[derive(Clone, Debug)]
pub(crate) enum EnvironmentTable {
    /// No sampling: BSDF sampling finds all light.
    None,
    /// Uniform over the sphere.
    Uniform,
    /// By luminance, over latitude and longitude.
    Bilinear(Bilinear),
    /// By luminance, over an equal-area square.
    Cells(Cells),
}

impl EnvironmentLight {
    /// Builds the sampling table.
    ///
    /// - `compensate`: leaves to BSDF sampling the directions that it samples well enough, all that are darker than the
    ///   mean (Karlík et al. 2019, *MIS Compensation*, §5.1). Correct only with MIS.
    pub(crate) fn new(scene: &Scene, environment: &Environment, compensate: bool) -> Self {
        let picture = environment.image.map(|image| TextureMap {
            wrap_v: Wrap::Clamp,
            // Like pbrt, use the nearest texel of equal-area pictures
            smooth: environment.mapping != EnvironmentMapping::EqualArea,
            ..TextureMap::new(image)
        });
        let height = environment.image.map_or(1, |image| scene.images[image.0 as usize].size().1);
        let mut light = Self {
            picture,
            mapping: environment.mapping,
            rows: EnvironmentRows::new(environment.mapping, height),
            factor: environment.factor,
            world_from_environment: environment.world_from_environment,
            table: if compensate { EnvironmentTable::None } else { EnvironmentTable::Uniform },
            integral: 4.0 * PI * luminance(environment.factor),
            is_compensated: compensate && environment.portals.is_empty(),
            portals: None,
            visibility: environment.visibility,
        };
        if !environment.portals.is_empty() {
            // A constant environment needs only enough cells to resolve solid angles
            let side = environment.image.map_or(128, |image| {
                let (width, height) = scene.images[image.0 as usize].size();
                width.min(height) as usize
            });
            let radiance = |direction, footprint| light.radiance_within(scene, direction, footprint);
            light.portals = Some(Portals::new(&environment.portals, side, radiance));
            return light;
        }
        if let Some(map) = &light.picture {
            let (width, height) = scene.images[map.image.0 as usize].size();
            let columns = (width as usize).clamp(1, TABLE_SIZE_MAX.0);
            let rows = (height as usize).clamp(1, TABLE_SIZE_MAX.1);
            let (table, integral) = light.tabulate(scene, columns, rows, compensate);
            light.table = table;
            light.integral = integral;
        }
        light
    }

    /// Returns the table over a picture, and the integral of the luminance that it represents.
    fn tabulate(&self, scene: &Scene, columns: usize, rows: usize, compensate: bool) -> (EnvironmentTable, f32) {
        // Solid angle of a cell over the mean of all cells. Pictures with rows at the poles may be small: their weights
        // integrate exactly over the interpolation between rows
        let height = PI / (rows as f32 * self.rows.scale);
        let weight = |row: usize| {
            let latitude = PI * self.rows.latitude_from_picture((row as f32 + 0.5) / rows as f32);
            0.5 * PI
                * match self.mapping {
                    EnvironmentMapping::EqualArea => 2.0 / PI,
                    EnvironmentMapping::LatitudeLongitude => math::sin(latitude),
                    EnvironmentMapping::LatitudeLongitudeToPoles if latitude.min(PI - latitude) < 0.5 * height => {
                        (1.0 - math::sin(height) / height) / height
                    }
                    EnvironmentMapping::LatitudeLongitudeToPoles => {
                        math::sin(latitude) * (2.0 * math::sin(0.5 * height) / height).powi(2)
                    }
                }
        };
        let mut cells = self.luminances(scene, columns, rows);
        let integral_of = |cells: &[f32]| {
            let by_row = cells.chunks_exact(columns).enumerate();
            let sum: f64 = by_row
                .map(|(row, cells)| f64::from(weight(row)) * cells.iter().map(|&l| f64::from(l)).sum::<f64>())
                .sum();
            (4.0 * std::f64::consts::PI * sum / (cells.len() as f64 * f64::from(self.rows.scale))) as f32
        };
        // Compensate for MIS: leave everything darker than the mean to BSDF sampling
        if compensate {
            let mean = integral_of(&cells) / (4.0 * PI);
            cells.iter_mut().for_each(|cell| *cell = (*cell - mean).max(0.0));
        }
        // Weight the cells by solid angle
        let integral = integral_of(&cells);
        for (row, cells) in cells.chunks_exact_mut(columns).enumerate() {
            cells.iter_mut().for_each(|cell| *cell *= weight(row));
        }
        let table = match self.mapping {
            EnvironmentMapping::EqualArea => Cells::new(&cells, columns, rows).map(EnvironmentTable::Cells),
            _ => Bilinear::new(cells, columns, rows).map(EnvironmentTable::Bilinear),
        };
        (table.unwrap_or(EnvironmentTable::None), integral)
    }

    /// Returns the luminance of each cell: of its texel, or the mean of its texels if the table is coarser than the
    /// picture.
    fn luminances(&self, scene: &Scene, columns: usize, rows: usize) -> Vec<f32> {
        let Some(map) = &self.picture else { return Vec::new() };
        let image = &scene.images[map.image.0 as usize];
        let size = (columns as u32, rows as u32);
        // Use a filter slightly wider than the cell, so that no light at its border is missed
        let footprint = 1.5 / columns.min(rows) as f32;
        let mut cells = Vec::with_capacity(columns * rows);
        for row in 0..size.1 {
            for column in 0..size.0 {
                let color = if size == image.size() {
                    image.texel(column, row).truncate() * self.factor
                } else {
                    let place = Vec2::new(column as f32 + 0.5, row as f32 + 0.5);
                    self.lookup(scene, place / Vec2::new(columns as f32, rows as f32), footprint)
                };
                cells.push(luminance(color).max(0.0));
            }
        }
        cells
    }

    /// Returns true if light sampling alone finds all of the environment's light.
    pub(crate) fn is_found(&self) -> bool {
        !self.is_compensated
    }

    /// Returns true if light sampling draws any directions of the environment.
    pub(crate) fn is_sampled(&self) -> bool {
        self.portals.is_some() || !matches!(self.table, EnvironmentTable::None)
    }

    /// Returns an estimate of the illuminance by sampled directions at a point: the mean over all orientations of a
    /// surface.
    pub(crate) fn illuminance(&self, from: Vec3) -> f32 {
        // Light sampling leaves out what no surface receives
        if !self.visibility.has_bounces() {
            return 0.0;
        }
        match (&self.portals, &self.table) {
            (Some(portals), _) => 0.25 * portals.integral(from),
            (None, EnvironmentTable::None) => 0.0,
            (None, _) => 0.25 * self.integral,
        }
    }

    /// Returns the radiance at a point from a direction of unit length. It is counted once per portal that the direction
    /// crosses.
    pub(crate) fn radiance_at(&self, scene: &Scene, from: Vec3, direction: Vec3) -> Spectrum {
        match self.portals.as_ref().map(|portals| portals.count(from, direction)) {
            None => self.radiance(scene, direction),
            Some(0) => Spectrum::ZERO,
            Some(count) => self.radiance(scene, direction) * count as f32,
        }
    }

    /// Samples a direction at a point. Returns it with its radiance and its density; `None`: no light for these
    /// numbers. `u[0]` chooses a portal, `u[1]` and `u[2]` the direction.
    pub(crate) fn sample_at(&self, scene: &Scene, from: Vec3, u: Quad) -> Option<(Vec3, Spectrum, SolidAnglePdf)> {
        let Some(portals) = &self.portals else { return self.sample(scene, [u[1], u[2]]) };
        let direction = portals.sample(from, u)?;
        let pdf = portals.pdf(from, direction);
        pdf.is_sound().then(|| (direction, self.radiance_at(scene, from, direction), pdf))
    }

    /// Returns the density with which [`Self::sample_at`] draws a direction.
    pub(crate) fn pdf_at(&self, from: Vec3, direction: Vec3) -> SolidAnglePdf {
        self.portals.as_ref().map_or_else(|| self.pdf(direction), |portals| portals.pdf(from, direction))
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        let table = match &self.table {
            EnvironmentTable::None | EnvironmentTable::Uniform => 0,
            EnvironmentTable::Bilinear(table) => table.memory_bytes(),
            EnvironmentTable::Cells(table) => table.memory_bytes(),
        };
        table + self.portals.as_ref().map_or(0, Portals::memory_bytes)
    }

    /// Returns the radiance from a direction of unit length, ignoring portals.
    fn radiance(&self, scene: &Scene, direction: Vec3) -> Spectrum {
        self.radiance_within(scene, direction, 0.0)
    }

    /// Returns the filtered radiance from a direction of unit length.
    ///
    /// - `footprint`: width of the filter, as a fraction of the picture.
    fn radiance_within(&self, scene: &Scene, direction: Vec3, footprint: f32) -> Spectrum {
        if self.picture.is_none() {
            return self.factor;
        }
        self.lookup(scene, self.uv_of(self.world_from_environment.transpose() * direction), footprint)
    }

    /// Returns the position on the picture of a direction in environment space.
    fn uv_of(&self, local: Vec3) -> Vec2 {
        if self.mapping == EnvironmentMapping::EqualArea {
            return square_of(local);
        }
        self.rows.place(latitude_longitude(local))
    }

    fn lookup(&self, scene: &Scene, uv: Vec2, footprint: f32) -> Spectrum {
        self.picture.as_ref().map_or(self.factor, |map| {
            let image = &scene.images[map.image.0 as usize];
            image.eval(map, uv, footprint).truncate() * self.factor
        })
    }

    /// Samples a direction of the whole sphere: returns it with its radiance and its density.
    fn sample(&self, scene: &Scene, u: [f32; 2]) -> Option<(Vec3, Spectrum, SolidAnglePdf)> {
        let (local, uv, pdf) = match &self.table {
            EnvironmentTable::None => return None,
            EnvironmentTable::Uniform => {
                let direction = uniform_sphere(u);
                return Some((direction, self.radiance(scene, direction), SolidAnglePdf::uniform(4.0 * PI)));
            }
            EnvironmentTable::Bilinear(table) => {
                let (uv, density) = table.sample(u);
                let latitude = self.rows.latitude_from_picture(uv[1]);
                if !(0.0..=1.0).contains(&latitude) {
                    return None;
                }
                let (sin_theta, cos_theta) = math::sin_cos(PI * latitude);
                let (sin_phi, cos_phi) = math::sin_cos(2.0 * PI * (uv[0] - 0.5));
                let local = Vec3::new(sin_theta * sin_phi, cos_theta, -sin_theta * cos_phi);
                (local, Vec2::from(uv), self.rows.scale * density / (2.0 * PI * PI * sin_theta))
            }
            EnvironmentTable::Cells(table) => {
                let (uv, density) = table.sample(u);
                (direction_of_square(uv.into()), Vec2::from(uv), density / (4.0 * PI))
            }
        };
        let pdf = SolidAnglePdf::new(pdf);
        pdf.is_sound().then(|| (self.world_from_environment * local, self.lookup(scene, uv, 0.0), pdf))
    }

    /// Returns the density with which [`Self::sample`] draws a direction.
    fn pdf(&self, direction: Vec3) -> SolidAnglePdf {
        let local = self.world_from_environment.transpose() * direction;
        SolidAnglePdf::new(match &self.table {
            EnvironmentTable::None => 0.0,
            EnvironmentTable::Uniform => 1.0 / (4.0 * PI),
            EnvironmentTable::Bilinear(table) => {
                let sin_theta = (local.x * local.x + local.z * local.z).sqrt();
                if sin_theta > 0.0 {
                    self.rows.scale * table.density(self.uv_of(local).into()) / (2.0 * PI * PI * sin_theta)
                } else {
                    0.0
                }
            }
            EnvironmentTable::Cells(table) => table.density(square_of(local).into()) / (4.0 * PI),
        })
    }
}

/// Returns longitude and latitude of a direction in environment space, 0 to 1: the upper edge is +y, the centre column
/// −z.
pub(super) fn latitude_longitude(direction: Vec3) -> Vec2 {
    let u = 0.5 + math::atan2(direction.x, -direction.z) / (2.0 * PI);
    Vec2::new(u, math::acos(direction.y) / PI)
}

/// Returns the position of a direction on an equal-area picture (Clarberg 2008): +z is the centre, the lower hemisphere
/// is folded into the corners.
pub(crate) fn square_of(direction: Vec3) -> Vec2 {
    let flat = direction.truncate().abs();
    let radius = (1.0 - direction.z.abs()).max(0.0).sqrt();
    let angle = if flat == Vec2::ZERO { 0.0 } else { math::atan2(flat.y, flat.x) * FRAC_2_PI };
    let upper = Vec2::new(radius - angle * radius, angle * radius);
    let place = if direction.z < 0.0 { 1.0 - Vec2::new(upper.y, upper.x) } else { upper };
    let place = Vec2::new(place.x.copysign(direction.x), place.y.copysign(direction.y));
    (place * 0.5 + 0.5).clamp(Vec2::ZERO, Vec2::splat(ONE_BELOW))
}

/// Returns the direction of a position on an equal-area picture.
pub(crate) fn direction_of_square(place: Vec2) -> Vec3 {
    let place = place * 2.0 - 1.0;
    let flat = place.abs();
    // Signed distance from the edge of the upper hemisphere's diamond; positive inside
    let from_edge = 1.0 - (flat.x + flat.y);
    let radius = 1.0 - from_edge.abs();
    let angle = if radius > 0.0 { ((flat.y - flat.x) / radius + 1.0) * FRAC_PI_4 } else { 0.0 };
    let z = (1.0 - radius * radius).copysign(from_edge);
    let (sin, cos) = math::sin_cos(angle);
    let sine = radius * (2.0 - radius * radius).max(0.0).sqrt();
    Vec3::new((cos * sine).copysign(place.x), (sin * sine).copysign(place.y), z)
}

/// Largest f32 below 1.
const ONE_BELOW: f32 = 1.0 - f32::EPSILON / 2.0;

#[cfg(test)]
mod tests {
    use super::*;
    use bottega_scene::{Image, ImageId};

    fn scene_with(environment_size: (u32, u32), texel: impl Fn(u32, u32) -> [f32; 3]) -> Scene {
        let (width, height) = environment_size;
        let data = (0..width * height).map(|i| texel(i % width, i / width)).collect();
        Scene { images: vec![Image::from_linear_rgb("environment", width, height, data)].into(), ..Scene::default() }
    }

    fn environment() -> Environment {
        Environment {
            image: Some(ImageId(0)),
            factor: Spectrum::new(2.0, 1.0, 0.5),
            mapping: EnvironmentMapping::LatitudeLongitude,
            world_from_environment: Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(0.3),
            ..Environment::uniform(Spectrum::ONE)
        }
    }

    /// Samples a direction; returns it with its radiance and its density in sr⁻¹.
    fn sample(light: &EnvironmentLight, scene: &Scene, u: [f32; 2]) -> Option<(Vec3, Spectrum, f32)> {
        light.sample(scene, u).map(|(direction, radiance, pdf)| (direction, radiance, pdf.per_sr()))
    }

    /// Returns the density of a direction in sr⁻¹.
    fn density(light: &EnvironmentLight, direction: Vec3) -> f32 {
        light.pdf(direction).per_sr()
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
            let (direction, radiance, pdf) = sample(&light, &scene, u).unwrap();
            assert!(direction.is_normalized());
            let again = density(&light, direction);
            // Rounding moves some directions into the next cell.
            if (again - pdf).abs() < 1e-3 * pdf {
                assert!((light.radiance(&scene, direction) - radiance).length() < 0.05 * radiance.length());
            }
            by_light += radiance / pdf / (128.0 * 128.0);
        }
        let by_uniform =
            grid(256).map(|u| light.radiance(&scene, uniform_sphere(u))).sum::<Spectrum>() * (4.0 * PI / 65536.0);
        assert!((by_light / by_uniform - 1.0).abs().max_element() < 0.02, "{by_light} {by_uniform}");
        assert!((light.integral / luminance(by_uniform) - 1.0).abs() < 0.02);
    }

    #[test]
    fn rows_that_end_at_the_poles_are_seen_and_drawn_there() {
        let scene = scene_with((12, 6), |x, y| [0.1 + (x % 5) as f32, (y * y) as f32 * 0.1, 3.0 - 0.5 * y as f32]);
        let upright = Environment {
            mapping: EnvironmentMapping::LatitudeLongitudeToPoles,
            world_from_environment: Mat3::IDENTITY,
            ..environment()
        };
        let light = EnvironmentLight::new(&scene, &upright, false);
        // Row 1 of 0 to 5 is a fifth of the way down: its blue is found there, and at the poles that of the outer rows
        for (angle, blue) in [(0.0, 3.0), (0.2, 2.5), (0.5, 1.75), (1.0, 0.5)] {
            let (sine, cosine) = (angle * PI).sin_cos();
            let seen = light.radiance(&scene, Vec3::new(sine, cosine, 0.0)).z;
            assert!((seen / 0.5 - blue).abs() < 1e-4, "{angle} {seen}");
        }
        let mut by_light = Spectrum::ZERO;
        for u in grid(256) {
            let Some((direction, radiance, pdf)) = sample(&light, &scene, u) else { continue };
            assert!((density(&light, direction) / pdf - 1.0).abs() < 0.02, "{direction}");
            by_light += radiance / pdf / 65536.0;
        }
        let by_uniform =
            grid(256).map(|u| light.radiance(&scene, uniform_sphere(u))).sum::<Spectrum>() * (4.0 * PI / 65536.0);
        assert!((by_light / by_uniform - 1.0).abs().max_element() < 5e-3, "{by_light} {by_uniform}");
        assert!((light.integral / luminance(by_uniform) - 1.0).abs() < 0.02);
    }

    #[test]
    fn nearly_all_stated_densities_are_found_again() {
        let scene = scene_with((64, 32), |x, y| [((x * 7 + y * 13) % 11) as f32; 3]);
        for compensate in [false, true] {
            let light = EnvironmentLight::new(&scene, &environment(), compensate);
            let same = grid(64).filter(|&u| {
                sample(&light, &scene, u).is_some_and(|(d, _, pdf)| (density(&light, d) - pdf).abs() < 1e-3 * pdf)
            });
            assert!(same.count() > 4000);
        }
    }

    #[test]
    fn the_density_integrates_to_one() {
        let scene = scene_with((16, 8), |x, y| [(x + y) as f32; 3]);
        let light = EnvironmentLight::new(&scene, &environment(), true);
        let integral: f32 = grid(256).map(|u| density(&light, uniform_sphere(u))).sum::<f32>() * 4.0 * PI / 65536.0;
        assert!((integral - 1.0).abs() < 0.02, "{integral}");
    }

    /// Light from half of the sphere in a rotated and mirrored equal-area environment.
    fn equal_area() -> (Scene, Environment) {
        let scene = scene_with((32, 32), |x, y| if x < 20 { [0.5 + (y % 3) as f32, x as f32, 2.0] } else { [0.0; 3] });
        let mirror = Mat3::from_diagonal(Vec3::new(-1.0, 1.0, 1.0));
        let place = environment().world_from_environment * mirror;
        let environment =
            Environment { mapping: EnvironmentMapping::EqualArea, world_from_environment: place, ..environment() };
        (scene, environment)
    }

    #[test]
    fn an_environment_of_equal_areas_is_sampled_as_it_is_seen() {
        let (scene, environment) = equal_area();
        let light = EnvironmentLight::new(&scene, &environment, false);
        let mut by_light = Spectrum::ZERO;
        for u in grid(600) {
            let (direction, radiance, pdf) = sample(&light, &scene, u).unwrap();
            assert!(direction.is_normalized() && radiance != Spectrum::ZERO);
            by_light += radiance / pdf / 360_000.0;
        }
        let by_uniform =
            grid(256).map(|u| light.radiance(&scene, uniform_sphere(u))).sum::<Spectrum>() * (4.0 * PI / 65536.0);
        assert!((by_light / by_uniform - 1.0).abs().max_element() < 0.01, "{by_light} {by_uniform}");
        assert!((light.integral / luminance(by_uniform) - 1.0).abs() < 0.01);
        let density: f32 = grid(256).map(|u| density(&light, uniform_sphere(u))).sum::<f32>() * 4.0 * PI / 65536.0;
        assert!((density - 1.0).abs() < 0.01, "{density}");
    }

    #[test]
    fn places_of_equal_areas_and_directions_belong_together() {
        for u in grid(64) {
            let direction = uniform_sphere(u);
            let place = square_of(direction);
            let back = direction_of_square(place);
            assert!((back - direction).length() < 2e-3, "{direction} {place} {back}");
        }
        assert!((square_of(Vec3::Z) - Vec2::splat(0.5)).length() < 1e-6);
        assert!((square_of(Vec3::X) - Vec2::new(1.0, 0.5)).length() < 1e-6);
        assert!((square_of(Vec3::Y) - Vec2::new(0.5, 1.0)).length() < 1e-6);
        // Equal areas: directions above a latitude take that share of the square.
        let above = grid(200).filter(|&u| direction_of_square(u.into()).z > 0.5).count();
        assert!((above as f32 / 40_000.0 - 0.25).abs() < 2e-3, "{above}");
    }

    #[test]
    fn directions_are_drawn_by_the_density_of_a_picture_with_a_tiny_sun() {
        // One texel a hundred thousand times as bright as the others, which are dark
        let scene = scene_with((64, 32), |x, y| if (x, y) == (40, 9) { [1e5; 3] } else { [0.0; 3] });
        for compensate in [false, true] {
            let light = EnvironmentLight::new(&scene, &environment(), compensate);
            let mut values = Vec::new();
            for u in grid(64) {
                let (_, radiance, pdf) = sample(&light, &scene, u).unwrap();
                values.push(luminance(radiance) / pdf);
            }
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            let largest = values.iter().fold(0.0_f32, |a, &b| a.max(b));
            // The picture is interpolated, and so is the density: no sample is a firefly.
            assert!(largest < 1.2 * mean, "{largest} {mean}");
            assert!((mean / light.integral - 1.0).abs() < 0.01, "{mean} {}", light.integral);
        }
    }

    #[test]
    fn every_direction_that_shines_can_be_drawn() {
        let scene = scene_with((16, 8), |x, y| if (x * 5 + y * 3) % 7 == 0 { [1.0; 3] } else { [0.0; 3] });
        let light = EnvironmentLight::new(&scene, &environment(), false);
        for u in grid(200) {
            let direction = uniform_sphere(u);
            let radiance = luminance(light.radiance(&scene, direction));
            // Near the poles, the weights of a table of eight rows are within a factor of three
            assert!(radiance <= 1e-5 || radiance / density(&light, direction) < 3.0 * light.integral, "{direction}");
        }
    }

    #[test]
    fn directions_and_texture_coordinates_follow_the_model() {
        assert!((latitude_longitude(Vec3::NEG_Z) - Vec2::new(0.5, 0.5)).length() < 1e-6);
        assert!((latitude_longitude(Vec3::X) - Vec2::new(0.75, 0.5)).length() < 1e-6);
        assert!(latitude_longitude(Vec3::Y).y.abs() < 1e-6);
    }

    #[test]
    fn a_uniform_environment_is_left_to_bsdf_sampling_when_compensated() {
        let light = EnvironmentLight::new(&Scene::default(), &Environment { image: None, ..environment() }, true);
        assert!(
            light.illuminance(Vec3::ZERO) == 0.0
                && !light.is_sampled()
                && sample(&light, &Scene::default(), [0.5; 2]).is_none()
        );
        let light = EnvironmentLight::new(&Scene::default(), &Environment { image: None, ..environment() }, false);
        assert!(light.illuminance(Vec3::ZERO) > 0.0 && density(&light, Vec3::X) == 1.0 / (4.0 * PI));
    }
}
