//! Elementary functions that are bit-identical on every platform.
//!
//! `sin`, `exp` and the like in `std` come from the platform's library and differ in the last bit between systems.
//! These use only `+ - * /`, `sqrt`, conversions and integer operations, which IEEE 754 defines exactly. They compute
//! in `f64` with short polynomials (fitted at Chebyshev nodes, relative error below 2⁻³⁴), and round once to `f32` at
//! the end. Each result is correctly rounded except for about one argument in a thousand, where it is the other
//! neighbor of the true value: the error is below **0.501 ulp** for every function here (tested).
//!
//! Where results are correctly rounded, monotone functions are monotone; exact cases (`exp(0)`, `ln(1)`, `powf(x, 1)`)
//! are exact.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, LOG2_E, PI};

/// Evaluates a polynomial by Horner's rule; lowest power first.
#[inline(always)]
fn poly<const N: usize>(x: f64, c: [f64; N]) -> f64 {
    let mut r = c[N - 1];
    for i in (0..N - 1).rev() {
        r = r * x + c[i];
    }
    r
}

/// Rounds to the nearest integer, ties to even, as a float and as an integer. For |x| < 2⁵¹.
#[inline(always)]
fn round(x: f64) -> (f64, i64) {
    const MAGIC: f64 = 6_755_399_441_055_744.0; // 1.5 · 2⁵²: adding it leaves no bits for a fraction
    let shifted = x + MAGIC;
    (shifted - MAGIC, (shifted.to_bits() as i64).wrapping_sub(MAGIC.to_bits() as i64))
}

/// Reduces x = quadrant · π/2 + r with |r| ≤ π/4 (or a hair more). Returns (r, quadrant mod 4).
#[inline(always)]
fn reduce(x: f32) -> (f64, u32) {
    /// π/2 in two parts: the upper has 31 bits, so its product with a quadrant number below 2²² is exact.
    const HI: f64 = 1.570_796_326_734_125_6;
    const LO: f64 = 6.077_100_506_506_192e-11;
    if x.abs() < 4.0e6 {
        let x = f64::from(x);
        let (k, quadrant) = round(x * (2.0 / PI));
        return ((x - k * HI) - k * LO, quadrant as u32 & 3);
    }
    reduce_large(x)
}

/// Reduces large arguments (Payne and Hanek 1983): multiplies only the bits of 2/π that matter modulo 4.
#[cold]
fn reduce_large(x: f32) -> (f64, u32) {
    const TWO_OVER_PI: [u64; 4] =
        [0xa2f9_836e_4e44_1529, 0xfc27_57d1_f534_ddc0, 0xdb62_9599_3c43_9041, 0xfe51_63ab_debb_c561];
    let bits = x.to_bits();
    let mantissa = u128::from((bits & 0x7f_ffff) | 0x80_0000);
    let exponent = ((bits >> 23) & 0xff) as i32 - 150; // |x| = mantissa · 2^exponent
    // A window of 96 bits of (2/π) · 2^(exponent − 2), modulo 1: the lost bits above are whole turns.
    let start = exponent - 2;
    let mut window = 0u128;
    for i in 0..96 {
        let position = start + i;
        let bit = if position < 0 { 0 } else { TWO_OVER_PI[position as usize / 64] >> (63 - position % 64) & 1 };
        window = window << 1 | u128::from(bit);
    }
    let turn = mantissa.wrapping_mul(window) << 32; // fraction of a turn in 128 bits, of which 96 are known
    let quadrant = (turn >> 126) as u32;
    let fraction = (turn << 2) as i128; // of a quadrant, as a signed number: at or above one half it is negative
    let carried = quadrant + u32::from(fraction < 0);
    let r = fraction as f64 * (FRAC_PI_2 / 340_282_366_920_938_463_463_374_607_431_768_211_456.0);
    if x < 0.0 { (-r, carried.wrapping_neg() & 3) } else { (r, carried & 3) }
}

