//! The conversion of a scene's material, at one point, into a [`Bsdf`].

use bottega_kernels::math;
use bottega_scene::{
    Anisotropy, Coated, CoatedBase, ColorParam, Diffuse, Facets, Hair as HairSurface, InnerReflection, Iridescence,
    Layered, Material, Phong, Pigment, Plastic as PlasticSurface, Principled as PrincipledSurface, RoughnessScale,
    ScalarParam, Scene, Spectrum, Strand, Subsurface, Surface, TextureMap, Uvs, Varnished, Ward,
};
use glam::{Vec2, Vec3, Vec4};

use super::coated::{ClearLayer, Stack, StackBase, matte_coated};
use super::conductor::Conductor;
use super::cover::Mean;
use super::dielectric::Dielectric;
use super::gloss::{Gloss, Highlight};
use super::hair::{Hair, HairParams, sigma_a_of_melanin, sigma_a_of_reflectance};
use super::matte::{RoughMatte, Translucent};
use super::measured::MeasuredReflection;
use super::microfacet::Microfacets;
use super::plastic::Plastic;
use super::principled::{Principled, PrincipledParams, PrincipledSheet};
use super::scatter::{split, within_range};
use super::scattering::OtherBsdf;
use super::subsurface::Interior;
use super::varnish::{Varnish, VarnishBase};
use super::{Bsdf, LiftedNormal, SurfaceParams};
use crate::mapping::{MappingPoint, TexturePlace};

/// A point on a surface: the inputs that the evaluation of a material needs.
#[derive(Clone, Copy, Debug)]
pub struct SurfacePoint {
    /// Both sets of texture coordinates of the surface.
    pub uvs: [Vec2; 2],
    /// Position of the point, for textures that are mapped by position.
    pub mapping_point: MappingPoint,
    /// Width of texture lookups in texture coordinates; 0: unfiltered.
    pub footprint: f32,
    /// Vertex colour, which multiplies the base colour; white for a mesh without vertex colours.
    pub vertex_color: Vec4,
    /// `true`: wo is on the front side.
    pub front: bool,
    /// Normal of the coat in the local frame, above the surface; +z: that of the base.
    pub coat_normal: Vec3,
    /// Perturbation of the shading normal; `None` where it does not darken the light.
    pub lifted: Option<LiftedNormal>,
    /// Random number in [0, 1) that chooses between blended surfaces.
    pub chance: f32,
    /// `true`: light enters materials that scatter it below their surface. `false`: they are matte.
    pub lets_in: bool,
}

impl SurfacePoint {
    /// Returns a point on a surface without textures and vertex colours; `front`: `true` if wo is on the front side.
    pub fn plain(front: bool) -> Self {
        Self {
            uvs: [Vec2::ZERO; 2],
            mapping_point: MappingPoint::default(),
            footprint: 0.0,
            vertex_color: Vec4::ONE,
            front,
            coat_normal: Vec3::Z,
            lifted: None,
            chance: 0.0,
            lets_in: false,
        }
    }

    fn place(&self) -> TexturePlace {
        TexturePlace { uvs: self.uvs, mapping_point: self.mapping_point }
    }

    fn color(&self, scene: &Scene, param: &ColorParam) -> Spectrum {
        param.eval(scene, self.place(), self.footprint)
    }

    fn scalar(&self, scene: &Scene, param: &ScalarParam) -> f32 {
        param.eval(scene, self.place(), self.footprint)
    }

    /// Evaluates a reflectance or transmittance, clamped to [0, 1].
    fn share(&self, scene: &Scene, param: &ColorParam) -> Spectrum {
        within(self.color(scene, param), 1.0)
    }

    /// Evaluates a base colour, multiplied by the vertex colour and clamped to [0, 1].
    fn base(&self, scene: &Scene, param: &ColorParam) -> Spectrum {
        within(self.color(scene, param) * self.vertex_color.truncate(), 1.0)
    }

    fn film_thickness(&self, scene: &Scene, film: &Iridescence) -> f32 {
        let [least, most] = film.thickness;
        let texture = film.thickness_texture.as_ref();
        let share =
            texture.map_or(1.0, |(map, channel)| texel(scene, map, self.place(), self.footprint)[*channel as usize]);
        least + (most - least) * share
    }

