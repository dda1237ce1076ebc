//! Materials of pbrt, with their textures.

use std::collections::BTreeMap;

use glam::DVec3;

use super::color::Color;
use super::context::Context;
use super::medium::preset_coefficients;
use super::needless::Directive;
use super::params::Params;
use super::texture::PbrtTextures;
use super::world::{Entity, MaterialRef, PbrtWorld};
use crate::color::Spectrum;
use crate::hair::{Hair, Pigment, Strand};
use crate::image::pictures::PictureKind;
use crate::import::text_place::{ImportError, ImportResult};
use crate::material::Relief;
use crate::param::{ColorParam, ScalarParam};
use crate::spectrum::named::metal_spectra;
use crate::spectrum::role::ColorRole;
use crate::spectrum::sampled::SampledSpectrum;
use crate::subsurface::{RadiusMeaning, Substance, Subsurface};
use crate::surface::{
    Coated, CoatedBase, Conductor, Dielectric, Diffuse, Distribution, Facets, Layered, RoughnessScale, Shadowing,
    Surface,
};
use crate::text::shortened;

/// Maximal nesting of mixtures.
const MIX_DEPTH_MAX: usize = 16;

/// The surface of a material, and its relief.
#[derive(Clone, Debug)]
pub(super) struct MaterialLook {
    pub(super) name: String,
    pub(super) surface: Surface,
    pub(super) relief: Option<Relief>,
}

/// The materials in use.
pub(super) struct Materials<'w> {
    world: &'w PbrtWorld,
    looks: BTreeMap<usize, MaterialLook>,
}

impl<'w> Materials<'w> {
    /// Makes an empty collection.
    pub(super) fn new(world: &'w PbrtWorld) -> Self {
        Self { world, looks: BTreeMap::new() }
    }

    /// Returns the index of a material.
    pub(super) fn find(&self, material: &MaterialRef) -> ImportResult<usize> {
        match material {
            MaterialRef::Index(index) => Ok(*index),
            MaterialRef::Named(name, at) => self
                .world
                .named_materials
                .get(&**name)
                .copied()
                .ok_or_else(|| at.fault(format!("there is no material \"{}\"", shortened(name))).into()),
        }
    }

    /// Returns the look of the material with that index.
    pub(super) fn look(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        index: usize,
    ) -> ImportResult<MaterialLook> {
        self.look_within(context, textures, index, &mut Vec::new())
    }

    fn look_within(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        index: usize,
        outer: &mut Vec<usize>,
    ) -> ImportResult<MaterialLook> {
        if let Some(look) = self.looks.get(&index) {
            return Ok(look.clone());
        }
        let world = self.world;
        let entity = &world.materials[index];
        if outer.contains(&index) || outer.len() >= MIX_DEPTH_MAX {
            return Err(entity
                .at
                .fault("the material is a mixture of itself, or of too many within each other")
                .into());
        }
        let surface = if entity.kind == "mix" {
            outer.push(index);
            let surface = self.mix(context, textures, entity, outer)?;
            outer.pop();
            surface
        } else {
            convert(context, textures, entity)?
        };
        let params = &entity.params;
        let relief = match params.text("normalmap")? {
            Some(file) => {
                let map = textures.picture(context, file, PictureKind::NORMALS, params.place_of("normalmap"))?;
                Some(Relief::normals(map, 1.0))
            }
            None => textures
                .scalar(context, params, "displacement")?
                .filter(|height| height.texture.is_some())
                .map(Relief::heights),
        };
        context.report_unused(Directive::Material, &entity.kind, params);
        let name = world.named_materials.iter().find(|(_, known)| **known == index).map(|(name, _)| name.clone());
        let look = MaterialLook { name: name.unwrap_or_default(), surface, relief };
        self.looks.insert(index, look.clone());
        Ok(look)
    }

    fn mix(
        &mut self,
        context: &mut Context<'_>,
        textures: &mut PbrtTextures<'_, '_>,
        entity: &Entity,
        outer: &mut Vec<usize>,
    ) -> ImportResult<Surface> {
        let params = &entity.params;
        let Some(([first, second], at)) =
            params.texts("materials").and_then(|(names, at)| Some((names.as_array::<2>()?, at)))
        else {
            return Err(entity.at.fault("`mix` needs two names in \"string materials\"").into());
        };
        let mut surfaces = Vec::with_capacity(2);
        for name in [first, second] {
            let index = self.find(&MaterialRef::Named(name.as_str().into(), at))?;
            let look = self.look_within(context, textures, index, outer)?;
            if look.relief.is_some() {
                context.unsupported(at, format!("the relief of \"{}\" is left out of the mixture", shortened(name)));
            }
            surfaces.push(look.surface);
        }
        let weight = textures.scalar(context, params, "amount")?.unwrap_or(0.5.into());
        let surfaces: [Surface; 2] = surfaces.try_into().unwrap_or_default();
        Ok(Surface::blend(weight, surfaces))
    }
}