#[inline(always)]
fn sin_kernel(r: f64) -> f64 {
    r * poly(
        r * r,
        [
            0.999_999_999_995_629_7,
            -0.166_666_666_313_102_95,
            0.008_333_328_755_170_368,
            -0.000_198_391_939_636_587_88,
            2.717_269_356_310_983_5e-6,
        ],
    )
}

#[inline(always)]
fn cos_kernel(r: f64) -> f64 {
    poly(
        r * r,
        [
            0.999_999_999_999_943_7,
            -0.499_999_999_993_445_1,
            0.041_666_666_542_918_53,
            -0.001_388_888_034_256_061_1,
            2.479_891_812_589_907_4e-5,
            -2.717_266_655_194_055e-7,
        ],
    )
}

/// Returns sine and cosine of an angle in radians, of any size. NaN for infinities and NaN.
#[inline]
pub fn sin_cos(x: f32) -> (f32, f32) {
    if !x.is_finite() {
        return (f32::NAN, f32::NAN);
    }
    if x.abs() < 1e-4 {
        return (x, 1.0); // also keeps the sign of −0
    }
    let (r, quadrant) = reduce(x);
    let (s, c) = (sin_kernel(r) as f32, cos_kernel(r) as f32);
    // Exchange and negate by the quadrant, without a branch: it is unpredictable
    let (s, c) = if quadrant & 1 == 0 { (s, c) } else { (c, s) };
    let sign = |value: f32, bits: u32| f32::from_bits(value.to_bits() ^ ((bits & 2) << 30));
    (sign(s, quadrant), sign(c, quadrant + 1))
}

/// Returns sine and cosine of `turns` full turns, in [0, 1], within 1.2e-7 and without a branch. For random directions;
/// otherwise use [`sin_cos`].
#[inline(always)]
pub fn sin_cos_of_turns(turns: f32) -> (f32, f32) {
    let quarters = 4.0 * turns;
    let nearest = (quarters + 0.5) as i32;
    // Exact: both are multiples of the last place of the greater one.
    let x = (quarters - nearest as f32) * std::f32::consts::FRAC_PI_2;
    // Minimax polynomials over half a quarter on either side (those of the Cephes library, sinf and cosf).
    let x2 = x * x;
    let s = x + x * x2 * (-1.666_665_5e-1 + x2 * (8.332_161e-3 + x2 * -1.951_529_6e-4));
    let c = 1.0 - 0.5 * x2 + x2 * x2 * (4.166_664_6e-2 + x2 * (-1.388_731_6e-3 + x2 * 2.443_315_7e-5));
    let (s, c) = if nearest & 1 == 0 { (s, c) } else { (c, s) };
    let sign = |value: f32, bits: i32| f32::from_bits(value.to_bits() ^ ((bits as u32 & 2) << 30));
    (sign(s, nearest), sign(c, nearest + 1))
}

/// Returns the sine of an angle in radians; see [`sin_cos`].
#[inline]
pub fn sin(x: f32) -> f32 {
    sin_cos(x).0
}

/// Returns the cosine of an angle in radians; see [`sin_cos`].
#[inline]
pub fn cos(x: f32) -> f32 {
    sin_cos(x).1
}

/// Returns the tangent of an angle in radians. NaN for infinities and NaN.
#[inline]
pub fn tan(x: f32) -> f32 {
    if !x.is_finite() {
        return f32::NAN;
    }
    if x.abs() < 1e-4 {
        return x;
    }
    let (r, quadrant) = reduce(x);
    let (s, c) = (sin_kernel(r), cos_kernel(r));
    (if quadrant & 1 == 0 { s / c } else { -c / s }) as f32
}

/// Returns 2^x for any x, in `f64`; saturates to 0 and infinity far outside the range of `f32`.
#[inline(always)]
fn exp2_wide(x: f64) -> f64 {
    let x = x.clamp(-300.0, 300.0);
    let (k, n) = round(x);
    let p = poly(
        x - k,
        [
            0.999_999_999_958_909_6,
            0.693_147_180_556_782,
            0.240_226_512_197_460_2,
            0.055_504_109_068_076_075,
            0.009_618_024_781_856_745,
            0.001_333_347_783_308_087_6,
            0.000_154_699_947_662_137_46,
            1.530_390_524_657_466_3e-5,
        ],
    );
    p * f64::from_bits(((n + 1023) as u64) << 52)
}

