//! Emitters: surfaces, lights without extent, and environments.

use glam::{DMat3, DMat4, DVec3};

use super::color::{ColorRole, TextureUse};
use super::document::{Object, ObjectId};
use super::importer::Importer;
use super::sensor::{fov_axis, standing, vertical_fov};
use super::slide::Slide;
use crate::image::{PictureHeader, PictureKind};
use crate::{
    ColorParam, Environment, EnvironmentMapping, Image, ImageId, Light, LightKind, SceneError, Spectrum, SpotFalloff,
    TextureMap, Wrap,
};

impl Importer<'_> {
    /// Returns the radiance that a surface emits from its front.
    pub(super) fn area_radiance(&mut self, id: ObjectId) -> Result<ColorParam, SceneError> {
        let object = self.visit(id)?;
        self.color(object, "radiance", ColorRole::Radiance, Spectrum::ONE)
    }

    /// Adds an emitter at the top of the scene.
    pub(super) fn add_emitter(&mut self, id: ObjectId) -> Result<(), SceneError> {
        let object = self.visit(id)?;
        let has_extent = !matches!(object.plugin.as_str(), "point" | "spot" | "directional" | "projector");
        if !has_extent && self.bad(object.float("sampling_weight"))? == Some(0.0) {
            self.report.note(object.at, "a lamp without extent whose `sampling_weight` is 0 shines nowhere");
            self.accept_all(object);
            return Ok(());
        }
        let to_world = self.to_world(object)?;
        match object.plugin.as_str() {
            "constant" => {
                let radiance = self.plain_color(object, "radiance", ColorRole::Radiance, Spectrum::ONE)?;
                self.set_environment(object, Environment::uniform(radiance));
            }
            "envmap" => self.environment_map(object, &to_world)?,
            "sky" | "sun" | "sunsky" => self.sun_and_sky(object, &to_world)?,
            "point" => {
                let position = self.bad(object.vector("position"))?;
                let position = to_world.transform_point3(position.unwrap_or(DVec3::ZERO)).as_vec3();
                let intensity = self.plain_color(object, "intensity", ColorRole::Radiance, Spectrum::ONE)?;
                self.add_light(object, LightKind::Point { position, intensity });
            }
            "spot" => self.spot(object, &to_world)?,
            "directional" => {
                let direction = self.bad(object.vector("direction"))?.unwrap_or(DVec3::Z);
                let Some(direction) = to_world.transform_vector3(direction).try_normalize() else {
                    return Err(self.report.invalid(object.at, "the light has no direction"));
                };
                let irradiance = self.plain_color(object, "irradiance", ColorRole::Radiance, Spectrum::ONE)?;
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

    /// Sets the environment; warns and ignores it if there already is one.
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
        let place = self.report.show(object.at);
        let image = self.pictures.want_at(location, PictureKind::COLORS, false, &place);
        // Mitsuba's picture begins at −z; ours has −z at the centre.
        let half_turn = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
        let world_from_environment = self.rotation(object, to_world) * half_turn;
        let environment = Environment::picture(image, Spectrum::splat(scale), world_from_environment.as_mat3());
        let mapping = EnvironmentMapping::LatitudeLongitudeToPoles;
        self.set_environment(object, Environment { mapping, ..environment });
        Ok(())
    }

    /// Returns the orthonormal part of a transformation; it may mirror.
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
        // The falloff needs a non-empty transition.
        let beam = beam.min(cutoff * 0.9999);
        let Some(direction) = to_world.transform_vector3(DVec3::Z).try_normalize() else {
            return Err(self.report.invalid(object.at, "the light has no direction"));
        };
        let intensity = self.plain_color(object, "intensity", ColorRole::Radiance, Spectrum::ONE)?;
        if let Some(child) = object.child("texture") {
            let texture = self.texture(child.object, TextureUse::Color(ColorRole::Unbounded))?;
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

    /// Adds a spot light whose picture fills the square around its cone.
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
        // Set the picture later, once the file's is decoded.
        let picture = TextureMap { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..TextureMap::new(ImageId(u32::MAX)) };
        self.add_light(
            object,
            LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect: 1.0 },
        );
        Ok(())
    }

    fn projector(&mut self, object: &Object, to_world: &DMat4) -> Result<(), SceneError> {
        let scale = self.number_at_least(object, "scale", 0.0, 1.0)? as f32;
        // Its `irradiance` is the radiance of a white wall perpendicular to the axis at distance 1, whose irradiance is
        // π times as much.
        let mut factor = Spectrum::splat(scale * std::f32::consts::PI);
        let mut picture = None;
        let mut aspect = 1.0;
        if let Some(child) = object.child("irradiance") {
            let texture = self.texture(child.object, TextureUse::Color(ColorRole::Radiance))?;
            factor *= texture.factor;
            picture = texture.map.map(|(map, _)| map);
            let inner = self.document.get(child.object);
            if inner.plugin == "bitmap" {
                // Read the header for the aspect ratio.
                let bytes = self.resources.read(&self.filename(inner)?)?;
                if let Ok(header) = PictureHeader::read(&bytes, u64::MAX) {
                    let (width, height) = header.size();
                    aspect = f64::from(width) / f64::from(height);
                }
            }
        } else {
            factor *= self.plain_color(object, "irradiance", ColorRole::Radiance, Spectrum::ONE)?;
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
