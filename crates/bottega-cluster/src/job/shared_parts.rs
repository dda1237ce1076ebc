//! The stored parts of a picture's shared preparation: a notice for each part, and a blob with its result.
//!
//! The machines of a job trace photons and place lighting agents in such parts: see [`together`](crate::machine::together).

use std::collections::BTreeSet;

use crate::job::board::JobBoard;

/// Returns the works with data here. A slow machine may have written it after the end of the job.
pub(crate) fn works(board: &JobBoard) -> BTreeSet<u64> {
    let notices = board.uplink.notices().all("cast/");
    notices.iter().filter_map(|notice| notice.name.split('/').nth(1)?.parse().ok()).collect()
}

/// Deletes the shared parts of a finished picture.
pub(crate) fn forget(board: &JobBoard, work: u64) {
    let prefix = format!("cast/{work}/");
    for notice in board.uplink.notices().all(&prefix) {
        board.uplink.blobs().forget(&format!("job-{work}/{}", notice.name.replacen(&format!("/{work}/"), "/", 1)));
        if let Err(error) = board.uplink.notices().remove(&notice.name) {
            tracing::debug!(%error, "cannot remove a notice");
        }
    }
}

/// Returns the notice of a part of a stage.
pub(crate) fn part_name(work: u64, stage: u32, part: u32) -> String {
    format!("cast/{work}/{stage}/{part}")
}

/// Returns the blob with the result of a part of a stage.
pub(crate) fn part_blob(work: u64, stage: u32, part: u32) -> String {
    format!("job-{work}/cast/{stage}/{part}")
}
