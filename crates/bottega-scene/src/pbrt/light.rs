//! Lights: those without extent, the environment, and the emission of surfaces.
//!
//! pbrt scales the spectrum of every light so that its luminance is 1 where `L` or `I` says no more than a spectrum; the
//! numbers of `rgb` are taken as they are. `power` and `illuminance` are in watts and W·m⁻², seen with the eye's luminance.

use std::f64::consts::PI;

use glam::{Affine3A, DAffine3, DMat3, DVec3, Mat3A, Vec3, Vec3A};

use super::color::Meaning;
use super::context::{Context, Outcome};
use super::film::Exposure;
use super::texture::Textures;
use super::token::Place;
use super::transform::axes_and_scale;
use super::world::{Entity, World};
use crate::text::shortened;
use crate::{
    ColorParam, Environment, EnvironmentMapping, Image, ImageId, Light, LightKind, Scene, Sides, Spectrum, SpotFalloff,
};

/// Luminance of linear Rec. 709.
const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// The lights of a scene, some of which wait for their pictures.
#[derive(Default)]
pub(super) struct Lights {
    list: Vec<Light>,
    /// Lights whose intensity is to be multiplied with the mean of a picture.
    goniometric: Vec<(usize, ImageId)>,
    /// What comes from everywhere.
    constant: Spectrum,
    picture: Option<EnvironmentPicture>,
}

struct EnvironmentPicture {
    image: ImageId,
    factor: Spectrum,
    /// Wanted on a surface that faces +z of the light's own space, before the exposure.
    illuminance: Option<f64>,
    world_from_light: DMat3,
    at: Place,
}

impl Lights {
    /// Understands all lights that are no surfaces.
    pub(super) fn new(
        context: &mut Context<'_>,
        textures: &mut Textures<'_, '_>,
        world: &World,
        exposure: Exposure,
    ) -> Outcome<Self> {
        let mut lights = Self::default();
        for entity in &world.lights {
            lights.add(context, textures, entity, exposure)?;
            context.report_unused(&entity.params);
        }
        Ok(lights)
    }

    fn add(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut Textures<'_, '_>,
        entity: &Entity,
        exposure: Exposure,
    ) -> Outcome<()> {
        let (params, at) = (&entity.params, entity.at);
        let scale = params.float("scale")?.unwrap_or(1.0);
        if scale.is_nan() || scale < 0.0 {
            return Err(params.place_of("scale").fault("a light's scale is negative").into());
        }
        let name = if entity.kind == "distant" || entity.kind == "infinite" { "L" } else { "I" };
        let color = context.color(params, name)?.map(|color| color.to_rec709(Meaning::Light));
        let power = params.float("power")?.filter(|power| *power > 0.0);
        let shine = |strength: f64| exposure.apply(color.unwrap_or(Spectrum::ONE)) * (scale * strength) as f32;
        let from = params.point3("from", "point3")?.unwrap_or(DVec3::ZERO);
        let to = params.point3("to", "point3")?.unwrap_or(DVec3::Z);
        let position = position(&entity.ctm, from, at)?;
        let kind = match entity.kind.as_str() {
            "infinite" => return self.add_environment(context, textures, entity, color, scale, exposure),
            "distant" => {
                let illuminance = params.float("illuminance")?.filter(|illuminance| *illuminance > 0.0);
                let direction = direction(&entity.ctm, to - from, at)?;
                LightKind::Directional { direction, irradiance: shine(illuminance.unwrap_or(1.0)) }
            }
            "point" => LightKind::Point { position, intensity: shine(power.map_or(1.0, |power| power / (4.0 * PI))) },
            "spot" => {
                let outer = params.float("coneangle")?.unwrap_or(30.0);
                let delta = params.float("conedeltaangle")?.unwrap_or(5.0);
                if !(outer > 0.0 && outer <= 180.0 && delta >= 0.0) {
                    return Err(params.place_of("coneangle").fault("the cone of the spot is empty").into());
                }
                let cos_outer = outer.to_radians().cos();
                let cos_inner = (outer - delta).max(0.0).to_radians().cos();
                let solid_angle = 2.0 * PI * ((1.0 - cos_inner) + 0.5 * (cos_inner - cos_outer));
                // The edge is never quite sharp here.
                let cos_outer = (cos_outer as f32).max(-1.0);
                let cos_inner = (cos_inner as f32).max(cos_outer + 1e-6).min(1.0);
                LightKind::Spot {
                    position,
                    direction: direction(&entity.ctm, to - from, at)?,
                    intensity: shine(power.map_or(1.0, |power| power / solid_angle)),
                    cos_inner,
                    cos_outer: cos_outer.min(cos_inner - 1e-6),
                    falloff: SpotFalloff::SmoothCosine,
                }
            }
            "goniometric" => {
                if let Some(file) = params.text("filename")? {
                    let map = textures.picture(context, file, false, params.place_of("filename"))?;
                    self.goniometric.push((self.list.len(), map.image));
                }
                context
                    .unsupported(at, "the goniometric light shines equally in all directions, with its mean intensity");
                let position = self::position(&entity.ctm, DVec3::ZERO, at)?;
                LightKind::Point { position, intensity: shine(power.map_or(1.0, |power| power / (4.0 * PI))) }
            }
            "projection" => {
                let file = params.text("filename")?.ok_or_else(|| at.fault("`projection` needs a `filename`"))?;
                let fov = params.float("fov")?.unwrap_or(90.0);
                if !(fov > 0.0 && fov < 180.0) {
                    return Err(params.place_of("fov").fault("`fov` must be between 0 and 180 degrees").into());
                }
                if power.is_some() {
                    context.unsupported(params.place_of("power"), "the power of a projection is left out");
                }
                let image = textures.projection(context, file, fov, params.place_of("filename"))?;
                let axes = axes(context, &entity.ctm, at)? * DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
                LightKind::Projector {
                    world_from_light: Affine3A {
                        matrix3: Mat3A::from(axes.as_mat3()),
                        translation: Vec3A::from(self::position(&entity.ctm, DVec3::ZERO, at)?),
                    },
                    image,
                    intensity: shine(1.0),
                    // Of the shorter side; it is known when the picture is.
                    vertical_fov: fov.to_radians() as f32,
                    aspect: 1.0,
                }
            }
            kind => {
                context.unsupported(at, format!("the light \"{}\" is not known, and left out", shortened(kind)));
                return Ok(());
            }
        };
        let (LightKind::Point { intensity: power, .. }
        | LightKind::Spot { intensity: power, .. }
        | LightKind::Projector { intensity: power, .. }
        | LightKind::Directional { irradiance: power, .. }) = &kind;
        if !power.is_finite() {
            return Err(at.fault("the light is brighter than can be computed with").into());
        }
        self.list.push(Light { name: String::new(), kind });
        Ok(())
    }

