//! A growing array of 32-bit words.

use bottega_render::flat::Portable;

/// A growing array of words. A place is an index into it.
#[derive(Debug, Default)]
pub(super) struct WordBuffer(pub(super) Vec<u32>);

impl WordBuffer {
    pub(super) fn place(&self) -> usize {
        self.0.len()
    }

    /// Appends a record and returns its place.
    pub(super) fn record(&mut self, record: &impl Portable) -> u32 {
        let place = self.place() as u32;
        record.put(&mut self.0);
        place
    }

    /// Writes a record over existing words.
    pub(super) fn put(&mut self, place: usize, record: &impl Portable) {
        let mut words = Vec::new();
        record.put(&mut words);
        self.0[place..place + words.len()].copy_from_slice(&words);
    }

    /// Appends numbers; those that are not finite become 0.
    pub(super) fn numbers(&mut self, numbers: &[f32]) {
        self.0.extend(numbers.iter().map(|&number| finite(number).to_bits()));
    }

    /// Appends zeros up to a multiple of `unit` words.
    pub(super) fn align(&mut self, unit: usize) {
        self.0.resize(self.0.len().next_multiple_of(unit), 0);
    }

    /// Appends zeros up to a place.
    pub(super) fn fill_to(&mut self, place: usize) {
        self.0.resize(place, 0);
    }
}

/// Returns the number, or 0 if it is not finite.
pub(super) fn finite(number: f32) -> f32 {
    if number.is_finite() { number } else { 0.0 }
}
