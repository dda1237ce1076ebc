//! Colours and spectra of parameters.

use glam::DVec3;

use super::context::Context;
use super::params::{Params, Values};
use crate::color::Spectrum;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::spectrum::color_space::ColorSpace;
use crate::spectrum::file::read_spd;
use crate::spectrum::named;
use crate::spectrum::role::ColorRole;
use crate::spectrum::sampled::SampledSpectrum;
use crate::text::shortened;

/// The colour of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Color {
    Rgb(DVec3, ColorSpace),
    Samples(SampledSpectrum),
    /// Colour of an illuminant, with luminance 1.
    Illuminant(Spectrum),
}

impl Color {
    /// Converts to linear Rec. 709.
    pub(super) fn to_rec709(&self, role: ColorRole) -> Spectrum {
        match self {
            Self::Rgb(rgb, space) => space.to_rec709(*rgb, role),
            Self::Samples(samples) => samples.pbrt_color(role),
            Self::Illuminant(color) => *color,
        }
    }
}

impl Context<'_> {
    /// Returns the colour of a parameter; `None` if it is not given.
    pub(super) fn color(&mut self, params: &Params, name: &str) -> ImportResult<Option<Color>> {
        let Some(param) = params.find(name, &["rgb", "spectrum", "blackbody"]) else { return Ok(None) };
        let at = param.at;
        let count = |count: usize| at.fault(format!("`{name}` has {count} values, which is not one colour"));
        let color = match (param.kind.as_str(), &param.values) {
            ("rgb", Values::Numbers(numbers)) => {
                let &[r, g, b] = numbers.as_slice() else { return Err(count(numbers.len()).into()) };
                let rgb = DVec3::new(r, g, b);
                if rgb.min_element() < 0.0 {
                    return Err(at.fault(format!("the colour `{name}` has a negative component")).into());
                }
                Color::Rgb(rgb, params.color_space_of(param))
            }
            ("blackbody", Values::Numbers(numbers)) => {
                // pbrt-v3 has a scale as second number, which is unsupported.
                let &[kelvin] = numbers.as_slice() else { return Err(count(numbers.len()).into()) };
                let radiation = SampledSpectrum::blackbody(kelvin);
                let peak = (360..=830).map(|nm| radiation.at(f64::from(nm))).fold(0.0, f64::max);
                if peak <= 0.0 {
                    return Err(at.fault(format!("a black body of {kelvin} K is dark")).into());
                }
                Color::Samples(radiation.scaled(1.0 / peak))
            }
            (_, Values::Numbers(numbers)) => {
                let (pairs, rest) = numbers.as_chunks::<2>();
                if !rest.is_empty() {
                    return Err(at.fault(format!("`{name}` is not a list of pairs of wavelength and value")).into());
                }
                if pairs.iter().any(|[_, value]| *value < 0.0) {
                    return Err(at.fault(format!("the spectrum `{name}` has a negative value")).into());
                }
                let pairs = pairs.iter().map(|&[nm, value]| (nm, value)).collect();
                Color::Samples(SampledSpectrum::new(pairs).map_err(|problem| at.fault(format!("`{name}`: {problem}")))?)
            }
            (_, Values::Texts(texts)) => match texts.as_slice() {
                [text] => self.named_spectrum(text, at)?,
                _ => return Err(count(texts.len()).into()),
            },
            (_, Values::Bools(_)) => return Ok(None),
        };
        Ok(Some(color))
    }

    /// Returns a spectrum by name, or from a file.
    fn named_spectrum(&mut self, name: &str, at: TextPlace) -> ImportResult<Color> {
        if let Some(metal) = name.strip_prefix("metal-")
            && let Some((metal, quantity)) = metal.rsplit_once('-')
            && let Some((eta, k)) = named::metal_spectra(metal)
        {
            match quantity {
                "eta" => return Ok(Color::Samples(eta)),
                "k" => return Ok(Color::Samples(k)),
                _ => {}
            }
        }
        if name.starts_with("glass-")
            && let Some(eta) = named::glass(name)
        {
            return Ok(Color::Samples(SampledSpectrum::constant(f64::from(eta))));
        }
        if (name.starts_with("stdillum-") || name.starts_with("illum-"))
            && let Some(color) = named::illuminant(name)
        {
            return Ok(Color::Illuminant(color));
        }
        let is_file = name.contains(['.', '/', '\\']);
        if !is_file {
            return Err(at.fault(format!("there is no spectrum of the name \"{}\"", shortened(name))).into());
        }
        let place = self.place(at);
        let location = self.resources.locate(name, &place)?;
        let bytes = self.resources.read(&location)?;
        Ok(Color::Samples(read_spd(location.path(), &bytes, self.resources.budget())?))
    }
}
