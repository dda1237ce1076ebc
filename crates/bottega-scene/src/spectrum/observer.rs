//! The CIE standard observer, illuminant D65, and the primaries of Rec. 709.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

/// Range of the tables, in nanometres.
pub(super) const WAVELENGTH_MIN: f64 = 360.0;
pub(super) const WAVELENGTH_MAX: f64 = 830.0;
const STEP: f64 = 5.0;

/// The integral of ȳ over the wavelength in nanometres, in steps of 1 nm.
pub(super) const Y_INTEGRAL: f64 = 106.750_259_4;

/// Mitsuba's factor for its D65 table, which then has luminance 1.
pub(super) const D65_SCALE: f64 = 0.010_101_273_6;

/// The tables' values at one wavelength.
#[derive(Clone, Copy, Debug)]
pub(super) struct Observer {
    /// Colour matching functions.
    pub(super) xyz: DVec3,
    /// Relative spectral power of D65, 100 at 560 nm.
    pub(super) d65: f64,
}

static TABLE: LazyLock<Vec<Observer>> = LazyLock::new(|| {
    let lines = include_str!("observer.txt").lines().filter(|line| !line.starts_with('#'));
    lines
        .map(|line| {
            let mut numbers = line.split(' ').map(|word| word.parse().unwrap_or(0.0));
            let mut next = || numbers.next().unwrap_or(0.0);
            Observer { xyz: DVec3::new(next(), next(), next()), d65: next() }
        })
        .collect()
});

impl Observer {
    /// Returns the values at a wavelength in nanometres, linear between table entries, 0 outside.
    pub(super) fn at(nm: f64) -> Self {
        let position = (nm - WAVELENGTH_MIN) / STEP;
        let table = &*TABLE;
        let last = table.len() - 1;
        if !(0.0..=last as f64).contains(&position) {
            return Self { xyz: DVec3::ZERO, d65: 0.0 };
        }
        let index = (position as usize).min(last - 1);
        let (a, b, t) = (table[index], table[index + 1], position - index as f64);
        Self { xyz: a.xyz.lerp(b.xyz, t), d65: a.d65 + (b.d65 - a.d65) * t }
    }
}

/// Converts XYZ to linear Rec. 709, whose white is D65 with Y = 1 (ITU-R BT.709-6, section 1.3 and 1.4).
pub(super) fn rec709_of_xyz(xyz: DVec3) -> DVec3 {
    DMat3::from_cols(
        DVec3::new(3.240_479, -0.969_256, 0.055_648),
        DVec3::new(-1.537_150, 1.875_991, -0.204_043),
        DVec3::new(-0.498_535, 0.041_556, 1.057_311),
    ) * xyz
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_whole() {
        assert_eq!(TABLE.len(), 95);
        assert_eq!(TABLE[40].d65, 100.0);
        let y: f64 = TABLE.iter().map(|line| line.xyz.y * STEP).sum();
        assert!((y / Y_INTEGRAL - 1.0).abs() < 2e-3, "{y}");
    }

    #[test]
    fn d65_is_white() {
        let sum: DVec3 = TABLE.iter().map(|line| line.xyz * line.d65).sum();
        let white = rec709_of_xyz(sum / sum.y);
        assert!((white - DVec3::ONE).abs().max_element() < 2e-3, "{white}");
    }
}
