//! Lights without extent, and emission of surfaces.
//!
//! pbrt scales a light spectrum to luminance 1 where `L` or `I` is a spectrum; `rgb` values are used unchanged. `power`
//! and `illuminance` are in watts and W·m⁻², weighted by luminance.

use std::f64::consts::PI;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3, Vec3A};

use super::context::Context;
use super::environment::InfiniteLights;
use super::film::Exposure;
use super::needless::Directive;
use super::place::axes;
use super::texture::PbrtTextures;
use super::world::{Entity, PbrtWorld};
use crate::color::{LUMINANCE, Spectrum};
use crate::image::Image;
use crate::image::pictures::PictureKind;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::light::{EnvironmentMapping, Light, LightKind, SpotFalloff};
use crate::material::Sides;
use crate::model::Scene;
use crate::param::ColorParam;
use crate::spectrum::role::ColorRole;
use crate::text::shortened;
use crate::texture::{ImageId, TextureMap, Wrap};

/// The lights of a scene, some of which need their pictures.
#[derive(Default)]
pub(super) struct Lights {
    list: Vec<Light>,
    /// Index and power, in watts, of lights with pictures.
    powers: Vec<(usize, f64)>,
    /// Pictures of goniometric lights, and their locations in the file.
    goniometric: Vec<(ImageId, TextPlace)>,
    environment: InfiniteLights,
}

impl Lights {
    /// Reads all lights that are not surfaces.
    pub(super) fn new(
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        world: &PbrtWorld,
        exposure: Exposure,
    ) -> ImportResult<Self> {
        let mut lights = Self::default();
        for entity in &world.lights {
            let before = lights.list.len();
            lights.add(context, textures, entity, exposure)?;
            lights.set_motion(context, world, entity, before);
            context.report_unused(Directive::Light, &entity.kind, &entity.params);
        }
        Ok(lights)
    }

    fn add(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        entity: &Entity,
        exposure: Exposure,
    ) -> ImportResult<()> {
        let (params, at) = (&entity.params, entity.at);
        let scale = params.float("scale")?.unwrap_or(1.0);
        if scale.is_nan() || scale < 0.0 {
            return Err(params.place_of("scale").fault("a light's scale is negative").into());
        }
        let name = if entity.kind == "distant" || entity.kind == "infinite" { "L" } else { "I" };
        let color = context.color(params, name)?.map(|color| color.to_rec709(ColorRole::Emission));
        if entity.kind == "infinite" {
            return self.environment.add(context, textures, entity, color, scale, exposure);
        }
        let strength = Strength {
            color: exposure.apply(color.unwrap_or(Spectrum::ONE)),
            scale,
            power: params.float("power")?.filter(|power| *power > 0.0),
        };
        let from = params.point3("from", "point3")?.unwrap_or(DVec3::ZERO);
        let to = params.point3("to", "point3")?.unwrap_or(DVec3::Z);
        let kind = match entity.kind.as_str() {
            "distant" => {
                let illuminance = params.float("illuminance")?.filter(|illuminance| *illuminance > 0.0);
                let direction = direction(&entity.ctm, to - from, at)?;
                let irradiance = strength.times(illuminance.unwrap_or(1.0));
                LightKind::Directional { direction, irradiance, angle: 0.0 }
            }
            "point" => point(strength, position(&entity.ctm, from, at)?),
            "spot" => spot(entity, strength, from, to)?,
            "goniometric" => self.goniometric(context, textures, entity, strength)?,
            "projection" => self.projection(context, textures, entity, strength)?,
            kind => {
                context.unsupported(at, format!("the light \"{}\" is unknown and left out", shortened(kind)));
                return Ok(());
            }
        };
        let (LightKind::Point { intensity: power, .. }
        | LightKind::Spot { intensity: power, .. }
        | LightKind::Goniometric { intensity: power, .. }
        | LightKind::Projector { intensity: power, .. }
        | LightKind::Directional { irradiance: power, .. }) = &kind;
        if !power.is_finite() {
            return Err(at.fault("the light is brighter than can be computed with").into());
        }
        self.list.push(Light::new("", kind));
        Ok(())
    }

    /// Sets the motion of the light that was added for an entity.
    ///
    /// - `before`: number of lights before it.
    fn set_motion(&mut self, context: &mut Context<'_>, world: &PbrtWorld, entity: &Entity, before: usize) {
        if !entity.moves() {
            return;
        }
        match self.list[before..].last_mut() {
            Some(light) if !matches!(light.kind, LightKind::Directional { .. }) => {
                let path = entity.path(world, |ctm| *ctm).after(&entity.ctm.inverse());
                light.motion = path.motion(DAffine3::as_affine3a);
            }
            _ => context.unsupported(entity.at, "the light at infinity moves; it keeps its first pose"),
        }
    }

