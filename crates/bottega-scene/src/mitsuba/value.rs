//! Values of properties, parsed from XML attributes.

use glam::{DVec3, Vec3};

use super::placement::Transform;
use super::xml::XmlElement;
use crate::spectrum::sampled::{SampledSpectrum, SpectrumError};
use crate::text::shortened;

/// The value of a property.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    Float(f64),
    Integer(i64),
    Boolean(bool),
    String(String),
    Vector(DVec3),
    Transform(Box<Transform>),
    /// Transformations at times, ascending; two at least.
    Animation(Vec<(f64, Transform)>),
    /// A colour, linear Rec. 709.
    Rgb(Vec3),
    /// A constant spectrum.
    Uniform(f64),
    Spectrum(SampledSpectrum),
    /// The name of a spectrum file.
    SpectrumFile(String),
    /// An unknown tag.
    Unknown,
}

/// An invalid value of a property, or an invalid operation of a transformation.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum ValueError {
    #[error("<{}> has no `{attribute}`", shortened(tag))]
    NoAttribute { tag: String, attribute: &'static str },
    #[error("`{}` is not a number", shortened(.0))]
    NotNumber(String),
    #[error("`{}` is not a whole number", shortened(.0))]
    NotInteger(String),
    #[error("`{}` is neither true nor false", shortened(.0))]
    NotBoolean(String),
    #[error("`{}` has {count} numbers, not 3", shortened(text))]
    NotTriple { text: String, count: usize },
    #[error("`{}` is not a colour", shortened(.0))]
    NotColor(String),
    #[error("no body glows at {kelvin} K")]
    NoBlackBody { kelvin: f64 },
    #[error("<spectrum> has neither `value` nor `filename`")]
    EmptySpectrum,
    #[error("a spectrum of {count} values does not name its wavelengths")]
    NoWavelengths { count: usize },
    #[error("`{}` is no `nm:value`", shortened(.0))]
    NotSpectrumPair(String),
    #[error(transparent)]
    Spectrum(#[from] SpectrumError),
    #[error("<rotate> has no axis")]
    NoAxis,
    #[error("<lookat> looks at its own origin")]
    LooksAtOrigin,
    #[error("a matrix has 16 numbers (or 9), not {count}")]
    MatrixSize { count: usize },
    #[error("<{}> is not an operation of a transformation", shortened(.0))]
    NotOperation(String),
    #[error("the transformation grows without limit")]
    NotFinite,
}

impl XmlElement {
    /// Returns the value of an attribute that its tag requires.
    pub(super) fn required(&self, attribute: &'static str) -> Result<&str, ValueError> {
        let missing = || ValueError::NoAttribute { tag: self.name.clone(), attribute };
        self.attribute(attribute).ok_or_else(missing)
    }
}

/// Reads the value of a property element.
pub(super) fn read(element: &XmlElement) -> Result<Value, ValueError> {
    let text = || element.required("value").map(str::trim);
    Ok(match element.name.as_str() {
        "float" | "double" => Value::Float(number(text()?)?),
        "integer" | "int" | "long" => Value::Integer(integer(text()?)?),
        "boolean" | "bool" => match text()?.to_ascii_lowercase().as_str() {
            "true" => Value::Boolean(true),
            "false" => Value::Boolean(false),
            other => return Err(ValueError::NotBoolean(other.into())),
        },
        "string" => Value::String(text()?.to_owned()),
        "point" | "vector" => Value::Vector(vector(element, 0.0)?),
        "rgb" => Value::Rgb(rgb(text()?)?),
        "srgb" => {
            let text = text()?;
            if text.starts_with('#') {
                Value::Rgb(rgb(text)?)
            } else {
                let encoded = rgb(text)?;
                Value::Rgb(encoded.map(|code| decode(f64::from(code.clamp(0.0, 1.0))) as f32))
            }
        }
        "spectrum" | "color" => spectrum(element)?,
        "blackbody" => {
            let kelvin = element.attribute("temperature").unwrap_or_default().trim();
            let kelvin = number(kelvin.trim_end_matches(['K', 'k']))?;
            if !(1.0..=1e6).contains(&kelvin) {
                return Err(ValueError::NoBlackBody { kelvin });
            }
            let scale = element.attribute("scale").map_or(Ok(1.0), number)?;
            Value::Spectrum(SampledSpectrum::blackbody(kelvin).scaled(scale))
        }
        _ => Value::Unknown,
    })
}

/// Parses a finite number.
pub(super) fn number(text: &str) -> Result<f64, ValueError> {
    let text = text.trim();
    // Accept the suffix of C, as in 1.0f.
    let number = text.parse::<f64>().or_else(|error| text.strip_suffix('f').map_or(Err(error), str::parse));
    match number {
        Ok(number) if number.is_finite() => Ok(number.clamp(-f64::from(f32::MAX), f64::from(f32::MAX))),
        Ok(number) if number.is_infinite() => Ok(f64::from(f32::MAX).copysign(number)),
        _ => Err(ValueError::NotNumber(text.into())),
    }
}

fn integer(text: &str) -> Result<i64, ValueError> {
    text.parse().map_err(|_| ValueError::NotInteger(text.into()))
}

/// Parses numbers separated by spaces, commas or semicolons.
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, ValueError> {
    text.split(|c: char| c.is_whitespace() || c == ',' || c == ';')
        .filter(|part| !part.is_empty())
        .map(number)
        .collect()
}

/// Reads a vector from `x`, `y`, `z`, or from `value` with one or three numbers.
pub(super) fn vector(element: &XmlElement, default: f64) -> Result<DVec3, ValueError> {
    if let Some(text) = element.attribute("value") {
        return triple(text);
    }
    let mut vector = DVec3::splat(default);
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if let Some(text) = element.attribute(name) {
            vector[axis] = number(text)?;
        }
    }
    Ok(vector)
}

