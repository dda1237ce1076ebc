//! Texture lookup: wrapping, bilinear filtering within a mip level, linear between levels.
//!
//! Nothing here depends on the platform: the level of detail uses the bits of a float instead of a logarithm.

use glam::{Vec2, Vec4};

use super::pyramid::{Level, Pyramid, Texel};
use super::{Image, Texels, with_pyramid};
use crate::texture::{TextureMap, Wrap};

impl Image {
    /// Returns the linear RGBA of the picture at a point of a surface.
    ///
    /// - `map`: mapping of the picture.
    /// - `uv`: texture coordinates before the transformation of `map`; one that is not finite counts as 0.
    /// - `footprint`: width of the lookup in units of `uv`; 0 (or NaN): the finest level. A picture that is not
    ///   `smooth` shows square texels in close-up, and is filtered as usual when minified.
    pub fn eval(&self, map: &TextureMap, uv: Vec2, footprint: f32) -> Vec4 {
        let at = map.picture_from_uv.transform_point2(uv);
        with_pyramid!(&self.texels, pyramid => pyramid.lookup(map, at, footprint))
    }

    /// Returns the derivatives of [`eval`](Self::eval)'s linear RGBA along u and v, per unit of `uv`. 0 where texels
    /// are not interpolated.
    ///
    /// - `map`, `uv`, `footprint`: as for [`eval`](Self::eval).
    pub fn slopes(&self, map: &TextureMap, uv: Vec2, footprint: f32) -> [Vec4; 2] {
        let at = map.picture_from_uv.transform_point2(uv);
        let [along_x, along_y] = with_pyramid!(&self.texels, pyramid => pyramid.slopes(map, at, footprint));
        [map.picture_from_uv.matrix2.x_axis, map.picture_from_uv.matrix2.y_axis]
            .map(|axis| along_x * axis.x + along_y * axis.y)
    }

    /// Returns the alpha of [`eval`](Self::eval), in [0, 1] for 8-bit and 16-bit pictures; 1, without a lookup, if the
    /// picture has none.
    pub fn alpha(&self, map: &TextureMap, uv: Vec2, footprint: f32) -> f32 {
        if self.has_alpha() { self.eval(map, uv, footprint).w } else { 1.0 }
    }
}

impl<T: Texel> Pyramid<T> {
    #[inline]
    fn lookup(&self, map: &TextureMap, at: Vec2, footprint: f32) -> Vec4 {
        let table = self.table();
        let finest = &self.levels[0];
        let detail = level_of_detail(map, finest.width, finest.height, footprint);
        if detail <= 0.0 {
            return if map.smooth { bilinear(finest, table, map, at) } else { nearest(finest, table, map, at) };
        }
        let last = self.levels.len() - 1;
        let level = detail as usize;
        if level >= last {
            return self.levels[last].texels[0].decode(table);
        }
        let fine = bilinear(&self.levels[level], table, map, at);
        let coarse = bilinear(&self.levels[level + 1], table, map, at);
        fine + (coarse - fine) * (detail - level as f32)
    }

    /// Returns the derivatives of [`lookup`](Self::lookup) along the picture's axes, whose lengths are 1.
    fn slopes(&self, map: &TextureMap, at: Vec2, footprint: f32) -> [Vec4; 2] {
        let table = self.table();
        let finest = &self.levels[0];
        let detail = level_of_detail(map, finest.width, finest.height, footprint).max(0.0);
        let last = self.levels.len() - 1;
        let level = detail as usize;
        if !map.smooth && detail == 0.0 || level >= last && detail > 0.0 {
            return [Vec4::ZERO; 2];
        }
        let fine = bilinear_slopes(&self.levels[level], table, map, at);
        let rest = detail - level as f32;
        if rest == 0.0 {
            return fine;
        }
        let coarse = bilinear_slopes(&self.levels[level + 1], table, map, at);
        [0, 1].map(|axis| fine[axis] + (coarse[axis] - fine[axis]) * rest)
    }
}