/// Returns the base-2 logarithm of a positive finite number, subnormals included.
#[inline(always)]
fn log2_wide(x: f32) -> f64 {
    // The cut at √½ puts the mantissa into [√½, √2), around 1, so that ln(1) is exact and its neighborhood accurate.
    const SQRT_HALF_BITS: u64 = 0x3fe6_a09e_667f_3bcd;
    let bits = f64::from(x).to_bits(); // every subnormal f32 is a normal f64
    let above = bits.wrapping_sub(SQRT_HALF_BITS);
    let exponent = (above as i64) >> 52;
    let m = f64::from_bits(bits.wrapping_sub((exponent as u64) << 52));
    let s = (m - 1.0) / (m + 1.0);
    let p = poly(
        s * s,
        [
            2.885_390_081_777_85,
            0.961_796_694_114_323_1,
            0.577_077_942_023_261_9,
            0.412_209_292_682_781_7,
            0.319_903_813_544_485_05,
            0.282_930_163_729_837_5,
        ],
    );
    exponent as f64 + s * p
}

/// Returns e^x: 0 below about −104, infinity above about 88.7, NaN for NaN.
#[inline]
pub fn exp(x: f32) -> f32 {
    exp2_wide(f64::from(x) * LOG2_E) as f32
}

/// Returns 2^x: 0 below −150, infinity from 128 on, NaN for NaN.
#[inline]
pub fn exp2(x: f32) -> f32 {
    exp2_wide(f64::from(x)) as f32
}

/// Returns the natural logarithm: −infinity for ±0, infinity for infinity, NaN for negative numbers and NaN.
#[inline]
pub fn ln(x: f32) -> f32 {
    use std::f64::consts::LN_2;
    if x > 0.0 && x < f32::INFINITY { (log2_wide(x) * LN_2) as f32 } else { log_special(x) }
}

/// Returns the base-2 logarithm: −infinity for ±0, infinity for infinity, NaN for negative numbers and NaN.
#[inline]
pub fn log2(x: f32) -> f32 {
    if x > 0.0 && x < f32::INFINITY { log2_wide(x) as f32 } else { log_special(x) }
}

#[cold]
fn log_special(x: f32) -> f32 {
    if x == 0.0 {
        f32::NEG_INFINITY
    } else if x == f32::INFINITY {
        x
    } else {
        f32::NAN
    }
}

/// Returns x^y with the special cases of IEEE 754 `pow`: x⁰ = 1 and 1^y = 1 even for NaN, NaN for a negative base with
/// a non-integer exponent.
#[inline]
pub fn powf(x: f32, y: f32) -> f32 {
    if x > 0.0 && x < f32::INFINITY && y.is_finite() {
        return exp2_wide(f64::from(y) * log2_wide(x)) as f32;
    }
    powf_special(x, y)
}

#[cold]
fn powf_special(x: f32, y: f32) -> f32 {
    if y == 0.0 || x == 1.0 {
        return 1.0;
    }
    if x.is_nan() || y.is_nan() {
        return f32::NAN;
    }
    let magnitude = x.abs();
    if y.is_infinite() {
        return if magnitude == 1.0 {
            1.0
        } else if (magnitude > 1.0) == (y > 0.0) {
            f32::INFINITY
        } else {
            0.0
        };
    }
    let is_integer = y.abs() >= 8_388_608.0 || (y as i32) as f32 == y;
    let is_odd = is_integer && y.abs() < 16_777_216.0 && (y as i32) & 1 == 1;
    let power = if magnitude == 0.0 || magnitude == f32::INFINITY {
        if (magnitude == 0.0) == (y > 0.0) { 0.0 } else { f32::INFINITY }
    } else if is_integer {
        exp2_wide(f64::from(y) * log2_wide(magnitude)) as f32
    } else {
        return f32::NAN;
    };
    if x.is_sign_negative() && is_odd { -power } else { power }
}