    fn facets(&self, scene: &Scene, facets: &Facets) -> Microfacets {
        let alpha = facets.roughness.each_ref().map(|roughness| {
            let roughness = self.scalar(scene, roughness);
            match facets.scale {
                RoughnessScale::Alpha => roughness,
                RoughnessScale::SquareRoot => roughness.max(0.0).sqrt(),
                RoughnessScale::Square => roughness * roughness,
            }
        });
        Microfacets::new(facets.distribution, facets.shadowing, alpha)
    }
}

fn texel(scene: &Scene, map: &TextureMap, uvs: impl Uvs, footprint: f32) -> Vec4 {
    let (uv, footprint) = uvs.of(scene, map, footprint);
    scene.images[map.image.0 as usize].eval(map, uv, footprint)
}

/// Returns the strength of an anisotropy and its direction in the tangent frame (x along u, y up the picture).
pub(crate) fn anisotropy_at(scene: &Scene, anisotropy: &Anisotropy, uvs: impl Uvs, footprint: f32) -> (f32, Vec2) {
    let (sin, cos) = math::sin_cos(anisotropy.rotation);
    let (direction, strength) = match &anisotropy.texture {
        None => (Vec2::X, 1.0),
        Some(map) => {
            let texel = texel(scene, map, uvs, footprint);
            ((2.0 * Vec2::new(texel.x, texel.y) - 1.0).normalize_or(Vec2::X), texel.z)
        }
    };
    (anisotropy.strength * strength, Vec2::new(cos, sin).rotate(direction))
}

/// Returns the BSDF of `material` at a point; black where the material has no surface on that side.
///
/// # Panics
///
/// If a texture's image is not in the scene, which [`Scene::validate`] excludes.
pub fn scattering<'m>(scene: &Scene, material: &'m Material, point: &SurfacePoint) -> Bsdf<'m> {
    match material.surface_of(point.front) {
        Some(surface) => of_surface(scene, surface, point).with_lifted(point.lifted),
        None => Bsdf::black(),
    }
}

/// Returns the medium below a point of `material`; `None`: none, or light is refracted there.
pub(crate) fn interior_at(scene: &Scene, material: &Material, point: &SurfacePoint) -> Option<Interior> {
    let (part, _) = part_at(scene, material.surface_of(point.front)?, point);
    let Surface::Layered(layered) = part else { return None };
    let below = below(scene, layered, point)?;
    Some(Interior::new(below, point.base(scene, &layered.base_color), |param| point.color(scene, param)))
}

/// Returns the scattering of light that leaves `material` from below at a point, seen from outside.
pub(crate) fn leaving(scene: &Scene, material: &Material, point: &SurfacePoint) -> Bsdf<'static> {
    let part = material.surface_of(point.front).map(|surface| part_at(scene, surface, point).0);
    match part {
        Some(Surface::Layered(layered)) => Bsdf::leaving(&of_layered(scene, layered, point)),
        _ => Bsdf::lambert(Spectrum::ONE),
    }
}

/// Returns the subsurface scattering of a layered material at a point, unless light passes through it otherwise.
fn below<'a>(scene: &Scene, layered: &'a Layered, point: &SurfacePoint) -> Option<&'a Subsurface> {
    let below = layered.subsurface.as_deref().filter(|_| !layered.thin)?;
    (point.scalar(scene, &layered.transmission) <= 0.0).then_some(below)
}

/// Returns the part of a blend or sum that the point's random number chooses, and the number of parts it stands for.
fn part_at<'a>(scene: &Scene, mut surface: &'a Surface, point: &SurfacePoint) -> (&'a Surface, f32) {
    let (mut chance, mut gain) = (point.chance, 1.0);
    loop {
        let (weight, surfaces) = match surface {
            Surface::Blend { weight, surfaces } => (point.scalar(scene, weight).clamp(0.0, 1.0), surfaces),
            Surface::Sum(surfaces) => {
                gain *= 2.0;
                (0.5, surfaces)
            }
            part => return (part, gain),
        };
        // Choose a part, and rescale the random number for nested blends
        let (is_second, rest) = split(chance, weight);
        (surface, chance) = (&surfaces[usize::from(is_second)], rest);
    }
}

