//! Spectra by samples, and their conversion to linear Rec. 709 by the conventions of Mitsuba and pbrt.

use glam::DVec3;

use super::observer::{self, Observer, WAVELENGTH_MAX, WAVELENGTH_MIN, rec709_of_xyz};
use super::role::ColorRole;
use crate::color::Spectrum;

/// Values that are not a spectrum.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(crate) enum SpectrumError {
    #[error("a spectrum needs at least one wavelength and value")]
    Empty,
    #[error("{nm} nm: {value} is not a sample of a spectrum")]
    NotSample { nm: f64, value: f64 },
    #[error("the wavelengths of a spectrum must increase: {nm} nm follows {before} nm")]
    NotIncreasing { before: f64, nm: f64 },
}

/// A spectrum by values at some wavelengths, linearly interpolated.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SampledSpectrum {
    /// Wavelengths in nanometres, strictly increasing, and values; finite, never empty.
    samples: Vec<(f64, f64)>,
}

impl SampledSpectrum {
    /// Makes a spectrum from wavelengths in nanometres, in increasing order, and values. The error names the invalid
    /// one.
    pub(crate) fn new(samples: Vec<(f64, f64)>) -> Result<Self, SpectrumError> {
        if samples.is_empty() {
            return Err(SpectrumError::Empty);
        }
        if let Some(&(nm, value)) =
            samples.iter().find(|(nm, value)| !(nm.is_finite() && value.is_finite() && *nm > 0.0))
        {
            return Err(SpectrumError::NotSample { nm, value });
        }
        if let Some(pair) = samples.windows(2).find(|pair| pair[0].0 >= pair[1].0) {
            return Err(SpectrumError::NotIncreasing { before: pair[0].0, nm: pair[1].0 });
        }
        Ok(Self { samples })
    }

    /// Returns a constant spectrum.
    pub(crate) fn constant(value: f64) -> Self {
        Self { samples: vec![(WAVELENGTH_MIN, value), (WAVELENGTH_MAX, value)] }
    }

    /// Returns the spectral radiance of a black body by Planck's law, in W·m⁻²·sr⁻¹·nm⁻¹.
    pub(crate) fn blackbody(kelvin: f64) -> Self {
        let samples = (0..=94).map(|index| {
            let nm = WAVELENGTH_MIN + 5.0 * f64::from(index);
            (nm, planck(nm, kelvin))
        });
        Self { samples: samples.collect() }
    }

    /// Returns the value at a wavelength in nanometres; outside of the samples, that of the nearest end.
    pub(crate) fn at(&self, nm: f64) -> f64 {
        let after = self.samples.partition_point(|sample| sample.0 <= nm);
        match (after.checked_sub(1).map(|before| self.samples[before]), self.samples.get(after)) {
            (Some((nm0, value0)), Some(&(nm1, value1))) => value0 + (value1 - value0) * ((nm - nm0) / (nm1 - nm0)),
            (Some((_, value)), None) | (None, Some(&(_, value))) => value,
            (None, None) => 0.0,
        }
    }

    /// Returns the spectrum multiplied by a number.
    pub(crate) fn scaled(mut self, factor: f64) -> Self {
        self.samples.iter_mut().for_each(|(_, value)| *value *= factor);
        self
    }

    /// Converts as Mitsuba 3 (`*_rgb`) does.
    pub(crate) fn mitsuba_color(&self, role: ColorRole) -> Spectrum {
        match role {
            ColorRole::Reflectance => self.mitsuba_reflectance(),
            ColorRole::Emission => self.mitsuba_radiance(),
            ColorRole::Unbounded => self.mitsuba_unbounded(),
        }
    }

    /// Converts as pbrt-v4 does.
    pub(crate) fn pbrt_color(&self, role: ColorRole) -> Spectrum {
        match role {
            ColorRole::Emission => self.pbrt_illuminant(),
            ColorRole::Reflectance | ColorRole::Unbounded => self.pbrt_reflectance(),
        }
    }

    /// Converts as Mitsuba 3 (`*_rgb`) does for a `spectrum` that is not emitted: under illuminant D65, clamped to [0,
    /// 1].
    pub(crate) fn mitsuba_reflectance(&self) -> Spectrum {
        rgb(self.mitsuba_integral(true)).min(Spectrum::ONE)
    }

    /// Converts as Mitsuba 3 (`*_rgb`) does for a `spectrum` that may exceed 1 and is not emitted, such as `eta`.
    pub(crate) fn mitsuba_unbounded(&self) -> Spectrum {
        rgb(self.mitsuba_integral(true))
    }

