//! Pictures of projectors. A projector divides its picture by the cube of the cosine to its axis; where a format does
//! not, the picture is multiplied by it.

use std::path::Path;

use glam::{DVec2, DVec3, Mat2, UVec2, Vec2};
use rayon::prelude::*;

use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::image::Image;
use crate::light::LightKind;
use crate::model::Scene;
use crate::texture::{ImageId, TextureMap};

/// Least side of a spot light's picture, in texels, to resolve the falloff towards the edge.
const SLIDE_SIDE_MIN: f32 = 512.0;

/// Maximal side, in texels. A finer picture is averaged.
const SLIDE_SIDE_MAX: f32 = 4096.0;

/// The picture of a spot light, and its falloff towards the edge of the cone.
pub(crate) struct Slide {
    map: TextureMap,
    /// Half angles in radians: of full intensity (`beam`), and where it reaches 0 (`cutoff`).
    beam: f64,
    pub(crate) cutoff: f64,
}

impl Slide {
    /// Makes a slide.
    ///
    /// - `beam`, `cutoff`: half angles in degrees.
    pub(crate) fn new(map: TextureMap, beam: f64, cutoff: f64) -> Self {
        Self { map, beam: beam.to_radians(), cutoff: cutoff.to_radians() }
    }

    /// Returns the size of the projected picture: a multiple of the original's size, so that texel edges stay aligned,
    /// but within the limit.
    fn size(&self, picture: &Image) -> UVec2 {
        let (width, height) = picture.size();
        let texels = Vec2::new(width as f32, height as f32);
        let matrix = self.map.picture_from_uv.matrix2;
        let along = |axis: Vec2| {
            let count = (axis * texels).abs().max_element().ceil().max(1.0);
            let enlarged = count * (SLIDE_SIDE_MIN / count).ceil();
            enlarged.clamp(1.0, SLIDE_SIDE_MAX) as u32
        };
        UVec2::new(along(matrix.x_axis), along(matrix.y_axis))
    }

    /// Renders the picture of an equivalent projector.
    fn image(&self, picture: &Image, size: UVec2) -> Image {
        let sides = size.as_dvec2();
        // If the original has smaller texels, average four lookups per texel.
        let footprint = (1.0 / sides).max_element() as f32;
        let (width, height) = picture.size();
        let scale = self.map.picture_from_uv.matrix2 * Mat2::from_diagonal((1.0 / sides).as_vec2());
        let texel_extent =
            [scale.x_axis, scale.y_axis].map(|axis| (axis * Vec2::new(width as f32, height as f32)).length());
        let is_finer = texel_extent.iter().any(|extent| *extent > 1.001);
        let color = |place: DVec2| {
            // The texture is rotated by 180° in our axes.
            let look = |place: DVec2, footprint: f32| {
                picture.eval(&self.map, (1.0 - place).as_vec2(), footprint).truncate().as_dvec3()
            };
            if !is_finer {
                return look(place, 0.0);
            }
            let quarter = 0.25 / sides;
            let quarters = [DVec2::new(-1.0, -1.0), DVec2::new(1.0, -1.0), DVec2::new(-1.0, 1.0), DVec2::ONE];
            quarters.into_iter().map(|side| look(place + side * quarter, 0.5 * footprint)).sum::<DVec3>() * 0.25
        };
        let half_width = self.cutoff.tan();
        let texel = |index: u32| {
            let place = (DVec2::new(f64::from(index % size.x), f64::from(index / size.x)) + 0.5) / sides;
            let cosine = 1.0 / (1.0 + ((2.0 * place - 1.0) * half_width).length_squared()).sqrt();
            let angle = cosine.acos();
            let fading = ((self.cutoff - angle) / (self.cutoff - self.beam)).clamp(0.0, 1.0);
            // Compensate for the projector's division by the cosine cubed.
            (color(place) * (fading * cosine.powi(3))).as_vec3().to_array()
        };
        let texels = (0..size.x * size.y).into_par_iter().map(texel).collect();
        Image::from_linear_rgb(picture.name.clone(), size.x, size.y, texels)
    }
}