/// Returns the cube root, also of negative numbers. Returns ±0, infinities and NaN unchanged.
#[inline]
pub fn cbrt(x: f32) -> f32 {
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    (exp2_wide(log2_wide(x.abs()) / 3.0) as f32).copysign(x)
}

/// Returns the arc tangent of t in [0, 1].
#[inline(always)]
fn atan_unit(t: f64) -> f64 {
    const TAN_PI_8: f64 = 0.414_213_562_373_095_03;
    let (t, offset) = if t > TAN_PI_8 { ((t - 1.0) / (t + 1.0), FRAC_PI_4) } else { (t, 0.0) };
    let p = poly(
        t * t,
        [
            0.999_999_999_999_233_4,
            -0.333_333_332_761_875_9,
            0.199_999_929_771_440_18,
            -0.142_853_836_057_480_34,
            0.111_034_032_247_056_67,
            -0.089_920_547_844_006_73,
            0.069_719_202_664_266_87,
            -0.037_614_421_906_879_18,
        ],
    );
    offset + t * p
}

/// Returns the angle in radians of the vector (x, y) against the x axis, in [−π, π], with the special cases of IEEE 754
/// `atan2`.
#[inline]
pub fn atan2(y: f32, x: f32) -> f32 {
    if x.is_nan() || y.is_nan() {
        return f32::NAN;
    }
    let (ax, ay) = (f64::from(x.abs()), f64::from(y.abs()));
    let (low, high) = if ax < ay { (ax, ay) } else { (ay, ax) };
    let ratio = if low == high {
        if low == 0.0 { 0.0 } else { 1.0 } // two zeros, or two infinities
    } else {
        low / high
    };
    let a = atan_unit(ratio);
    let a = if ax < ay { FRAC_PI_2 - a } else { a };
    let a = if x.is_sign_negative() { PI - a } else { a };
    (a as f32).copysign(y)
}

/// Returns the arc tangent in radians, in [−π/2, π/2]; NaN for NaN.
#[inline]
pub fn atan(x: f32) -> f32 {
    atan2(x, 1.0)
}

/// Returns the arc sine of x in [0, 0.5].
#[inline(always)]
fn asin_half(x: f64) -> f64 {
    x * poly(
        x * x,
        [
            1.000_000_000_000_828_4,
            0.166_666_666_130_793_67,
            0.075_000_056_744_022_06,
            0.044_640_558_126_651_51,
            0.030_428_232_165_658_486,
            0.021_854_690_993_978_47,
            0.020_686_707_917_837_294,
            0.001_901_354_586_174_211_7,
            0.032_972_865_728_252_5,
        ],
    )
}

/// Returns the arc cosine in radians, in [0, π]. Arguments beyond ±1, as from a rounded dot product, count as ±1; NaN
/// for NaN.
#[inline]
pub fn acos(x: f32) -> f32 {
    let a = f64::from(x.abs());
    if a <= 0.5 {
        return (FRAC_PI_2 - asin_half(a).copysign(f64::from(x))) as f32;
    }
    let half = 0.5 * (1.0 - a);
    let a = 2.0 * asin_half((if half < 0.0 { 0.0 } else { half }).sqrt());
    (if x < 0.0 { PI - a } else { a }) as f32
}

/// Returns the arc cosines of four numbers, each with the bits of [`acos`], without branches and for all at once.
#[inline(always)]
pub fn acos_of_four(x: [f32; 4]) -> [f32; 4] {
    let wide = x.map(f64::from);
    let a = wide.map(f64::abs);
    // Near ±1 the arc sine of the half angle is accurate
    let is_small = a.map(|a| a <= 0.5);
    let root = a.map(|a| 0.5 * (1.0 - a)).map(|half| (if half < 0.0 { 0.0 } else { half }).sqrt());
    let sine: [f64; 4] = std::array::from_fn(|i| if is_small[i] { a[i] } else { root[i] });
    let angle = sine.map(asin_half);
    std::array::from_fn(|i| {
        let small = FRAC_PI_2 - angle[i].copysign(wide[i]);
        let double = 2.0 * angle[i];
        let large = if x[i] < 0.0 { PI - double } else { double };
        (if is_small[i] { small } else { large }) as f32
    })
}

