//! Materials: glTF 2.0, section 3.9, and its extensions.

use glam::Vec3;

use super::accessor::find;
use super::document;
use super::source::GltfSource;
use super::texture::{Textures, Use};
use crate::error::{SceneError, Warnings};
use crate::material::{AlphaMode, Material, Relief, Sides};
use crate::medium::{Medium, MediumId};
use crate::param::{ColorParam, ScalarParam};
use crate::surface::{Anisotropy, Iridescence, Layered, Surface};
use crate::text::shortened;
use crate::texture::{Channel, TextureMap};

/// Converts a material of the document; `None`: the default material of the specification.
pub(super) fn convert(
    source: &GltfSource<'_>,
    index: Option<usize>,
    textures: &mut Textures<'_>,
    media: &mut Vec<Medium>,
    warnings: &mut Warnings,
) -> Result<Material, SceneError> {
    let default = document::Material::default();
    let description = match index {
        None => &default,
        Some(index) => find("material", &source.document.materials, index)
            .map_err(|problem| source.invalid("meshes[*].primitives[*].material", problem))?,
    };
    let place = index.map_or_else(|| "default material".into(), |index| format!("materials[{index}]"));
    let culls_back = source.options.cull_backfaces;
    MaterialConverter { place, textures, media, warnings, culls_back }.convert(description)
}

struct MaterialConverter<'a, 's> {
    place: String,
    textures: &'a mut Textures<'s>,
    media: &'a mut Vec<Medium>,
    warnings: &'a mut Warnings,
    culls_back: bool,
}

type Info<'a> = Option<&'a document::TextureInfo>;

impl MaterialConverter<'_, '_> {
    fn convert(mut self, description: &document::Material) -> Result<Material, SceneError> {
        let no_extensions = document::MaterialExtensions::default();
        let extensions = description.extensions.as_deref().unwrap_or(&no_extensions);
        let strength = extensions.emissive_strength.as_ref().and_then(|e| e.emissive_strength).unwrap_or(1.0);
        let strength = self.number("KHR_materials_emissive_strength", strength, 0.0, f32::MAX);
        let emission = self.color(
            "emissiveFactor",
            description.emissive_factor,
            description.emissive_texture.as_deref(),
            f32::MAX,
        )?;
        let relief = self.normal("normalTexture", description.normal_texture.as_deref())?;
        let mut layered = Layered::default();
        let mut interior = None;
        let alpha = match &extensions.specular_glossiness {
            Some(description) => self.add_specular_glossiness(description, &mut layered)?,
            None => {
                let default = document::MetallicRoughness::default();
                let description = description.pbr_metallic_roughness.as_deref();
                let alpha = self.add_metallic_roughness(description.unwrap_or(&default), &mut layered)?;
                self.add_dielectric(extensions, &mut layered)?;
                interior = self.volume(extensions, &mut layered);
                alpha
            }
        };
        self.add_layers(extensions, &mut layered)?;
        self.add_effects(extensions, &mut layered)?;
        let texture = layered.base_color.texture.map(|map| (map, Channel::A));
        let is_unlit = extensions.unlit.is_some();
        Ok(Material {
            name: description.name.clone(),
            opacity: ScalarParam { factor: alpha, texture },
            alpha_mode: self.alpha_mode(description),
            culls_back: self.culls_back && !description.double_sided,
            emission: ColorParam { factor: (emission.factor * strength).min(Vec3::splat(f32::MAX)), ..emission },
            emission_sides: if description.double_sided { Sides::Both } else { Sides::Front },
            relief: relief.map(|(map, scale)| Relief::normals(map, scale)),
            surface: if is_unlit { Surface::Unlit(layered.base_color) } else { layered.into() },
            interior,
            ..Material::default()
        })
    }