/// Adds the pictures of spot lights to a scene whose file pictures are loaded. Each has the index of its light.
pub(crate) fn add_slides(
    scene: &mut Scene,
    slides: &[(usize, Slide)],
    budget: &MemoryBudget,
    path: &Path,
) -> Result<(), SceneError> {
    for (light, slide) in slides {
        let original = &scene.images[slide.map.image.0 as usize];
        let size = slide.size(original);
        budget.take(path, "", (size.x * size.y) as usize * size_of::<[f32; 3]>() * 4 / 3)?;
        let made = slide.image(original, size);
        // Interpolate enlarged texels, so that the falloff has no steps.
        let is_enlarged = size.x > original.size().0 || size.y > original.size().1;
        let next = ImageId(scene.images.len() as u32);
        if let LightKind::Projector { picture, .. } = &mut scene.lights[*light].kind {
            (picture.image, picture.smooth) = (next, slide.map.smooth || is_enlarged);
            scene.images.push(made);
        }
    }
    Ok(())
}

/// Least side of a projected picture: texels are subdivided until the cosine is almost constant within each.
const PROJECTION_SIDE: u32 = 512;

/// Multiplies a picture by the cube of the cosine to the axis of its projection.
///
/// - `fov`: angle of the shorter side, in degrees.
pub(crate) fn projection_image(image: &Image, fov: f64) -> Image {
    let (columns, rows) = image.size();
    let parts = PROJECTION_SIDE.div_ceil(columns.max(rows));
    let (width, height) = (columns * parts, rows * parts);
    let scale = (0.5 * fov.to_radians()).tan() / f64::from(width.min(height));
    let texel = |index: u32| {
        let (x, y) = (index % width, index / width);
        let offset = |place: u32, size: u32| (2.0 * f64::from(place) + 1.0 - f64::from(size)) * scale;
        let cosine = 1.0 / (1.0 + offset(x, width).powi(2) + offset(y, height).powi(2)).sqrt();
        (image.texel(x / parts, y / parts).truncate() * cosine.powi(3) as f32).to_array()
    };
    Image::from_linear_rgb(image.name.clone(), width, height, (0..width * height).map(texel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of red, green and blue, one texel each.
    fn columns(width: u32, height: u32) -> Image {
        let texel = |index: u32| {
            let mut texel = [0; 3];
            texel[(index % width % 3) as usize] = 255;
            texel
        };
        Image::from_rgb8("columns", width, height, (0..width * height).map(texel).collect(), true)
    }

    #[test]
    fn the_light_of_a_spot_has_the_mean_of_its_picture_at_any_size() {
        for (width, height) in [(1920, 1080), (333, 3), (9000, 4)] {
            let picture = columns(width, height);
            let slide = Slide::new(TextureMap::new(ImageId(0)), 20.0, 24.0);
            let size = slide.size(&picture);
            let thrown = slide.image(&picture, size);
            let white = Image::from_rgb8("white", 1, 1, vec![[255; 3]], true);
            let full = slide.image(&white, size).mean();
            let share = thrown.mean() / full;
            for channel in 0..3 {
                let count = (0..width).filter(|x| x % 3 == channel as u32).count();
                let expected = count as f64 / f64::from(width);
                let error = (f64::from(share[channel]) / expected - 1.0).abs();
                assert!(error < 5e-3, "{width} × {height}, {size}: {share}");
            }
        }
    }

    #[test]
    fn a_spot_throws_every_texel_of_its_picture() {
        // The picture fills the slide up to the corners; only the cosines darken it.
        let picture = columns(1920, 1080);
        let slide = Slide::new(TextureMap::new(ImageId(0)), 88.0, 88.5);
        let size = slide.size(&picture);
        assert_eq!(size, UVec2::new(1920, 1080));
        let thrown = slide.image(&picture, size);
        for x in [959, 960, 961] {
            let texel = thrown.texel(x, 540).truncate();
            // Rotated by 180°: the last column comes first.
            let expected = ((1919 - x) % 3) as usize;
            assert!(texel[expected] > 0.0 && texel.element_sum() == texel[expected], "{x}: {texel}");
        }
        assert_eq!(slide.size(&columns(3, 700)), UVec2::new(513, 700));
        assert_eq!(slide.size(&columns(5000, 1)), UVec2::new(4096, 512));
    }
}