fn of_surface<'m>(scene: &Scene, surface: &'m Surface, point: &SurfacePoint) -> Bsdf<'m> {
    match part_at(scene, surface, point) {
        (part, 1.0) => of_part(scene, part, point),
        (part, gain) => of_part(scene, part, point).times(gain),
    }
}

/// Returns the scattering of a surface that is neither a blend nor a sum.
fn of_part<'m>(scene: &Scene, surface: &'m Surface, point: &SurfacePoint) -> Bsdf<'m> {
    match surface {
        Surface::Null | Surface::Unlit(_) | Surface::Blend { .. } | Surface::Sum(_) => Bsdf::black(),
        Surface::Layered(layered) => Bsdf::new(&of_layered(scene, layered, point)),
        Surface::Diffuse(diffuse) => of_diffuse(scene, diffuse, point),
        Surface::DiffuseTransmission { reflectance, transmittance } => {
            let [reflectance, transmittance] = [reflectance, transmittance].map(|color| point.base(scene, color));
            // Scale down if reflectance and transmittance exceed 1 in sum
            let scale = 1.0 / (reflectance + transmittance).max(Spectrum::ONE);
            let translucent = Translucent::new(reflectance * scale, transmittance * scale);
            Bsdf::other(translucent.map(OtherBsdf::Translucent))
        }
        Surface::Conductor(conductor) => {
            Bsdf::other(of_conductor(scene, conductor, point, 1.0).map(OtherBsdf::Conductor))
        }
        Surface::Dielectric(dielectric) => {
            let inside = !dielectric.thin && !point.front;
            let dielectric = Dielectric::new(
                if inside { 1.0 / sound_eta(dielectric.eta) } else { sound_eta(dielectric.eta) },
                point.share(scene, &dielectric.reflectance),
                point.share(scene, &dielectric.transmittance),
                point.facets(scene, &dielectric.facets),
                dielectric.thin,
            );
            Bsdf::other(dielectric.map(OtherBsdf::Dielectric))
        }
        Surface::Plastic(plastic) => Bsdf::other(Some(OtherBsdf::Plastic(of_plastic(scene, plastic, point)))),
        Surface::Coated(coated) => Bsdf::other(Some(of_coated(scene, coated, point))),
        Surface::Varnished(varnished) => Bsdf::other(of_varnished(scene, varnished, point).map(OtherBsdf::Varnish)),
        Surface::Phong(phong) => Bsdf::other(of_phong(scene, phong, point).map(OtherBsdf::Gloss)),
        Surface::Ward(ward) => Bsdf::other(of_ward(scene, ward, point).map(OtherBsdf::Gloss)),
        Surface::Principled(principled) => {
            let params = of_principled(scene, principled, point);
            Bsdf::other(Some(if principled.thin {
                OtherBsdf::PrincipledSheet(PrincipledSheet::new(params))
            } else {
                OtherBsdf::Principled(Principled::new(params, !point.front && params.spec_trans > 0.0))
            }))
        }
        Surface::Hair(hair) => Bsdf::other(Some(OtherBsdf::Hair(Hair::new(&of_hair(scene, hair, point))))),
        Surface::Measured(measured) => Bsdf::other(Some(OtherBsdf::Measured(MeasuredReflection(measured)))),
    }
}

fn of_diffuse(scene: &Scene, diffuse: &Diffuse, point: &SurfacePoint) -> Bsdf<'static> {
    let color = point.base(scene, &diffuse.reflectance);
    let deviation = point.scalar(scene, &diffuse.roughness);
    if deviation > 0.0 && color != Spectrum::ZERO {
        Bsdf::other(Some(OtherBsdf::RoughMatte(RoughMatte::new(color, deviation.min(DEVIATION_MAX)))))
    } else {
        Bsdf::lambert(color)
    }
}

