//! Emission of a medium by its temperature.
//!
//! The color of a black body is tabulated over the inverse of its temperature, in which the logarithm of Planck's law is
//! nearly linear in the visible range: linear interpolation is within 0.6 % from 1000 K.

use crate::color::Spectrum;
use crate::grid::Grid;
use crate::spectrum::sampled::{SampledSpectrum, planck};

/// Entries of the table.
pub(crate) const ENTRIES: usize = 2048;
/// Bodies below this temperature in kelvin do not shine, as in pbrt.
const KELVIN_MIN: f32 = 100.0;
/// Bodies above this temperature in kelvin have the color at this temperature.
const KELVIN_MAX: f32 = 1e5;
/// Wien's displacement constant, in nm·K.
const WIEN: f64 = 2.897_771_955e6;
/// The constant of Stefan and Boltzmann, in W·m⁻²·K⁻⁴.
const STEFAN_BOLTZMANN: f64 = 5.670_374_419e-8;
/// In Cycles, colors of bodies below this temperature in kelvin are those at it.
const KELVIN_RED: f64 = 800.0;

/// The emission of a medium by temperature: a grid of temperatures, and the color of a black body at each temperature.
#[derive(Clone, Debug, PartialEq)]
pub struct Blackbody {
    /// Values of the grid; the temperature in kelvin is (value − `offset`) · `scale`.
    pub temperatures: Grid,
    /// Factor from values to kelvin.
    pub scale: f32,
    /// Value at 0 K.
    pub offset: f32,
    /// `true`: emission is proportional to absorption. `false`: it does not depend on the density.
    pub times_density: bool,
    /// Colors over the inverse temperature, from [`KELVIN_MAX`] to [`KELVIN_MIN`].
    pub(crate) colors: Vec<Spectrum>,
}

impl Blackbody {
    /// Returns the emission of black bodies whose spectral radiance is 1 at its peak, whatever the temperature, as in
    /// pbrt. It is proportional to absorption.
    ///
    /// - `temperatures`, `scale`, `offset`: see the fields of this struct.
    /// - `convert`: applied to the linear Rec. 709 color of each temperature.
    pub fn of_equal_peaks(temperatures: Grid, scale: f32, offset: f32, convert: impl Fn(Spectrum) -> Spectrum) -> Self {
        let color = |kelvin: f64| {
            let peak = planck(WIEN / kelvin, kelvin);
            convert(SampledSpectrum::blackbody(kelvin).scaled(1.0 / peak).pbrt_radiance())
        };
        Self { temperatures, scale, offset, times_density: true, colors: table(color) }
    }

    /// Returns the emission of Cycles' *Principled Volume* with a blackbody intensity of 1: a luminance of σ/π · 1e-6 ·
    /// T⁴ per scene unit, by the law of Stefan and Boltzmann, whatever the density.
    ///
    /// - `temperatures`, `scale`, `offset`: see the fields of this struct.
    pub fn of_power(temperatures: Grid, scale: f32, offset: f32) -> Self {
        let color = |kelvin: f64| {
            let power = STEFAN_BOLTZMANN / std::f64::consts::PI * 1e-6 * kelvin.powi(4);
            SampledSpectrum::blackbody(kelvin.max(KELVIN_RED)).pbrt_illuminant() * power as f32
        };
        Self { temperatures, scale, offset, times_density: false, colors: table(color) }
    }

    /// Returns the linear Rec. 709 color of the temperature at point `p` of the grid's unit cube, interpolated as
    /// [`Grid::at`] does.
    pub fn at(&self, p: glam::Vec3) -> Spectrum {
        self.color((self.temperatures.at(p).x - self.offset) * self.scale)
    }

    /// Returns the linear Rec. 709 color of a temperature in kelvin: black up to 100 K and for NaN; above 100,000 K,
    /// the color at that temperature.
    pub fn color(&self, kelvin: f32) -> Spectrum {
        if kelvin.is_nan() || kelvin <= KELVIN_MIN {
            return Spectrum::ZERO;
        }
        let place = (1.0 / kelvin.min(KELVIN_MAX) - inverse_kelvin(0)) / STEP;
        let first = (place as usize).min(ENTRIES - 2);
        self.colors[first].lerp(self.colors[first + 1], place - first as f32)
    }
}

/// Returns the table of a color that depends on the temperature in kelvin.
fn table(color: impl Fn(f64) -> Spectrum) -> Vec<Spectrum> {
    (0..ENTRIES).map(|entry| color(f64::from(1.0 / inverse_kelvin(entry)))).collect()
}

/// Distance of two entries of the table.
const STEP: f32 = (1.0 / KELVIN_MIN - 1.0 / KELVIN_MAX) / (ENTRIES - 1) as f32;

/// Returns the inverse temperature of an entry of the table.
fn inverse_kelvin(entry: usize) -> f32 {
    1.0 / KELVIN_MAX + STEP * entry as f32
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::grid::Blend;

    #[test]
    fn the_table_is_planck_s_law() {
        for kelvin in [1000.0_f32, 1234.5, 2000.0, 3000.0, 5778.0, 20_000.0] {
            let grid = Grid::new([1; 3], vec![kelvin / 10.0 + 5.0], Blend::Nearest).unwrap();
            let color = Blackbody::of_equal_peaks(grid, 10.0, 5.0, |color| color).at(Vec3::splat(0.5));
            let kelvin = f64::from(kelvin);
            let exact = SampledSpectrum::blackbody(kelvin).scaled(1.0 / planck(WIEN / kelvin, kelvin)).pbrt_radiance();
            let error = ((color - exact) / exact.max(Spectrum::splat(0.01 * exact.max_element()))).abs();
            assert!(error.max_element() < 6e-3, "{kelvin}: {color} {exact}");
        }
    }

    #[test]
    fn cold_bodies_are_dark_and_hot_ones_finite() {
        for (value, is_dark) in [(0.0, true), (100.0, true), (1e12, false)] {
            let grid = Grid::new([1; 3], vec![value], Blend::Nearest).unwrap();
            let color = Blackbody::of_equal_peaks(grid, 1.0, 0.0, |color| color).at(Vec3::splat(0.5));
            assert!(color.is_finite() && (color == Spectrum::ZERO) == is_dark, "{value}: {color}");
        }
    }
}
