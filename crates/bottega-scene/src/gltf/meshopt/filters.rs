//! Filters of decoded attributes: EXT_meshopt_compression, appendix B, and the colour filter of
//! KHR_meshopt_compression.

use std::f32::consts::FRAC_1_SQRT_2;

use crate::gltf::error::GltfError;

/// An attribute filter, undone in place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl Filter {
    /// Returns the filter with a name in the file; `None`: no filter.
    ///
    /// # Errors
    /// No filter has that name.
    pub(super) fn of(name: Option<&str>) -> Result<Option<Self>, GltfError> {
        Ok(match name {
            None | Some("NONE") => None,
            Some("OCTAHEDRAL") => Some(Self::Octahedral),
            Some("QUATERNION") => Some(Self::Quaternion),
            Some("EXPONENTIAL") => Some(Self::Exponential),
            Some("COLOR") => Some(Self::Color),
            Some(other) => return Err(GltfError::MeshoptFilter(other.into())),
        })
    }

    /// Returns true if the filter supports elements of `stride` bytes.
    pub(super) fn fits(self, stride: usize) -> bool {
        match self {
            Self::Octahedral | Self::Color => stride == 4 || stride == 8,
            Self::Quaternion => stride == 8,
            Self::Exponential => stride.is_multiple_of(4),
        }
    }

    /// Undoes the filter on elements of `stride` bytes, which [`fits`](Self::fits) accepts.
    pub(super) fn undo(self, stride: usize, elements: &mut [u8]) {
        match (self, stride) {
            (Self::Octahedral, 4) => for_each_4x8(elements, |v| {
                let [x, y, z] = octahedral(v.map(|v| f32::from(v as i8)), 127.0);
                [x as i8 as u8, y as i8 as u8, z as i8 as u8, v[3]]
            }),
            (Self::Octahedral, _) => for_each_4x16(elements, |v| {
                let [x, y, z] = octahedral(v.map(|v| f32::from(v as i16)), 32767.0);
                [x as i16 as u16, y as i16 as u16, z as i16 as u16, v[3]]
            }),
            (Self::Quaternion, _) => for_each_4x16(elements, quaternion),
            (Self::Exponential, _) => {
                let (words, _) = elements.as_chunks_mut::<4>();
                words.iter_mut().for_each(|word| *word = exponential(i32::from_le_bytes(*word)).to_le_bytes());
            }
            (Self::Color, 4) => for_each_4x8(elements, |v| {
                let [y, co, cg, a] = v;
                let coded = [i32::from(y), i32::from(co as i8), i32::from(cg as i8), i32::from(a)];
                color(coded, 255.0).map(|v| v as u8)
            }),
            (Self::Color, _) => for_each_4x16(elements, |v| {
                let [y, co, cg, a] = v;
                let coded = [i32::from(y), i32::from(co as i16), i32::from(cg as i16), i32::from(a)];
                color(coded, 65535.0).map(|v| v as u16)
            }),
        }
    }
}

fn for_each_4x8(elements: &mut [u8], undo: impl Fn([u8; 4]) -> [u8; 4]) {
    let (elements, _) = elements.as_chunks_mut::<4>();
    elements.iter_mut().for_each(|element| *element = undo(*element));
}

fn for_each_4x16(elements: &mut [u8], undo: impl Fn([u16; 4]) -> [u16; 4]) {
    let (elements, _) = elements.as_chunks_mut::<8>();
    for element in elements {
        let words = std::array::from_fn(|k| u16::from_le_bytes([element[2 * k], element[2 * k + 1]]));
        for (k, word) in undo(words).iter().enumerate() {
            element[2 * k..2 * k + 2].copy_from_slice(&word.to_le_bytes());
        }
    }
}

/// Decodes an octahedral unit vector, in units of `greatest`; the third number stands for 1.
fn octahedral([x, y, one, _]: [f32; 4], greatest: f32) -> [f32; 3] {
    let (x, y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    // Unfold the lower half.
    let fold = z.min(0.0);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let scale = greatest / (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|v| (v * scale).round())
}

/// Decodes three components and the index of the fourth, the greatest.
fn quaternion(coded: [u16; 4]) -> [u16; 4] {
    let [a, b, c, last] = coded.map(|v| v as i16);
    let scale = FRAC_1_SQRT_2 / f32::from(last | 3);
    let [x, y, z] = [a, b, c].map(|v| f32::from(v) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let greatest = (last & 3) as usize;
    let mut q = [0; 4];
    for (k, v) in [w, x, y, z].into_iter().enumerate() {
        q[(greatest + k) % 4] = (v * 32767.0).round() as i16 as u16;
    }
    q
}

/// Decodes a mantissa and an exponent of two.
fn exponential(coded: i32) -> f32 {
    let mantissa = f64::from(coded << 8 >> 8);
    let exponent = i64::from(coded >> 24);
    let power = f64::from_bits(((1023 + exponent) as u64) << 52);
    (mantissa * power) as f32
}

/// Decodes luma, two chromas and alpha, whose highest bit gives the number of bits.
fn color([y, co, cg, coded_alpha]: [i32; 4], greatest: f32) -> [f32; 4] {
    let bits = 32 - (coded_alpha as u32).leading_zeros();
    let all = (1i32 << bits) - 1;
    let alpha = coded_alpha & all >> 1;
    let alpha = alpha << 1 | alpha & 1;
    let scale = greatest / all as f32;
    [y + co - cg, y + cg, y - co - cg, alpha].map(|v| (v as f32 * scale).round())
}
