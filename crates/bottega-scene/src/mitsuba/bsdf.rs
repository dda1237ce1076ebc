//! Bsdfs: surfaces with their backs, opacity and relief.

use super::boundary::{eta, facets, ior};
use super::context::ImportContext;
use super::document::{Class, Object, ObjectId};
use super::gloss::{phong, ward};
use super::texture::{MitsubaTextures, TextureUse};
use super::value::numbers;
use crate::color::{Spectrum, luminance};
use crate::hair::{Hair, Pigment, Strand};
use crate::import::text_place::{ImportResult, TextFault};
use crate::material::{Back, Relief, ReliefRule, ReliefSource};
use crate::param::{ColorParam, ScalarParam};
use crate::spectrum::named::metal;
use crate::spectrum::role::ColorRole;
use crate::surface::{Conductor, Dielectric, Diffuse, InnerReflection, Plastic, Principled, Surface, Varnished};
use crate::text::shortened;
use crate::texture::Channel;

/// A converted bsdf, before emission is added.
#[derive(Clone, Debug)]
pub(super) struct LoweredBsdf {
    pub(super) surface: Surface,
    pub(super) back: Back,
    /// Opacity; `None`: opaque.
    pub(super) opacity: Option<ScalarParam>,
    pub(super) relief: Option<Relief>,
}

impl LoweredBsdf {
    /// Makes a bsdf whose back is black, unless light passes through.
    pub(super) fn one_sided(surface: Surface) -> Self {
        let back = if surface.transmits() { Back::Same } else { Back::Black };
        Self { surface, back, opacity: None, relief: None }
    }

    /// Returns the surface of the back.
    fn back_surface(&self) -> Surface {
        match &self.back {
            Back::Same => self.surface.clone(),
            Back::Black => Surface::matte(Spectrum::ZERO),
            Back::Other(surface) => (**surface).clone(),
        }
    }

    /// Returns true if light may pass through.
    pub(super) fn transmits(&self) -> bool {
        self.surface.transmits() || self.opacity.is_some()
    }

    /// Turns opacity into a blend with a clear sheet, which every ray hits: Mitsuba's `mask` and `null` are bsdfs of
    /// surfaces that exist, which matters for emission and within blends.
    pub(super) fn met_everywhere(mut self) -> Self {
        let clear = |opacity: &ScalarParam, surface| Surface::blend(opacity.clone(), [Surface::Null, surface]);
        if let Some(opacity) = self.opacity.take() {
            if self.back != Back::Same {
                self.back = Back::Other(Box::new(clear(&opacity, self.back_surface())));
            }
            self.surface = clear(&opacity, self.surface);
        } else if self.surface == Surface::Null {
            self.surface = Surface::clear_sheet(Spectrum::ONE.into());
        }
        self
    }
}

/// Returns the surface for the back that scatters there as the given one does on the front.
fn mirrored(mut surface: Surface) -> Surface {
    match &mut surface {
        Surface::Dielectric(dielectric) if !dielectric.thin => dielectric.eta = dielectric.eta.recip(),
        Surface::Principled(principled) if !principled.thin && principled.spec_trans.factor > 0.0 => {
            principled.eta = principled.eta.recip();
        }
        Surface::Blend { surfaces, .. } | Surface::Sum(surfaces) => {
            surfaces.iter_mut().for_each(|part| *part = mirrored(std::mem::take(part)));
        }
        _ => {}
    }
    surface
}

/// Converts a `<bsdf>` to a surface.
pub(super) fn bsdf(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    id: ObjectId,
) -> ImportResult<LoweredBsdf> {
    let object = context.visit(id)?;
    Ok(match object.plugin.as_str() {
        "twosided" => two_sided(context, textures, object)?,
        "mask" => mask(context, textures, object)?,
        "bumpmap" | "bump" => {
            let inner = inner(context, textures, object)?;
            let relief = bump(context, textures, object)?;
            with_relief(context, object, inner, relief)?
        }
        "normalmap" => {
            let inner = inner(context, textures, object)?;
            let relief = normal_map(context, textures, object)?;
            with_relief(context, object, inner, relief)?
        }
        "blendbsdf" | "mixturebsdf" => {
            let was_blended = std::mem::replace(&mut textures.is_blended, true);
            let blended = if object.plugin == "blendbsdf" {
                blend(context, textures, object)
            } else {
                mixture(context, textures, object)
            };
            textures.is_blended = was_blended;
            blended?
        }
        "coating" | "roughcoating" => coating(context, textures, object)?,
        _ => LoweredBsdf::one_sided(surface(context, textures, object)?),
    })
}

