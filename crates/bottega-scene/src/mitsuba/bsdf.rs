//! Materials: bsdfs combined with emission and media.

use super::color::{ColorRole, TextureUse};
use super::document::{Class, Object, ObjectId};
use super::importer::{Importer, MaterialKey};
use super::shared::MeshNeeds;
use super::value::Value;
use crate::spectrum::{metal, mitsuba_ior};
use crate::text::shortened;
use crate::{
    AlphaMode, Back, Channel, ColorParam, Conductor, Dielectric, Diffuse, Distribution, Facets, InnerReflection,
    Material, Plastic, Principled, Relief, ReliefRule, ReliefSource, RoughnessScale, ScalarParam, SceneError,
    Shadowing, Sides, Spectrum, Surface,
};

/// A converted bsdf, before emission is added.
#[derive(Clone, Debug)]
struct LoweredBsdf {
    surface: Surface,
    back: Back,
    /// Opacity; `None`: opaque.
    opacity: Option<ScalarParam>,
    relief: Option<Relief>,
}

impl LoweredBsdf {
    fn one_sided(surface: Surface) -> Self {
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
    fn transmits(&self) -> bool {
        self.surface.transmits() || self.opacity.is_some()
    }

    /// Turns opacity into a blend with a clear sheet, which every ray hits: Mitsuba's `mask` and `null` are bsdfs of
    /// surfaces that exist, which matters for emission and within blends.
    fn met_everywhere(mut self) -> Self {
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
        Surface::Blend { surfaces, .. } => {
            surfaces.iter_mut().for_each(|part| *part = mirrored(std::mem::take(part)));
        }
        _ => {}
    }
    surface
}

impl Importer<'_> {
    /// Returns the material of a shape, shared by all shapes with the same parts.
    pub(super) fn material(&mut self, key: MaterialKey) -> Result<(u32, MeshNeeds), SceneError> {
        if let Some(&known) = self.materials.get(&key) {
            return Ok(known);
        }
        let (bsdf, emitter, interior, exterior) = key;
        (self.wants_vertex_colors, self.wants_face_colors) = (false, false);
        self.awaited.clear();
        let lowered = match bsdf {
            Some(bsdf) => self.bsdf(bsdf)?,
            // An emitter without a bsdf is black.
            None if emitter.is_some() => LoweredBsdf::one_sided(Surface::matte(Spectrum::ZERO)),
            None => LoweredBsdf::one_sided(Surface::matte(Spectrum::splat(0.5))),
        };
        let emission = match emitter {
            Some(emitter) => self.area_radiance(emitter)?,
            None => ColorParam::default(),
        };
        // Opacity does not affect emission.
        let shines = emission.factor.max_element() > 0.0;
        let lowered = if shines { lowered.met_everywhere() } else { lowered };
        let name = bsdf.map_or_else(String::new, |bsdf| self.document.get(bsdf).id.clone());
        let is_boundary = lowered.transmits();
        let material = Material {
            name,
            culls_back: false,
            alpha_mode: if lowered.opacity.is_some() { AlphaMode::Blend } else { AlphaMode::Opaque },
            surface: lowered.surface,
            back: lowered.back,
            opacity: lowered.opacity.unwrap_or_default(),
            emission,
            emission_sides: Sides::Front,
            relief: lowered.relief,
            interior: interior.filter(|_| is_boundary),
            exterior: exterior.filter(|_| is_boundary),
            see_through: false,
        };
        let tangents = material.needs_tangents();
        let uvs = tangents || !material.textures().is_empty();
        let (colors, face_colors) = (self.wants_vertex_colors, self.wants_face_colors);
        let needs = MeshNeeds { uvs, tangents, colors, face_colors };
        let made = (self.scene.push_material(material), needs);
        if self.awaited.is_empty() {
            self.materials.insert(key, made);
        } else {
            // Each mesh has its own values.
            self.awaited_by.insert(made.0, std::mem::take(&mut self.awaited));
        }
        Ok(made)
    }

