//! Colours and numbers of properties: constants, spectra or textures.

use glam::Vec3;

use super::document::{Class, Object, ObjectId, ObjectProperty};
use super::importer::Importer;
use super::value::Value;
use super::xml::XmlPlace;
use crate::spectrum::{Sampled, read_spd};
use crate::{Channel, ColorParam, ScalarParam, SceneError, Spectrum};

/// The quantity that a colour describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorRole {
    /// A reflectance or transmittance, in [0, 1].
    Reflectance,
    /// Radiance of an emitter.
    Radiance,
    /// Another spectrum, such as an index of refraction.
    Unbounded,
}

/// The use of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TextureUse {
    /// The main reflectance of a surface, which mesh colours multiply.
    Base,
    Color(ColorRole),
    /// A number: the texture's luminance.
    Number,
    /// A vector, unconverted: a normal map.
    Vector,
}

/// Mitsuba's range of visible wavelengths, in nm.
const VISIBLE: [f64; 2] = [360.0, 830.0];

impl Importer<'_> {
    /// Returns a colour or colour texture.
    pub(super) fn color(
        &mut self,
        object: &Object,
        name: &str,
        role: ColorRole,
        default: Spectrum,
    ) -> Result<ColorParam, SceneError> {
        if let Some(property) = object.property(name) {
            return Ok(self.property_color(property, role)?.into());
        }
        let Some(child) = object.child(name) else { return Ok(default.into()) };
        // Mesh colours multiply only the main reflectance of a surface.
        let is_base = matches!(name, "reflectance" | "diffuse_reflectance" | "base_color");
        let wanted = if is_base { TextureUse::Base } else { TextureUse::Color(role) };
        let texture = self.texture(child.object, wanted)?;
        let factor = self.in_range(texture.factor, role, child.at);
        Ok(ColorParam { factor, texture: texture.map.map(|(map, _)| map) })
    }

    /// Returns a colour that cannot be a texture; the factor of a texture is used, with a warning.
    pub(super) fn plain_color(
        &mut self,
        object: &Object,
        name: &str,
        role: ColorRole,
        default: Spectrum,
    ) -> Result<Spectrum, SceneError> {
        let color = self.color(object, name, role, default)?;
        if color.texture.is_some()
            && let Some(child) = object.child(name)
        {
            self.report.warn(child.at, format!("`{name}` cannot be a texture here; 0.5 stands for it"));
            return Ok(color.factor * 0.5);
        }
        Ok(color.factor)
    }

    /// Returns a number or number texture.
    pub(super) fn scalar(&mut self, object: &Object, name: &str, default: f64) -> Result<ScalarParam, SceneError> {
        if let Some(property) = object.property(name) {
            let number = match property.value {
                Value::Float(number) => number,
                Value::Integer(number) => number as f64,
                _ => f64::from(luminance(self.property_color(property, ColorRole::Unbounded)?)),
            };
            if number < 0.0 {
                self.report.warn(property.at, format!("`{name}` is below 0; 0 stands for it"));
            }
            return Ok((number.max(0.0) as f32).into());
        }
        let Some(child) = object.child(name) else { return Ok((default as f32).into()) };
        let texture = self.texture(child.object, TextureUse::Number)?;
        let factor = self.in_range(texture.factor, ColorRole::Unbounded, child.at);
        Ok(ScalarParam {
            factor: luminance(factor),
            texture: texture.map.map(|(map, channel)| (map, channel.unwrap_or(Channel::R))),
        })
    }

    /// Returns the colour of a property.
    pub(super) fn property_color(
        &mut self,
        property: &ObjectProperty,
        role: ColorRole,
    ) -> Result<Spectrum, SceneError> {
        let color = match &property.value {
            Value::Rgb(rgb) => *rgb,
            Value::Float(number) => Vec3::splat(*number as f32),
            Value::Integer(number) => Vec3::splat(*number as f32),
            Value::Vector(vector) => vector.as_vec3(),
            Value::Uniform(value) => self.uniform(*value, role),
            Value::Spectrum(sampled) => spectrum_color(sampled, role),
            Value::SpectrumFile(name) => {
                let location = self.find(name, property.at)?;
                let bytes = self.resources.read(&location)?;
                spectrum_color(&read_spd(location.path(), &bytes, self.resources.budget())?, role)
            }
            _ => return self.bad(Err(property.wrong("a colour"))),
        };
        Ok(self.in_range(color, role, property.at))
    }

    /// Returns the colour of a constant spectrum: white for surfaces. Emitted, it has the colour of equal energy,
    /// except in Mitsuba 0.x, where it is also white.
    fn uniform(&self, value: f64, role: ColorRole) -> Spectrum {
        if role == ColorRole::Radiance && !self.document.is_old {
            Sampled::constant(value).mitsuba_radiance()
        } else {
            Vec3::splat(value as f32)
        }
    }

    /// Returns the colour of a spectrum plugin. `None`: it is another texture.
    pub(super) fn spectrum_plugin(&mut self, id: ObjectId, role: ColorRole) -> Result<Option<Spectrum>, SceneError> {
        let object = self.document.get(id);
        if object.class != Class::Texture {
            return Ok(None);
        }
        let wavelengths = |text: Option<&str>| text.map(super::value::numbers).transpose();
        Ok(Some(match object.plugin.as_str() {
            "uniform" => {
                let value = self.bad(object.float("value"))?.unwrap_or(1.0);
                self.uniform(value, role)
            }
            "d65" => match self.bad(object.float("scale"))? {
                Some(scale) => Vec3::splat(scale as f32),
                None => self.color(object, "color", role, Vec3::ONE)?.factor,
            },
            "rgb" | "srgb" => self.color(object, "color", role, Vec3::splat(0.5))?.factor,
            "blackbody" => {
                let kelvin = self.number_at_least(object, "temperature", 1.0, 6500.0)?.min(1e6);
                let scale = self.bad(object.float("scale"))?.unwrap_or(1.0);
                let edge =
                    |name: &str, default: f64| Ok::<_, SceneError>(self.bad(object.float(name))?.unwrap_or(default));
                if edge("wavelength_min", VISIBLE[0])? > VISIBLE[0] || edge("wavelength_max", VISIBLE[1])? < VISIBLE[1]
                {
                    self.report.warn(object.at, "a black body glows at all wavelengths, and not in a part of them");
                }
                spectrum_color(&Sampled::blackbody(kelvin).scaled(scale), role)
            }
            "regular" => {
                let values = wavelengths(self.bad(object.string("values"))?)
                    .map_err(|problem| self.report.invalid(object.at, problem))?
                    .unwrap_or_default();
                let least = self.bad(object.float("wavelength_min"))?.unwrap_or(VISIBLE[0]);
                let greatest = self.bad(object.float("wavelength_max"))?.unwrap_or(VISIBLE[1]);
                let step = (greatest - least) / values.len().saturating_sub(1).max(1) as f64;
                let pairs = values.iter().enumerate().map(|(index, value)| (least + step * index as f64, *value));
                spectrum_color(
                    &Sampled::new(pairs.collect()).map_err(|problem| self.report.invalid(object.at, problem))?,
                    role,
                )
            }
            "irregular" => {
                let values = wavelengths(self.bad(object.string("values"))?)
                    .map_err(|problem| self.report.invalid(object.at, problem))?
                    .unwrap_or_default();
                let at = wavelengths(self.bad(object.string("wavelengths"))?)
                    .map_err(|problem| self.report.invalid(object.at, problem))?
                    .unwrap_or_default();
                if at.len() != values.len() {
                    let problem = format!("there are {} wavelengths for {} values", at.len(), values.len());
                    return Err(self.report.invalid(object.at, problem));
                }
                spectrum_color(
                    &Sampled::new(at.into_iter().zip(values).collect())
                        .map_err(|problem| self.report.invalid(object.at, problem))?,
                    role,
                )
            }
            _ => return Ok(None),
        }))
    }

    /// Clamps a colour to the range of its role, with a warning.
    fn in_range(&mut self, color: Vec3, role: ColorRole, at: XmlPlace) -> Vec3 {
        let most = if role == ColorRole::Reflectance { 1.0 } else { f32::MAX };
        let clamped = color.clamp(Vec3::ZERO, Vec3::splat(most));
        if clamped != color {
            self.report.warn(at, "a colour is out of range, and brought back into it");
        }
        clamped
    }
}

fn spectrum_color(sampled: &Sampled, role: ColorRole) -> Spectrum {
    match role {
        ColorRole::Reflectance => sampled.mitsuba_reflectance(),
        ColorRole::Radiance => sampled.mitsuba_radiance(),
        ColorRole::Unbounded => sampled.mitsuba_unbounded(),
    }
}

/// Returns the luminance of linear Rec. 709.
pub(super) fn luminance(color: Spectrum) -> f32 {
    if color.x == color.y && color.y == color.z { color.x } else { color.dot(Vec3::new(0.2126, 0.7152, 0.0722)) }
}
