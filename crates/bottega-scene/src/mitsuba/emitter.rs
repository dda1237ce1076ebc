//! Emitters at the top of the scene: lights without extent, and environments.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::context::ImportContext;
use super::document::{Object, ObjectId};
use super::fov::{fov, fov_axis, vertical_fov};
use super::orientation::{looking, rotation, standing};
use super::sky::sun_and_sky;
use super::texture::{MitsubaTextures, TextureUse};
use crate::color::Spectrum;
use crate::image::Image;
use crate::image::decode::PictureHeader;
use crate::image::pictures::PictureKind;
use crate::import::projector::Slide;
use crate::import::text_place::ImportResult;
use crate::light::{Environment, EnvironmentMapping, Light, LightKind, SpotFalloff};
use crate::spectrum::role::ColorRole;
use crate::texture::{ImageId, TextureMap, Wrap};

/// The lights without extent and the environment of a scene.
#[derive(Default)]
pub(super) struct Emitters {
    pub(super) lights: Vec<Light>,
    pub(super) environment: Option<Environment>,
    /// Pictures of spot lights, each with the index of its light.
    pub(super) slides: Vec<(usize, Slide)>,
}

impl Emitters {
    /// Adds an emitter at the top of the scene, with its motion.
    pub(super) fn add(
        &mut self,
        context: &mut ImportContext<'_>,
        textures: &mut MitsubaTextures<'_>,
        id: ObjectId,
    ) -> ImportResult<()> {
        let before = self.lights.len();
        self.add_still(context, textures, id)?;
        let object = context.document.get(id);
        let Some(path) = object.animation("to_world") else { return Ok(()) };
        match self.lights.get_mut(before) {
            Some(light) if !matches!(light.kind, LightKind::Directional { .. }) => {
                let path = path.then(&DAffine3::from_translation(-context.origin));
                light.motion = path.after(&path.first().inverse()).motion(DAffine3::as_affine3a);
            }
            _ => context.warn(object.at, format!("the {} moves; it keeps its first pose", object.describe())),
        }
        Ok(())
    }

    /// Adds an emitter as it is at first.
    fn add_still(
        &mut self,
        context: &mut ImportContext<'_>,
        textures: &mut MitsubaTextures<'_>,
        id: ObjectId,
    ) -> ImportResult<()> {
        let object = context.visit(id)?;
        let has_extent = !matches!(object.plugin.as_str(), "point" | "spot" | "directional" | "projector");
        if !has_extent && object.float("sampling_weight")? == Some(0.0) {
            context.note(object.at, "a light without extent whose `sampling_weight` is 0 emits no light");
            object.accept_all();
            return Ok(());
        }
        let to_world = context.to_world(object)?;
        match object.plugin.as_str() {
            "constant" => {
                let radiance = textures.plain_color(context, object, "radiance", ColorRole::Emission, Spectrum::ONE)?;
                self.set_environment(context, object, Environment::uniform(radiance));
            }
            "envmap" => {
                let environment = environment_map(context, textures, object, &to_world)?;
                self.set_environment(context, object, environment);
            }
            "sky" | "sun" | "sunsky" => {
                let environment = sun_and_sky(context, textures, object, &to_world)?;
                self.set_environment(context, object, environment);
            }
            "point" => {
                let position = object.vector("position")?;
                let position = to_world.transform_point3(position.unwrap_or(DVec3::ZERO)).as_vec3();
                let intensity =
                    textures.plain_color(context, object, "intensity", ColorRole::Emission, Spectrum::ONE)?;
                self.add_light(object, LightKind::Point { position, intensity });
            }
            "spot" => self.spot(context, textures, object, &to_world)?,
            "directional" => {
                let direction = object.vector("direction")?.unwrap_or(DVec3::Z);
                let Some(direction) = to_world.transform_vector3(direction).try_normalize() else {
                    return Err(object.at.fault("the light has no direction").into());
                };
                let irradiance =
                    textures.plain_color(context, object, "irradiance", ColorRole::Emission, Spectrum::ONE)?;
                let direction = direction.as_vec3();
                self.add_light(object, LightKind::Directional { direction, irradiance, angle: 0.0 });
            }
            "projector" => {
                let kind = projector(context, textures, object, &to_world)?;
                self.add_light(object, kind);
            }
            "area" => context.warn(object.at, "an area emitter outside of a shape emits no light"),
            _ => {
                context.warn(object.at, format!("the {} is not supported and left out", object.describe()));
                object.accept_all();
            }
        }
        Ok(())
    }

    fn add_light(&mut self, object: &Object, kind: LightKind) {
        self.lights.push(Light::new(object.label(), kind));
    }