fn convert(context: &mut Context<'_>, textures: &mut PbrtTextures<'_, '_>, entity: &Entity) -> ImportResult<Surface> {
    let (params, at) = (&entity.params, entity.at);
    let color = |context: &mut Context<'_>, textures: &mut PbrtTextures<'_, '_>, name: &str, default: f32| {
        let color = textures.color(context, params, name, ColorRole::Reflectance)?;
        Ok::<_, ImportError>(color.unwrap_or(Spectrum::splat(default).into()))
    };
    Ok(match entity.kind.as_str() {
        "interface" | "none" | "" => Surface::Null,
        "diffuse" => Surface::Diffuse(Diffuse {
            reflectance: color(context, textures, "reflectance", 0.5)?,
            roughness: 0.0.into(),
        }),
        "coateddiffuse" => {
            let reflectance = color(context, textures, "reflectance", 0.5)?;
            let base = CoatedBase::Diffuse(Diffuse { reflectance, roughness: 0.0.into() });
            let facets = facets(context, textures, params, "")?;
            let eta = index_of_refraction(context, params, "eta", 1.5)?;
            coated(context, textures, params, eta, facets, base)?
        }
        "coatedconductor" => {
            let inner = facets(context, textures, params, "conductor.")?;
            let base = CoatedBase::Conductor(conductor(context, textures, params, "conductor.", inner)?);
            let facets = facets(context, textures, params, "interface.")?;
            let eta = index_of_refraction(context, params, "interface.eta", 1.5)?;
            coated(context, textures, params, eta, facets, base)?
        }
        "conductor" => {
            let facets = facets(context, textures, params, "")?;
            Surface::Conductor(conductor(context, textures, params, "", facets)?)
        }
        "dielectric" | "thindielectric" => {
            let thin = entity.kind == "thindielectric";
            let facets = if thin { Facets::smooth() } else { facets(context, textures, params, "")? };
            Surface::Dielectric(Dielectric {
                eta: index_of_refraction(context, params, "eta", 1.5)?,
                reflectance: Spectrum::ONE.into(),
                transmittance: Spectrum::ONE.into(),
                facets,
                thin,
            })
        }
        "diffusetransmission" => {
            let scale = params.float("scale")?.unwrap_or(1.0) as f32;
            let mut reflectance = color(context, textures, "reflectance", 0.25)?;
            let mut transmittance = color(context, textures, "transmittance", 0.25)?;
            reflectance.factor *= scale;
            transmittance.factor *= scale;
            Surface::DiffuseTransmission { reflectance, transmittance }
        }
        "subsurface" => subsurface(context, textures, entity)?,
        "hair" => hair(context, textures, entity)?,
        "measured" => {
            let reference = params.text("filename")?.ok_or_else(|| at.fault("`measured` needs a `filename`"))?;
            let place = context.place(params.place_of("filename"));
            let location = context.resources.locate(reference, &place)?;
            Surface::Measured(context.measured.get(context.resources, &location)?)
        }
        kind => {
            context.unsupported(
                at,
                format!("the material \"{}\" is unknown; a gray matte one replaces it", shortened(kind)),
            );
            Surface::matte(Spectrum::splat(0.5))
        }
    })
}

/// Reads the roughness along u and v.
///
/// - `prefix`: prefix of the parameter names.
fn facets(
    context: &mut Context<'_>,
    textures: &mut PbrtTextures<'_, '_>,
    params: &Params,
    prefix: &str,
) -> ImportResult<Facets> {
    let both = textures.scalar(context, params, &format!("{prefix}roughness"))?;
    let mut roughness: [ScalarParam; 2] = [0.0.into(), 0.0.into()];
    for (roughness, name) in roughness.iter_mut().zip(["uroughness", "vroughness"]) {
        let own = textures.scalar(context, params, &format!("{prefix}{name}"))?;
        *roughness = own.or_else(|| both.clone()).unwrap_or(0.0.into());
        if roughness.factor < 0.0 {
            return Err(params.place_of(&format!("{prefix}{name}")).fault("a roughness is negative").into());
        }
    }
    let scale = match params.bool("remaproughness")? {
        Some(false) => RoughnessScale::Alpha,
        _ => RoughnessScale::SquareRoot,
    };
    Ok(Facets { distribution: Distribution::Ggx, roughness, scale, shadowing: Shadowing::Correlated })
}