    fn add_environment(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut Textures<'_, '_>,
        entity: &Entity,
        color: Option<Spectrum>,
        scale: f64,
        exposure: Exposure,
    ) -> Outcome<()> {
        let (params, at) = (&entity.params, entity.at);
        let illuminance = params.float("illuminance")?.filter(|illuminance| *illuminance > 0.0);
        if params.points3("portal", "point3")?.is_some() {
            context.warn(params.place_of("portal"), "the portal is not needed, and left out");
        }
        let Some(file) = params.text("filename")? else {
            let strength = scale * illuminance.map_or(1.0, |illuminance| illuminance / PI);
            self.constant += exposure.apply(color.unwrap_or(Spectrum::ONE)) * strength as f32;
            if !self.constant.is_finite() {
                return Err(at.fault("the light is brighter than can be computed with").into());
            }
            return Ok(());
        };
        if color.is_some() {
            return Err(at.fault("an infinite light has either `L` or a `filename`").into());
        }
        if self.picture.is_some() {
            context.unsupported(at, "a second picture all around the scene is left out");
            return Ok(());
        }
        self.picture = Some(EnvironmentPicture {
            image: textures.picture(context, file, false, params.place_of("filename"))?.image,
            factor: exposure.apply(Spectrum::ONE) * scale as f32,
            illuminance,
            world_from_light: axes(context, &entity.ctm, at)?,
            at: params.place_of("filename"),
        });
        Ok(())
    }

    /// Adds the lights to a scene whose pictures are there.
    pub(super) fn finish(mut self, context: &mut Context<'_>, scene: &mut Scene) -> Outcome<()> {
        for (index, image) in self.goniometric {
            if let LightKind::Point { intensity, .. } = &mut self.list[index].kind {
                *intensity *= scene.images[image.0 as usize].mean().truncate().element_sum() / 3.0;
            }
        }
        for light in &mut self.list {
            if let LightKind::Projector { image, vertical_fov, aspect, .. } = &mut light.kind {
                let (width, height) = scene.images[image.0 as usize].size();
                *aspect = width as f32 / height as f32;
                let tan = (0.5 * f64::from(*vertical_fov)).tan() / f64::from(aspect.min(1.0));
                *vertical_fov = (2.0 * tan.atan()) as f32;
            }
        }
        scene.lights = self.list;
        scene.environment = match self.picture {
            None if self.constant == Spectrum::ZERO => None,
            None => Some(Environment::uniform(self.constant)),
            Some(picture) => Some(picture.environment(context, scene, self.constant)?),
        };
        Ok(())
    }
}

