//! The photon, packed into twenty-four bytes.

use bottega_scene::Spectrum;
use glam::{Vec2, Vec3};

use crate::guide::octahedron::{direction_from_square, square_from_direction};

/// Quantization steps along a side of the octahedral map, for directions and for normals.
const DIRECTION_STEPS: u32 = 1 << 10;
const NORMAL_STEPS: u32 = 1 << 6;
/// Exponent bias: powers range from 2⁻¹²⁸ to 2¹²⁷.
const EXPONENT_BIAS: i32 = 128;

/// A photon on a surface, packed into 24 bytes; other data at a surface point has the same form.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Photon {
    /// Position, in world space.
    pub p: Vec3,
    mark: Mark,
}

/// The data of a photon without its position, packed: directions, power and number of bounces.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    /// Octahedral coordinates: 10 bits each for the direction, 6 bits each for the normal.
    directions: u32,
    /// Red, green and blue with a shared exponent (Ward 1991, *Real Pixels*), or a tag.
    power: u32,
    /// Number of bounces; for places in an [`IrradianceMap`](super::IrradianceMap), the position of the list.
    label: u32,
}

impl Photon {
    /// Packs a photon.
    ///
    /// - `p`: position in world space.
    /// - `to_light`: direction against its flight; unit length.
    /// - `normal`: geometric normal, on the side where it arrived; unit length.
    /// - `power`: power per channel, finite and at least 0.
    pub fn new(p: Vec3, to_light: Vec3, normal: Vec3, power: Spectrum) -> Self {
        let directions = packed(to_light, DIRECTION_STEPS, 10) | packed(normal, NORMAL_STEPS, 6) << 20;
        Self { p, mark: Mark { directions, power: shared_exponent(power), label: 0 } }
    }

    /// Packs a point with a tag in place of the power.
    pub(crate) fn tagged(p: Vec3, to_light: Vec3, normal: Vec3, tag: u32) -> Self {
        let mark = Self::new(p, to_light, normal, Spectrum::ZERO).mark;
        Self { p, mark: Mark { power: tag, ..mark } }
    }

    /// Returns the packed data without the position.
    pub fn mark(&self) -> Mark {
        self.mark
    }

    /// Returns this photon with another power.
    #[must_use]
    pub fn with_power(self, power: Spectrum) -> Self {
        Self { mark: Mark { power: shared_exponent(power), ..self.mark }, ..self }
    }

    /// Returns this photon with another number of bounces: how often the light was scattered before it arrived.
    #[must_use]
    pub fn with_bounces(self, bounces: u32) -> Self {
        self.with_label(bounces)
    }

    /// Returns this photon with another label.
    #[must_use]
    pub(super) fn with_label(self, label: u32) -> Self {
        Self { mark: Mark { label, ..self.mark }, ..self }
    }

    /// Returns a photon of packed data.
    pub(super) fn of(p: Vec3, mark: Mark) -> Self {
        Self { p, mark }
    }
}

impl Mark {
    /// Returns the packed form.
    pub(crate) fn to_numbers(self) -> [u32; 3] {
        [self.directions, self.power, self.label]
    }

    /// Returns the data of a packed form.
    pub(crate) fn from_numbers([directions, power, label]: [u32; 3]) -> Self {
        Self { directions, power, label }
    }

    /// Returns the number of times that the light was scattered before it arrived.
    #[inline(always)]
    pub fn bounces(self) -> u32 {
        self.label
    }

    /// Returns the label.
    #[inline(always)]
    pub(super) fn label(self) -> u32 {
        self.label
    }

    /// Returns the direction that the light came from: unit length, within a quarter of a degree.
    #[inline(always)]
    pub fn to_light(self) -> Vec3 {
        unpacked(self.directions, DIRECTION_STEPS, 10)
    }

    /// Returns the geometric normal on the side where it arrived: unit length, within four degrees.
    #[inline(always)]
    pub fn normal(self) -> Vec3 {
        unpacked(self.directions >> 20, NORMAL_STEPS, 6)
    }

    /// Returns this mark with a tag in place of the power.
    #[must_use]
    pub(crate) fn with_tag(self, tag: u32) -> Self {
        Self { power: tag, ..self }
    }

    /// Returns the tag in place of the power.
    #[inline(always)]
    pub(crate) fn tag(self) -> u32 {
        self.power
    }

    /// Returns the power per channel, within half a percent of its greatest channel.
    #[inline(always)]
    pub fn power(self) -> Spectrum {
        of_shared_exponent(self.power)
    }
}

/// Unpacks red, green and blue with a shared exponent.
#[inline(always)]
pub(super) fn of_shared_exponent(number: u32) -> Spectrum {
    let [r, g, b, exponent] = number.to_le_bytes();
    // Build 2^(e − bias − 8) from its bits: it is normal wherever a mantissa is not 0
    let scale = f64::from_bits(((i64::from(exponent) - i64::from(EXPONENT_BIAS) - 8 + 1023) as u64) << 52) as f32;
    Vec3::new(f32::from(r), f32::from(g), f32::from(b)) * scale
}

