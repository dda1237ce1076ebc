//! Input and output of an importer.

use std::path::Path;

use glam::DVec3;

use crate::hints::{Metadata, RenderHints};
use crate::model::Scene;
use crate::options::LoadOptions;
use crate::resource::Resources;

/// The input of an importer.
pub(crate) struct ImportRequest<'a> {
    /// Path of the scene file.
    pub(crate) path: &'a Path,
    /// Bytes of the scene file.
    pub(crate) file: &'a [u8],
    pub(crate) options: &'a LoadOptions,
    /// Subtracted from all world positions before they are rounded to single precision. 0, except for scenes far from
    /// the origin.
    pub(crate) origin: DVec3,
    /// Access to the files that the scene refers to.
    pub(crate) resources: &'a Resources<'a>,
}

/// The output of an importer. The scene may lack lights and cameras.
pub(crate) type ImportOutput = (Scene, Metadata, RenderHints);