    fn goniometric(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        entity: &Entity,
        strength: Strength,
    ) -> ImportResult<LightKind> {
        let params = &entity.params;
        let Some(file) = params.text("filename")? else {
            context.warn(entity.at, "a goniometric light without `filename` shines equally in all directions");
            return Ok(point(strength, position(&entity.ctm, DVec3::ZERO, entity.at)?));
        };
        let image = textures.picture(context, file, PictureKind::COLORS, params.place_of("filename"))?.image;
        self.goniometric.push((image, params.place_of("filename")));
        let (axes, position) = self.pictured(context, entity, strength)?;
        // Its pole is +y.
        let swapped = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::Y);
        let world_from_light = (axes * swapped).as_mat3();
        let mapping = EnvironmentMapping::EqualArea;
        Ok(LightKind::Goniometric { position, world_from_light, image, mapping, intensity: strength.times(1.0) })
    }

    fn projection(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        entity: &Entity,
        strength: Strength,
    ) -> ImportResult<LightKind> {
        let (params, at) = (&entity.params, entity.at);
        let file = params.text("filename")?.ok_or_else(|| at.fault("`projection` needs a `filename`"))?;
        let fov = params.float("fov")?.unwrap_or(90.0);
        if !(fov > 0.0 && fov < 180.0) {
            return Err(params.place_of("fov").fault("`fov` must be between 0 and 180 degrees").into());
        }
        let image = textures.projection(context, file, fov, params.place_of("filename"))?;
        let (axes, position) = self.pictured(context, entity, strength)?;
        let axes = axes * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
        Ok(LightKind::Projector {
            world_from_light: Affine3A { matrix3: Mat3A::from(axes.as_mat3()), translation: Vec3A::from(position) },
            // pbrt does not interpolate the texels.
            picture: TextureMap { smooth: false, ..TextureMap::new(image) },
            intensity: strength.times(1.0),
            // Angle of the shorter side, corrected once the picture is loaded.
            vertical_fov: fov.to_radians() as f32,
            aspect: 1.0,
        })
    }

    /// Returns axes and position of a light with a picture, which must be the next in the list. Its power is applied
    /// once the picture is loaded.
    fn pictured(
        &mut self,
        context: &mut Context<'_>,
        entity: &Entity,
        strength: Strength,
    ) -> ImportResult<(DMat3, Vec3)> {
        self.powers.extend(strength.power.map(|power| (self.list.len(), power)));
        let axes = axes(context, &entity.ctm, entity.at)?;
        Ok((axes, position(&entity.ctm, DVec3::ZERO, entity.at)?))
    }

    /// Adds the lights to a scene, once its pictures are loaded.
    pub(super) fn finish(mut self, context: &mut Context<'_>, scene: &mut Scene) -> ImportResult<()> {
        for (image, at) in self.goniometric {
            let (width, height) = scene.images[image.0 as usize].size();
            if width != height {
                return Err(at.fault("the picture of a goniometric light must be square, one of equal areas").into());
            }
        }
        for light in &mut self.list {
            if let LightKind::Projector { picture, vertical_fov, aspect, .. } = &mut light.kind {
                let (width, height) = scene.images[picture.image.0 as usize].size();
                *aspect = width as f32 / height as f32;
                let tan = (0.5 * f64::from(*vertical_fov)).tan() / f64::from(aspect.min(1.0));
                *vertical_fov = (2.0 * tan.atan()) as f32;
            }
        }
        for (index, power) in self.powers {
            let (intensity, there) = match &mut self.list[index].kind {
                LightKind::Goniometric { intensity, image, .. } => {
                    let mean = scene.images[image.0 as usize].mean().truncate().element_sum() / 3.0;
                    (intensity, 4.0 * PI * f64::from(mean))
                }
                LightKind::Projector { intensity, picture, vertical_fov, aspect, .. } => {
                    // Area at distance 1; the cubes of the cosines are baked into the picture.
                    let area = 4.0 * (0.5 * f64::from(*vertical_fov)).tan().powi(2) * f64::from(*aspect);
                    (intensity, area * mean_luminance(&scene.images[picture.image.0 as usize]))
                }
                _ => continue,
            };
            let factor = if there > 0.0 { (power / there) as f32 } else { 0.0 };
            *intensity = (*intensity * factor).min(Spectrum::MAX);
        }
        scene.lights = self.list;
        scene.environment = self.environment.finish(context, scene)?;
        Ok(())
    }
}

/// The strength of a light.
#[derive(Clone, Copy)]
struct Strength {
    /// Colour after the exposure.
    color: Spectrum,
    scale: f64,
    /// Power in watts, if given.
    power: Option<f64>,
}

impl Strength {
    fn times(self, factor: f64) -> Spectrum {
        self.color * (self.scale * factor) as f32
    }

