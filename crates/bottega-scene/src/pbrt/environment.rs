//! The light `infinite`: environments, optionally through portals.

use std::f64::consts::PI;

use glam::{DMat3, DVec3};

use super::context::Context;
use super::film::Exposure;
use super::params::Params;
use super::place::axes;
use super::texture::PbrtTextures;
use super::world::Entity;
use crate::color::{LUMINANCE, Spectrum};
use crate::image::Image;
use crate::image::pictures::PictureKind;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::light::{Environment, EnvironmentMapping, Portal};
use crate::model::{COORDINATE_MAX, Scene};
use crate::texture::ImageId;

/// The infinite lights of a scene.
#[derive(Default)]
pub(super) struct InfiniteLights {
    /// Sum of the constant lights.
    constant: Spectrum,
    picture: Option<Sky>,
    /// The light behind portals, and its portals.
    beyond: Option<(Sky, Vec<Portal>)>,
}

/// An infinite light.
#[derive(Clone, Debug)]
struct Sky {
    /// The picture; `None`: constant.
    image: Option<ImageId>,
    factor: Spectrum,
    /// With a picture: requested illuminance of a surface that faces +z of the light's space, before the exposure.
    illuminance: Option<f64>,
    world_from_light: DMat3,
    at: TextPlace,
}

impl InfiniteLights {
    /// Adds a light.
    ///
    /// - `color`: its `L`, if given.
    pub(super) fn add(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        entity: &Entity,
        color: Option<Spectrum>,
        scale: f64,
        exposure: Exposure,
    ) -> ImportResult<()> {
        let (params, at) = (&entity.params, entity.at);
        let portal = portal(params, context.origin)?;
        let sky = sky(context, textures, entity, color, scale, exposure)?;
        if let Some(portal) = portal {
            match &mut self.beyond {
                None => self.beyond = Some((sky, vec![portal])),
                Some((first, portals)) if first.is_same(&sky) => portals.push(portal),
                Some(_) => context.unsupported(at, "a portal with another sky than that of the first one is left out"),
            }
        } else if sky.image.is_none() {
            self.constant += sky.factor;
            if !self.constant.is_finite() {
                return Err(at.fault("the light is brighter than can be computed with").into());
            }
        } else if self.picture.is_some() {
            context.unsupported(at, "a second picture all around the scene is left out");
        } else {
            self.picture = Some(sky);
        }
        Ok(())
    }

    /// Returns the environment, once the scene's pictures are loaded; `None`: no infinite light, or a black one.
    pub(super) fn finish(self, context: &mut Context<'_>, scene: &mut Scene) -> ImportResult<Option<Environment>> {
        let open = match self.picture {
            None if self.constant == Spectrum::ZERO => None,
            None => Some(Environment::uniform(self.constant)),
            Some(sky) => Some(sky.environment(context, scene, self.constant)?),
        };
        let Some((sky, portals)) = self.beyond else { return Ok(open) };
        if open.is_some() {
            context.unsupported(sky.at, "beside light from everywhere that through portals is left out");
            return Ok(open);
        }
        Ok(Some(Environment { portals, ..sky.environment(context, scene, Spectrum::ZERO)? }))
    }
}

/// Reads a light without its portal.
fn sky(
    context: &mut Context<'_>,
    textures: &mut PbrtTextures<'_, '_>,
    entity: &Entity,
    color: Option<Spectrum>,
    scale: f64,
    exposure: Exposure,
) -> ImportResult<Sky> {
    let (params, at) = (&entity.params, entity.at);
    let illuminance = params.float("illuminance")?.filter(|illuminance| *illuminance > 0.0);
    let Some(file) = params.text("filename")? else {
        let strength = scale * illuminance.map_or(1.0, |illuminance| illuminance / PI);
        let factor = exposure.apply(color.unwrap_or(Spectrum::ONE)) * strength as f32;
        return Ok(Sky { image: None, factor, illuminance: None, world_from_light: DMat3::IDENTITY, at });
    };
    if color.is_some() {
        return Err(at.fault("an infinite light has either `L` or a `filename`").into());
    }
    Ok(Sky {
        image: Some(textures.picture(context, file, PictureKind::COLORS, params.place_of("filename"))?.image),
        factor: exposure.apply(Spectrum::ONE) * scale as f32,
        illuminance,
        world_from_light: axes(context, &entity.ctm, at)?,
        at: params.place_of("filename"),
    })
}

