//! An array of words that grows.

use bottega_scene::TextureMap;
use glam::{Mat3, Vec2, Vec3, Vec4};

use super::NONE;

#[derive(Debug, Default)]
pub(crate) struct Words(Vec<u32>, Vec<(u32, TextureMap)>);

impl Words {
    pub(super) fn with_header(count: usize) -> Self {
        Self(vec![0; count], Vec::new())
    }

    /// The words, and pictures with the places of their numbers.
    pub(super) fn into_inner(self) -> (Vec<u32>, Vec<(u32, TextureMap)>) {
        (self.0, self.1)
    }

    /// The place of what is written next.
    pub(crate) fn place(&self) -> u32 {
        self.0.len() as u32
    }

    /// Writes a word of the header.
    pub(crate) fn head(&mut self, place: usize, word: u32) {
        self.0[place] = word;
    }

    pub(crate) fn word(&mut self, word: u32) {
        self.0.push(word);
    }

    pub(crate) fn flag(&mut self, flag: bool) {
        self.0.push(u32::from(flag));
    }

    pub(crate) fn number(&mut self, number: f32) {
        self.0.push(number.to_bits());
    }

    pub(crate) fn numbers(&mut self, numbers: &[f32]) {
        self.0.extend(numbers.iter().map(|number| number.to_bits()));
    }

    pub(crate) fn words(&mut self, words: &[u32]) {
        self.0.extend_from_slice(words);
    }

    /// A place for the number of a picture; [`NONE`] where there is none.
    pub(crate) fn picture(&mut self, map: Option<TextureMap>) {
        self.1.extend(map.map(|map| (self.place(), map)));
        self.word(NONE);
    }

    pub(crate) fn vec2(&mut self, v: Vec2) {
        self.numbers(&v.to_array());
    }

    pub(crate) fn vec3(&mut self, v: Vec3) {
        self.numbers(&v.to_array());
    }

    pub(crate) fn vec4(&mut self, v: Vec4) {
        self.numbers(&v.to_array());
    }

    /// Column by column.
    pub(crate) fn mat3(&mut self, m: Mat3) {
        self.numbers(&m.to_cols_array());
    }

    /// Zeros up to the end of a record that begins at `start`.
    pub(crate) fn fill(&mut self, start: u32, record: u32) {
        debug_assert!(self.place() <= start + record, "a record of {} words", self.place() - start);
        self.0.resize((start + record) as usize, 0);
    }
}