    /// Returns the medium of a solid. A thickness of 0 is a thin sheet; otherwise the geometry gives the thickness, and
    /// the number is for rasterizers.
    fn volume(&mut self, extensions: &document::MaterialExtensions, layered: &mut Layered) -> Option<MediumId> {
        let volume = extensions.volume.as_ref().filter(|volume| volume.thickness_factor > 0.0)?;
        layered.thin = false;
        let color = volume.attenuation_color.unwrap_or([1.0; 3]);
        let color = self.factor("KHR_materials_volume.attenuationColor", color, 1.0);
        let distance = volume.attenuation_distance?;
        if !(distance > 0.0 && distance.is_finite()) {
            let place = "KHR_materials_volume.attenuationDistance";
            self.warn(place, format!("{distance} is no distance; there is no absorption"));
            return None;
        }
        // Light has the colour after the distance. For a black channel use e⁻⁸⁰, which is 0 in single precision.
        let coefficient = |color: f32| if color < 1e-30 { 80.0 } else { -f64::from(color).ln() } / f64::from(distance);
        let absorption = Vec3::from_array(color.to_array().map(|color| coefficient(color).min(1e30) as f32));
        if absorption == Vec3::ZERO {
            return None;
        }
        self.media.push(Medium { name: self.place.clone(), ..Medium::absorbing(absorption) });
        Some(MediumId(self.media.len() as u32 - 1))
    }

    fn alpha_mode(&mut self, description: &document::Material) -> AlphaMode {
        match description.alpha_mode.as_deref() {
            None | Some("OPAQUE") => AlphaMode::Opaque,
            Some("BLEND") => AlphaMode::Blend,
            Some("MASK") => {
                let cutoff = description.alpha_cutoff.unwrap_or(0.5);
                AlphaMode::Mask { cutoff: self.number("alphaCutoff", cutoff, 0.0, f32::MAX) }
            }
            Some(other) => {
                let message = format!("`{}` is unknown and counts as OPAQUE", shortened(other));
                self.warnings.unsupported(format!("{}.alphaMode", self.place), message);
                AlphaMode::Opaque
            }
        }
    }

    /// Adds the metallic-roughness parameters. Returns alpha.
    fn add_metallic_roughness(
        &mut self,
        description: &document::MetallicRoughness,
        layered: &mut Layered,
    ) -> Result<f32, SceneError> {
        let [r, g, b, a] = description.base_color_factor.unwrap_or([1.0; 4]);
        layered.base_color =
            self.color("baseColorFactor", [r, g, b], description.base_color_texture.as_deref(), 1.0)?;
        let texture = description.metallic_roughness_texture.as_deref();
        let metallic = description.metallic_factor.unwrap_or(1.0);
        layered.metallic = self.scalar("metallicFactor", metallic, texture, Channel::B)?;
        let roughness = description.roughness_factor.unwrap_or(1.0);
        layered.roughness = self.scalar("roughnessFactor", roughness, texture, Channel::G)?;
        Ok(self.number("baseColorFactor", a, 0.0, 1.0))
    }

    /// Adds the specular-glossiness parameters. They describe a dielectric by its reflection at normal incidence.
    /// KHR_materials_ior reserves the index 0, total reflection, for this; the colour of KHR_materials_specular scales
    /// it. Returns alpha.
    fn add_specular_glossiness(
        &mut self,
        description: &document::SpecularGlossiness,
        layered: &mut Layered,
    ) -> Result<f32, SceneError> {
        let [r, g, b, a] = description.diffuse_factor.unwrap_or([1.0; 4]);
        layered.base_color = self.color("diffuseFactor", [r, g, b], description.diffuse_texture.as_deref(), 1.0)?;
        let texture = description.specular_glossiness_texture.as_deref();
        let specular = description.specular_factor.unwrap_or([1.0; 3]);
        layered.specular_color = self.color("specularFactor", specular, texture, 1.0)?;
        layered.ior = 0.0;
        let glossiness = description.glossiness_factor.unwrap_or(1.0);
        let glossiness = self.number("glossinessFactor", glossiness, 0.0, 1.0);
        layered.roughness = match texture {
            None => (1.0 - glossiness).into(),
            Some(info) => {
                let picture = Use::RoughnessOfGlossiness { factor_bits: glossiness.to_bits() };
                let map = self.texture("specularGlossinessTexture", info, picture)?;
                ScalarParam { factor: 1.0, texture: Some((map, Channel::G)) }
            }
        };
        Ok(self.number("diffuseFactor", a, 0.0, 1.0))
    }