/// Parses one number for all components, or three.
pub(super) fn triple(text: &str) -> Result<DVec3, ValueError> {
    match numbers(text)?.as_slice() {
        &[all] => Ok(DVec3::splat(all)),
        &[x, y, z] => Ok(DVec3::new(x, y, z)),
        other => Err(ValueError::NotTriple { text: text.into(), count: other.len() }),
    }
}

/// Parses one or three numbers, or `#rrggbb` encoded as sRGB.
fn rgb(text: &str) -> Result<Vec3, ValueError> {
    let Some(digits) = text.strip_prefix('#') else { return triple(text).map(glam::DVec3::as_vec3) };
    let code = (digits.len() == 6).then(|| u32::from_str_radix(digits, 16).ok()).flatten();
    let code = code.ok_or_else(|| ValueError::NotColor(text.into()))?;
    let channel = |shift: u32| decode(f64::from((code >> shift) & 0xff) / 255.0) as f32;
    Ok(Vec3::new(channel(16), channel(8), channel(0)))
}

/// Decodes sRGB, IEC 61966-2-1.
fn decode(code: f64) -> f64 {
    if code <= 0.040_45 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

/// Parses one value, three (RGB in Mitsuba 0.x), pairs of wavelength and value, or a file name.
fn spectrum(element: &XmlElement) -> Result<Value, ValueError> {
    if let Some(name) = element.attribute("filename") {
        return Ok(Value::SpectrumFile(name.to_owned()));
    }
    let text = element.attribute("value").ok_or(ValueError::EmptySpectrum)?.trim();
    if text.starts_with('#') {
        return rgb(text).map(Value::Rgb);
    }
    if !text.contains(':') {
        return match numbers(text)?.as_slice() {
            &[value] => Ok(Value::Uniform(value)),
            &[r, g, b] => Ok(Value::Rgb(DVec3::new(r, g, b).as_vec3())),
            other => Err(ValueError::NoWavelengths { count: other.len() }),
        };
    }
    let pairs = text.split(|c: char| c.is_whitespace() || c == ',').filter(|pair| !pair.is_empty());
    let pair = |pair: &str| {
        let (nm, value) = pair.split_once(':').ok_or_else(|| ValueError::NotSpectrumPair(pair.into()))?;
        Ok((number(nm)?, number(value)?))
    };
    Ok(Value::Spectrum(SampledSpectrum::new(pairs.map(pair).collect::<Result<_, ValueError>>()?)?))
}
