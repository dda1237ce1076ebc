//! False colors: numbers as colors in which equal steps look equal.

/// A color map: colors for the numbers from 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ColorMap {
    /// Black, purple, orange, pale yellow: for errors and cost.
    #[default]
    Inferno,
    /// Purple, green, yellow: for neutral quantities.
    Viridis,
}

impl ColorMap {
    /// Returns the color of a value in [0, 1], as 8-bit sRGB. Values outside have the color of the nearest end; NaN is
    /// gray, which is not in the map.
    pub fn color(self, value: f32) -> [u8; 3] {
        if value.is_nan() {
            return [128; 3];
        }
        let knots = match self {
            Self::Inferno => &INFERNO,
            Self::Viridis => &VIRIDIS,
        };
        let position = value.clamp(0.0, 1.0) * (KNOTS - 1) as f32;
        let index = (position as usize).min(KNOTS - 2);
        let fraction = position - index as f32;
        std::array::from_fn(|c| {
            let (low, high) = (f32::from(knots[index][c]), f32::from(knots[index + 1][c]));
            (low + (high - low) * fraction).round() as u8
        })
    }
}

/// Returns the color of a value in [0, 1] in [`ColorMap::Inferno`], as 8-bit sRGB.
pub fn false_color(value: f32) -> [u8; 3] {
    ColorMap::Inferno.color(value)
}

const KNOTS: usize = 33;

// Every eighth color of the maps by S. van der Walt and N. Smith (2015, public domain); interpolation is within two
// steps of 255.
const INFERNO: [[u8; 3]; KNOTS] = [
    [0, 0, 4],
    [4, 3, 18],
    [11, 7, 36],
    [21, 11, 55],
    [33, 12, 74],
    [46, 10, 90],
    [60, 9, 101],
    [74, 12, 107],
    [87, 16, 109],
    [99, 20, 110],
    [112, 25, 110],
    [125, 30, 109],
    [137, 34, 106],
    [150, 39, 102],
    [163, 43, 97],
    [175, 49, 92],
    [187, 55, 85],
    [198, 62, 77],
    [209, 70, 68],
    [219, 79, 59],
    [227, 89, 50],
    [235, 101, 40],
    [241, 113, 30],
    [246, 127, 20],
    [249, 141, 10],
    [251, 156, 6],
    [252, 171, 15],
    [251, 186, 31],
    [249, 202, 50],
    [245, 217, 73],
    [242, 232, 101],
    [243, 245, 134],
    [252, 255, 164],
];

const VIRIDIS: [[u8; 3]; KNOTS] = [
    [68, 1, 84],
    [71, 13, 96],
    [72, 24, 106],
    [72, 35, 116],
    [71, 45, 123],
    [69, 54, 129],
    [66, 64, 134],
    [63, 73, 137],
    [59, 82, 139],
    [55, 90, 141],
    [51, 99, 141],
    [47, 106, 142],
    [44, 114, 142],
    [41, 122, 142],
    [38, 129, 142],
    [35, 137, 142],
    [33, 144, 140],
    [31, 152, 139],
    [31, 159, 136],
    [33, 166, 133],
    [40, 174, 128],
    [49, 181, 123],
    [62, 188, 116],
    [76, 194, 108],
    [93, 201, 99],
    [110, 206, 88],
    [130, 211, 76],
    [150, 216, 63],
    [171, 220, 50],
    [192, 223, 36],
    [213, 226, 26],
    [234, 229, 26],
    [253, 231, 37],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn larger_values_are_brighter() {
        for map in [ColorMap::Inferno, ColorMap::Viridis] {
            let lightness = |i: u16| {
                let [r, g, b] = map.color(f32::from(i) / 256.0).map(|v| crate::linear_from_srgb(f32::from(v) / 255.0));
                crate::luminance([r, g, b])
            };
            assert!((0..256).all(|i| lightness(i + 1) >= lightness(i) - 2e-3), "{map:?}");
            assert!(lightness(256) > lightness(0) + 0.5);
        }
    }

    #[test]
    fn values_outside_and_broken_ones_have_a_color() {
        assert_eq!(false_color(-3.0), false_color(0.0));
        assert_eq!(false_color(f32::INFINITY), false_color(1.0));
        assert_eq!(false_color(f32::NAN), [128; 3]);
    }
}
