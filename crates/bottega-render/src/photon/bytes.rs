//! The byte form of photon maps, for other machines that render the same picture: four-byte numbers, little-endian.

use glam::Vec3;

use super::{
    map::PhotonMap,
    record::{Mark, Photon},
};

/// Bytes being written.
#[derive(Debug, Default)]
pub(crate) struct Writer(pub(crate) Vec<u8>);

/// Bytes being read, from an untrusted source.
#[derive(Debug)]
pub(crate) struct Reader<'a>(pub(crate) &'a [u8]);

/// A value that can be sent to other machines.
pub(crate) trait ByteForm: Sized {
    /// Appends the value to `to`.
    fn write(&self, to: &mut Writer);

    /// Reads a value from `from`; `None`: the bytes are not a valid one.
    fn read(from: &mut Reader<'_>) -> Option<Self>;
}

impl Writer {
    /// Writes a four-byte number.
    pub(crate) fn number(&mut self, number: u32) {
        self.0.extend(number.to_le_bytes());
    }

    /// Writes an eight-byte number.
    pub(crate) fn long(&mut self, number: u64) {
        self.0.extend(number.to_le_bytes());
    }

    /// Writes a floating-point number by its bits.
    pub(crate) fn value(&mut self, value: f32) {
        self.number(value.to_bits());
    }

    /// Writes a vector: x, y, z.
    pub(crate) fn vector(&mut self, vector: Vec3) {
        vector.to_array().into_iter().for_each(|value| self.value(value));
    }

    /// Writes a map: the number of photons, the planes of the tree, and the photons in the order of their numbers.
    pub(crate) fn map(&mut self, map: &PhotonMap) {
        self.number(map.len() as u32);
        for (plane, axis) in map.planes() {
            self.value(plane);
            self.number(axis);
        }
        map.iter().for_each(|photon| self.photon(&photon));
    }

    fn photon(&mut self, photon: &Photon) {
        self.vector(photon.p);
        photon.mark().to_numbers().into_iter().for_each(|number| self.number(number));
    }

    /// Writes the count of the numbers, and the numbers.
    pub(crate) fn numbers(&mut self, numbers: &[u32]) {
        self.number(numbers.len() as u32);
        numbers.iter().for_each(|&number| self.number(number));
    }

    /// Writes the count of the photons, and the photons.
    pub(crate) fn photons(&mut self, photons: &[Photon]) {
        self.number(photons.len() as u32);
        photons.iter().for_each(|photon| self.photon(photon));
    }
}

/// Size of a photon, in bytes.
const PHOTON_BYTES: usize = 24;

impl Reader<'_> {
    /// Reads a number; `None`: no bytes left.
    pub(crate) fn number(&mut self) -> Option<u32> {
        let (first, rest) = self.0.split_first_chunk::<4>()?;
        self.0 = rest;
        Some(u32::from_le_bytes(*first))
    }

    /// Reads an eight-byte number; `None`: no bytes left.
    pub(crate) fn long(&mut self) -> Option<u64> {
        let (first, rest) = self.0.split_first_chunk::<8>()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*first))
    }

    /// Reads a floating-point number; `None`: not finite.
    pub(crate) fn value(&mut self) -> Option<f32> {
        self.number().map(f32::from_bits).filter(|value| value.is_finite())
    }

    /// Reads a vector; `None`: not finite.
    pub(crate) fn vector(&mut self) -> Option<Vec3> {
        Some(Vec3::new(self.value()?, self.value()?, self.value()?))
    }

    /// Reads the count of a list; `None`: not enough bytes left for it.
    ///
    /// - `size`: least bytes per element.
    pub(crate) fn count(&mut self, size: usize) -> Option<usize> {
        let count = self.number()? as usize;
        (count.checked_mul(size)? <= self.0.len()).then_some(count)
    }

    fn photon(&mut self) -> Option<(Vec3, [u32; 3])> {
        Some((self.vector()?, [self.number()?, self.number()?, self.number()?]))
    }

    /// Reads a list of numbers; `None`: not valid.
    pub(crate) fn numbers(&mut self) -> Option<Vec<u32>> {
        let count = self.count(size_of::<u32>())?;
        (0..count).map(|_| self.number()).collect()
    }

    /// Reads a list of photons; `None`: not valid.
    pub(crate) fn photons(&mut self) -> Option<Vec<Photon>> {
        let count = self.count(PHOTON_BYTES)?;
        (0..count).map(|_| self.photon().map(|(p, numbers)| Photon::of(p, Mark::from_numbers(numbers)))).collect()
    }

    /// Reads a photon map; `None`: not valid.
    pub(crate) fn map(&mut self) -> Option<PhotonMap> {
        let count = self.count(PHOTON_BYTES)?;
        let planes =
            (0..PhotonMap::plane_count(count)).map(|_| Some((self.value()?, self.number()?))).collect::<Option<_>>()?;
        let photons = (0..count).map(|_| self.photon()).collect::<Option<_>>()?;
        PhotonMap::from_parts(planes, photons)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A list of one photon at a position.
    fn photon_at(position: [f32; 3]) -> Vec<u8> {
        let numbers = position.map(f32::to_bits);
        [1].into_iter().chain(numbers).chain([0; 3]).flat_map(u32::to_le_bytes).collect()
    }

    #[test]
    fn positions_that_are_not_finite_are_refused() {
        assert_eq!(Reader(&photon_at([0.5; 3])).photons().map(|photons| photons.len()), Some(1));
        for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert!(Reader(&wrong.to_le_bytes()).value().is_none());
            for axis in 0..3 {
                let mut position = [0.5; 3];
                position[axis] = wrong;
                assert!(Reader(&photon_at(position)).photons().is_none(), "{position:?}");
            }
        }
    }
}