/// Packs a direction as two octahedral coordinates of `bits` bits.
fn packed(w: Vec3, steps: u32, bits: u32) -> u32 {
    // An even number of intervals puts the poles and the axes on the grid
    let last = (steps - 2) as f32;
    let place = (square_from_direction(w).0 * 0.5 + 0.5).clamp(Vec2::ZERO, Vec2::ONE) * last + 0.5;
    place.x as u32 | (place.y as u32) << bits
}

/// Unpacks a direction; see [`packed`].
#[inline(always)]
fn unpacked(code: u32, steps: u32, bits: u32) -> Vec3 {
    let mask = steps - 1;
    let place = Vec2::new((code & mask) as f32, (code >> bits & mask) as f32);
    direction_from_square(place * (2.0 / (steps - 2) as f32) - 1.0).0
}

/// Packs red, green and blue with a shared exponent into four bytes; NaN becomes 0.
pub(super) fn shared_exponent(power: Spectrum) -> u32 {
    let largest = power.max_element();
    // NaN counts as no light
    if largest.is_nan() || largest < f32::MIN_POSITIVE {
        return 0;
    }
    let largest = largest.min(f32::MAX);
    // Find the least power of two above the greatest channel
    let mut exponent = ((largest.to_bits() >> 23) as i32 - 127) + 1;
    let scale_of = |exponent: i32| 2.0_f64.powi(8 - exponent);
    if f64::from(largest) * scale_of(exponent) >= 255.5 {
        exponent += 1;
    }
    let exponent = exponent.clamp(-EXPONENT_BIAS, 127);
    let mantissa = |part: f32| ((f64::from(part.max(0.0)) * scale_of(exponent)) + 0.5).min(255.0) as u8;
    let parts = power.to_array().map(mantissa);
    u32::from_le_bytes([parts[0], parts[1], parts[2], (exponent + EXPONENT_BIAS) as u8])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::uniform_sphere;

    fn directions() -> impl Iterator<Item = Vec3> {
        let grid = (0..4096).map(|i| uniform_sphere([((i % 64) as f32 + 0.5) / 64.0, ((i / 64) as f32 + 0.5) / 64.0]));
        grid.chain([Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y, Vec3::NEG_Z])
    }

    #[test]
    fn a_photon_takes_twenty_four_bytes() {
        assert_eq!(size_of::<Photon>(), 24);
    }

    #[test]
    fn directions_and_normals_come_back() {
        for w in directions() {
            let mark = Photon::new(Vec3::ZERO, w, -w, Vec3::ONE).mark();
            assert!(mark.to_light().angle_between(w) < 0.25_f32.to_radians(), "{w} {}", mark.to_light());
            assert!(mark.normal().angle_between(-w) < 4.0_f32.to_radians(), "{w} {}", mark.normal());
        }
        let mark = Photon::new(Vec3::ZERO, Vec3::NEG_Y, Vec3::Y, Vec3::ONE).mark();
        assert_eq!((mark.to_light(), mark.normal()), (Vec3::NEG_Y, Vec3::Y));
    }

    #[test]
    fn powers_come_back_however_large_or_small() {
        for scale in [1e-30, 1e-9, 0.37, 1.0, 255.9, 1e12, 1e37] {
            for power in [Vec3::new(1.0, 0.5, 0.02), Vec3::new(0.3, 0.999, 0.0), Vec3::splat(0.998)] {
                let power = power * scale;
                let back = Photon::new(Vec3::ZERO, Vec3::Y, Vec3::Y, power).mark().power();
                assert!((back - power).abs().max_element() <= 0.004 * power.max_element(), "{power} {back}");
            }
        }
        for nothing in [Vec3::ZERO, Vec3::splat(f32::NAN), Vec3::splat(-1.0)] {
            assert_eq!(Photon::new(Vec3::ZERO, Vec3::Y, Vec3::Y, nothing).mark().power(), Vec3::ZERO);
        }
    }

    #[test]
    fn the_mean_of_many_powers_is_kept() {
        let (mut given, mut kept) = (Vec3::ZERO, Vec3::ZERO);
        for i in 0..10_000 {
            let part = |prime: u32| (i * prime % 9973) as f32 / 9973.0;
            let power = Vec3::new(0.2 + part(7), 0.5 * part(31), 0.1 * part(101));
            given += power;
            kept += Photon::new(Vec3::ZERO, Vec3::Y, Vec3::Y, power).mark().power();
        }
        assert!((kept / given - 1.0).abs().max_element() < 1e-3, "{kept} {given}");
    }
}
