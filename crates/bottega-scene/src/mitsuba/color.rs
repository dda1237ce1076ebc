//! Colours of properties and of spectrum plugins.

use glam::Vec3;

use super::context::ImportContext;
use super::document::{Class, Object, ObjectProperty};
use super::value::{self, Value};
use crate::color::Spectrum;
use crate::import::text_place::{ImportError, ImportResult, TextFault, TextPlace};
use crate::spectrum::file::read_spd;
use crate::spectrum::role::ColorRole;
use crate::spectrum::sampled::SampledSpectrum;

/// Mitsuba's range of visible wavelengths, in nm.
const VISIBLE: [f64; 2] = [360.0, 830.0];

/// Returns the colour of a property.
pub(super) fn property_color(
    context: &mut ImportContext<'_>,
    property: &ObjectProperty,
    role: ColorRole,
) -> ImportResult<Spectrum> {
    let color = match &property.value {
        Value::Rgb(rgb) => *rgb,
        Value::Float(number) => Vec3::splat(*number as f32),
        Value::Integer(number) => Vec3::splat(*number as f32),
        Value::Vector(vector) => vector.as_vec3(),
        Value::Uniform(value) => uniform(context, *value, role),
        Value::Spectrum(sampled) => sampled.mitsuba_color(role),
        Value::SpectrumFile(name) => {
            let location = context.find(name, property.at)?;
            let bytes = context.resources.read(&location)?;
            read_spd(location.path(), &bytes, context.resources.budget())?.mitsuba_color(role)
        }
        _ => return Err(property.wrong("a colour").into()),
    };
    Ok(in_range(context, color, role, property.at))
}

/// Returns the colour of a constant spectrum: white for surfaces. Emitted, it has the colour of equal energy, except in
/// Mitsuba 0.x, where it is also white.
fn uniform(context: &ImportContext<'_>, value: f64, role: ColorRole) -> Spectrum {
    if role == ColorRole::Emission && !context.document.is_old {
        SampledSpectrum::constant(value).mitsuba_radiance()
    } else {
        Vec3::splat(value as f32)
    }
}

/// Returns the colour of a plugin that gives a spectrum by numbers. `None`: it is another texture.
pub(super) fn plugin_color(
    context: &mut ImportContext<'_>,
    object: &Object,
    role: ColorRole,
) -> ImportResult<Option<Spectrum>> {
    if object.class != Class::Texture {
        return Ok(None);
    }
    let samples = match object.plugin.as_str() {
        "uniform" => {
            let value = object.float("value")?.unwrap_or(1.0);
            return Ok(Some(uniform(context, value, role)));
        }
        "blackbody" => {
            let kelvin = object.float_at_least("temperature", 1.0, 6500.0)?.min(1e6);
            let scale = object.float("scale")?.unwrap_or(1.0);
            let edge = |name: &str, default: f64| Ok::<_, ImportError>(object.float(name)?.unwrap_or(default));
            if edge("wavelength_min", VISIBLE[0])? > VISIBLE[0] || edge("wavelength_max", VISIBLE[1])? < VISIBLE[1] {
                context.warn(object.at, "a black body glows at all wavelengths, and not in a part of them");
            }
            return Ok(Some(SampledSpectrum::blackbody(kelvin).scaled(scale).mitsuba_color(role)));
        }
        "regular" => {
            let values = numbers(object, "values")?;
            let least = object.float("wavelength_min")?.unwrap_or(VISIBLE[0]);
            let greatest = object.float("wavelength_max")?.unwrap_or(VISIBLE[1]);
            let step = (greatest - least) / values.len().saturating_sub(1).max(1) as f64;
            values.iter().enumerate().map(|(index, value)| (least + step * index as f64, *value)).collect()
        }
        "irregular" => {
            let (values, wavelengths) = (numbers(object, "values")?, numbers(object, "wavelengths")?);
            if wavelengths.len() != values.len() {
                let problem = format!("there are {} wavelengths for {} values", wavelengths.len(), values.len());
                return Err(object.at.fault(problem).into());
            }
            wavelengths.into_iter().zip(values).collect()
        }
        _ => return Ok(None),
    };
    Ok(Some(SampledSpectrum::new(samples).map_err(|error| object.at.fault(error))?.mitsuba_color(role)))
}

/// Returns the list of numbers in a text property; empty if it is not given.
fn numbers(object: &Object, name: &str) -> Result<Vec<f64>, TextFault> {
    let text = object.string(name)?.unwrap_or_default();
    value::numbers(text).map_err(|error| object.at.fault(error))
}

/// Clamps a colour to the range of its role, with a warning.
pub(super) fn in_range(context: &mut ImportContext<'_>, color: Vec3, role: ColorRole, at: TextPlace) -> Vec3 {
    let most = if role == ColorRole::Reflectance { 1.0 } else { f32::MAX };
    let clamped = color.clamp(Vec3::ZERO, Vec3::splat(most));
    if clamped != color {
        context.warn(at, "a colour is out of range, and brought back into it");
    }
    clamped
}