/// Returns the arc sine in radians, in [−π/2, π/2]. Arguments beyond ±1 count as ±1; NaN for NaN.
#[inline]
pub fn asin(x: f32) -> f32 {
    let a = f64::from(x.abs());
    let y = if a <= 0.5 {
        asin_half(a)
    } else {
        let half = 0.5 * (1.0 - a);
        FRAC_PI_2 - 2.0 * asin_half((if half < 0.0 { 0.0 } else { half }).sqrt())
    };
    (y as f32).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Distance of `got` from `exact` in units of the last place of the f32 nearest to `exact`.
    fn ulp_error(got: f32, exact: f64) -> f64 {
        let nearest = exact as f32;
        if nearest.is_infinite() || nearest.is_nan() {
            return if got.to_bits() == nearest.to_bits() || (got.is_nan() && nearest.is_nan()) { 0.0 } else { 1e9 };
        }
        let exponent = ((nearest.to_bits() >> 23 & 0xff) as i32 - 127).max(-126);
        (f64::from(got) - exact).abs() / 2f64.powi(exponent - 23)
    }

    /// Every `stride`-th f32 between two numbers of the same sign, and the negatives.
    fn sweep(low: f32, high: f32, stride: usize) -> impl Iterator<Item = f32> {
        (low.to_bits()..=high.to_bits()).step_by(stride).map(f32::from_bits).flat_map(|x| [x, -x])
    }

    fn check(name: &str, args: impl Iterator<Item = f32>, ours: fn(f32) -> f32, exact: fn(f64) -> f64) {
        let (mut worst, mut at, mut off) = (0.0, 0.0, 0);
        let mut count = 0u32;
        for x in args {
            let e = ulp_error(ours(x), exact(f64::from(x)));
            count += 1;
            off += u32::from(e > 0.5);
            if e > worst {
                (worst, at) = (e, x);
            }
        }
        assert!(worst <= 0.501, "{name}({at:e}) is off by {worst} ulp");
        assert!(off <= count / 500, "{name}: {off} of {count} not rounded correctly");
    }

    #[test]
    fn four_arc_cosines_are_those_of_each() {
        let all = sweep(1e-8, 1.5, 40_000).chain([0.0, -0.0, 0.5, -0.5, f32::INFINITY, f32::NAN]);
        for x in all {
            let some = [x, -0.3, x * 0.5, 0.9];
            for (four, one) in acos_of_four(some).into_iter().zip(some.map(acos)) {
                assert!(four.to_bits() == one.to_bits() || four.is_nan() && one.is_nan(), "{x}");
            }
        }
    }

    #[test]
    fn turns_are_angles() {
        for i in 0..=1_000_000 {
            let turns = i as f32 / 1e6;
            let (s, c) = sin_cos_of_turns(turns);
            let (exact_s, exact_c) = (f64::from(turns) * std::f64::consts::TAU).sin_cos();
            let error = (f64::from(s) - exact_s).abs().max((f64::from(c) - exact_c).abs());
            assert!(error < 1.2e-7, "{turns}: {s} {c}, off by {error:e}");
        }
    }

    #[test]
    fn every_function_of_one_argument_is_within_half_an_ulp() {
        let all = || sweep(0.0, f32::MAX, 4999);
        let unit = || sweep(1e-6, 1.0, 997);
        check("sin", all().chain(sweep(0.5, 100.0, 331)), sin, f64::sin);
        check("cos", all().chain(sweep(0.5, 100.0, 331)), cos, f64::cos);
        check("tan", all(), tan, f64::tan);
        check("exp", all().chain(sweep(0.1, 104.0, 331)), exp, f64::exp);
        check("exp2", all(), exp2, f64::exp2);
        check("ln", all().chain(sweep(0.5, 2.0, 97)), ln, f64::ln);
        check("log2", all(), log2, f64::log2);
        check("cbrt", all(), cbrt, f64::cbrt);
        check("atan", all(), atan, f64::atan);
        check("acos", unit(), acos, f64::acos);
        check("asin", unit(), asin, f64::asin);
    }

    #[test]
    fn functions_of_two_arguments_are_within_half_an_ulp() {
        for (i, a) in sweep(1e-30, 1e30, 2_000_003).enumerate() {
            for b in sweep(1e-3, 1e3, 1_000_003 + i) {
                assert!(ulp_error(atan2(a, b), f64::from(a).atan2(f64::from(b))) <= 0.501, "atan2({a:e}, {b:e})");
                if a > 0.0 {
                    assert!(ulp_error(powf(a, b), f64::from(a).powf(f64::from(b))) <= 0.501, "powf({a:e}, {b:e})");
                }
            }
        }
    }

    #[test]
    fn powf_and_atan2_keep_the_special_cases_of_the_standard() {
        let values =
            [0.0, -0.0, 1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 0.5, -0.5, 1e-40, 16_777_218.0, f32::MAX, f32::INFINITY];
        let values = || values.into_iter().chain([f32::NEG_INFINITY, f32::NAN, 1e9, -1e9, 8_388_609.0, -8_388_609.0]);
        for a in values() {
            for b in values() {
                let same = |got: f32, std: f64, name: &str| {
                    let right = ulp_error(got, std) <= 0.501
                        && (std.is_nan() || got.is_sign_negative() == std.is_sign_negative());
                    assert!(right, "{name}({a}, {b}): {got} != {std}");
                };
                same(powf(a, b), f64::from(a).powf(f64::from(b)), "powf");
                same(atan2(a, b), f64::from(a).atan2(f64::from(b)), "atan2");
            }
        }
    }

    #[test]
    fn edge_cases_are_exact() {
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(f32::NEG_INFINITY), 0.0);
        assert_eq!(exp(f32::INFINITY), f32::INFINITY);
        assert!(exp(f32::NAN).is_nan() && ln(f32::NAN).is_nan() && sin(f32::NAN).is_nan() && cbrt(f32::NAN).is_nan());
        assert_eq!((ln(1.0), ln(0.0), ln(f32::INFINITY)), (0.0, f32::NEG_INFINITY, f32::INFINITY));
        assert!(ln(-1.0).is_nan() && sin_cos(f32::INFINITY).1.is_nan() && tan(f32::INFINITY).is_nan());
        assert_eq!((acos(1.0), acos(2.0), acos(-1.5), asin(1.5)), (0.0, 0.0, PI as f32, FRAC_PI_2 as f32));
        assert!(acos(f32::NAN).is_nan() && asin(f32::NAN).is_nan());
        assert_eq!(sin(-0.0).to_bits(), (-0.0f32).to_bits());
        assert_eq!((sin_cos(0.0), cbrt(27.0), cbrt(-8.0)), ((0.0, 1.0), 3.0, -2.0));
    }

    #[test]
    fn exp_ln_and_acos_are_monotone_between_neighbors() {
        for start in sweep(1e-3, 80.0, 400_009) {
            let mut x = start;
            for _ in 0..200 {
                let next = x.next_up();
                assert!(exp(x) <= exp(next), "exp at {x:e}");
                if x > 0.0 {
                    assert!(ln(x) <= ln(next), "ln at {x:e}");
                }
                if x.abs() < 0.99 {
                    assert!(acos(x) >= acos(next), "acos at {x:e}");
                }
                x = next;
            }
        }
    }

    #[test]
    fn one_fixed_digest_holds_on_every_platform() {
        let mut digest = 0xcbf2_9ce4_8422_2325u64;
        for x in sweep(1e-20, 1e20, 99_991) {
            let (s, c) = sin_cos(x);
            for y in [s, c, exp(x), ln(x.abs()), powf(x.abs(), 0.37), atan2(x, 0.7), acos(s), cbrt(x)] {
                digest = (digest ^ u64::from(y.to_bits())).wrapping_mul(0x0100_0000_01b3);
            }
        }
        assert_eq!(digest, DIGEST, "digest is {digest:#018x}");
    }
    const DIGEST: u64 = 0xc61b_bd89_ce98_9ce5;
}
