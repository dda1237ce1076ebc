//! Emitters: those of surfaces, those without extent, and environments.

use std::path::Path;

use glam::{DMat3, DMat4, DVec2, DVec3, UVec2, Vec2};
use rayon::prelude::*;

use super::Importer;
use super::color::Role;
use super::document::{Object, ObjectId};
use super::sensor::{fov_axis, standing, vertical_fov};
use super::texture::Use;
use crate::image::{Encoding, Header};
use crate::load::MemoryBudget;
use crate::{
    ColorParam, Environment, EnvironmentMapping, Image, ImageId, Light, LightKind, Scene, SceneError, Spectrum,
    SpotFalloff, TextureMap, Wrap,
};

impl Importer<'_> {
    /// What a surface emits, from its front.
    pub(super) fn area_radiance(&mut self, id: ObjectId) -> Result<ColorParam, SceneError> {
        let object = self.visit(id)?;
        self.ignore_sampling(object);
        self.color(object, "radiance", Role::Radiance, Spectrum::ONE)
    }

    fn ignore_sampling(&self, object: &Object) {
        // These tell how to sample, not what is there.
        object.ignore(&["sampling_weight", "shape", "shadow_map_resolution"]);
    }

    /// An emitter of the scene itself.
    pub(super) fn add_emitter(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let object = self.visit(id)?;
        self.ignore_sampling(object);
        let to_world = self.to_world(object)?;
        match object.plugin.as_str() {
            "constant" => {
                let radiance = self.plain_color(object, "radiance", Role::Radiance, Spectrum::ONE)?;
                self.set_environment(object, Environment::uniform(radiance));
            }
            "envmap" => self.environment_map(object, &to_world)?,
            "sky" | "sun" | "sunsky" => self.sun_and_sky(object, &to_world)?,
            "point" => {
                let position = self.bad(object.vector("position"))?;
                let position = to_world.transform_point3(position.unwrap_or(DVec3::ZERO)).as_vec3();
                let intensity = self.plain_color(object, "intensity", Role::Radiance, Spectrum::ONE)?;
                self.add_light(object, LightKind::Point { position, intensity });
            }
            "spot" => self.spot(object, &to_world)?,
            "directional" => {
                let direction = self.bad(object.vector("direction"))?.unwrap_or(DVec3::Z);
                let Some(direction) = to_world.transform_vector3(direction).try_normalize() else {
                    return Err(self.report.invalid(object.at, "the light has no direction"));
                };
                let irradiance = self.plain_color(object, "irradiance", Role::Radiance, Spectrum::ONE)?;
                self.add_light(object, LightKind::Directional { direction: direction.as_vec3(), irradiance });
            }
            "projector" => self.projector(object, &to_world)?,
            "area" => self.report.warn(object.at, "an area emitter outside of a shape shines nowhere"),
            _ => {
                self.report.warn(object.at, format!("the {} is not supported and left out", object.describe()));
                self.accept_all(object);
            }
        }
        Ok(())
    }

    fn add_light(&mut self, object: &Object, kind: LightKind) {
        self.scene.lights.push(Light { name: object.label(), kind });
    }

    pub(super) fn set_environment(&mut self, object: &Object, environment: Environment) {
        if self.scene.environment.is_some() {
            self.report.warn(object.at, "there is a second environment; the first one counts");
            return;
        }
        self.scene.environment = Some(environment);
    }

    fn environment_map(&mut self, object: &Object, to_world: &DMat4) -> Result<(), SceneError> {
        let location = self.filename(object)?;
        let scale = self.number_at_least(object, "scale", 0.0, 1.0)? as f32;
        object.ignore(&["mis_compensation", "cache"]);
        let place = self.report.show(object.at);
        let image = self.pictures.want_at(location, Encoding::Srgb, false, &place);
        // Mitsuba's picture begins at −z, ours has −z in the middle.
        let half_turn = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
        let world_from_environment = self.rotation(object, to_world) * half_turn;
        let environment = Environment::picture(image, Spectrum::splat(scale), world_from_environment.as_mat3());
        let mapping = EnvironmentMapping::LatitudeLongitudeToPoles;
        self.set_environment(object, Environment { mapping, ..environment });
        Ok(())
    }

    /// The orthonormal part of a transformation; it may mirror.
    pub(super) fn rotation(&mut self, object: &Object, to_world: &DMat4) -> DMat3 {
        match standing(to_world) {
            Some((rotation, _, is_pure)) => {
                if !is_pure {
                    self.report.warn(object.at, format!("the scale of the {} is left out", object.describe()));
                }
                rotation
            }
            None => {
                self.report.warn(object.at, format!("the {} has no orientation", object.describe()));
                DMat3::IDENTITY
            }
        }
    }

    fn spot(&mut self, object: &Object, to_world: &DMat4) -> Result<(), SceneError> {
        let cutoff = self.number_at_least(object, "cutoff_angle", 0.01, 20.0)?.min(179.0);
        let beam = self.number_at_least(object, "beam_width", 0.0, cutoff * 0.75)?;
        // A sharp edge still needs some width.
        let beam = beam.min(cutoff * 0.9999);
        let Some(direction) = to_world.transform_vector3(DVec3::Z).try_normalize() else {
            return Err(self.report.invalid(object.at, "the light has no direction"));
        };
        let intensity = self.plain_color(object, "intensity", Role::Radiance, Spectrum::ONE)?;
        if let Some(child) = object.child("texture") {
            let texture = self.texture(child.object, Use::Color(Role::Unbounded))?;
            if let Some((map, _)) = texture.map {
                return self.spot_with_picture(
                    object,
                    to_world,
                    intensity * texture.factor,
                    Slide::new(map, beam, cutoff),
                );
            }
            self.report.warn(child.at, "the texture of a spot does not vary, and is left out");
        }
        let (cos_inner, cos_outer) = (beam.to_radians().cos() as f32, cutoff.to_radians().cos() as f32);
        let cos_outer = cos_outer.min(cos_inner.next_down()).max(-1.0);
        self.add_light(
            object,
            LightKind::Spot {
                position: to_world.w_axis.truncate().as_vec3(),
                direction: direction.as_vec3(),
                intensity,
                cos_inner,
                cos_outer,
                falloff: SpotFalloff::LinearAngle,
            },
        );
        Ok(())
    }

    /// A spot whose picture fills the square around its cone.
    fn spot_with_picture(
        &mut self,
        object: &Object,
        to_world: &DMat4,
        intensity: Spectrum,
        slide: Slide,
    ) -> Result<(), SceneError> {
        let Some((rotation, position, _)) = standing(to_world) else {
            return Err(self.report.invalid(object.at, "the transformation of the spot is singular"));
        };
        if slide.cutoff >= 89.0_f64.to_radians() {
            return Err(self.report.invalid(object.at, "a picture cannot fill a cone of 89 degrees or more"));
        }
        let vertical_fov = 2.0 * slide.cutoff as f32;
        self.slides.push((self.scene.lights.len(), slide));
        let world_from_light = super::sensor::looking(&rotation, position);
        // The picture follows when that of the file is there.
        let picture = TextureMap { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..TextureMap::new(ImageId(u32::MAX)) };
        self.add_light(
            object,
            LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect: 1.0 },
        );
        Ok(())
    }

    fn projector(&mut self, object: &Object, to_world: &DMat4) -> Result<(), SceneError> {
        let scale = self.number_at_least(object, "scale", 0.0, 1.0)? as f32;
        // Its `irradiance` is the radiance of a white wall across the axis at distance 1: π times as much arrives there.
        let mut factor = Spectrum::splat(scale * std::f32::consts::PI);
        let mut picture = None;
        let mut aspect = 1.0;
        if let Some(child) = object.child("irradiance") {
            let texture = self.texture(child.object, Use::Color(Role::Radiance))?;
            factor *= texture.factor;
            picture = texture.map.map(|(map, _)| map);
            let inner = self.document.get(child.object);
            if inner.plugin == "bitmap" {
                // Its proportions are wanted before it is decoded.
                let bytes = self.resources.read(&self.filename(inner)?)?;
                if let Ok(header) = Header::read(&bytes, u64::MAX) {
                    let (width, height) = header.size();
                    aspect = f64::from(width) / f64::from(height);
                }
            }
        } else {
            factor *= self.plain_color(object, "irradiance", Role::Radiance, Spectrum::ONE)?;
        }
        let picture = picture.unwrap_or_else(|| {
            TextureMap::new(self.pictures.add(Image::from_linear_rgb("white", 1, 1, vec![[1.0; 3]])))
        });
        let axis = fov_axis(self, object)?;
        let fov = self.fov(object)?;
        let Some((rotation, position, _)) = standing(to_world) else {
            return Err(self.report.invalid(object.at, "the transformation of the projector is singular"));
        };
        let world_from_light = super::sensor::looking(&rotation, position);
        self.add_light(
            object,
            LightKind::Projector {
                world_from_light,
                picture,
                intensity: factor,
                vertical_fov: vertical_fov(fov, axis, aspect) as f32,
                aspect: aspect as f32,
            },
        );
        Ok(())
    }
}