/// Reads an index of refraction: a number, or a spectrum of which the value at yellow is used.
fn index_of_refraction(context: &mut Context<'_>, params: &Params, name: &str, default: f64) -> ImportResult<f32> {
    let eta = match context.color(params, name)? {
        Some(Color::Samples(samples)) => {
            if samples != SampledSpectrum::constant(samples.at(587.6)) {
                context.unsupported(params.place_of(name), "light of all colours is refracted as yellow is (587.6 nm)");
            }
            samples.at(587.6)
        }
        Some(color) => f64::from(color.to_rec709(ColorRole::Unbounded).y),
        None => match params.texture(name)? {
            Some((_, at)) => {
                context.unsupported(at, format!("`{name}` is the same everywhere: {default}"));
                default
            }
            None => params.float(name)?.unwrap_or(default),
        },
    };
    // pbrt treats 0 as vacuum.
    let eta = if eta == 0.0 { 1.0 } else { eta as f32 };
    if eta > 0.0 && eta.is_normal() { Ok(eta) } else { Err(params.place_of(name).fault("it must be above 0").into()) }
}

fn conductor(
    context: &mut Context<'_>,
    textures: &mut PbrtTextures<'_, '_>,
    params: &Params,
    prefix: &str,
    facets: Facets,
) -> ImportResult<Conductor> {
    let name = |name: &str| format!("{prefix}{name}");
    let reflectance = Spectrum::ONE.into();
    // A metal with η = 1 and this reflectance at normal incidence.
    let k_of = |r: DVec3| {
        let r = r.clamp(DVec3::ZERO, DVec3::splat(0.9999));
        DVec3::new(r.x / (1.0 - r.x), r.y / (1.0 - r.y), r.z / (1.0 - r.z)).powf(0.5) * 2.0
    };
    if let Some(k) = textures.changed(context, params, &name("reflectance"), k_of)? {
        return Ok(Conductor { eta: Spectrum::ONE.into(), k, reflectance, facets });
    }
    let given = |context: &mut Context<'_>, what: &str| context.color(params, &name(what));
    let has_texture = params.texture(&name("eta"))?.is_some() || params.texture(&name("k"))?.is_some();
    if has_texture {
        let mut number = |what: &str| textures.color(context, params, &name(what), ColorRole::Unbounded);
        let (eta, k) = (number("eta")?, number("k")?);
        let (copper_eta, copper_k) = metal_color(&copper().0, &copper().1);
        let or = |param: Option<ColorParam>, default: Spectrum| param.unwrap_or(default.into());
        return Ok(Conductor { eta: or(eta, copper_eta), k: or(k, copper_k), reflectance, facets });
    }
    let eta = given(context, "eta")?.unwrap_or_else(|| Color::Samples(copper().0));
    let k = given(context, "k")?.unwrap_or_else(|| Color::Samples(copper().1));
    let (eta, k) = match (&eta, &k) {
        (Color::Samples(eta), Color::Samples(k)) => metal_color(eta, k),
        _ => (eta.to_rec709(ColorRole::Unbounded), k.to_rec709(ColorRole::Unbounded)),
    };
    Ok(Conductor { eta: eta.into(), k: k.into(), reflectance, facets })
}

/// Returns copper, the default metal.
fn copper() -> (SampledSpectrum, SampledSpectrum) {
    let nothing = || (SampledSpectrum::constant(1.0), SampledSpectrum::constant(1.0));
    metal_spectra("Cu").unwrap_or_else(nothing)
}