    fn add_dielectric(
        &mut self,
        extensions: &document::MaterialExtensions,
        layered: &mut Layered,
    ) -> Result<(), SceneError> {
        if let Some(ior) = extensions.ior.as_ref().and_then(|ior| ior.ior) {
            layered.ior = if ior == 0.0 { 0.0 } else { self.number("KHR_materials_ior.ior", ior, 1.0, 100.0) };
        }
        if let Some(specular) = &extensions.specular {
            let factor = specular.specular_factor.unwrap_or(1.0);
            let texture = specular.specular_texture.as_deref();
            layered.specular = self.scalar("KHR_materials_specular.specularFactor", factor, texture, Channel::A)?;
            let factor = specular.specular_color_factor.unwrap_or([1.0; 3]);
            let texture = specular.specular_color_texture.as_deref();
            layered.specular_color =
                self.color("KHR_materials_specular.specularColorFactor", factor, texture, f32::MAX)?;
        }
        if let Some(transmission) = &extensions.transmission {
            let texture = transmission.transmission_texture.as_deref();
            let factor = transmission.transmission_factor;
            let place = "KHR_materials_transmission.transmissionFactor";
            layered.transmission = self.scalar(place, factor, texture, Channel::R)?;
            layered.thin = true;
        }
        Ok(())
    }

    fn add_layers(
        &mut self,
        extensions: &document::MaterialExtensions,
        layered: &mut Layered,
    ) -> Result<(), SceneError> {
        if let Some(coat) = &extensions.clearcoat {
            let place = "KHR_materials_clearcoat.clearcoatFactor";
            layered.coat = self.scalar(place, coat.clearcoat_factor, coat.clearcoat_texture.as_deref(), Channel::R)?;
            let place = "KHR_materials_clearcoat.clearcoatRoughnessFactor";
            let texture = coat.clearcoat_roughness_texture.as_deref();
            layered.coat_roughness = self.scalar(place, coat.clearcoat_roughness_factor, texture, Channel::G)?;
            let place = "KHR_materials_clearcoat.clearcoatNormalTexture";
            layered.coat_normal = self.normal(place, coat.clearcoat_normal_texture.as_deref())?;
        }
        if let Some(sheen) = &extensions.sheen {
            let place = "KHR_materials_sheen.sheenColorFactor";
            layered.sheen_color =
                self.color(place, sheen.sheen_color_factor, sheen.sheen_color_texture.as_deref(), 1.0)?;
            let place = "KHR_materials_sheen.sheenRoughnessFactor";
            let texture = sheen.sheen_roughness_texture.as_deref();
            layered.sheen_roughness = self.scalar(place, sheen.sheen_roughness_factor, texture, Channel::A)?;
        }
        Ok(())
    }

    /// Adds anisotropy, iridescence, dispersion and diffuse transmission.
    fn add_effects(
        &mut self,
        extensions: &document::MaterialExtensions,
        layered: &mut Layered,
    ) -> Result<(), SceneError> {
        if let Some(anisotropy) = &extensions.anisotropy {
            let place = "KHR_materials_anisotropy.anisotropyStrength";
            let strength = self.number(place, anisotropy.anisotropy_strength, 0.0, 1.0);
            let place = "KHR_materials_anisotropy.anisotropyRotation";
            let rotation = self.number(place, anisotropy.anisotropy_rotation, -f32::MAX, f32::MAX);
            if strength > 0.0 {
                let place = "KHR_materials_anisotropy.anisotropyTexture";
                let texture = anisotropy.anisotropy_texture.as_deref();
                let texture = texture.map(|info| self.texture(place, info, Use::Data)).transpose()?;
                layered.anisotropy = Some(Anisotropy { strength, rotation, texture });
            }
        }
        if let Some(iridescence) = &extensions.iridescence {
            layered.iridescence = self.iridescence(iridescence)?;
        }
        if let Some(dispersion) = &extensions.dispersion {
            let place = "KHR_materials_dispersion.dispersion";
            layered.dispersion = self.number(place, dispersion.dispersion, 0.0, f32::MAX);
        }
        if let Some(diffuse) = &extensions.diffuse_transmission {
            let place = "KHR_materials_diffuse_transmission.diffuseTransmissionFactor";
            let texture = diffuse.diffuse_transmission_texture.as_deref();
            layered.diffuse_transmission =
                self.scalar(place, diffuse.diffuse_transmission_factor, texture, Channel::A)?;
            let place = "KHR_materials_diffuse_transmission.diffuseTransmissionColorFactor";
            let color = diffuse.diffuse_transmission_color_factor.unwrap_or([1.0; 3]);
            let texture = diffuse.diffuse_transmission_color_texture.as_deref();
            layered.diffuse_transmission_color = self.color(place, color, texture, 1.0)?;
            let is_solid = extensions.volume.as_ref().is_some_and(|volume| volume.thickness_factor > 0.0);
            layered.thin |= layered.diffuse_transmission.factor > 0.0 && !is_solid;
        }
        Ok(())
    }

