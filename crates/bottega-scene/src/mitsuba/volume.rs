//! Grids of Mitsuba's `gridvolume`: only their mean is asked for.

use glam::{DVec3, Vec3};

/// The mean of the values of a `.vol` file of version 3 with floats, in one channel or three.
pub(super) fn mean(bytes: &[u8]) -> Result<Vec3, &'static str> {
    const HEADER_BYTES: usize = 48;
    if !bytes.starts_with(b"VOL\x03") {
        return Err("it does not begin like a grid of version 3");
    }
    let Some((header, values)) = bytes.split_at_checked(HEADER_BYTES) else {
        return Err("it ends within its header");
    };
    let integer = |index: usize| {
        let at = 4 + 4 * index;
        header.get(at..at + 4).and_then(|bytes| bytes.try_into().ok()).map_or(0, i32::from_le_bytes)
    };
    if integer(0) != 1 {
        return Err("its values are no floats");
    }
    let channels = integer(4);
    if channels != 1 && channels != 3 && channels != 6 {
        return Err("it has neither one channel nor three");
    }
    let cells = [1, 2, 3].iter().try_fold(channels as usize, |product, &index| {
        usize::try_from(integer(index)).ok().and_then(|size| product.checked_mul(size))
    });
    let Some(count) = cells.filter(|&count| count > 0 && count <= values.len() / 4) else {
        return Err("it is shorter than its header says");
    };
    let channels = channels as usize;
    let mut sum = DVec3::ZERO;
    for cell in values[..4 * count].chunks_exact(4 * channels) {
        let value = |channel: usize| {
            let at = 4 * if channels == 1 { 0 } else { channel };
            let value = f32::from_le_bytes([cell[at], cell[at + 1], cell[at + 2], cell[at + 3]]);
            if value.is_finite() { f64::from(value) } else { 0.0 }
        };
        sum += DVec3::new(value(0), value(1), value(2));
    }
    Ok((sum / (count / channels) as f64).as_vec3())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(size: [i32; 3], channels: i32, values: &[f32]) -> Vec<u8> {
        let mut bytes = b"VOL\x03".to_vec();
        [1, size[0], size[1], size[2], channels].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes.extend([0u8; 24]);
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        bytes
    }

    #[test]
    fn the_mean_is_taken_of_each_channel() {
        assert_eq!(mean(&grid([2, 1, 1], 1, &[1.0, 3.0])), Ok(Vec3::splat(2.0)));
        assert_eq!(mean(&grid([1, 1, 2], 3, &[1.0, 2.0, 3.0, 3.0, 2.0, 5.0])), Ok(Vec3::new(2.0, 2.0, 4.0)));
    }

    #[test]
    fn a_header_that_cannot_be_true_is_an_error() {
        assert!(mean(&grid([i32::MAX; 3], 1, &[1.0])).is_err());
        assert!(mean(&grid([2, 2, 2], 1, &[1.0; 7])).is_err());
        assert!(mean(&grid([-1, 2, 2], 1, &[1.0; 7])).is_err());
        assert!(mean(b"VOL\x03").is_err());
    }
}
