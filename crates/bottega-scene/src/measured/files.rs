//! The measured materials that a scene refers to.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::material::Measured;
use super::read::read;
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::file::read_file;
use crate::resource::{Location, Resources};

/// Measured materials by the name of their file. Surfaces of one file share its tables.
#[derive(Debug, Default)]
pub(crate) struct MeasuredFiles {
    known: BTreeMap<String, Arc<Measured>>,
}

impl MeasuredFiles {
    /// Reads the material of a file, once.
    pub(crate) fn get(&mut self, resources: &Resources<'_>, location: &Location) -> Result<Arc<Measured>, SceneError> {
        if let Some(known) = self.known.get(&location.name) {
            return Ok(Arc::clone(known));
        }
        let bytes = resources.read(location)?;
        let read = read(location.path(), &bytes, resources.budget());
        let measured = Arc::new(resources.attribute(location, read)?);
        self.known.insert(location.name.clone(), Arc::clone(&measured));
        Ok(measured)
    }
}

impl Measured {
    /// Reads a `.bsdf` file.
    ///
    /// - `max_memory_bytes`: limit of the file and of its tables, in bytes.
    ///
    /// # Errors
    /// The file cannot be read, is not a measured material, is damaged or too large.
    pub fn read(path: &Path, max_memory_bytes: usize) -> Result<Self, SceneError> {
        let budget = MemoryBudget::new(max_memory_bytes);
        read(path, &read_file(path, &budget)?, &budget)
    }
}
