//! Words of 32 bits, written one after the other.

use bottega_scene::Spectrum;

/// A growing array of words. Places are told by their index.
#[derive(Debug, Default)]
pub(super) struct Words(pub(super) Vec<u32>);

impl Words {
    pub(super) fn place(&self) -> usize {
        self.0.len()
    }

    pub(super) fn word(&mut self, word: u32) {
        self.0.push(word);
    }

    /// A number that is not finite becomes 0.
    pub(super) fn number(&mut self, number: f32) {
        self.0.push(if number.is_finite() { number } else { 0.0 }.to_bits());
    }

    pub(super) fn numbers(&mut self, numbers: &[f32]) {
        numbers.iter().for_each(|&number| self.number(number));
    }

    pub(super) fn color(&mut self, color: Spectrum) {
        self.numbers(&color.to_array());
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