    /// Converts as Mitsuba 3 (`*_rgb`) does for a `spectrum` of an emitter and for its metal files: constant 1 has
    /// luminance 1 and the colour of equal energy.
    pub(crate) fn mitsuba_radiance(&self) -> Spectrum {
        rgb(self.mitsuba_integral(false))
    }

    /// Converts as pbrt-v4 shows spectral radiance, without scaling it: constant 1 has luminance 1 and the colour of equal
    /// energy.
    pub(crate) fn pbrt_radiance(&self) -> Spectrum {
        rgb(self.xyz(|_| 1.0))
    }

    /// Integrates as Mitsuba does: a sum over 1000 wavelengths, 0 outside of the samples.
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

    /// Converts as pbrt-v4 does for emission: scaled to luminance 1, with its colour. Black if the spectrum is 0.
    pub(crate) fn pbrt_illuminant(&self) -> Spectrum {
        let xyz = self.xyz(|_| 1.0);
        if xyz.y > 0.0 { rgb(xyz / xyz.y) } else { Spectrum::ZERO }
    }

    /// Converts as pbrt-v4 does for reflectance, absorption and the like, under the white of its colour space, D65:
    /// constant 1 is white.
    pub(crate) fn pbrt_reflectance(&self) -> Spectrum {
        let white = Self::constant(1.0).xyz(|seen| seen.d65);
        rgb(self.xyz(|seen| seen.d65) / white.y)
    }

    /// Returns the CIE x and y of light of this spectrum, which must not be 0.
    pub(crate) fn chromaticity(&self) -> (f64, f64) {
        let xyz = self.xyz(|_| 1.0);
        (xyz.x / xyz.element_sum(), xyz.y / xyz.element_sum())
    }

    /// Returns CIE XYZ relative to the luminance of a constant 1, in steps of 1 nm; outside of the samples, with the
    /// nearest end.
    fn xyz(&self, weight: impl Fn(&Observer) -> f64) -> DVec3 {
        let mut sum = DVec3::ZERO;
        for nm in WAVELENGTH_MIN as u32..=WAVELENGTH_MAX as u32 {
            let seen = Observer::at(f64::from(nm));
            sum += seen.xyz * (self.at(f64::from(nm)) * weight(&seen));
        }
        sum / observer::Y_INTEGRAL
    }
}

/// Returns the color of each reflectance that is 1 at one of some wavelengths, 0 at the others, and linear between. By these
/// weights the values of a reflectance at the wavelengths sum to its color, which [`SampledSpectrum::pbrt_reflectance`] clamps.
///
/// - `wavelengths`: in nanometres, in increasing order.
pub(crate) fn reflectance_weights(wavelengths: &[f64]) -> Result<Vec<DVec3>, SpectrumError> {
    let white = SampledSpectrum::new(wavelengths.iter().map(|&nm| (nm, 1.0)).collect())?.xyz(|seen| seen.d65);
    let mut weights = vec![DVec3::ZERO; wavelengths.len()];
    for nm in WAVELENGTH_MIN as u32..=WAVELENGTH_MAX as u32 {
        let nm = f64::from(nm);
        let seen = Observer::at(nm);
        let light = rec709_of_xyz(seen.xyz * (seen.d65 / (white.y * observer::Y_INTEGRAL)));
        let after = wavelengths.partition_point(|node| *node <= nm);
        match (after.checked_sub(1), wavelengths.get(after)) {
            (Some(before), Some(next)) => {
                let share = (nm - wavelengths[before]) / (next - wavelengths[before]);
                weights[before] += light * (1.0 - share);
                weights[after] += light * share;
            }
            (Some(last), None) => weights[last] += light,
            (None, _) => weights[0] += light,
        }
    }
    Ok(weights)
}

/// Returns the spectral radiance of a black body, in W·m⁻²·sr⁻¹·nm⁻¹ (SI constants of 2019).
pub(crate) fn planck(nm: f64, kelvin: f64) -> f64 {
    const C: f64 = 299_792_458.0;
    const H: f64 = 6.626_070_15e-34;
    const K: f64 = 1.380_649e-23;
    if kelvin.is_nan() || kelvin <= 0.0 {
        return 0.0;
    }
    let metres = nm * 1e-9;
    1e-9 * (2.0 * H * C * C) / (metres.powi(5) * ((H * C / (metres * K * kelvin)).exp() - 1.0))
}

/// Converts CIE XYZ to Rec. 709; values out of gamut become 0.
pub(super) fn rgb(xyz: DVec3) -> Spectrum {
    rec709_of_xyz(xyz).max(DVec3::ZERO).as_vec3()
}