/// Reads the four corners of `portal`, which pbrt takes in world space. Light comes in from the side of the cross
/// product of the edges to the fourth and the second corner.
///
/// - `origin`: offset subtracted from all positions.
fn portal(params: &Params, origin: DVec3) -> ImportResult<Option<Portal>> {
    let Some(points) = params.points3("portal", "point3")? else { return Ok(None) };
    let fault = |problem: &str| params.place_of("portal").fault(problem.to_owned());
    let &[p0, p1, p2, p3] = points.as_slice() else { return Err(fault("a portal has four corners").into()) };
    let is_in_reach = |p: &DVec3| p.is_finite() && p.abs().max_element() < f64::from(COORDINATE_MAX);
    if !points.iter().all(is_in_reach) {
        return Err(fault("a portal is out of reach").into());
    }
    let (x, y) = (p3 - p0, p1 - p0);
    let size = x.length().max(y.length());
    let is_rectangle = x.dot(y).abs() <= 1e-3 * x.length() * y.length() && (p0 + x + y - p2).length() <= 1e-3 * size;
    let lengths = (x.length() * y.length()) as f32;
    if !is_rectangle || !lengths.is_normal() {
        return Err(fault("a portal must be a rectangle, corner after corner").into());
    }
    // Make the edges exactly perpendicular.
    let y = y - x * (x.dot(y) / x.length_squared());
    Ok(Some(Portal { corner: (p0 - origin).as_vec3(), edges: [x.as_vec3(), y.as_vec3()] }))
}

impl Sky {
    fn is_same(&self, other: &Self) -> bool {
        (self.image, self.factor, self.illuminance, self.world_from_light)
            == (other.image, other.factor, other.illuminance, other.world_from_light)
    }

    fn environment(
        self,
        context: &mut Context<'_>,
        scene: &mut Scene,
        constant: Spectrum,
    ) -> ImportResult<Environment> {
        let Some(mut id) = self.image else { return Ok(Environment::uniform(self.factor)) };
        let image = &scene.images[id.0 as usize];
        let (width, height) = image.size();
        let (mapping, light_from_environment) = if width == height {
            (EnvironmentMapping::EqualArea, DMat3::IDENTITY)
        } else {
            let message = "the picture is not square, so it is taken for one by latitude and longitude with +z up, as \
                           pbrt's `imgtool makeequiarea` takes it; pbrt itself wants a square one of equal areas";
            context.warn(self.at, message);
            // Azimuth runs from +x towards +y, starting at the left edge.
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
            mapping,
            ..Environment::picture(id, factor, (self.world_from_light * light_from_environment).as_mat3())
        })
    }
}

/// Returns the illuminance of a surface that faces +z of the light's space, as pbrt computes it: with 2 π as the solid
/// angle of the whole sphere, so lights with an `illuminance` are twice as bright as specified.
fn illuminance(image: &Image, mapping: EnvironmentMapping) -> f64 {
    let (width, height) = image.size();
    let mut sum = 0.0;
    for y in 0..height {
        let v = (f64::from(y) + 0.5) / f64::from(height);
        for x in 0..width {
            let u = (f64::from(x) + 0.5) / f64::from(width);
            // Cosine to +z, and the texel's share of the sphere times the number of texels.
            let (cosine, part) = match mapping {
                EnvironmentMapping::EqualArea => {
                    let from_edge = 1.0 - (2.0 * u - 1.0).abs() - (2.0 * v - 1.0).abs();
                    let radius = 1.0 - from_edge.abs();
                    ((1.0 - radius * radius) * from_edge.signum(), 1.0)
                }
                _ => ((v * PI).cos(), 0.5 * PI * (v * PI).sin()),
            };
            if cosine > 0.0 {
                sum += image.texel(x, y).truncate().as_dvec3().dot(LUMINANCE) * cosine * part;
            }
        }
    }
    2.0 * PI * sum / (f64::from(width) * f64::from(height))
}
