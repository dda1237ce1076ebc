//! Textures of one variable: noise, veins of marble, dots, and the slope of the surface.

use glam::{Affine2, DVec3, Vec2};

use super::mapping::PlacedMapping;

/// A function of the first coordinate of a mapping.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RampNode {
    /// Mapping whose first coordinate is the variable.
    pub(super) mapping: PlacedMapping,
    pub(super) kind: RampKind,
    /// Least and greatest value of the variable.
    pub(super) range: [f32; 2],
    /// Mean value, which replaces the texture where it cannot be followed.
    pub(super) mean: f64,
}

/// The function of a [`RampNode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RampKind {
    /// The variable itself.
    Line,
    /// 0 below ½, else 1.
    Step,
    /// The colours of pbrt's marble.
    Marble,
}

/// Texels of a ramp that is not a line: a multiple of the segments of marble.
const TEXELS: u32 = 6 * 256;

impl RampNode {
    /// Returns the value at a value of the variable.
    pub(super) fn value(&self, at: f32) -> DVec3 {
        match self.kind {
            RampKind::Line => DVec3::splat(f64::from(at)),
            RampKind::Step => DVec3::splat(if at < 0.5 { 0.0 } else { 1.0 }),
            RampKind::Marble => marble(f64::from(at)),
        }
    }

    /// Returns true unless values between two texels are interpolated.
    pub(super) fn is_step(&self) -> bool {
        self.kind == RampKind::Step
    }

    /// Returns the number of texels of a picture of a function of the ramp. Two suffice for a line.
    ///
    /// - `value`: the function of the variable.
    pub(super) fn texels(&self, value: &dyn Fn(f32) -> DVec3) -> u32 {
        const PROBES: u16 = 37;
        let [least, most] = self.range;
        let at = |share: f32| value(least + (most - least) * share);
        let (first, last) = (at(0.0), at(1.0));
        let is_line = (0..=PROBES).all(|probe| {
            let share = f32::from(probe) / f32::from(PROBES);
            let off = at(share) - first.lerp(last, f64::from(share));
            off.abs().max_element() <= 1e-5 * (first.abs() + last.abs()).max_element()
        });
        if is_line || self.is_step() { 2 } else { TEXELS }
    }

    /// Returns the variable at a texel's centre of a picture with that width.
    pub(super) fn at_texel(&self, x: u32, width: u32) -> f32 {
        let [least, most] = self.range;
        least + (most - least) * (x as f32 / (width - 1) as f32)
    }

    /// Returns the transformation of the mapping's coordinates to a picture of that width. The range of the variable
    /// lies between the centres of the first and the last texel.
    pub(super) fn picture_from_uv(&self, width: u32) -> Affine2 {
        let [least, most] = self.range;
        let margin = 0.5 / width as f32;
        let scale = (1.0 - 2.0 * margin) / (most - least);
        Affine2::from_scale_angle_translation(Vec2::new(scale, 1.0), 0.0, Vec2::new(margin - scale * least, 0.0))
    }
}

/// Returns the colour of pbrt's marble between two veins: 1.5 times a row of Bézier curves, each of which begins at the
/// second point of the one before.
fn marble(at: f64) -> DVec3 {
    const STONE: DVec3 = DVec3::new(0.58, 0.58, 0.6);
    const POINTS: [DVec3; 9] = [
        STONE,
        STONE,
        STONE,
        DVec3::splat(0.5),
        DVec3::new(0.6, 0.59, 0.58),
        STONE,
        STONE,
        DVec3::new(0.2, 0.2, 0.33),
        STONE,
    ];
    const SEGMENTS: usize = POINTS.len() - 3;
    let at = at.clamp(0.0, 1.0) * SEGMENTS as f64;
    let first = (at as usize).min(SEGMENTS - 1);
    let t = at - first as f64;
    let mut points = [0, 1, 2, 3].map(|point| POINTS[first + point]);
    for count in (1..4).rev() {
        for point in 0..count {
            points[point] = points[point].lerp(points[point + 1], t);
        }
    }
    points[0] * 1.5
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(kind: RampKind, range: [f32; 2]) -> RampNode {
        let mapping = PlacedMapping { uv_set: 2, picture_from_uv: Affine2::IDENTITY };
        RampNode { mapping, kind, range, mean: 0.0 }
    }

    #[test]
    fn marble_has_the_colours_of_pbrt() {
        assert!((marble(0.0) - DVec3::new(0.87, 0.87, 0.9)).length() < 1e-9);
        assert!((marble(0.25) - DVec3::new(0.828_75, 0.826_875, 0.84)).length() < 1e-9, "{}", marble(0.25));
        assert!((marble(0.75) - DVec3::new(0.802_5, 0.800_625, 0.845_625)).length() < 1e-9, "{}", marble(0.75));
        assert!((marble(1.0) - DVec3::new(0.87, 0.87, 0.9)).length() < 1e-9);
    }

    #[test]
    fn a_line_needs_two_texels() {
        let noise = ramp(RampKind::Line, [-2.0, 3.0]);
        assert_eq!(noise.texels(&|at| noise.value(at) * 3.0 + 1.0), 2);
        assert_eq!(noise.texels(&|at| noise.value(at) * noise.value(at)), TEXELS);
        assert_eq!([noise.at_texel(0, 2), noise.at_texel(1, 2)], [-2.0, 3.0]);
        let place = noise.picture_from_uv(2);
        for (value, x) in [(-2.0, 0.25), (0.5, 0.5), (3.0, 0.75)] {
            let at = place.transform_point2(Vec2::new(value, 0.5));
            assert!((at - Vec2::new(x, 0.5)).length() < 1e-6, "{value}: {at}");
        }
    }
}