fn of_plastic(scene: &Scene, plastic: &PlasticSurface, point: &SurfacePoint) -> Plastic {
    let facets = point.facets(scene, &plastic.facets);
    let (eta, diffuse) = (sound_eta(plastic.eta), point.base(scene, &plastic.diffuse));
    let specular = point.share(scene, &plastic.specular);
    let has_cover = plastic.inner != InnerReflection::Lost && !facets.is_smooth();
    let cover = has_cover.then(|| facets.cover(eta, 0.0, Mean::Nodes));
    Plastic::new(eta, diffuse, specular, plastic.inner, facets, cover)
}

fn of_phong(scene: &Scene, phong: &Phong, point: &SurfacePoint) -> Option<Gloss> {
    let highlight = Highlight::phong(point.scalar(scene, &phong.exponent));
    Gloss::new(point.base(scene, &phong.diffuse), point.share(scene, &phong.specular), highlight)
}

fn of_ward(scene: &Scene, ward: &Ward, point: &SurfacePoint) -> Option<Gloss> {
    let alpha = ward.roughness.each_ref().map(|roughness| point.scalar(scene, roughness));
    let highlight = Highlight::ward(alpha, ward.variant);
    Gloss::new(point.base(scene, &ward.diffuse), point.share(scene, &ward.specular), highlight)
}

/// Returns the BSDF of a varnish; `None` for a base that [`Scene::validate`] excludes.
fn of_varnished(scene: &Scene, varnished: &Varnished, point: &SurfacePoint) -> Option<Varnish> {
    // A black base scatters nothing
    let black = || VarnishBase::Matte(RoughMatte::new(Spectrum::ZERO, 0.0));
    let base = match &varnished.base {
        Surface::Diffuse(diffuse) => {
            let deviation = within_range(point.scalar(scene, &diffuse.roughness), 0.0, DEVIATION_MAX);
            VarnishBase::Matte(RoughMatte::new(point.base(scene, &diffuse.reflectance), deviation))
        }
        Surface::Conductor(conductor) => {
            of_conductor(scene, conductor, point, 1.0).map_or_else(black, VarnishBase::Conductor)
        }
        Surface::Plastic(plastic) => VarnishBase::Plastic(of_plastic(scene, plastic, point)),
        Surface::Phong(phong) => of_phong(scene, phong, point).map_or_else(black, VarnishBase::Gloss),
        Surface::Ward(ward) => of_ward(scene, ward, point).map_or_else(black, VarnishBase::Gloss),
        Surface::Principled(principled) => {
            VarnishBase::Principled(Principled::new(of_principled(scene, principled, point), false))
        }
        _ => return None,
    };
    let (eta, facets) = (sound_eta(varnished.eta), point.facets(scene, &varnished.facets));
    let absorption = within(point.color(scene, &varnished.absorption), ABSORPTION_MAX);
    let cover = (!facets.is_smooth()).then(|| facets.cover(eta, 0.0, Mean::Nodes));
    Some(Varnish { eta, facets, cover, specular: point.share(scene, &varnished.specular), absorption, base })
}

fn of_coated(scene: &Scene, coated: &Coated, point: &SurfacePoint) -> OtherBsdf<'static> {
    let eta = sound_eta(coated.eta);
    let facets = point.facets(scene, &coated.facets);
    let layer = ClearLayer {
        thickness: within_range(point.scalar(scene, &coated.thickness), 0.0, 100.0),
        albedo: point.share(scene, &coated.albedo),
        g: point.scalar(scene, &coated.g).clamp(-0.99, 0.99),
        max_depth: coated.max_depth.min(MAX_DEPTH),
    };
    match &coated.base {
        CoatedBase::Diffuse(diffuse) => {
            // The roughness of the base itself is ignored below a coat
            let color = point.base(scene, &diffuse.reflectance);
            if layer.albedo == Spectrum::ZERO {
                let cover = facets.cover(eta, layer.thickness, Mean::Exact);
                OtherBsdf::Plastic(matte_coated(eta, color, facets, &layer, cover))
            } else {
                OtherBsdf::Stack(Stack::new(eta, facets, layer, StackBase::Matte(color)))
            }
        }
        CoatedBase::Conductor(conductor) => {
            let base = match of_conductor(scene, conductor, point, eta) {
                Some(metal) => StackBase::Metal(metal),
                None => StackBase::Matte(Spectrum::ZERO),
            };
            OtherBsdf::Stack(Stack::new(eta, facets, layer, base))
        }
    }
}

