//! Volume files of Mitsuba's `gridvolume` and `sdfgrid`.

use std::path::Path;

use glam::{DAffine3, DVec3};

use crate::error::SceneError;
use crate::grid::{Blend, Grid, GridError};
use crate::values::VALUE_MAX;

/// An error in a volume file, for the message that it is damaged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum VolumeError {
    #[error("it does not begin, at byte 0, like a grid of version 3")]
    NotVolume,
    #[error("it ends at byte {length}, within its header of {HEADER_BYTES}")]
    InHeader { length: usize },
    #[error("its values are not floats, but of kind {kind} (byte 4)")]
    NotFloats { kind: i32 },
    #[error("it announces {channels} channels (byte 20), and not 1 or 3")]
    Channels { channels: i32 },
    #[error("its {length} bytes cannot hold the {x} × {y} × {z} cells that it announces (byte 8)", x = size[0], y = size[1], z = size[2])]
    TooShort { length: usize, size: [i32; 3] },
    #[error("the value at byte {byte} is not a finite number up to {VALUE_MAX:e}")]
    NotNumber { byte: usize },
    #[error(transparent)]
    Grid(#[from] GridError),
    #[error("a grid of distances has one channel, not {channels}")]
    DistanceChannels { channels: usize },
    #[error("a surface needs two samples along each axis, not {x} × {y} × {z}", x = size[0], y = size[1], z = size[2])]
    Flat { size: [u32; 3] },
}

impl VolumeError {
    /// Converts to the error for the user.
    pub(super) fn in_file(&self, path: &Path) -> SceneError {
        SceneError::Damaged { path: path.into(), problem: self.to_string() }
    }
}

/// Size of the header of a volume file.
const HEADER_BYTES: usize = 48;

/// A grid with the box that its file gives.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Volume {
    pub(super) grid: Grid,
    /// Unit cube to the box of the file.
    pub(super) file_from_cube: DAffine3,
}

/// The parsed numbers of a volume file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Numbers {
    /// Samples along x, y and z.
    pub(super) size: [u32; 3],
    /// Channels: 1 or 3.
    pub(super) channels: usize,
    /// Values, those of a sample adjacent; x runs fastest.
    pub(super) values: Vec<f32>,
    /// Unit cube to the box of the file.
    file_from_cube: DAffine3,
}

/// Reads a grid of densities or the like, which are at least 0; see [`numbers`].
pub(super) fn read(bytes: &[u8], blend: Blend) -> Result<Volume, VolumeError> {
    let Numbers { size, values, file_from_cube, .. } = numbers(bytes)?;
    let grid = Grid::new(size, values, blend)?;
    Ok(Volume { grid, file_from_cube })
}

/// Reads a `.vol` file of version 3 with floats, in one or three channels (of six, the first three are used).
pub(super) fn numbers(bytes: &[u8]) -> Result<Numbers, VolumeError> {
    if !bytes.starts_with(b"VOL\x03") {
        return Err(VolumeError::NotVolume);
    }
    let Some((header, values)) = bytes.split_at_checked(HEADER_BYTES) else {
        return Err(VolumeError::InHeader { length: bytes.len() });
    };
    let word = |index: usize| <[u8; 4]>::try_from(&header[4 + 4 * index..8 + 4 * index]).unwrap_or_default();
    let integer = |index: usize| i32::from_le_bytes(word(index));
    if integer(0) != 1 {
        return Err(VolumeError::NotFloats { kind: integer(0) });
    }
    let channels = match integer(4) {
        channels @ (1 | 3 | 6) => channels as usize,
        channels => return Err(VolumeError::Channels { channels }),
    };
    let announced = [1, 2, 3].map(integer);
    let size = announced.map(|side| u32::try_from(side).unwrap_or(0));
    let count = size.iter().try_fold(channels, |product, &side| product.checked_mul(side as usize));
    let Some(count) = count.filter(|&count| count > 0 && count <= values.len() / 4) else {
        return Err(VolumeError::TooShort { length: bytes.len(), size: announced });
    };
    let float = |bytes: &[u8]| bytes.try_into().map_or(0.0, f32::from_le_bytes);
    let is_number = |bytes: &[u8; 4]| f32::from_le_bytes(*bytes).abs() <= VALUE_MAX;
    if let Some(index) = values[..4 * count].as_chunks::<4>().0.iter().position(|bytes| !is_number(bytes)) {
        return Err(VolumeError::NotNumber { byte: HEADER_BYTES + 4 * index });
    }
    let cells = values[..4 * count].chunks_exact(4 * channels);
    let channels = channels.min(3);
    let values = cells.flat_map(|cell| cell.chunks_exact(4).take(channels).map(float)).collect();
    let corner =
        |index: usize| DVec3::from_array([0, 1, 2].map(|axis| f64::from(f32::from_le_bytes(word(index + axis)))));
    let (low, high) = (corner(5), corner(8));
    let file_from_cube = DAffine3::from_translation(low) * DAffine3::from_scale(high - low);
    Ok(Numbers { size, channels, values, file_from_cube })
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    fn file(size: [i32; 3], channels: i32, values: &[f32]) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        [1, size[0], size[1], size[2], channels].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        [1.0f32, 2.0, 3.0, 2.0, 4.0, 6.0].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes
    }

    fn grid(size: [i32; 3], channels: i32, values: &[f32]) -> Result<Grid, VolumeError> {
        read(&file(size, channels, values), Blend::Linear).map(|volume| volume.grid)
    }

    #[test]
    fn values_have_their_places_and_channels() {
        let gray = grid([2, 1, 1], 1, &[1.0, 3.0]).unwrap();
        assert_eq!(gray.at(Vec3::new(0.75, 0.5, 0.5)), Vec3::splat(3.0));
        let colored = grid([1, 1, 2], 3, &[1.0, 2.0, 3.0, 3.0, 2.0, 5.0]).unwrap();
        assert_eq!(colored.at(Vec3::new(0.5, 0.5, 0.75)), Vec3::new(3.0, 2.0, 5.0));
        let six = grid([1, 1, 1], 6, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]).unwrap();
        assert_eq!(six.mean(), Vec3::new(1.0, 2.0, 3.0));
    }

    #[test]
    fn the_file_names_a_box() {
        let volume = read(&file([1, 1, 1], 1, &[1.0]), Blend::Linear).unwrap();
        assert_eq!(volume.file_from_cube.transform_point3(DVec3::ONE), DVec3::new(2.0, 4.0, 6.0));
    }

    #[test]
    fn a_header_that_cannot_be_true_is_an_error() {
        assert!(grid([i32::MAX; 3], 1, &[1.0]).is_err());
        assert!(grid([2, 2, 2], 1, &[1.0; 7]).is_err());
        assert!(grid([-1, 2, 2], 1, &[1.0; 7]).is_err());
        assert!(read(b"VOL\x03", Blend::Linear).is_err());
        for value in [f32::NAN, f32::INFINITY, 1e30] {
            let refused = grid([1, 1, 2], 1, &[1.0, value]).unwrap_err();
            assert_eq!(refused, VolumeError::NotNumber { byte: 52 });
        }
    }
}
