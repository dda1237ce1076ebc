//! Reading of little-endian numbers from bytes.

use super::error::VoxelError;

/// A place in a file's bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct ByteCursor<'a> {
    bytes: &'a [u8],
    place: usize,
}

impl<'a> ByteCursor<'a> {
    /// Begins at a place, which may lie behind the end.
    pub(super) fn new(bytes: &'a [u8], place: usize) -> Self {
        Self { bytes, place }
    }

    /// Returns the place, in bytes from the begin.
    pub(super) fn place(&self) -> usize {
        self.place
    }

    /// Returns the same bytes from a later place; `None`: it is earlier, or behind the end.
    pub(super) fn moved_forward(self, place: usize) -> Option<Self> {
        (place >= self.place && place <= self.bytes.len()).then_some(Self { place, ..self })
    }

    /// Takes the next bytes. `what`: what they belong to, for the message.
    pub(super) fn take(&mut self, count: usize, what: &'static str) -> Result<&'a [u8], VoxelError> {
        let rest = self.bytes.get(self.place..).unwrap_or_default();
        let Some(taken) = rest.get(..count) else { return Err(VoxelError::End { place: self.bytes.len(), what }) };
        self.place += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &'static str) -> Result<[u8; N], VoxelError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, what)?);
        Ok(array)
    }

    pub(super) fn u8(&mut self, what: &'static str) -> Result<u8, VoxelError> {
        Ok(self.array::<1>(what)?[0])
    }

    pub(super) fn u16(&mut self, what: &'static str) -> Result<u16, VoxelError> {
        self.array(what).map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self, what: &'static str) -> Result<u32, VoxelError> {
        self.array(what).map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self, what: &'static str) -> Result<i32, VoxelError> {
        self.array(what).map(i32::from_le_bytes)
    }

    pub(super) fn u64(&mut self, what: &'static str) -> Result<u64, VoxelError> {
        self.array(what).map(u64::from_le_bytes)
    }

    pub(super) fn i64(&mut self, what: &'static str) -> Result<i64, VoxelError> {
        self.array(what).map(i64::from_le_bytes)
    }

    pub(super) fn f32(&mut self, what: &'static str) -> Result<f32, VoxelError> {
        self.array(what).map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self, what: &'static str) -> Result<f64, VoxelError> {
        self.array(what).map(f64::from_le_bytes)
    }

    /// Takes several numbers.
    pub(super) fn f64s<const N: usize>(&mut self, what: &'static str) -> Result<[f64; N], VoxelError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            *number = self.f64(what)?;
        }
        Ok(numbers)
    }

    /// Takes three numbers.
    pub(super) fn i32s(&mut self, what: &'static str) -> Result<[i32; 3], VoxelError> {
        Ok([self.i32(what)?, self.i32(what)?, self.i32(what)?])
    }

    /// Takes a text behind its length.
    pub(super) fn text(&mut self, what: &'static str) -> Result<String, VoxelError> {
        let length = self.u32(what)?;
        Ok(String::from_utf8_lossy(self.take(length as usize, what)?).into_owned())
    }
}

/// Returns true if bit `index` of a mask is set; bits of a byte from the lowest.
pub(super) fn is_set(mask: &[u8], index: usize) -> bool {
    mask[index / 8] >> (index % 8) & 1 == 1
}

/// Counts the bits of a mask that are set.
pub(super) fn count_set(mask: &[u8]) -> usize {
    mask.iter().map(|byte| byte.count_ones() as usize).sum()
}