/// Returns log₂ of the footprint in texels of the finest level, along the axis where it covers more of them.
#[inline]
fn level_of_detail(map: &TextureMap, width: u32, height: u32, footprint: f32) -> f32 {
    if footprint.is_nan() || footprint <= 0.0 {
        return 0.0;
    }
    let m = map.picture_from_uv.matrix2;
    let columns = m.row(0).length_squared() * (width as f32 * width as f32);
    let rows = m.row(1).length_squared() * (height as f32 * height as f32);
    0.5 * log2_piecewise(columns.max(rows) * footprint * footprint)
}

/// Approximates log₂, piecewise linear between powers of two: at most 0.09 below the true value, invisible in a blend
/// of two mip levels. 128 for infinity and NaN.
#[inline]
fn log2_piecewise(x: f32) -> f32 {
    let bits = x.abs().to_bits().min(f32::INFINITY.to_bits());
    let exponent = (bits >> 23) as i32 - 127;
    exponent as f32 + (bits & 0x7f_ffff) as f32 * (1.0 / 8_388_608.0)
}

/// Wraps a texture coordinate into [0, 1].
#[inline]
fn wrapped(x: f32, wrap: Wrap) -> f32 {
    match wrap {
        Wrap::Repeat => fraction(x),
        Wrap::Mirror => {
            let phase = 2.0 * fraction(0.5 * x);
            if phase > 1.0 { 2.0 - phase } else { phase }
        }
        Wrap::Clamp if x.is_nan() => 0.0,
        Wrap::Clamp => x.clamp(0.0, 1.0),
    }
}

/// Returns x − ⌊x⌋, or 0 where a float has no fraction (also for infinity and NaN).
#[inline]
fn fraction(x: f32) -> f32 {
    if x.abs() < 8_388_608.0 {
        let rest = x - x as i32 as f32;
        if rest < 0.0 { rest + 1.0 } else { rest }
    } else {
        0.0
    }
}

/// Returns the two neighbouring texels along one axis, and the weight of the second.
#[inline]
fn neighbors(x: f32, wrap: Wrap, size: u32) -> (usize, usize, f32) {
    let last = size as i32 - 1;
    let center = wrapped(x, wrap) * size as f32 + 0.5;
    let second = (center as i32).min(last + 1);
    let weight = center - second as f32;
    let first = second - 1;
    let (first, second) = match wrap {
        Wrap::Repeat => (if first < 0 { last } else { first }, if second > last { 0 } else { second }),
        Wrap::Mirror | Wrap::Clamp => (first.max(0), second.min(last)),
    };
    (first as usize, second as usize, weight)
}

/// Returns the four texels around a point, upper row first, and the weights of the second column and row.
#[inline]
fn around<T: Texel>(level: &Level<T>, table: &[f32; 256], map: &TextureMap, at: Vec2) -> ([Vec4; 4], f32, f32) {
    let (x0, x1, u) = neighbors(at.x, map.wrap_u, level.width);
    let (y0, y1, v) = neighbors(at.y, map.wrap_v, level.height);
    let width = level.width as usize;
    let texel = |x: usize, y: usize| level.texels[y * width + x].decode(table);
    ([texel(x0, y0), texel(x1, y0), texel(x0, y1), texel(x1, y1)], u, v)
}

#[inline]
fn bilinear<T: Texel>(level: &Level<T>, table: &[f32; 256], map: &TextureMap, at: Vec2) -> Vec4 {
    let ([a, b, c, d], u, v) = around(level, table, map, at);
    let upper = a * (1.0 - u) + b * u;
    let lower = c * (1.0 - u) + d * u;
    upper * (1.0 - v) + lower * v
}

/// Returns the derivatives of [`bilinear`] along both axes.
fn bilinear_slopes<T: Texel>(level: &Level<T>, table: &[f32; 256], map: &TextureMap, at: Vec2) -> [Vec4; 2] {
    let ([a, b, c, d], u, v) = around(level, table, map, at);
    let along_x = (b - a) * (1.0 - v) + (d - c) * v;
    let along_y = (c - a) * (1.0 - u) + (d - b) * u;
    let sign = |x: f32, wrap: Wrap| match wrap {
        // Every second copy is mirrored.
        Wrap::Mirror if fraction(0.5 * x) > 0.5 => -1.0,
        _ => 1.0,
    };
    [along_x * (level.width as f32 * sign(at.x, map.wrap_u)), along_y * (level.height as f32 * sign(at.y, map.wrap_v))]
}