    /// Converts a thin film; `None`: there is none, or it has no effect.
    fn iridescence(&mut self, description: &document::Iridescence) -> Result<Option<Iridescence>, SceneError> {
        let place = "KHR_materials_iridescence.iridescenceFactor";
        let texture = description.iridescence_texture.as_deref();
        let factor = self.scalar(place, description.iridescence_factor, texture, Channel::R)?;
        if factor.factor == 0.0 {
            return Ok(None);
        }
        let place = "KHR_materials_iridescence.iridescenceIor";
        let ior = self.number(place, description.iridescence_ior.unwrap_or(1.3), 1.0, 100.0);
        let place = "KHR_materials_iridescence.iridescenceThicknessMinimum";
        let thinnest = self.number(place, description.iridescence_thickness_minimum.unwrap_or(100.0), 0.0, 1e6);
        let place = "KHR_materials_iridescence.iridescenceThicknessMaximum";
        let thickest = self.number(place, description.iridescence_thickness_maximum.unwrap_or(400.0), 0.0, 1e6);
        let place = "KHR_materials_iridescence.iridescenceThicknessTexture";
        let texture = description.iridescence_thickness_texture.as_deref();
        let texture = texture.map(|info| self.texture(place, info, Use::Data)).transpose()?;
        let thickness_texture = texture.map(|map| (map, Channel::G));
        Ok(Some(Iridescence { factor, ior, thickness: [thinnest, thickest], thickness_texture }))
    }

    fn warn(&mut self, member: &str, message: impl Into<String>) {
        self.warnings.add(format!("{}.{member}", self.place), message);
    }

    /// Clamps a number to its range, with a warning.
    fn number(&mut self, member: &str, value: f32, least: f32, greatest: f32) -> f32 {
        if (least..=greatest).contains(&value) {
            return value;
        }
        let inside = if value.is_nan() { least } else { value.clamp(least, greatest) };
        self.warn(member, format!("{value} is out of range and counts as {inside}"));
        inside
    }

    fn factor(&mut self, member: &str, color: [f32; 3], greatest: f32) -> Vec3 {
        Vec3::from_array(color.map(|channel| self.number(member, channel, 0.0, greatest)))
    }

    fn color(
        &mut self,
        member: &str,
        factor: [f32; 3],
        texture: Info<'_>,
        greatest: f32,
    ) -> Result<ColorParam, SceneError> {
        let factor = self.factor(member, factor, greatest);
        let texture = texture.map(|info| self.texture(member, info, Use::Color)).transpose()?;
        Ok(ColorParam { factor, texture })
    }

    fn scalar(
        &mut self,
        member: &str,
        factor: f32,
        texture: Info<'_>,
        channel: Channel,
    ) -> Result<ScalarParam, SceneError> {
        let factor = self.number(member, factor, 0.0, 1.0);
        // Sheen roughness and specular strength are alpha channels of colour pictures; alpha is linear in both.
        let picture = if channel == Channel::A { Use::Color } else { Use::Data };
        let texture = texture.map(|info| self.texture(member, info, picture)).transpose()?;
        Ok(ScalarParam { factor, texture: texture.map(|map| (map, channel)) })
    }

    fn normal(&mut self, member: &str, texture: Info<'_>) -> Result<Option<(TextureMap, f32)>, SceneError> {
        let Some(info) = texture else { return Ok(None) };
        let scale = self.number(member, info.scale.unwrap_or(1.0), -f32::MAX, f32::MAX);
        Ok(Some((self.texture(member, info, Use::Data)?, scale)))
    }

    fn texture(&mut self, member: &str, info: &document::TextureInfo, picture: Use) -> Result<TextureMap, SceneError> {
        let place = format!("{}.{member}", self.place);
        self.textures.map(&place, info, picture, self.warnings)
    }
}