    /// Returns the intensity of a light that emits into a solid angle.
    fn intensity(self, solid_angle: f64) -> Spectrum {
        self.times(self.power.map_or(1.0, |power| power / solid_angle))
    }
}

fn point(strength: Strength, position: Vec3) -> LightKind {
    LightKind::Point { position, intensity: strength.intensity(4.0 * PI) }
}

fn spot(entity: &Entity, strength: Strength, from: DVec3, to: DVec3) -> ImportResult<LightKind> {
    let (params, at) = (&entity.params, entity.at);
    let outer = params.float("coneangle")?.unwrap_or(30.0);
    let delta = params.float("conedeltaangle")?.unwrap_or(5.0);
    if !(outer > 0.0 && outer <= 180.0 && delta >= 0.0) {
        return Err(params.place_of("coneangle").fault("the cone of the spot is empty").into());
    }
    let cos_outer = outer.to_radians().cos();
    let cos_inner = (outer - delta).max(0.0).to_radians().cos();
    let solid_angle = 2.0 * PI * ((1.0 - cos_inner) + 0.5 * (cos_inner - cos_outer));
    // Our cone needs a non-empty transition.
    let cos_outer = (cos_outer as f32).max(-1.0);
    let cos_inner = (cos_inner as f32).max(cos_outer + 1e-6).min(1.0);
    Ok(LightKind::Spot {
        position: position(&entity.ctm, from, at)?,
        direction: direction(&entity.ctm, to - from, at)?,
        intensity: strength.intensity(solid_angle),
        cos_inner,
        cos_outer: cos_outer.min(cos_inner - 1e-6),
        falloff: SpotFalloff::SmoothCosine,
    })
}

/// The emission of a surface.
#[derive(Clone, Debug)]
pub(super) struct Emission {
    /// Radiance that the surface emits.
    pub(super) color: ColorParam,
    /// Sides that emit.
    pub(super) sides: Sides,
    /// `true`: divide it by the luminance of its picture, once that is loaded.
    pub(super) by_power: bool,
}

/// Returns the emission of an area light.
///
/// - `area`: area of the surface, in world space.
/// - `primitive_count`: pbrt makes a light of each primitive, and gives the power to each.
pub(super) fn emission(
    context: &mut Context<'_>,
    textures: &mut PbrtTextures<'_, '_>,
    entity: &Entity,
    exposure: Exposure,
    area: f64,
    primitive_count: usize,
) -> ImportResult<Emission> {
    let (params, at) = (&entity.params, entity.at);
    if entity.kind != "diffuse" {
        let message = format!("the area light \"{}\" is treated as a diffuse one", shortened(&entity.kind));
        context.unsupported(at, message);
    }
    let mut scale = params.float("scale")?.unwrap_or(1.0);
    let two_sided = params.bool("twosided")?.unwrap_or(false);
    let color = context.color(params, "L")?.map(|color| color.to_rec709(ColorRole::Emission));
    let texture = match params.text("filename")? {
        Some(file) => {
            if color.is_some() {
                return Err(at.fault("an area light has either `L` or a `filename`").into());
            }
            let picture = textures.picture(context, file, PictureKind::COLORS, params.place_of("filename"))?;
            // Unlike a texture, the picture does not repeat.
            Some(TextureMap { wrap_u: Wrap::Clamp, wrap_v: Wrap::Clamp, ..picture })
        }
        None => None,
    };
    let power = params.float("power")?.filter(|power| *power > 0.0);
    if let Some(power) = power {
        let sides = if two_sided { 2.0 } else { 1.0 };
        scale *= power * primitive_count.max(1) as f64 / (sides * area.max(f64::MIN_POSITIVE) * PI);
    }
    if !(scale >= 0.0 && (scale as f32).is_finite()) {
        return Err(params.place_of("scale").fault("a light's scale is negative, or its surface is empty").into());
    }
    Ok(Emission {
        color: ColorParam { factor: exposure.apply(color.unwrap_or(Spectrum::ONE)) * scale as f32, texture },
        sides: if two_sided { Sides::Both } else { Sides::Front },
        by_power: power.is_some() && texture.is_some(),
    })
}

/// Returns the mean luminance of a picture.
pub(super) fn mean_luminance(image: &Image) -> f64 {
    image.mean().truncate().as_dvec3().dot(LUMINANCE)
}

fn position(ctm: &DAffine3, point: DVec3, at: TextPlace) -> ImportResult<Vec3> {
    let position = ctm.transform_point3(point).as_vec3();
    if position.is_finite() { Ok(position) } else { Err(at.fault("the light is out of reach").into()) }
}

fn direction(ctm: &DAffine3, vector: DVec3, at: TextPlace) -> ImportResult<Vec3> {
    let direction = ctm.transform_vector3(vector).try_normalize();
    direction
        .map(|direction| direction.as_vec3().normalize())
        .ok_or_else(|| at.fault("the light has no direction").into())
}