#[inline]
fn nearest<T: Texel>(level: &Level<T>, table: &[f32; 256], map: &TextureMap, at: Vec2) -> Vec4 {
    let index = |x: f32, wrap: Wrap, size: u32| ((wrapped(x, wrap) * size as f32) as usize).min(size as usize - 1);
    let x = index(at.x, map.wrap_u, level.width);
    let y = index(at.y, map.wrap_v, level.height);
    level.texels[y * level.width as usize + x].decode(table)
}

#[cfg(test)]
mod tests {
    use glam::Affine2;
    use proptest::prelude::*;

    use super::*;
    use crate::texture::ImageId;

    fn map() -> TextureMap {
        TextureMap::new(ImageId(0))
    }

    /// Red grows along x, green along y.
    fn ramp(width: u32, height: u32) -> Image {
        let texels = (0..width * height).map(|i| [(i % width) as f32, (i / width) as f32, 0.0]).collect();
        Image::from_linear_rgb("ramp", width, height, texels)
    }

    #[test]
    fn the_centre_of_a_texel_has_its_value() {
        let image = ramp(7, 5);
        for (x, y) in [(0, 0), (6, 4), (3, 2), (0, 4)] {
            let uv = Vec2::new((x as f32 + 0.5) / 7.0, (y as f32 + 0.5) / 5.0);
            assert!((image.eval(&map(), uv, 0.0) - image.texel(x, y)).length() < 1e-5);
        }
    }

    #[test]
    fn between_texels_values_are_interpolated() {
        let image = ramp(8, 8);
        let value = image.eval(&map(), Vec2::new(0.3, 0.6), 0.0);
        assert!((value - Vec4::new(0.3 * 8.0 - 0.5, 0.6 * 8.0 - 0.5, 0.0, 1.0)).length() < 1e-5, "{value}");
    }

