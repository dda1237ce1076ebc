//! The file of a mesh reader, for errors and memory.

use std::path::Path;

use bytemuck::Pod;

use super::lines::LocatedFault;
use crate::budget::MemoryBudget;
use crate::error::SceneError;

/// The file that is being read, for errors and for the memory budget.
#[derive(Clone, Copy)]
pub(super) struct MeshSource<'a> {
    pub(super) path: &'a Path,
    pub(super) budget: &'a MemoryBudget,
}

impl MeshSource<'_> {
    /// Makes an error at a location within the file.
    pub(super) fn invalid(&self, place: impl Into<String>, problem: impl Into<String>) -> SceneError {
        SceneError::Invalid { path: self.path.into(), place: place.into(), problem: problem.into() }
    }

    /// Makes an error at a line and column.
    pub(super) fn located(&self, LocatedFault { line, column, problem }: LocatedFault) -> SceneError {
        SceneError::Text { path: self.path.into(), line, column, problem }
    }

    /// Makes an error for a damaged file.
    pub(super) fn damaged(&self, problem: impl Into<String>) -> SceneError {
        SceneError::Damaged { path: self.path.into(), problem: problem.into() }
    }

    /// Books and allocates zeroed memory. The caller has checked that the file can hold that many.
    pub(super) fn zeroed<T: Pod>(&self, count: usize) -> Result<Vec<T>, SceneError> {
        self.budget.take(self.path, "", count.saturating_mul(size_of::<T>()))?;
        // The system's zero pages are first touched by the threads that fill them.
        bytemuck::allocation::try_zeroed_vec(count).map_err(|()| SceneError::Read {
            path: self.path.into(),
            by: String::new(),
            source: std::io::ErrorKind::OutOfMemory.into(),
        })
    }
}