/// Converts a metal to three colours: η as an observer sees it, and k such that the reflection at normal incidence has
/// the colour of the spectra.
fn metal_color(eta: &SampledSpectrum, k: &SampledSpectrum) -> (Spectrum, Spectrum) {
    let reflected = |nm: f64| {
        let (eta, k) = (eta.at(nm), k.at(nm));
        ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k)
    };
    let samples = (0..=94).map(|index| 360.0 + 5.0 * f64::from(index)).map(|nm| (nm, reflected(nm))).collect();
    let eta_color = eta.pbrt_reflectance().as_dvec3();
    let Ok(samples) = SampledSpectrum::new(samples) else { return (eta_color.as_vec3(), k.pbrt_reflectance()) };
    let r = samples.pbrt_reflectance().as_dvec3().clamp(DVec3::ZERO, DVec3::splat(0.9999));
    let k_squared = (r * (eta_color + 1.0) * (eta_color + 1.0) - (eta_color - 1.0) * (eta_color - 1.0)) / (1.0 - r);
    (eta_color.as_vec3(), k_squared.max(DVec3::ZERO).powf(0.5).as_vec3())
}

fn coated(
    context: &mut Context<'_>,
    textures: &mut PbrtTextures<'_, '_>,
    params: &Params,
    eta: f32,
    facets: Facets,
    base: CoatedBase,
) -> ImportResult<Surface> {
    let mut g = textures.scalar(context, params, "g")?.unwrap_or(0.0.into());
    if !(0.0..1.0).contains(&g.factor) {
        context.unsupported(params.place_of("g"), "the coat scatters evenly: its g is not in [0, 1)");
        g = 0.0.into();
    }
    let depth = params.integer("maxdepth")?.unwrap_or(10);
    if params.bool("twosided")? == Some(false) {
        context.unsupported(params.place_of("twosided"), "the coat lies on both sides, though `twosided` is false");
    }
    Ok(Surface::Coated(Box::new(Coated {
        eta,
        facets,
        thickness: textures.scalar(context, params, "thickness")?.unwrap_or(0.01.into()),
        albedo: textures.color(context, params, "albedo", ColorRole::Reflectance)?.unwrap_or_default(),
        g,
        max_depth: u32::try_from(depth).unwrap_or(0),
        base,
    })))
}

/// Reads a subsurface material: a named substance, coefficients, or a reflectance with mean free paths.
fn subsurface(
    context: &mut Context<'_>,
    textures: &mut PbrtTextures<'_, '_>,
    entity: &Entity,
) -> ImportResult<Surface> {
    let params = &entity.params;
    let scale = params.float("scale")?.unwrap_or(1.0) as f32;
    let scaled = |mut param: ColorParam| {
        param.factor *= scale;
        param
    };
    let coefficients = |sigma: [DVec3; 2]| {
        let [absorption, scattering] = sigma.map(|sigma| scaled(sigma.as_vec3().into()));
        Substance::Coefficients { absorption, scattering }
    };
    let mut color = |context: &mut Context<'_>, name: &str, role| textures.color(context, params, name, role);
    let sigma_a = color(context, "sigma_a", ColorRole::Unbounded)?;
    let sigma_s = color(context, "sigma_s", ColorRole::Unbounded)?;
    let reflectance = color(context, "reflectance", ColorRole::Reflectance)?;
    let mfp = color(context, "mfp", ColorRole::Unbounded)?;
    let mut base_color = Spectrum::ONE.into();
    let substance = match (params.text("name")?, sigma_a, sigma_s, reflectance) {
        (Some(name), ..) => {
            let problem = || params.place_of("name").fault(format!("there is no substance \"{}\"", shortened(name)));
            coefficients(preset_coefficients(name).ok_or_else(problem)?)
        }
        (None, Some(absorption), Some(scattering), _) => {
            Substance::Coefficients { absorption: scaled(absorption), scattering: scaled(scattering) }
        }
        (None, _, _, Some(reflectance)) => {
            base_color = reflectance;
            let radius = scaled(mfp.unwrap_or(Spectrum::ONE.into()));
            Substance::Colored { radius, meaning: RadiusMeaning::MeanFreePath }
        }
        (None, Some(_), None, None) | (None, None, Some(_), None) => {
            return Err(entity.at.fault("`sigma_a` and `sigma_s` are needed together").into());
        }
        // Whole milk
        (None, None, None, None) => coefficients([DVec3::new(0.0011, 0.0024, 0.014), DVec3::new(2.55, 3.21, 3.77)]),
    };
    let g = params.float("g")?.unwrap_or(0.0);
    if g.is_nan() || g.abs() >= 1.0 {
        return Err(params.place_of("g").fault("`g` is between -1 and 1").into());
    }
    let eta = index_of_refraction(context, params, "eta", 1.33)?;
    let below = Subsurface { weight: 1.0.into(), substance, g: g as f32, inner_eta: eta.max(1.0) };
    Ok(Surface::Layered(Box::new(Layered {
        base_color,
        roughness: perceptual_roughness(context, textures, params)?.into(),
        ior: eta.max(1.0),
        subsurface: Some(Box::new(below)),
        ..Layered::default()
    })))
}

