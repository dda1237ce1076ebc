//! Parts that the importers share, whatever the format: each importer only translates its own syntax and parameters.

pub(crate) mod bezier;
pub(crate) mod merge;
pub(crate) mod path;
pub(crate) mod placed_meshes;
pub(crate) mod projector;
pub(crate) mod request;
pub(crate) mod sphere;
pub(crate) mod strand;
pub(crate) mod sun_sky;
pub(crate) mod text_place;
pub(crate) mod tube;