/// Texels along a side of what a spot with a picture throws: so many at least, for how it fades towards its edge.
const SLIDE_SIDE_MIN: f32 = 512.0;
/// The most texels along a side. A finer picture is averaged.
const SLIDE_SIDE_MAX: f32 = 4096.0;

/// The picture that a spot throws, and how it fades towards the edge of the cone.
pub(super) struct Slide {
    map: TextureMap,
    /// Half angles in radians: of full intensity, and beyond which there is nothing.
    beam: f64,
    cutoff: f64,
}

impl Slide {
    /// - `beam`, `cutoff`: half angles in degrees.
    fn new(map: TextureMap, beam: f64, cutoff: f64) -> Self {
        Self { map, beam: beam.to_radians(), cutoff: cutoff.to_radians() }
    }

    /// Columns and rows of what is thrown: those of the picture, or so many times as many, so that its texels stay where they
    /// are; fewer where there are too many.
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

    /// The picture of a projector that throws the same.
    fn image(&self, picture: &Image, size: UVec2) -> Image {
        let sides = size.as_dvec2();
        // Where texels of the picture are smaller than ours, its mean over each is taken, by quarters.
        let footprint = (1.0 / sides).max_element() as f32;
        let (width, height) = picture.size();
        let scale = self.map.picture_from_uv.matrix2 * glam::Mat2::from_diagonal((1.0 / sides).as_vec2());
        let texel_extent =
            [scale.x_axis, scale.y_axis].map(|axis| (axis * Vec2::new(width as f32, height as f32)).length());
        let is_finer = texel_extent.iter().any(|extent| *extent > 1.001);
        let color = |place: DVec2| {
            // Seen along our axes, the texture is turned half round.
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
            // A projector divides by the cube of the cosine.
            (color(place) * (fading * cosine.powi(3))).as_vec3().to_array()
        };
        let texels = (0..size.x * size.y).into_par_iter().map(texel).collect();
        Image::from_linear_rgb(picture.name.clone(), size.x, size.y, texels)
    }
}

