//! The sRGB transfer function (IEC 61966-2-1), by tables.
//!
//! The tables are computed at compile time with only + − × ÷, so they are bit-identical on every platform.

/// The linear value of each 8-bit sRGB code.
pub(super) const LINEAR_OF_SRGB: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut code = 0;
    while code < 256 {
        table[code] = decode(code as f64 / 255.0) as f32;
        code += 1;
    }
    table
};

/// The value of each 8-bit linear code.
pub(super) const LINEAR_OF_UNORM: [f32; 256] = {
    let mut table = [0.0; 256];
    let mut code = 0;
    while code < 256 {
        table[code] = (code as f64 / 255.0) as f32;
        code += 1;
    }
    table
};

/// The linear value half-way (in the encoding) between code i and code i + 1.
const THRESHOLDS: [f32; 255] = {
    let mut table = [0.0; 255];
    let mut code = 0;
    while code < 255 {
        table[code] = decode((code as f64 + 0.5) / 255.0) as f32;
        code += 1;
    }
    table
};

const GUESS_CELLS: usize = 4096;

/// The code of the smallest linear value in each of the equal cells of [0, 1).
const GUESSES: [u8; GUESS_CELLS] = {
    let mut table = [0; GUESS_CELLS];
    let (mut cell, mut code) = (0, 0);
    while cell < GUESS_CELLS {
        while code < 255 && (cell as f32 / GUESS_CELLS as f32) > THRESHOLDS[code] {
            code += 1;
        }
        table[cell] = code as u8;
        cell += 1;
    }
    table
};

/// Converts one channel in [0, 1] from sRGB to linear.
pub(super) const fn decode(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { power_2_4((encoded + 0.055) / 1.055) }
}

/// Computes x^2.4 = (x · x^⅕)², the fifth root by Newton's method; `x` in [0.08, 1].
const fn power_2_4(x: f64) -> f64 {
    let mut root = 1.0;
    let mut step = 0;
    while step < 32 {
        let fourth = root * root * root * root;
        root -= (fourth * root - x) / (5.0 * fourth);
        step += 1;
    }
    (x * root) * (x * root)
}

/// Returns the nearest 8-bit sRGB code of a linear value, clamped to [0, 1].
pub(super) fn srgb_of_linear(linear: f32) -> u8 {
    let inside = linear.clamp(0.0, 1.0);
    let cell = ((inside * GUESS_CELLS as f32) as usize).min(GUESS_CELLS - 1);
    let mut code = GUESSES[cell];
    while code < 255 && inside > THRESHOLDS[code as usize] {
        code += 1;
    }
    code
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_agrees_with_the_power_function() {
        for (code, &linear) in LINEAR_OF_SRGB.iter().enumerate() {
            let encoded = code as f64 / 255.0;
            let expected = if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) };
            assert!((f64::from(linear) - expected).abs() < 1e-7, "{code}: {linear} {expected}");
        }
        assert_eq!(LINEAR_OF_SRGB[255], 1.0);
    }

    #[test]
    fn encoding_is_the_inverse_of_decoding_and_monotonic() {
        for code in 0..=255u8 {
            assert_eq!(srgb_of_linear(LINEAR_OF_SRGB[code as usize]), code);
        }
        let mut last = 0;
        for i in 0..=100_000 {
            let code = srgb_of_linear(i as f32 / 100_000.0);
            assert!(code >= last);
            last = code;
        }
        assert_eq!((srgb_of_linear(f32::NAN), srgb_of_linear(-1.0), srgb_of_linear(9.0)), (0, 0, 255));
    }
}
