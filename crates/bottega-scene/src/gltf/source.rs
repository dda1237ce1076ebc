//! The shared context of the importer.

use std::fmt::Display;
use std::path::Path;

use glam::DVec3;

use super::accessor::Bytes;
use super::document::Document;
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::options::LoadOptions;
use crate::resource::Resources;
use crate::text::shortened;

/// The document, its bytes and the options.
pub(super) struct GltfSource<'a> {
    /// Path of the scene file.
    pub(super) path: &'a Path,
    pub(super) document: &'a Document,
    /// Contents of the buffers.
    pub(super) bytes: Bytes<'a>,
    pub(super) options: &'a LoadOptions,
    /// Selected material variant (KHR_materials_variants).
    pub(super) variant: Option<usize>,
    pub(super) budget: &'a MemoryBudget,
    pub(super) resources: &'a Resources<'a>,
    /// Offset that is subtracted from all world positions.
    pub(super) origin: DVec3,
}

impl GltfSource<'_> {
    /// Makes an error at a location of the document.
    pub(super) fn invalid(&self, place: impl Into<String>, problem: impl Display) -> SceneError {
        SceneError::Invalid { path: self.path.into(), place: place.into(), problem: problem.to_string() }
    }

    /// Returns the index of a selected part, by its name or else its number.
    pub(super) fn by_name<'n>(
        &self,
        what: &'static str,
        wanted: &str,
        names: impl Iterator<Item = &'n str>,
    ) -> Result<usize, SceneError> {
        const SHOWN: usize = 20;
        let names: Vec<&str> = names.collect();
        let by_number = || wanted.parse().ok().filter(|&number| number < names.len());
        names.iter().position(|&name| name == wanted).or_else(by_number).ok_or_else(|| {
            let shown = names.iter().take(SHOWN).enumerate();
            let mut known: Vec<String> =
                shown.map(|(number, name)| format!("{number} `{}`", shortened(name))).collect();
            if names.len() > SHOWN {
                known.push("…".into());
            }
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            SceneError::NoSuch { path: self.path.into(), what, wanted: shortened(wanted).into_owned(), known }
        })
    }

    /// Returns the size of all buffers, in bytes: an upper bound of any valid count.
    pub(super) fn buffer_bytes(&self) -> usize {
        let decompressed = self.bytes.decompressed.iter().flatten().map(Vec::len);
        self.bytes.buffers.iter().map(|buffer| buffer.len()).chain(decompressed).sum()
    }
}