fn of_principled(scene: &Scene, principled: &PrincipledSurface, point: &SurfacePoint) -> PrincipledParams {
    let unit = |param: &ScalarParam| within_range(point.scalar(scene, param), 0.0, 1.0);
    PrincipledParams {
        base_color: point.base(scene, &principled.base_color),
        roughness: unit(&principled.roughness),
        anisotropic: unit(&principled.anisotropic),
        metallic: unit(&principled.metallic),
        spec_trans: unit(&principled.spec_trans),
        eta: sound_eta(principled.eta),
        spec_tint: unit(&principled.spec_tint),
        sheen: unit(&principled.sheen),
        sheen_tint: unit(&principled.sheen_tint),
        flatness: unit(&principled.flatness),
        clearcoat: unit(&principled.clearcoat),
        clearcoat_gloss: unit(&principled.clearcoat_gloss),
        diff_trans: 0.5 * within_range(point.scalar(scene, &principled.diff_trans), 0.0, 2.0),
    }
}

fn of_hair(scene: &Scene, hair: &HairSurface, point: &SurfacePoint) -> HairParams {
    let scalar = |param: &ScalarParam, most: f32| within_range(point.scalar(scene, param), 0.0, most);
    let beta_n = scalar(&hair.beta_n, 1.0);
    let sigma_a = match &hair.pigment {
        Pigment::SigmaA(sigma_a) => within(point.color(scene, sigma_a), ABSORPTION_MAX),
        Pigment::Reflectance(reflectance) => sigma_a_of_reflectance(point.base(scene, reflectance), beta_n),
        Pigment::Melanin { eumelanin, pheomelanin } => {
            sigma_a_of_melanin(scalar(eumelanin, ABSORPTION_MAX), scalar(pheomelanin, ABSORPTION_MAX))
        }
    };
    HairParams {
        sigma_a,
        eta: sound_eta(hair.eta),
        beta_m: scalar(&hair.beta_m, 1.0),
        beta_n,
        alpha: within_range(hair.alpha, -90.0, 90.0).to_radians(),
        h: match hair.strand {
            Strand::AlongU => Some(2.0 * point.uvs[0].y - 1.0),
            Strand::AlongV => None,
        },
    }
}

/// Returns the BSDF of a metal at a point.
///
/// - `outside`: index of refraction of the medium around the metal.
fn of_conductor(
    scene: &Scene,
    conductor: &bottega_scene::Conductor,
    point: &SurfacePoint,
    outside: f32,
) -> Option<Conductor> {
    let index = |param| within(point.color(scene, param) / outside, 1e3);
    let tint = point.share(scene, &conductor.reflectance);
    Conductor::new(index(&conductor.eta), index(&conductor.k), tint, point.facets(scene, &conductor.facets))
}

/// Largest standard deviation of the slopes of a rough matte surface.
const DEVIATION_MAX: f32 = 10.0;

/// Largest absorption and concentration of pigments: nothing passes through such a fibre or layer.
const ABSORPTION_MAX: f32 = 1e6;

/// Largest number of scattering events followed within a layer.
pub const MAX_DEPTH: u32 = 1000;

/// Clamps every channel to [0, max]; NaN becomes 0.
fn within(color: Spectrum, max: f32) -> Spectrum {
    let channel = |x: f32| within_range(x, 0.0, max);
    Spectrum::new(channel(color.x), channel(color.y), channel(color.z))
}

/// Clamps an index of refraction to at most 20; values not above 0.05 (or NaN) become 1.
fn sound_eta(eta: f32) -> f32 {
    if eta > 0.05 { eta.min(20.0) } else { 1.0 }
}