impl EnvironmentPicture {
    fn environment(self, context: &mut Context<'_>, scene: &mut Scene, constant: Spectrum) -> Outcome<Environment> {
        let image = &scene.images[self.image.0 as usize];
        let (width, height) = image.size();
        let (mapping, light_from_environment) = if width == height {
            (EnvironmentMapping::EqualArea, DMat3::IDENTITY)
        } else {
            let message = "the picture is not square, so it is taken for one by latitude and longitude with +z up, as \
                           pbrt's `imgtool makeequiarea` takes it; pbrt itself wants a square one of equal areas";
            context.warn(self.at, message);
            // Azimuth counts from +x towards +y, at the left edge.
            let columns = DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::X);
            (EnvironmentMapping::LatitudeLongitude, columns)
        };
        let mut factor = self.factor;
        if let Some(wanted) = self.illuminance {
            let there = illuminance(image, mapping);
            if there > 0.0 {
                factor *= (wanted / there) as f32;
            }
        }
        if !factor.is_finite() {
            return Err(self.at.fault("the light is brighter than can be computed with").into());
        }
        let mut id = self.image;
        if constant != Spectrum::ZERO && factor.min_element() > 0.0 {
            let bytes = width as usize * height as usize * size_of::<[f32; 3]>() * 4 / 3;
            context.resources.budget().take(context.path(self.at.file), &context.place(self.at), bytes)?;
            let more = constant / factor;
            let texel = |index: u32| (image.texel(index % width, index / width).truncate() + more).to_array();
            let texels = (0..width * height).map(texel).collect();
            let sum = Image::from_linear_rgb(image.name.clone(), width, height, texels);
            scene.images.push(sum);
            id = ImageId(scene.images.len() as u32 - 1);
        }
        Ok(Environment {
            image: Some(id),
            mapping,
            factor,
            world_from_environment: (self.world_from_light * light_from_environment).as_mat3(),
        })
    }
}

/// What a picture brings to a surface that faces +z of the light's own space.
fn illuminance(image: &Image, mapping: EnvironmentMapping) -> f64 {
    let (width, height) = image.size();
    let mut sum = 0.0;
    for y in 0..height {
        let v = (f64::from(y) + 0.5) / f64::from(height);
        for x in 0..width {
            let u = (f64::from(x) + 0.5) / f64::from(width);
            // Cosine to +z, and solid angle.
            let (cosine, solid_angle) = match mapping {
                EnvironmentMapping::EqualArea => {
                    let from_edge = 1.0 - (2.0 * u - 1.0).abs() - (2.0 * v - 1.0).abs();
                    let radius = 1.0 - from_edge.abs();
                    ((1.0 - radius * radius) * from_edge.signum(), 4.0 * PI)
                }
                EnvironmentMapping::LatitudeLongitude => ((v * PI).cos(), 2.0 * PI * PI * (v * PI).sin()),
            };
            if cosine > 0.0 {
                sum += image.texel(x, y).truncate().as_dvec3().dot(LUMINANCE) * cosine * solid_angle;
            }
        }
    }
    sum / (f64::from(width) * f64::from(height))
}

/// What a surface emits.
#[derive(Clone, Debug)]
pub(super) struct Emission {
    pub(super) color: ColorParam,
    pub(super) sides: Sides,
    /// Whether it is to be divided by the luminance of its picture, when that is there.
    pub(super) by_power: bool,
}

/// What an area light makes a surface emit.
///
/// - `area`: of the surface, in world space.
/// - `primitive_count`: pbrt makes a light of each primitive, and gives the power to each.
pub(super) fn emission(
    context: &mut Context<'_>,
    textures: &mut Textures<'_, '_>,
    entity: &Entity,
    exposure: Exposure,
    area: f64,
    primitive_count: usize,
) -> Outcome<Emission> {
    let (params, at) = (&entity.params, entity.at);
    if entity.kind != "diffuse" {
        let message = format!("the area light \"{}\" is taken for a diffuse one", shortened(&entity.kind));
        context.unsupported(at, message);
    }
    let mut scale = params.float("scale")?.unwrap_or(1.0);
    let two_sided = params.bool("twosided")?.unwrap_or(false);
    let color = context.color(params, "L")?.map(|color| color.to_rec709(Meaning::Light));
    let texture = match params.text("filename")? {
        Some(file) => {
            if color.is_some() {
                return Err(at.fault("an area light has either `L` or a `filename`").into());
            }
            Some(textures.picture(context, file, false, params.place_of("filename"))?)
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

/// Mean luminance of a picture.
pub(super) fn mean_luminance(image: &Image) -> f64 {
    image.mean().truncate().as_dvec3().dot(LUMINANCE)
}

fn position(ctm: &DAffine3, point: DVec3, at: Place) -> Outcome<Vec3> {
    let position = ctm.transform_point3(point).as_vec3();
    if position.is_finite() { Ok(position) } else { Err(at.fault("the light is out of reach").into()) }
}

fn direction(ctm: &DAffine3, vector: DVec3, at: Place) -> Outcome<Vec3> {
    let direction = ctm.transform_vector3(vector).try_normalize();
    direction
        .map(|direction| direction.as_vec3().normalize())
        .ok_or_else(|| at.fault("the light has no direction").into())
}

/// The axes of a transformation, orthonormal; they may mirror.
fn axes(context: &mut Context<'_>, ctm: &DAffine3, at: Place) -> Outcome<DMat3> {
    let (axes, scale) = axes_and_scale(ctm);
    let is_perpendicular = (axes * axes.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-3);
    if !axes.is_finite() || !is_perpendicular {
        return Err(at.fault("the transformation of the light is singular or skewed").into());
    }
    if scale.max_element() > 1.001 * scale.min_element() {
        context.unsupported(at, "the scale of the light's space is left out: it would distort the light");
    }
    Ok(axes)
}