    fn bsdf(&mut self, id: ObjectId) -> Result<LoweredBsdf, SceneError> {
        let object = self.visit(id)?;
        Ok(match object.plugin.as_str() {
            "twosided" => self.two_sided(object)?,
            "mask" => self.mask(object)?,
            "bumpmap" | "bump" => {
                let inner = self.inner(object)?;
                let relief = self.bump(object)?;
                self.with_relief(object, inner, relief)?
            }
            "normalmap" => {
                let inner = self.inner(object)?;
                let relief = self.normal_map(object)?;
                self.with_relief(object, inner, relief)?
            }
            "blendbsdf" | "mixturebsdf" => {
                let was_blended = std::mem::replace(&mut self.is_blended, true);
                let blended = if object.plugin == "blendbsdf" { self.blend(object) } else { self.mixture(object) };
                self.is_blended = was_blended;
                blended?
            }
            "coating" | "roughcoating" => {
                let message = format!("the {} is left out; what it covers is kept", object.describe());
                self.report.warn(object.at, message);
                self.accept_all(object);
                self.inner(object)?
            }
            _ => LoweredBsdf::one_sided(self.surface(object)?),
        })
    }

    fn surface(&mut self, object: &Object) -> Result<Surface, SceneError> {
        let half = Spectrum::splat(0.5);
        Ok(match object.plugin.as_str() {
            "null" => Surface::Null,
            "diffuse" => Surface::Diffuse(Diffuse {
                // Mitsuba 0.x has two names for it.
                reflectance: match object.property("diffuse_reflectance").is_some()
                    || object.child("diffuse_reflectance").is_some()
                {
                    true => self.color(object, "diffuse_reflectance", ColorRole::Reflectance, half)?,
                    false => self.color(object, "reflectance", ColorRole::Reflectance, half)?,
                },
                roughness: 0.0.into(),
            }),
            "roughdiffuse" => {
                let alpha = self.scalar(object, "alpha", 0.2)?;
                // Its α is the slope of a Beckmann distribution, whose standard deviation is α ∕ √2.
                let roughness = ScalarParam { factor: alpha.factor * std::f32::consts::FRAC_1_SQRT_2, ..alpha };
                Surface::Diffuse(Diffuse {
                    reflectance: self.color(object, "reflectance", ColorRole::Reflectance, half)?,
                    roughness,
                })
            }
            // Their effect on polarization is ignored.
            "polarizer" | "circular" | "retarder" => {
                let mut transmittance = self.color(object, "transmittance", ColorRole::Reflectance, Spectrum::ONE)?;
                transmittance.factor *= if object.plugin == "retarder" { 1.0 } else { 0.5 };
                Surface::clear_sheet(transmittance)
            }
            "difftrans" => Surface::DiffuseTransmission {
                reflectance: Spectrum::ZERO.into(),
                transmittance: self.color(object, "transmittance", ColorRole::Reflectance, half)?,
            },
            "conductor" | "roughconductor" => Surface::Conductor(self.conductor(object)?),
            "dielectric" | "roughdielectric" | "thindielectric" => Surface::Dielectric(Dielectric {
                eta: self.eta(object, "bk7")?,
                reflectance: self.color(object, "specular_reflectance", ColorRole::Reflectance, Spectrum::ONE)?,
                transmittance: self.color(object, "specular_transmittance", ColorRole::Reflectance, Spectrum::ONE)?,
                facets: self.facets(object, object.plugin == "roughdielectric")?,
                thin: object.plugin == "thindielectric",
            }),
            "plastic" | "roughplastic" | "pplastic" => {
                let inner = match object.plugin.as_str() {
                    "pplastic" => InnerReflection::Lost,
                    _ if self.bad(object.boolean("nonlinear", false))? => InnerReflection::Nonlinear,
                    _ => InnerReflection::Linear,
                };
                Surface::Plastic(Plastic {
                    eta: self.eta(object, "polypropylene")?,
                    diffuse: self.color(object, "diffuse_reflectance", ColorRole::Reflectance, half)?,
                    specular: self.color(object, "specular_reflectance", ColorRole::Reflectance, Spectrum::ONE)?,
                    inner,
                    facets: self.facets(object, object.plugin != "plastic")?,
                })
            }
            "principled" | "principledthin" => Surface::Principled(Box::new(self.principled(object)?)),
            "phong" | "ward" => {
                let message = format!("the {} is not supported; its diffuse part stands for it", object.describe());
                self.report.warn(object.at, message);
                self.accept_all(object);
                Surface::Diffuse(Diffuse {
                    reflectance: self.color(object, "diffuse_reflectance", ColorRole::Reflectance, half)?,
                    roughness: 0.0.into(),
                })
            }
            _ => {
                let message = format!("the {} is not supported; gray diffuse stands for it", object.describe());
                self.report.warn(object.at, message);
                self.accept_all(object);
                Surface::matte(half)
            }
        })
    }