/// Evaluates the textures of a layered material, except those of bump and normal maps, which the frame already includes.
fn of_layered(scene: &Scene, layered: &Layered, point: &SurfacePoint) -> SurfaceParams {
    let color = |param: &ColorParam| point.color(scene, param);
    let scalar = |param: &ScalarParam| point.scalar(scene, param);
    let film = layered.iridescence.as_ref();
    // Light that enters is white: the medium inside colors it
    let entering = below(scene, layered, point).filter(|_| point.lets_in);
    let (through, through_color) = match entering {
        Some(below) => (scalar(&below.weight), Spectrum::ONE),
        None => (scalar(&layered.diffuse_transmission), color(&layered.diffuse_transmission_color)),
    };
    SurfaceParams {
        base_color: color(&layered.base_color) * point.vertex_color.truncate(),
        metallic: scalar(&layered.metallic),
        roughness: scalar(&layered.roughness),
        anisotropy: layered
            .anisotropy
            .as_ref()
            .map_or(0.0, |stretch| anisotropy_at(scene, stretch, point.place(), point.footprint).0),
        ior: layered.ior,
        dispersion: layered.dispersion,
        specular: scalar(&layered.specular),
        specular_color: color(&layered.specular_color),
        transmission: scalar(&layered.transmission),
        diffuse_transmission: through,
        diffuse_transmission_color: through_color,
        thin: layered.thin,
        iridescence: film.map_or(0.0, |film| scalar(&film.factor)),
        iridescence_ior: film.map_or(1.0, |film| film.ior),
        iridescence_thickness: film.map_or(0.0, |film| point.film_thickness(scene, film)),
        coat: scalar(&layered.coat),
        coat_roughness: scalar(&layered.coat_roughness),
        coat_normal: point.coat_normal,
        sheen_color: color(&layered.sheen_color),
        sheen_roughness: scalar(&layered.sheen_roughness),
        front: point.front,
    }
}

#[cfg(test)]
mod tests {
    use bottega_scene::{Channel, Image, ImageId, TextureMap};

    use super::*;

    fn picture(uv_set: u8) -> TextureMap {
        TextureMap { uv_set, smooth: false, ..TextureMap::new(ImageId(0)) }
    }

    #[test]
    fn textures_and_vertex_colours_multiply_the_factors() {
        let texels = vec![[1.0, 0.5, 0.25], [0.0, 0.5, 1.0]];
        let scene = Scene { images: vec![Image::from_linear_rgb("two", 2, 1, texels)].into(), ..Scene::default() };
        let layered = Layered {
            base_color: ColorParam { factor: Spectrum::new(0.5, 1.0, 1.0), texture: Some(picture(0)) },
            roughness: ScalarParam { factor: 0.5, texture: Some((picture(1), Channel::G)) },
            metallic: 1.0.into(),
            thin: true,
            ..Layered::default()
        };
        let uvs = [Vec2::new(0.25, 0.5), Vec2::new(0.75, 0.5)];
        let vertex_color = Vec4::new(1.0, 1.0, 0.5, 0.3);
        let point = SurfacePoint { uvs, vertex_color, ..SurfacePoint::plain(false) };
        let params = of_layered(&scene, &layered, &point);
        assert!((params.base_color - Spectrum::new(0.5, 0.5, 0.125)).length() < 1e-3, "{}", params.base_color);
        assert!((params.roughness - 0.25).abs() < 1e-3, "{}", params.roughness);
        assert!(params.metallic == 1.0 && params.thin && !params.front);
    }

    #[test]
    fn an_unlit_material_scatters_nothing() {
        let material = Surface::Unlit(Spectrum::ONE.into()).into();
        assert!(scattering(&Scene::default(), &material, &SurfacePoint::plain(true)).is_black());
    }

    #[test]
    fn a_blend_is_one_of_its_surfaces_as_often_as_its_weight_says() {
        let surfaces = Box::new([Surface::matte(Spectrum::ZERO), Surface::matte(Spectrum::ONE)]);
        let material = Surface::Blend { weight: 0.25.into(), surfaces }.into();
        let is_white = |chance: f32| {
            let point = SurfacePoint { chance, ..SurfacePoint::plain(true) };
            !scattering(&Scene::default(), &material, &point).is_black()
        };
        assert_eq!((0..100).filter(|&i| is_white((i as f32 + 0.5) / 100.0)).count(), 25);
    }
}
