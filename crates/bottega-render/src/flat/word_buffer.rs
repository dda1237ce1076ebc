//! A growing array of words.

use bottega_scene::TextureMap;
use glam::{Vec2, Vec3, Vec4};

use super::Portable;

/// A growing array of words, and the pictures whose handles belong into some of them.
#[derive(Debug, Default)]
pub(super) struct WordBuffer(Vec<u32>, Vec<(u32, TextureMap)>);

impl WordBuffer {
    /// Creates an array that starts with `count` zero words.
    pub(super) fn with_header(count: usize) -> Self {
        Self(vec![0; count], Vec::new())
    }

    /// Returns the words, and the pictures with the offsets of their handles.
    pub(super) fn into_inner(self) -> (Vec<u32>, Vec<(u32, TextureMap)>) {
        (self.0, self.1)
    }

    /// Returns the offset of the next word.
    pub(super) fn place(&self) -> u32 {
        self.0.len() as u32
    }

    /// Sets a word of the header.
    pub(super) fn head(&mut self, place: usize, word: u32) {
        self.0[place] = word;
    }

    /// Appends floats by their bits.
    pub(super) fn numbers(&mut self, numbers: &[f32]) {
        self.0.extend(numbers.iter().map(|number| number.to_bits()));
    }

    /// Appends words to the table.
    pub(super) fn words(&mut self, words: &[u32]) {
        self.0.extend_from_slice(words);
    }

    /// Writes a record; returns its offset.
    pub(super) fn record(&mut self, record: &impl Portable) -> u32 {
        let place = self.place();
        record.put(&mut self.0);
        place
    }

    /// Registers the word at `place` as the handle of a picture.
    pub(super) fn picture(&mut self, place: u32, map: TextureMap) {
        self.1.push((place, map));
    }

    pub(super) fn vec2(&mut self, v: Vec2) {
        self.numbers(&v.to_array());
    }

    pub(super) fn vec3(&mut self, v: Vec3) {
        self.numbers(&v.to_array());
    }

    pub(super) fn vec4(&mut self, v: Vec4) {
        self.numbers(&v.to_array());
    }
}
