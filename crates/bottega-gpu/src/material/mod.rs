//! Materials and textures of a scene as words that the shaders of `wgsl/` read, and these shaders.
//!
//! All surfaces of `bottega_render::bsdf` are there, function for function, with the same tables; the tests hold the two
//! together. The library ([`source`]) has no bindings and no entry points: who uses it declares `material_words` and `texture_words`, arrays
//! of `u32` in storage.

mod covers;
mod encode;
mod features;
mod sources;
mod surfaces;
mod textures;
mod words;
mod writer;

#[cfg(test)]
mod tests;

pub(crate) use encode::EncodedMaterials;
pub(crate) use features::Features;

pub(crate) use sources::source;