/// Reads the roughness along u and v as one perceptual roughness, the root of α.
fn perceptual_roughness(
    context: &mut Context<'_>,
    textures: &mut PbrtTextures<'_, '_>,
    params: &Params,
) -> ImportResult<f32> {
    let facets = facets(context, textures, params, "")?;
    for (roughness, name) in facets.roughness.iter().zip(["uroughness", "vroughness"]) {
        if roughness.texture.is_some() {
            let name = if params.texture("roughness")?.is_some() { "roughness" } else { name };
            context.unsupported(params.place_of(name), format!("`{name}` is the same everywhere"));
        }
    }
    let alpha = facets.roughness.map(|roughness| match facets.scale {
        RoughnessScale::SquareRoot => roughness.factor.sqrt(),
        RoughnessScale::Alpha | RoughnessScale::Square => roughness.factor,
    });
    Ok((alpha[0] * alpha[1]).powf(0.25).min(1.0))
}

/// Reads hair; of several kinds of colour the first of `sigma_a`, `reflectance`, `color` and pigments counts.
fn hair(context: &mut Context<'_>, textures: &mut PbrtTextures<'_, '_>, entity: &Entity) -> ImportResult<Surface> {
    let params = &entity.params;
    let sigma_a = textures.color(context, params, "sigma_a", ColorRole::Unbounded)?;
    let mut reflectance = textures.color(context, params, "reflectance", ColorRole::Reflectance)?;
    if reflectance.is_none() {
        reflectance = textures.color(context, params, "color", ColorRole::Reflectance)?;
    }
    let [eumelanin, pheomelanin] =
        [textures.scalar(context, params, "eumelanin")?, textures.scalar(context, params, "pheomelanin")?];
    let pigment = match (sigma_a, reflectance) {
        (Some(sigma_a), _) => Pigment::SigmaA(sigma_a),
        (None, Some(reflectance)) => Pigment::Reflectance(reflectance),
        (None, None) => {
            let default = if pheomelanin.is_some() { 0.0 } else { 1.3 };
            Pigment::Melanin {
                eumelanin: eumelanin.unwrap_or(default.into()),
                pheomelanin: pheomelanin.unwrap_or(0.0.into()),
            }
        }
    };
    let alpha = match params.texture("alpha")? {
        Some((_, at)) => {
            context.unsupported(at, "the scales of hair have the same angle everywhere: 2°");
            2.0
        }
        None => params.float("alpha")?.unwrap_or(2.0),
    };
    if !(-90.0..=90.0).contains(&alpha) {
        return Err(params.place_of("alpha").fault("the angle of the scales is from -90 to 90 degrees").into());
    }
    let mut roughness = |name: &str| {
        let beta = textures.scalar(context, params, name)?.unwrap_or(0.3.into());
        if beta.texture.is_none() && !(0.0..=1.0).contains(&beta.factor) {
            return Err(params.place_of(name).fault(format!("`{name}` is from 0 to 1")).into());
        }
        Ok::<_, ImportError>(beta)
    };
    let (beta_m, beta_n) = (roughness("beta_m")?, roughness("beta_n")?);
    Ok(Surface::Hair(Box::new(Hair {
        pigment,
        eta: index_of_refraction(context, params, "eta", 1.55)?,
        beta_m,
        beta_n,
        alpha: alpha as f32,
        strand: Strand::AlongU,
    })))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metals_reflect_the_colour_that_their_spectra_do() {
        for metal in ["Ag", "Au", "Cu", "Al"] {
            let Some((eta, k)) = metal_spectra(metal) else { panic!("{metal}") };
            let (eta, k) = metal_color(&eta, &k);
            let r = ((eta - 1.0).powf(2.0) + k * k) / ((eta + 1.0).powf(2.0) + k * k);
            let expected = match metal {
                // Lagarde, Feeding a physically based shading model: F0 in linear sRGB, from other data.
                "Ag" => Spectrum::new(0.972, 0.960, 0.915),
                "Au" => Spectrum::new(1.0, 0.766, 0.336),
                "Cu" => Spectrum::new(0.955, 0.637, 0.538),
                _ => Spectrum::new(0.913, 0.921, 0.925),
            };
            assert!((r - expected).abs().max_element() < 0.06, "{metal}: {r}");
        }
    }
}
