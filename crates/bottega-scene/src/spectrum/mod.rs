//! Spectra in scene files, to linear Rec. 709.
//!
//! We compute with three colours; a spectrum is projected onto them once, when it is read. How, differs between the
//! formats, so each convention has its function here: [`Sampled::mitsuba_reflectance`] and others do what Mitsuba 3 does in
//! its variants `*_rgb`; [`Sampled::pbrt_illuminant`] and others give what pbrt-v4 shows in an RGB film.

mod file;
mod named;
mod observer;

use glam::DVec3;

pub(crate) use file::read_spd;
pub(crate) use named::{glass, illuminant, metal, metal_spectra, mitsuba_ior};
use observer::{Observer, WAVELENGTH_MAX, WAVELENGTH_MIN, rec709_of_xyz};

use crate::Spectrum;

/// A spectrum by its values at some wavelengths, linear in between.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Sampled {
    /// Wavelength in nanometres, strictly increasing, and value; finite; never empty.
    samples: Vec<(f64, f64)>,
}

impl Sampled {
    /// From wavelengths in nanometres, in increasing order, and values. An error says which one is wrong.
    pub(crate) fn new(samples: Vec<(f64, f64)>) -> Result<Self, String> {
        if samples.is_empty() {
            return Err("a spectrum needs at least one wavelength and value".into());
        }
        if let Some((nm, value)) =
            samples.iter().find(|(nm, value)| !(nm.is_finite() && value.is_finite() && *nm > 0.0))
        {
            return Err(format!("{nm} nm: {value} is no sample of a spectrum"));
        }
        if let Some(pair) = samples.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
            return Err(format!(
                "the wavelengths of a spectrum must increase: {} nm follows {} nm",
                pair[1].0, pair[0].0
            ));
        }
        Ok(Self { samples })
    }

    /// The same value everywhere.
    pub(crate) fn constant(value: f64) -> Self {
        Self { samples: vec![(WAVELENGTH_MIN, value), (WAVELENGTH_MAX, value)] }
    }

    /// Planck's law: spectral radiance of a black body, in W·m⁻²·sr⁻¹·nm⁻¹.
    pub(crate) fn blackbody(kelvin: f64) -> Self {
        let samples = (0..=94).map(|index| {
            let nm = WAVELENGTH_MIN + 5.0 * f64::from(index);
            (nm, planck(nm, kelvin))
        });
        Self { samples: samples.collect() }
    }

    /// The value at a wavelength in nanometres; that of the nearest end outside.
    pub(crate) fn at(&self, nm: f64) -> f64 {
        let after = self.samples.partition_point(|sample| sample.0 <= nm);
        match (after.checked_sub(1).map(|before| self.samples[before]), self.samples.get(after)) {
            (Some((nm0, value0)), Some(&(nm1, value1))) => value0 + (value1 - value0) * ((nm - nm0) / (nm1 - nm0)),
            (Some((_, value)), None) | (None, Some(&(_, value))) => value,
            (None, None) => 0.0,
        }
    }

    /// The same spectrum times a number.
    pub(crate) fn scaled(mut self, factor: f64) -> Self {
        self.samples.iter_mut().for_each(|(_, value)| *value *= factor);
        self
    }

    /// As Mitsuba 3 (`*_rgb`) takes a `spectrum` that is not emitted: seen under the illuminant D65, in [0, 1].
    pub(crate) fn mitsuba_reflectance(&self) -> Spectrum {
        rgb(self.mitsuba_integral(true)).min(Spectrum::ONE)
    }

    /// As Mitsuba 3 (`*_rgb`) takes a `spectrum` that may exceed 1 and is not emitted, such as `eta`.
    pub(crate) fn mitsuba_unbounded(&self) -> Spectrum {
        rgb(self.mitsuba_integral(true))
    }

    /// As Mitsuba 3 (`*_rgb`) takes a `spectrum` within an emitter, and the files of its metals: 1 everywhere has the
    /// luminance 1 and the colour of equal energy.
    pub(crate) fn mitsuba_radiance(&self) -> Spectrum {
        rgb(self.mitsuba_integral(false))
    }

    /// Mitsuba's sum over 1000 wavelengths, 0 outside of the samples.
    fn mitsuba_integral(&self, under_d65: bool) -> DVec3 {
        const STEPS: u32 = 1000;
        let range = WAVELENGTH_MAX - WAVELENGTH_MIN;
        let (first, last) = (self.samples[0].0, self.samples[self.samples.len() - 1].0);
        let mut sum = DVec3::ZERO;
        for step in 0..STEPS {
            let nm = WAVELENGTH_MIN + f64::from(step) / f64::from(STEPS - 1) * range;
            if nm >= first && nm <= last {
                let seen = Observer::at(nm);
                sum += seen.xyz * (self.at(nm) * if under_d65 { seen.d65 * observer::D65_SCALE } else { 1.0 });
            }
        }
        sum * (range / f64::from(STEPS) / observer::Y_INTEGRAL)
    }

    /// As pbrt-v4 shows what is emitted: every light is scaled so that its spectrum has the luminance 1, and keeps its
    /// colour. Black where the spectrum is dark.
    pub(crate) fn pbrt_illuminant(&self) -> Spectrum {
        let xyz = self.xyz(|_| 1.0);
        if xyz.y > 0.0 { rgb(xyz / xyz.y) } else { Spectrum::ZERO }
    }

    /// As pbrt-v4 shows a reflectance, an absorption and the like under the white of its colour space, D65: 1 everywhere
    /// is white.
    pub(crate) fn pbrt_reflectance(&self) -> Spectrum {
        let white = Self::constant(1.0).xyz(|seen| seen.d65);
        rgb(self.xyz(|seen| seen.d65) / white.y)
    }

    /// CIE x and y of light of this spectrum, which is not dark.
    pub(crate) fn chromaticity(&self) -> (f64, f64) {
        let xyz = self.xyz(|_| 1.0);
        (xyz.x / xyz.element_sum(), xyz.y / xyz.element_sum())
    }

    /// What an observer sees, relative to the luminance of 1 everywhere. By 1 nm; nearest end outside of the samples.
    fn xyz(&self, weight: impl Fn(&Observer) -> f64) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for nm in WAVELENGTH_MIN as u32..=WAVELENGTH_MAX as u32 {
            let seen = Observer::at(f64::from(nm));
            sum += seen.xyz * (self.at(f64::from(nm)) * weight(&seen));
        }
        sum / observer::Y_INTEGRAL
    }
}

/// Spectral radiance in W·m⁻²·sr⁻¹·nm⁻¹ (constants of the SI, 2019).
fn planck(nm: f64, kelvin: f64) -> f64 {
    const C: f64 = 299_792_458.0;
    const H: f64 = 6.626_070_15e-34;
    const K: f64 = 1.380_649e-23;
    if kelvin.is_nan() || kelvin <= 0.0 {
        return 0.0;
    }
    let metres = nm * 1e-9;
    1e-9 * (2.0 * H * C * C) / (metres.powi(5) * ((H * C / (metres * K * kelvin)).exp() - 1.0))
}

/// Rec. 709 of CIE XYZ; what is out of its gamut becomes 0.
fn rgb(xyz: DVec3) -> Spectrum {
    rec709_of_xyz(xyz).max(DVec3::ZERO).as_vec3()
}

#[cfg(test)]
mod tests;