    #[test]
    fn slopes_are_the_differences_of_lookups() {
        let texels = (0..8 * 4).map(|i| [(i * 37 % 11) as f32, (i * 23 % 7) as f32, 0.0]).collect();
        let image = Image::from_linear_rgb("rough", 8, 4, texels);
        let turned =
            Affine2::from_angle_translation(0.4, Vec2::new(0.3, 0.1)) * Affine2::from_scale(Vec2::new(2.0, 3.0));
        for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
            let map = TextureMap { picture_from_uv: turned, wrap_u: wrap, wrap_v: wrap, ..map() };
            let mut checked = 0;
            for (i, footprint) in (0..60).flat_map(|i| [0.0, 0.07].map(|footprint| (i, footprint))) {
                let uv = Vec2::new(0.013 + 0.11 * i as f32, 0.017 - 0.07 * i as f32).fract() * 2.0 - 0.7;
                for (axis, slope) in [Vec2::X, Vec2::Y].into_iter().zip(image.slopes(&map, uv, footprint)) {
                    let at = |step: f32| image.eval(&map, uv + axis * step, footprint);
                    let step = 2e-4;
                    let (ahead, behind) = (at(step) - at(0.0), at(0.0) - at(-step));
                    // Skip lookups with a texel boundary between them.
                    if (ahead - behind).length() < 1.5e-4 {
                        checked += 1;
                        let difference = (ahead + behind) / (2.0 * step);
                        assert!((slope - difference).length() < 0.02 * (20.0 + slope.length()), "{slope} {difference}");
                    }
                }
            }
            assert!(checked > 100, "{checked}");
        }
        let square = TextureMap { smooth: false, ..map() };
        assert_eq!(image.slopes(&square, Vec2::splat(0.3), 0.0), [Vec4::ZERO; 2]);
        assert_eq!(image.slopes(&map(), Vec2::splat(0.3), 5.0), [Vec4::ZERO; 2]);
    }

    #[test]
    fn wrap_modes_decide_the_texels_beyond_the_edge() {
        let image = ramp(4, 1);
        let at = |wrap, u| {
            let map = TextureMap { wrap_u: wrap, smooth: false, ..map() };
            image.eval(&map, Vec2::new(u, 0.5), 0.0).x
        };
        assert_eq!((at(Wrap::Repeat, 1.1), at(Wrap::Repeat, -0.1)), (0.0, 3.0));
        assert_eq!((at(Wrap::Mirror, 1.1), at(Wrap::Mirror, -0.1), at(Wrap::Mirror, 2.1)), (3.0, 0.0, 0.0));
        assert_eq!((at(Wrap::Clamp, 7.0), at(Wrap::Clamp, -7.0)), (3.0, 0.0));
        // Bilinear: at the seam of a repeated picture, the last and first texel are blended.
        assert_eq!(image.eval(&map(), Vec2::new(1.0, 0.5), 0.0).x, 1.5);
        let mirror = TextureMap { wrap_u: Wrap::Mirror, ..map() };
        assert_eq!(image.eval(&mirror, Vec2::new(1.0, 0.5), 0.0).x, 3.0);
    }

    #[test]
    fn a_wide_footprint_sees_the_mean() {
        let image = ramp(16, 16);
        for footprint in [1.0, 10.0, f32::INFINITY] {
            let value = image.eval(&map(), Vec2::new(0.2, 0.9), footprint);
            assert!((value - Vec4::new(7.5, 7.5, 0.0, 1.0)).length() < 1e-4, "{footprint}: {value}");
        }
    }

    #[test]
    fn the_level_follows_the_footprint_and_the_transform() {
        let plain = map();
        assert_eq!(level_of_detail(&plain, 64, 32, 4.0 / 64.0), 2.0);
        let tiled = TextureMap { picture_from_uv: Affine2::from_scale(Vec2::splat(4.0)), ..map() };
        assert_eq!(level_of_detail(&tiled, 64, 32, 4.0 / 64.0), 4.0);
        assert!(level_of_detail(&plain, 64, 64, 0.5 / 64.0) < 0.0);
        assert_eq!(level_of_detail(&plain, 64, 64, f32::NAN), 0.0);
    }

    #[test]
    fn texture_transforms_move_the_picture() {
        let image = ramp(4, 4);
        let map =
            TextureMap { picture_from_uv: Affine2::from_translation(Vec2::new(0.25, 0.0)), smooth: false, ..map() };
        assert_eq!(image.eval(&map, Vec2::new(0.1, 0.1), 0.0).x, 1.0);
    }

    proptest! {
        #[test]
        fn any_lookup_stays_between_the_least_and_the_greatest_texel(
            u in any::<f32>(), v in any::<f32>(), footprint in any::<f32>(), width in 1u32..9, height in 1u32..9,
            wrap in 0..3usize, smooth: bool,
        ) {
            let image = ramp(width, height);
            let wrap = [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp][wrap];
            let map = TextureMap { wrap_u: wrap, wrap_v: wrap, smooth, ..map() };
            let value = image.eval(&map, Vec2::new(u, v), footprint);
            prop_assert!(value.is_finite());
            prop_assert!(value.x >= -1e-4 && value.x <= (width - 1) as f32 + 1e-4);
            prop_assert!(value.y >= -1e-4 && value.y <= (height - 1) as f32 + 1e-4);
        }

        #[test]
        fn repeating_and_mirroring_are_periodic(u in -4.0f32..4.0, v in -4.0f32..4.0) {
            let image = ramp(5, 3);
            let mirror = TextureMap { wrap_u: Wrap::Mirror, wrap_v: Wrap::Mirror, ..map() };
            for (map, period) in [(map(), 1.0), (mirror, 2.0)] {
                let here = image.eval(&map, Vec2::new(u, v), 0.0);
                let there = image.eval(&map, Vec2::new(u + period, v - period), 0.0);
                prop_assert!((here - there).length() < 1e-3);
            }
        }
    }
}