    /// Sets the environment; warns and ignores it if there already is one.
    fn set_environment(&mut self, context: &mut ImportContext<'_>, object: &Object, environment: Environment) {
        if self.environment.is_some() {
            context.warn(object.at, "there is a second environment; the first one counts");
            return;
        }
        self.environment = Some(environment);
    }

    fn spot(
        &mut self,
        context: &mut ImportContext<'_>,
        textures: &mut MitsubaTextures<'_>,
        object: &Object,
        to_world: &DMat4,
    ) -> ImportResult<()> {
        let cutoff = object.float_at_least("cutoff_angle", 0.01, 20.0)?.min(179.0);
        let beam = object.float_at_least("beam_width", 0.0, cutoff * 0.75)?;
        // The falloff needs a non-empty transition.
        let beam = beam.min(cutoff * 0.9999);
        let Some(direction) = to_world.transform_vector3(DVec3::Z).try_normalize() else {
            return Err(object.at.fault("the light has no direction").into());
        };
        let intensity = textures.plain_color(context, object, "intensity", ColorRole::Emission, Spectrum::ONE)?;
        if let Some(child) = object.child("texture") {
            let texture = textures.texture(context, child.object, TextureUse::Color(ColorRole::Unbounded))?;
            if let Some((map, _)) = texture.map {
                return self.spot_with_picture(
                    object,
                    to_world,
                    intensity * texture.factor,
                    Slide::new(map, beam, cutoff),
                );
            }
            context.warn(child.at, "the texture of a spot does not vary, and is left out");
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
    ) -> ImportResult<()> {
        let Some((rotation, position, _)) = standing(to_world) else {
            return Err(object.at.fault("the transformation of the spot is singular").into());
        };
        if slide.cutoff >= 89.0_f64.to_radians() {
            return Err(object.at.fault("a picture cannot fill a cone of 89 degrees or more").into());
        }
        let vertical_fov = 2.0 * slide.cutoff as f32;
        self.slides.push((self.lights.len(), slide));
        let world_from_light = looking(&rotation, position);
        // Set the picture later, once the file's is decoded.
        let picture = TextureMap { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..TextureMap::new(ImageId(u32::MAX)) };
        self.add_light(
            object,
            LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect: 1.0 },
        );
        Ok(())
    }
}

fn environment_map(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
    to_world: &DMat4,
) -> ImportResult<Environment> {
    let location = context.filename(object)?;
    let scale = object.float_at_least("scale", 0.0, 1.0)? as f32;
    let place = context.place(object.at);
    let image = textures.pictures.want_at(location, PictureKind::COLORS, false, &place);
    // Mitsuba's picture begins at −z; ours has −z at the centre.
    let half_turn = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, -1.0));
    let world_from_environment = rotation(context, object, to_world) * half_turn;
    let environment = Environment::picture(image, Spectrum::splat(scale), world_from_environment.as_mat3());
    let mapping = EnvironmentMapping::LatitudeLongitudeToPoles;
    Ok(Environment { mapping, ..environment })
}

fn projector(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
    to_world: &DMat4,
) -> ImportResult<LightKind> {
    let scale = object.float_at_least("scale", 0.0, 1.0)? as f32;
    // Its `irradiance` is the radiance of a white wall perpendicular to the axis at distance 1, whose irradiance is
    // π times as much.
    let mut factor = Spectrum::splat(scale * std::f32::consts::PI);
    let mut picture = None;
    let mut aspect = 1.0;
    if let Some(child) = object.child("irradiance") {
        let texture = textures.texture(context, child.object, TextureUse::Color(ColorRole::Emission))?;
        factor *= texture.factor;
        picture = texture.map.map(|(map, _)| map);
        let inner = context.document.get(child.object);
        if inner.plugin == "bitmap" {
            // Read the header for the aspect ratio.
            let bytes = context.resources.read(&context.filename(inner)?)?;
            if let Ok(header) = PictureHeader::read(&bytes, u64::MAX) {
                let (width, height) = header.size();
                aspect = f64::from(width) / f64::from(height);
            }
        }
    } else {
        factor *= textures.plain_color(context, object, "irradiance", ColorRole::Emission, Spectrum::ONE)?;
    }
    let picture = picture.unwrap_or_else(|| {
        TextureMap::new(textures.pictures.add(Image::from_linear_rgb("white", 1, 1, vec![[1.0; 3]])))
    });
    let axis = fov_axis(context, object)?;
    let fov = fov(object)?;
    let Some((rotation, position, _)) = standing(to_world) else {
        return Err(object.at.fault("the transformation of the projector is singular").into());
    };
    let world_from_light = looking(&rotation, position);
    Ok(LightKind::Projector {
        world_from_light,
        picture,
        intensity: factor,
        vertical_fov: vertical_fov(fov, axis, aspect) as f32,
        aspect: aspect as f32,
    })
}
