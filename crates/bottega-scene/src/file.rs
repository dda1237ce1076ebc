//! Reading of whole regular files.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::budget::MemoryBudget;
use crate::error::SceneError;

/// Reads a regular file. Rejects folders, devices and pipes (which might never end), and files larger than the scene's
/// memory limit.
pub(crate) fn read_file(path: &Path, budget: &MemoryBudget) -> Result<Vec<u8>, SceneError> {
    let read = |source| SceneError::Read { path: path.to_path_buf(), by: String::new(), source };
    let metadata = std::fs::metadata(path).map_err(read)?;
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(SceneError::NotAFile { path: path.to_path_buf(), by: String::new(), found });
    }
    let length = usize::try_from(metadata.len()).unwrap_or(usize::MAX);
    budget.check(path, length)?;
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(length).map_err(|_| read(std::io::ErrorKind::OutOfMemory.into()))?;
    // Read no more than the length above, even if the file grows meanwhile.
    let file = File::open(path).map_err(read)?;
    file.take(metadata.len()).read_to_end(&mut bytes).map_err(read)?;
    Ok(bytes)
}

/// Returns the BLAKE3 hash of a file, computed by several threads if it is long.
pub(crate) fn hash(bytes: &[u8]) -> blake3::Hash {
    const LONG: usize = 1 << 18;
    if bytes.len() < LONG { blake3::hash(bytes) } else { blake3::Hasher::new().update_rayon(bytes).finalize() }
}
