//! Words of 32 bits, written one after the other.

use bottega_render::flat::Portable;

/// A growing array of words. Places are told by their index.
#[derive(Debug, Default)]
pub(super) struct Words(pub(super) Vec<u32>);

impl Words {
    pub(super) fn place(&self) -> usize {
        self.0.len()
    }

    /// Appends a record; returns its place.
    pub(super) fn record(&mut self, record: &impl Portable) -> u32 {
        let place = self.place() as u32;
        record.put(&mut self.0);
        place
    }

    /// Writes a record where there is room for it.
    pub(super) fn put(&mut self, place: usize, record: &impl Portable) {
        let mut words = Vec::new();
        record.put(&mut words);
        self.0[place..place + words.len()].copy_from_slice(&words);
    }

    /// Numbers that are not finite become 0.
    pub(super) fn numbers(&mut self, numbers: &[f32]) {
        self.0.extend(numbers.iter().map(|&number| finite(number).to_bits()));
    }

    /// Zeros up to a multiple of `unit` words.
    pub(super) fn align(&mut self, unit: usize) {
        self.0.resize(self.0.len().next_multiple_of(unit), 0);
    }

    /// Zeros up to that place.
    pub(super) fn fill_to(&mut self, place: usize) {
        self.0.resize(place, 0);
    }
}

/// A number, or 0 where it is not finite.
pub(super) fn finite(number: f32) -> f32 {
    if number.is_finite() { number } else { 0.0 }
}