fn surface(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<Surface> {
    let half = Spectrum::splat(0.5);
    Ok(match object.plugin.as_str() {
        "null" => Surface::Null,
        "diffuse" => Surface::Diffuse(Diffuse {
            // Mitsuba 0.x has two names for it.
            reflectance: match object.has("diffuse_reflectance") {
                true => textures.color(context, object, "diffuse_reflectance", ColorRole::Reflectance, half)?,
                false => textures.color(context, object, "reflectance", ColorRole::Reflectance, half)?,
            },
            roughness: 0.0.into(),
        }),
        "roughdiffuse" => {
            let alpha = textures.scalar(context, object, "alpha", 0.2)?;
            // Its α is the slope of a Beckmann distribution, whose standard deviation is α ∕ √2.
            let roughness = ScalarParam { factor: alpha.factor * std::f32::consts::FRAC_1_SQRT_2, ..alpha };
            Surface::Diffuse(Diffuse {
                reflectance: textures.color(context, object, "reflectance", ColorRole::Reflectance, half)?,
                roughness,
            })
        }
        // Their effect on polarization is ignored.
        "polarizer" | "circular" | "retarder" => {
            let mut transmittance =
                textures.color(context, object, "transmittance", ColorRole::Reflectance, Spectrum::ONE)?;
            transmittance.factor *= if object.plugin == "retarder" { 1.0 } else { 0.5 };
            Surface::clear_sheet(transmittance)
        }
        "difftrans" => Surface::DiffuseTransmission {
            reflectance: Spectrum::ZERO.into(),
            transmittance: textures.color(context, object, "transmittance", ColorRole::Reflectance, half)?,
        },
        "conductor" | "roughconductor" => Surface::Conductor(conductor(context, textures, object)?),
        "dielectric" | "roughdielectric" | "thindielectric" => Surface::Dielectric(Dielectric {
            eta: eta(object, "bk7")?,
            reflectance: textures.color(
                context,
                object,
                "specular_reflectance",
                ColorRole::Reflectance,
                Spectrum::ONE,
            )?,
            transmittance: textures.color(
                context,
                object,
                "specular_transmittance",
                ColorRole::Reflectance,
                Spectrum::ONE,
            )?,
            facets: facets(context, textures, object, object.plugin == "roughdielectric")?,
            thin: object.plugin == "thindielectric",
        }),
        "plastic" | "roughplastic" | "pplastic" => {
            let inner = match object.plugin.as_str() {
                "pplastic" => InnerReflection::Lost,
                _ if object.boolean("nonlinear", false)? => InnerReflection::Nonlinear,
                _ => InnerReflection::Linear,
            };
            Surface::Plastic(Plastic {
                eta: eta(object, "polypropylene")?,
                diffuse: textures.color(context, object, "diffuse_reflectance", ColorRole::Reflectance, half)?,
                specular: textures.color(
                    context,
                    object,
                    "specular_reflectance",
                    ColorRole::Reflectance,
                    Spectrum::ONE,
                )?,
                inner,
                facets: facets(context, textures, object, object.plugin != "plastic")?,
            })
        }
        "principled" | "principledthin" => Surface::Principled(Box::new(principled(context, textures, object)?)),
        "hair" => Surface::Hair(Box::new(hair(context, textures, object)?)),
        "phong" => Surface::Phong(phong(context, textures, object)?),
        "ward" => Surface::Ward(ward(context, textures, object)?),
        "measured" => {
            let location = context.filename(object)?;
            Surface::Measured(context.measured.get(context.resources, &location)?)
        }
        _ => {
            let message = format!("the {} is not supported; gray diffuse replaces it", object.describe());
            context.warn(object.at, message);
            object.accept_all();
            Surface::matte(half)
        }
    })
}

/// Returns the nested bsdfs, in order.
fn inner_bsdfs(context: &ImportContext<'_>, object: &Object) -> Vec<ObjectId> {
    let is_bsdf = |id: ObjectId| context.document.get(id).class == Class::Bsdf;
    let children = object.children.iter().filter(|child| is_bsdf(child.object));
    children.inspect(|child| child.used.set(true)).map(|child| child.object).collect()
}

/// Converts the first nested bsdf.
fn inner(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<LoweredBsdf> {
    match inner_bsdfs(context, object).first() {
        Some(&id) => bsdf(context, textures, id),
        None => Err(object.at.fault(format!("the {} has no bsdf within", object.describe())).into()),
    }
}

fn two_sided(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<LoweredBsdf> {
    let sides = inner_bsdfs(context, object);
    let mut front = inner(context, textures, object)?;
    let mut other = match sides.get(1) {
        Some(&back) => Some(bsdf(context, textures, back)?),
        None => None,
    };
    let is_clear = front.transmits() || other.as_ref().is_some_and(LoweredBsdf::transmits);
    if !object.boolean("allow_transmission", false)? && is_clear {
        context.note(object.at, "Mitsuba requires `allow_transmission` of a twosided bsdf that transmits light");
    }
    if let Some(back) = other.take_if(|other| other.opacity != front.opacity) {
        (front, other) = (front.met_everywhere(), Some(back.met_everywhere()));
    }
    let (mut relief, mut back) = (front.relief, front.surface.clone());
    if let Some(other) = other {
        if other.relief != relief {
            context.warn(object.at, "a relief on one side of a twosided bsdf counts for both");
        }
        (relief, back) = (relief.or(other.relief), other.surface);
    }
    // The back is the mirror image of the front.
    if let Some(Relief { rule: ReliefRule::Mitsuba { mirrored, .. }, .. }) = &mut relief {
        *mirrored = true;
    }
    let back = mirrored(back);
    let back = if back == front.surface { Back::Same } else { Back::Other(Box::new(back)) };
    Ok(LoweredBsdf { back, relief, ..front })
}

fn mask(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<LoweredBsdf> {
    let mut inner = inner(context, textures, object)?;
    let mut opacity = textures.scalar(context, object, "opacity", 0.5)?;
    // A mask within a mask lets the product of both pass
    match inner.opacity.take() {
        Some(within) if opacity.texture.is_none() => {
            opacity = ScalarParam { factor: opacity.factor * within.factor, ..within };
        }
        Some(within) if within.texture.is_none() => opacity.factor *= within.factor,
        within => inner = LoweredBsdf { opacity: within, ..inner }.met_everywhere(),
    }
    Ok(LoweredBsdf { opacity: Some(opacity), ..inner })
}

/// Converts a coating of Mitsuba 0.6. Only the boundary of a `roughcoating` is rough: light reaches the base as through
/// a smooth one.
fn coating(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<LoweredBsdf> {
    let inner = inner(context, textures, object)?;
    let eta = eta(object, "bk7")?;
    let facets = facets(context, textures, object, object.plugin == "roughcoating")?;
    let mut absorption = textures.color(context, object, "sigma_a", ColorRole::Unbounded, Spectrum::ZERO)?;
    absorption.factor *= object.float_at_least("thickness", 0.0, 1.0)? as f32;
    let specular = textures.color(context, object, "specular_reflectance", ColorRole::Reflectance, Spectrum::ONE)?;
    let over = |base, share: f32| Varnished {
        eta,
        facets: facets.clone(),
        specular: ColorParam { factor: specular.factor * share, ..specular.clone() },
        absorption: absorption.clone(),
        base,
    };
    if inner.opacity.is_some() || inner.relief.is_some() {
        context.warn(object.at, "a mask or a relief within a coating counts for the coating, too");
    }
    let back = match &inner.back {
        Back::Same => Some(Back::Same),
        // The coating itself has two sides
        Back::Black | Back::Other(_) => inner.back_surface().varnished(&over).map(|back| Back::Other(Box::new(back))),
    };
    let Some((surface, back)) = inner.surface.clone().varnished(&over).zip(back) else {
        let message =
            format!("the {} is left out: it lies on another coating, or on a clear surface", object.describe());
        context.warn(object.at, message);
        return Ok(inner);
    };
    Ok(LoweredBsdf { surface, back, ..inner })
}

/// Returns the first nested texture, whatever its name.
fn inner_texture(context: &ImportContext<'_>, object: &Object) -> Option<ObjectId> {
    let is_texture = |id: ObjectId| context.document.get(id).class == Class::Texture;
    let child = object.children.iter().find(|child| is_texture(child.object))?;
    child.used.set(true);
    Some(child.object)
}

fn bump(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<Option<ReliefSource>> {
    let scale = object.float("scale")?.unwrap_or(1.0) as f32;
    let Some(id) = inner_texture(context, object) else { return Ok(None) };
    let texture = textures.texture(context, id, TextureUse::Number)?;
    Ok(texture.map.map(|(map, channel)| {
        let factor = luminance(texture.factor) * scale;
        ReliefSource::Heights(ScalarParam { factor, texture: Some((map, channel.unwrap_or(Channel::R))) })
    }))
}

fn normal_map(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<Option<ReliefSource>> {
    let Some(id) = inner_texture(context, object) else { return Ok(None) };
    let texture = textures.texture(context, id, TextureUse::Vector)?;
    Ok(texture.map.map(|(map, _)| ReliefSource::Normals(map, 1.0)))
}

fn with_relief(
    context: &mut ImportContext<'_>,
    object: &Object,
    inner: LoweredBsdf,
    source: Option<ReliefSource>,
) -> ImportResult<LoweredBsdf> {
    let turns = object.boolean("flip_invalid_normals", true)?;
    let shadows = object.boolean("use_shadowing_function", true)?;
    let Some(source) = source else {
        context.warn(object.at, format!("the {} has no texture", object.describe()));
        return Ok(inner);
    };
    if inner.relief.is_some() {
        context.warn(object.at, "of two reliefs within one another, the outer one counts");
    }
    let rule = ReliefRule::Mitsuba { turns, shadows, mirrored: false };
    Ok(LoweredBsdf { relief: Some(Relief { source, rule }), ..inner })
}

fn blend(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<LoweredBsdf> {
    let inner = inner_bsdfs(context, object);
    let weight = textures.scalar(context, object, "weight", 0.5)?;
    let &[first, second] = inner.as_slice() else {
        return Err(object.at.fault(format!("the {} needs two bsdfs", object.describe())).into());
    };
    let (first, second) = (bsdf(context, textures, first)?, bsdf(context, textures, second)?);
    Ok(blended(context, object, weight, first, second))
}

/// Blends two bsdfs. `weight` is the share of the second.
fn blended(
    context: &mut ImportContext<'_>,
    object: &Object,
    weight: ScalarParam,
    mut first: LoweredBsdf,
    mut second: LoweredBsdf,
) -> LoweredBsdf {
    if first.opacity != second.opacity {
        (first, second) = (first.met_everywhere(), second.met_everywhere());
    }
    if first.relief != second.relief {
        context.warn(object.at, "a relief within a blend counts for all of it");
    }
    let back = match (&first.back, &second.back) {
        (Back::Same, Back::Same) => Back::Same,
        (Back::Black, Back::Black) => Back::Black,
        _ => Back::Other(Box::new(Surface::blend(weight.clone(), [first.back_surface(), second.back_surface()]))),
    };
    LoweredBsdf {
        surface: Surface::blend(weight, [first.surface, second.surface]),
        back,
        opacity: first.opacity,
        relief: first.relief.or(second.relief),
    }
}

/// Converts a mixture of Mitsuba 0.x: any number of bsdfs, whose weights may sum to less than 1; the rest absorbs.
fn mixture(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<LoweredBsdf> {
    let inner = inner_bsdfs(context, object);
    let text = object.string("weights")?.unwrap_or_default();
    let weights = numbers(text).map_err(|problem| object.at.fault(problem))?;
    if inner.is_empty() || weights.len() != inner.len() || weights.iter().any(|&weight| weight < 0.0) {
        return Err(object.at.fault("a mixture needs one weight, not below 0, for each of its bsdfs").into());
    }
    let mut parts = Vec::new();
    for (&id, &weight) in inner.iter().zip(&weights) {
        parts.push((bsdf(context, textures, id)?, weight));
    }
    let rest = 1.0 - weights.iter().sum::<f64>();
    if rest > 1e-4 {
        parts.push((LoweredBsdf { back: Back::Same, ..LoweredBsdf::one_sided(Surface::matte(Spectrum::ZERO)) }, rest));
    }
    let mut parts = parts.into_iter();
    let Some((mut all, mut total)) = parts.next() else {
        return Err(object.at.fault("a mixture without parts").into());
    };
    for (part, weight) in parts {
        total += weight;
        let share = if total > 0.0 { weight / total } else { 0.0 };
        all = blended(context, object, (share as f32).into(), all, part);
    }
    Ok(all)
}

fn conductor(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<Conductor> {
    let has_eta = object.has("eta");
    let default = if context.document.is_old { "Cu" } else { "none" };
    let name = object.string("material")?.unwrap_or(if has_eta { "none" } else { default });
    let (eta, k) = if has_eta {
        let outside = ior(object, "ext_eta", "vacuum")?;
        let mut eta = textures.color(context, object, "eta", ColorRole::Unbounded, Spectrum::ZERO)?;
        let mut k = textures.color(context, object, "k", ColorRole::Unbounded, Spectrum::ONE)?;
        (eta.factor, k.factor) = (eta.factor / outside, k.factor / outside);
        (eta, k)
    } else if name == "none" {
        (Spectrum::ZERO.into(), Spectrum::ZERO.into())
    } else {
        let outside = ior(object, "ext_eta", "vacuum")?;
        match metal(name) {
            Some((eta, k)) => ((eta / outside).into(), (k / outside).into()),
            None => {
                let message = format!("the metal `{}` is unknown; a perfect mirror replaces it", shortened(name));
                context.warn(object.at, message);
                (Spectrum::ZERO.into(), Spectrum::ZERO.into())
            }
        }
    };
    Ok(Conductor {
        eta,
        k,
        reflectance: textures.color(context, object, "specular_reflectance", ColorRole::Reflectance, Spectrum::ONE)?,
        facets: facets(context, textures, object, object.plugin == "roughconductor")?,
    })
}

fn hair(context: &mut ImportContext<'_>, textures: &mut MitsubaTextures<'_>, object: &Object) -> ImportResult<Hair> {
    let pigment = if object.has("sigma_a") {
        if object.has("eumelanin") || object.has("pheomelanin") {
            return Err(object.at.fault("hair has either `sigma_a` or pigments, not both").into());
        }
        let mut sigma_a = textures.color(context, object, "sigma_a", ColorRole::Unbounded, Spectrum::ZERO)?;
        sigma_a.factor *= object.float_at_least("scale", 0.0, 1.0)? as f32;
        Pigment::SigmaA(sigma_a)
    } else {
        // It scales `sigma_a` alone.
        object.float_at_least("scale", 0.0, 1.0)?;
        let concentration =
            |name: &str, default: f64| Ok::<_, TextFault>((object.float_at_least(name, 0.0, default)? as f32).into());
        Pigment::Melanin {
            eumelanin: concentration("eumelanin", 1.3)?,
            pheomelanin: concentration("pheomelanin", 0.2)?,
        }
    };
    let roughness = |name: &str| {
        let beta = object.float(name)?.unwrap_or(0.3);
        let is_sound = (0.0..=1.0).contains(&beta);
        if is_sound { Ok((beta as f32).into()) } else { Err(object.at.fault(format!("`{name}` is from 0 to 1"))) }
    };
    let alpha = object.float("scale_tilt")?.unwrap_or(2.0);
    if !(-90.0..=90.0).contains(&alpha) {
        return Err(object.at.fault("`scale_tilt` is from -90 to 90 degrees").into());
    }
    Ok(Hair {
        pigment,
        eta: eta(object, "amber")?,
        beta_m: roughness("longitudinal_roughness")?,
        beta_n: roughness("azimuthal_roughness")?,
        alpha: alpha as f32,
        strand: Strand::AlongV,
    })
}

fn principled(
    context: &mut ImportContext<'_>,
    textures: &mut MitsubaTextures<'_>,
    object: &Object,
) -> ImportResult<Principled> {
    let thin = object.plugin == "principledthin";
    let eta = match (object.property("eta").is_some(), object.float("specular")?) {
        (true, _) => ior(object, "eta", "vacuum")?,
        // The reflectance at normal incidence is 0.08 × specular.
        (false, Some(specular)) => (2.0 / (1.0 - (0.08 * specular.clamp(0.0, 1.0)).sqrt()) - 1.0) as f32,
        (false, None) => 1.5,
    };
    let solid = |value: ScalarParam| if thin { 0.0.into() } else { value };
    Ok(Principled {
        base_color: textures.color(context, object, "base_color", ColorRole::Reflectance, Spectrum::splat(0.5))?,
        roughness: textures.scalar(context, object, "roughness", 0.5)?,
        anisotropic: textures.scalar(context, object, "anisotropic", 0.0)?,
        metallic: solid(textures.scalar(context, object, "metallic", 0.0)?),
        spec_trans: textures.scalar(context, object, "spec_trans", 0.0)?,
        eta,
        spec_tint: textures.scalar(context, object, "spec_tint", 0.0)?,
        sheen: textures.scalar(context, object, "sheen", 0.0)?,
        sheen_tint: textures.scalar(context, object, "sheen_tint", 0.0)?,
        flatness: textures.scalar(context, object, "flatness", 0.0)?,
        clearcoat: solid(textures.scalar(context, object, "clearcoat", 0.0)?),
        clearcoat_gloss: solid(textures.scalar(context, object, "clearcoat_gloss", 0.0)?),
        diff_trans: if thin { textures.scalar(context, object, "diff_trans", 0.0)? } else { 0.0.into() },
        thin,
    })
}