    /// Marks everything within an unsupported object as read, so that it is not reported again.
    pub(super) fn accept_all(&self, object: &Object) {
        object.properties.iter().for_each(|property| property.used.set(true));
        object.children.iter().for_each(|child| child.used.set(true));
    }

    /// Returns the nested bsdfs, in order.
    fn inner_bsdfs(&self, object: &Object) -> Vec<ObjectId> {
        let is_bsdf = |id: ObjectId| self.document.get(id).class == Class::Bsdf;
        let children = object.children.iter().filter(|child| is_bsdf(child.object));
        children.inspect(|child| child.used.set(true)).map(|child| child.object).collect()
    }

    /// Converts the first nested bsdf.
    fn inner(&mut self, object: &Object) -> Result<LoweredBsdf, SceneError> {
        match self.inner_bsdfs(object).first() {
            Some(&id) => self.bsdf(id),
            None => Err(self.report.invalid(object.at, format!("the {} has no bsdf within", object.describe()))),
        }
    }

    fn two_sided(&mut self, object: &Object) -> Result<LoweredBsdf, SceneError> {
        let sides = self.inner_bsdfs(object);
        let mut front = self.inner(object)?;
        let mut other = match sides.get(1) {
            Some(&back) => Some(self.bsdf(back)?),
            None => None,
        };
        let is_clear = front.transmits() || other.as_ref().is_some_and(LoweredBsdf::transmits);
        if !self.bad(object.boolean("allow_transmission", false))? && is_clear {
            self.report
                .note(object.at, "Mitsuba wants `allow_transmission` of a twosided bsdf that lets light through");
        }
        if let Some(back) = other.take_if(|other| other.opacity != front.opacity) {
            (front, other) = (front.met_everywhere(), Some(back.met_everywhere()));
        }
        let (mut relief, mut back) = (front.relief, front.surface.clone());
        if let Some(other) = other {
            if other.relief != relief {
                self.report.warn(object.at, "a relief on one side of a twosided bsdf counts for both");
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

    fn mask(&mut self, object: &Object) -> Result<LoweredBsdf, SceneError> {
        let inner = self.inner(object)?;
        let opacity = self.scalar(object, "opacity", 0.5)?;
        if inner.opacity.is_some() {
            self.report.warn(object.at, "of two masks within one another, the outer one counts");
        }
        Ok(LoweredBsdf { opacity: Some(opacity), ..inner })
    }

    /// Returns the first nested texture, whatever its name.
    fn inner_texture(&self, object: &Object) -> Option<ObjectId> {
        let is_texture = |id: ObjectId| self.document.get(id).class == Class::Texture;
        let child = object.children.iter().find(|child| is_texture(child.object))?;
        child.used.set(true);
        Some(child.object)
    }

    fn bump(&mut self, object: &Object) -> Result<Option<ReliefSource>, SceneError> {
        let scale = self.bad(object.float("scale"))?.unwrap_or(1.0) as f32;
        let Some(id) = self.inner_texture(object) else { return Ok(None) };
        let texture = self.texture(id, TextureUse::Number)?;
        Ok(texture.map.map(|(map, channel)| {
            let factor = super::color::luminance(texture.factor) * scale;
            ReliefSource::Heights(ScalarParam { factor, texture: Some((map, channel.unwrap_or(Channel::R))) })
        }))
    }

    fn normal_map(&mut self, object: &Object) -> Result<Option<ReliefSource>, SceneError> {
        let Some(id) = self.inner_texture(object) else { return Ok(None) };
        let texture = self.texture(id, TextureUse::Vector)?;
        Ok(texture.map.map(|(map, _)| ReliefSource::Normals(map, 1.0)))
    }

    fn with_relief(
        &mut self,
        object: &Object,
        inner: LoweredBsdf,
        source: Option<ReliefSource>,
    ) -> Result<LoweredBsdf, SceneError> {
        let turns = self.bad(object.boolean("flip_invalid_normals", true))?;
        let shadows = self.bad(object.boolean("use_shadowing_function", true))?;
        let Some(source) = source else {
            self.report.warn(object.at, format!("the {} has no texture", object.describe()));
            return Ok(inner);
        };
        if inner.relief.is_some() {
            self.report.warn(object.at, "of two reliefs within one another, the outer one counts");
        }
        let rule = ReliefRule::Mitsuba { turns, shadows, mirrored: false };
        Ok(LoweredBsdf { relief: Some(Relief { source, rule }), ..inner })
    }

    fn blend(&mut self, object: &Object) -> Result<LoweredBsdf, SceneError> {
        let inner = self.inner_bsdfs(object);
        let weight = self.scalar(object, "weight", 0.5)?;
        let &[first, second] = inner.as_slice() else {
            return Err(self.report.invalid(object.at, format!("the {} needs two bsdfs", object.describe())));
        };
        let (first, second) = (self.bsdf(first)?, self.bsdf(second)?);
        Ok(self.blended(object, weight, first, second))
    }

    /// Blends two bsdfs. `weight` is the share of the second.
    fn blended(
        &mut self,
        object: &Object,
        weight: ScalarParam,
        mut first: LoweredBsdf,
        mut second: LoweredBsdf,
    ) -> LoweredBsdf {
        if first.opacity != second.opacity {
            (first, second) = (first.met_everywhere(), second.met_everywhere());
        }
        if first.relief != second.relief {
            self.report.warn(object.at, "a relief within a blend counts for all of it");
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
    fn mixture(&mut self, object: &Object) -> Result<LoweredBsdf, SceneError> {
        let inner = self.inner_bsdfs(object);
        let text = self.bad(object.string("weights"))?.unwrap_or_default();
        let weights = super::value::numbers(text).map_err(|problem| self.report.invalid(object.at, problem))?;
        if inner.is_empty() || weights.len() != inner.len() || weights.iter().any(|&weight| weight < 0.0) {
            return Err(self
                .report
                .invalid(object.at, "a mixture needs one weight, not below 0, for each of its bsdfs"));
        }
        let mut parts = Vec::new();
        for (&id, &weight) in inner.iter().zip(&weights) {
            parts.push((self.bsdf(id)?, weight));
        }
        let rest = 1.0 - weights.iter().sum::<f64>();
        if rest > 1e-4 {
            parts.push((
                LoweredBsdf { back: Back::Same, ..LoweredBsdf::one_sided(Surface::matte(Spectrum::ZERO)) },
                rest,
            ));
        }
        let mut parts = parts.into_iter();
        let Some((mut all, mut total)) = parts.next() else {
            return Err(self.report.invalid(object.at, "a mixture of nothing"));
        };
        for (part, weight) in parts {
            total += weight;
            let share = if total > 0.0 { weight / total } else { 0.0 };
            all = self.blended(object, (share as f32).into(), all, part);
        }
        Ok(all)
    }

    fn conductor(&mut self, object: &Object) -> Result<Conductor, SceneError> {
        let has_eta = object.property("eta").is_some() || object.child("eta").is_some();
        let default = if self.document.is_old { "Cu" } else { "none" };
        let name = self.bad(object.string("material"))?.unwrap_or(if has_eta { "none" } else { default });
        let (eta, k) = if has_eta {
            let outside = self.ior(object, "ext_eta", "vacuum")?;
            let mut eta = self.color(object, "eta", ColorRole::Unbounded, Spectrum::ZERO)?;
            let mut k = self.color(object, "k", ColorRole::Unbounded, Spectrum::ONE)?;
            (eta.factor, k.factor) = (eta.factor / outside, k.factor / outside);
            (eta, k)
        } else if name == "none" {
            (Spectrum::ZERO.into(), Spectrum::ZERO.into())
        } else {
            let outside = self.ior(object, "ext_eta", "vacuum")?;
            match metal(name) {
                Some((eta, k)) => ((eta / outside).into(), (k / outside).into()),
                None => {
                    let message =
                        format!("the metal `{}` is not known; a perfect mirror stands for it", shortened(name));
                    self.report.warn(object.at, message);
                    (Spectrum::ZERO.into(), Spectrum::ZERO.into())
                }
            }
        };
        Ok(Conductor {
            eta,
            k,
            reflectance: self.color(object, "specular_reflectance", ColorRole::Reflectance, Spectrum::ONE)?,
            facets: self.facets(object, object.plugin == "roughconductor")?,
        })
    }

    /// Returns the index of refraction of the inside over the outside.
    fn eta(&mut self, object: &Object, interior: &str) -> Result<f32, SceneError> {
        let (inside, outside) = (self.ior(object, "int_ior", interior)?, self.ior(object, "ext_ior", "air")?);
        Ok(inside / outside)
    }

    /// Returns an index of refraction, given by number or name.
    fn ior(&mut self, object: &Object, name: &str, default: &str) -> Result<f32, SceneError> {
        let by_name = |name: &str| mitsuba_ior(name).unwrap_or(1.5);
        let Some(property) = object.property(name) else { return Ok(by_name(default)) };
        match &property.value {
            Value::Float(number) if (0.01..=100.0).contains(number) => Ok(*number as f32),
            Value::Integer(number) if (1..=100).contains(number) => Ok(*number as f32),
            Value::String(text) => mitsuba_ior(text).ok_or_else(|| {
                self.report.invalid(property.at, format!("no substance is known as `{}`", shortened(text)))
            }),
            _ => Err(self.report.invalid(property.at, format!("`{name}` is no index of refraction"))),
        }
    }

    fn facets(&mut self, object: &Object, is_rough: bool) -> Result<Facets, SceneError> {
        if !is_rough {
            return Ok(Facets::smooth());
        }
        let distribution = match self.bad(object.string("distribution"))? {
            Some("ggx") => Distribution::Ggx,
            None | Some("beckmann") => Distribution::Beckmann,
            Some(other) => {
                let message =
                    format!("the distribution `{}` is not supported; Beckmann's stands for it", shortened(other));
                self.report.warn(object.at, message);
                Distribution::Beckmann
            }
        };
        let alpha = self.scalar(object, "alpha", 0.1)?;
        let is_given = |name: &str| object.property(name).is_some() || object.child(name).is_some();
        let mut roughness = [alpha.clone(), alpha];
        for (roughness, name) in roughness.iter_mut().zip(["alpha_u", "alpha_v"]) {
            if is_given(name) {
                *roughness = self.scalar(object, name, 0.1)?;
            }
        }
        Ok(Facets { distribution, roughness, scale: RoughnessScale::Alpha, shadowing: Shadowing::Separable })
    }

    fn principled(&mut self, object: &Object) -> Result<Principled, SceneError> {
        let thin = object.plugin == "principledthin";
        let eta = match (object.property("eta").is_some(), self.bad(object.float("specular"))?) {
            (true, _) => self.ior(object, "eta", "vacuum")?,
            // The reflectance at normal incidence is 0.08 × specular.
            (false, Some(specular)) => (2.0 / (1.0 - (0.08 * specular.clamp(0.0, 1.0)).sqrt()) - 1.0) as f32,
            (false, None) => 1.5,
        };
        let solid = |value: ScalarParam| if thin { 0.0.into() } else { value };
        Ok(Principled {
            base_color: self.color(object, "base_color", ColorRole::Reflectance, Spectrum::splat(0.5))?,
            roughness: self.scalar(object, "roughness", 0.5)?,
            anisotropic: self.scalar(object, "anisotropic", 0.0)?,
            metallic: solid(self.scalar(object, "metallic", 0.0)?),
            spec_trans: self.scalar(object, "spec_trans", 0.0)?,
            eta,
            spec_tint: self.scalar(object, "spec_tint", 0.0)?,
            sheen: self.scalar(object, "sheen", 0.0)?,
            sheen_tint: self.scalar(object, "sheen_tint", 0.0)?,
            flatness: self.scalar(object, "flatness", 0.0)?,
            clearcoat: solid(self.scalar(object, "clearcoat", 0.0)?),
            clearcoat_gloss: solid(self.scalar(object, "clearcoat_gloss", 0.0)?),
            diff_trans: if thin { self.scalar(object, "diff_trans", 0.0)? } else { 0.0.into() },
            thin,
        })
    }
}

/// Returns the material for a surface turned inside out. `None`: it cannot be expressed.
pub(super) fn turned(material: &Material) -> Option<Material> {
    let mut turned = material.clone();
    turned.emission_sides = match material.emission_sides {
        Sides::Front => Sides::Back,
        Sides::Back => Sides::Front,
        Sides::Both => Sides::Both,
    };
    std::mem::swap(&mut turned.interior, &mut turned.exterior);
    match (&material.surface, &material.back) {
        (Surface::Dielectric(dielectric), Back::Same) if dielectric.eta > 0.0 => {
            turned.surface = Surface::Dielectric(Dielectric { eta: 1.0 / dielectric.eta, ..dielectric.clone() });
        }
        (Surface::Null, Back::Same) => {}
        (surface, _) if material.transmits() && !surface.is_thin() => return None,
        (_, Back::Same) => {}
        (surface, Back::Black) => {
            turned.surface = Surface::matte(Spectrum::ZERO);
            turned.back = Back::Other(Box::new(surface.clone()));
        }
        (surface, Back::Other(back)) => {
            turned.surface = (**back).clone();
            turned.back = Back::Other(Box::new(surface.clone()));
        }
    }
    Some(turned)
}
