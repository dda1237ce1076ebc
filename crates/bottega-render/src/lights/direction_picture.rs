//! Pictures that give a factor for each direction: profiles of lamps.
//!
//! Parameters: the picture by latitude and longitude, whose texels are interpolated; a rotation.

use std::f32::consts::PI;

use bottega_kernels::math;
use bottega_scene::{DirectionPicture, EnvironmentMapping, Image, ImageId, Scene, Spectrum, TextureMap, Wrap};
use glam::{Mat3, Vec3};

use super::environment::{EnvironmentRows, latitude_longitude, square_of};

/// Most texels of the level of a picture of which [`PictureExtent`] is computed.
const TEXELS_MAX: u32 = 1 << 14;

/// A picture of directions, ready for lookups.
pub(super) struct DirectionLookup<'a> {
    image: &'a Image,
    map: TextureMap,
    mapping: EnvironmentMapping,
    world_from_light: Mat3,
}

impl<'a> DirectionLookup<'a> {
    /// Prepares the picture of a surface.
    pub(super) fn new(scene: &'a Scene, picture: &DirectionPicture) -> Self {
        let mapping = EnvironmentMapping::LatitudeLongitudeToPoles;
        Self::with_mapping(scene, picture.image, mapping, picture.world_from_light)
    }

    /// Prepares a picture of any layout. Like pbrt, the nearest texel of a picture of equal areas is used.
    pub(super) fn with_mapping(
        scene: &'a Scene,
        image: ImageId,
        mapping: EnvironmentMapping,
        world_from_light: Mat3,
    ) -> Self {
        let is_equal_area = mapping == EnvironmentMapping::EqualArea;
        let wrap_v = if is_equal_area { Wrap::Repeat } else { Wrap::Clamp };
        let map = TextureMap { wrap_v, smooth: !is_equal_area, ..TextureMap::new(image) };
        Self { image: &scene.images[image.0 as usize], map, mapping, world_from_light }
    }

    /// Returns the factor of a direction of unit length. Like pbrt, a picture of equal areas gives the mean of its channels.
    pub(super) fn factor(&self, direction: Vec3) -> Spectrum {
        let local = self.world_from_light.transpose() * direction;
        if self.mapping == EnvironmentMapping::EqualArea {
            let texel = self.image.eval(&self.map, square_of(local), 0.0).truncate();
            return Spectrum::splat(texel.element_sum() / 3.0);
        }
        let rows = EnvironmentRows::new(self.mapping, self.image.size().1);
        self.image.eval(&self.map, rows.place(latitude_longitude(local)), 0.0).truncate()
    }
}

/// The directions into which a picture sends light, roughly, and its strength.
#[derive(Clone, Copy, Debug)]
pub(super) struct PictureExtent {
    /// Axis and half angle of a cone that has all of the light, world space.
    pub(super) axis: Vec3,
    pub(super) angle: f32,
    /// Greatest factor.
    pub(super) peak: f32,
    /// Mean of the factor over all directions.
    pub(super) mean: f32,
}

impl PictureExtent {
    /// Computes the extent of a picture by latitude and longitude.
    pub(super) fn new(scene: &Scene, picture: &DirectionPicture) -> Self {
        let image = &scene.images[picture.image.0 as usize];
        let is_small = |level: &usize| {
            let (width, height) = image.level_size(*level);
            width.saturating_mul(height) <= TEXELS_MAX
        };
        let level = (0..image.level_count()).find(is_small).unwrap_or(image.level_count() - 1);
        let (width, height) = image.level_size(level);
        let (mut peak, mut sum, mut weights) = (0.0_f32, 0.0_f32, 0.0_f32);
        let mut lit: Option<(u32, u32)> = None;
        for row in 0..height {
            let weight = math::sin(PI * (row as f32 + 0.5) / height as f32);
            let (mut row_peak, mut row_sum) = (0.0_f32, 0.0_f32);
            for column in 0..width {
                let value = (image.level_texel(level, column, row).truncate().element_sum() / 3.0).max(0.0);
                row_peak = row_peak.max(value);
                row_sum += value;
            }
            if row_peak > 0.0 {
                lit = Some((lit.map_or(row, |(first, _)| first), row));
            }
            peak = peak.max(row_peak);
            sum += weight * row_sum / width as f32;
            weights += weight;
        }
        let whole = Self { axis: picture.world_from_light * Vec3::Y, angle: PI, peak, mean: sum / weights };
        // Means of coarse levels of 8 bits may lose light
        let Some((first, last)) = lit.filter(|_| level == 0 || image.is_high_dynamic_range()) else { return whole };
        // One more row on each side, for the interpolation
        let rows = |count: u32| (PI * (count as f32 + 1.5) / height as f32).min(PI);
        let (from_top, from_bottom) = (rows(last), rows(height - 1 - first));
        if from_top <= from_bottom {
            Self { angle: from_top, ..whole }
        } else {
            Self { axis: -whole.axis, angle: from_bottom, ..whole }
        }
    }

    /// Returns the mean over the greatest factor.
    pub(super) fn share(&self) -> f32 {
        if self.peak > 0.0 { self.mean / self.peak } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose upper `lit` rows are bright.
    fn scene(rows: u32, lit: u32) -> Scene {
        let texel = |row: u32| if row < lit { [0.5, 1.0, 1.5] } else { [0.0; 3] };
        let image = Image::from_linear_rgb("lamp", 4, rows, (0..4 * rows).map(|i| texel(i / 4)).collect());
        Scene { images: vec![image].into(), ..Scene::default() }
    }

    fn picture(world_from_light: Mat3) -> DirectionPicture {
        DirectionPicture { image: ImageId(0), world_from_light }
    }

    #[test]
    fn the_first_and_the_last_row_are_the_poles() {
        let scene = scene(3, 1);
        let lookup = picture(Mat3::from_rotation_z(std::f32::consts::FRAC_PI_2));
        let factor = |direction: Vec3| DirectionLookup::new(&scene, &lookup).factor(direction).y;
        // +y of the light is −x of the world
        assert!((factor(Vec3::NEG_X) - 1.0).abs() < 1e-5 && factor(Vec3::X).abs() < 1e-5);
        assert!(factor(Vec3::Z).abs() < 1e-5);
        let between = Vec3::new(-1.0, 1.0, 0.0).normalize();
        assert!((factor(between) - 0.5).abs() < 1e-4);
    }

    #[test]
    fn the_cone_has_all_of_the_light() {
        let scene = scene(181, 31);
        let extent = PictureExtent::new(&scene, &picture(Mat3::IDENTITY));
        assert_eq!((extent.axis, extent.peak), (Vec3::Y, 1.0));
        assert!(extent.angle > 31.0_f32.to_radians() && extent.angle < 34.0_f32.to_radians());
        // (1 − cos 31°) / 2
        assert!((extent.mean - 0.0714).abs() < 0.002, "{}", extent.mean);
    }
}