/// Puts the pictures of spots into a scene that has those of the file. Each has the index of its light.
pub(super) fn add_slides(
    scene: &mut Scene,
    slides: &[(usize, Slide)],
    budget: &MemoryBudget,
    path: &Path,
) -> Result<(), SceneError> {
    for (light, slide) in slides {
        let thrown = &scene.images[slide.map.image.0 as usize];
        let size = slide.size(thrown);
        budget.take(path, "", (size.x * size.y) as usize * size_of::<[f32; 3]>() * 4 / 3)?;
        let made = slide.image(thrown, size);
        // What fades is not to have steps where texels are large.
        let is_enlarged = size.x > thrown.size().0 || size.y > thrown.size().1;
        let next = ImageId(scene.images.len() as u32);
        if let LightKind::Projector { picture, .. } = &mut scene.lights[*light].kind {
            (picture.image, picture.smooth) = (next, slide.map.smooth || is_enlarged);
            scene.images.push(made);
        }
    }
    Ok(())
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
    fn what_a_spot_throws_has_the_mean_of_its_picture_at_any_size() {
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
        // Full up to the corners, but for the cosines.
        let picture = columns(1920, 1080);
        let slide = Slide::new(TextureMap::new(ImageId(0)), 88.0, 88.5);
        let size = slide.size(&picture);
        assert_eq!(size, UVec2::new(1920, 1080));
        let thrown = slide.image(&picture, size);
        for x in [959, 960, 961] {
            let texel = thrown.texel(x, 540).truncate();
            // Turned half round, the last column comes first.
            let expected = ((1919 - x) % 3) as usize;
            assert!(texel[expected] > 0.0 && texel.element_sum() == texel[expected], "{x}: {texel}");
        }
        assert_eq!(slide.size(&columns(3, 700)), UVec2::new(513, 700));
        assert_eq!(slide.size(&columns(5000, 1)), UVec2::new(4096, 512));
    }
}
