//! The input and output of an importer.

use std::path::Path;

use glam::DVec3;

use crate::resource::Resources;
use crate::{LoadOptions, Metadata, RenderHints, Scene};

/// What an importer is given.
pub(crate) struct ImportRequest<'a> {
    /// The scene file.
    pub(crate) path: &'a Path,
    /// Its bytes.
    pub(crate) file: &'a [u8],
    pub(crate) options: &'a LoadOptions,
    /// What is taken from all places of the world before they are rounded to single precision; 0 but for scenes far away.
    pub(crate) origin: DVec3,
    /// What it refers to.
    pub(crate) resources: &'a Resources<'a>,
}

/// What an importer makes. Lights and cameras may be missing from the scene.
pub(crate) type Imported = (Scene, Metadata, RenderHints);
