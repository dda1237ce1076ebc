//! Materials and textures of a scene as words that the shaders of `wgsl/` read, and those shaders.
//!
//! All surfaces of `bottega_render::bsdf` are there, function for function, with the same tables; the tests compare the two. The
//! library ([`source`]) has no bindings and no entry points: its user declares the storage arrays `material_words` and
//! `texture_words` of `u32`.

mod covers;
mod encode;
mod features;
mod sources;
mod surfaces;
mod textures;
mod word_buffer;
mod writer;

#[cfg(test)]
mod tests;

pub(crate) use encode::EncodedMaterials;
pub(crate) use features::Features;

pub(crate) use sources::source;
