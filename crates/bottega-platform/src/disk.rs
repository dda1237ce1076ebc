//! Space on a disk.

use std::path::Path;

/// The space of a disk, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DiskSpace {
    /// Free space available to this user, in bytes.
    pub free: u64,
    /// Total space, in bytes.
    pub total: u64,
}

/// Returns the space on the disk of a folder; `None`: the folder does not exist, or the system does not report the space.
#[cfg(unix)]
pub fn space(folder: &Path) -> Option<DiskSpace> {
    let statistics = rustix::fs::statvfs(folder).ok()?;
    let bytes = |blocks: u64| blocks.saturating_mul(statistics.f_frsize);
    Some(DiskSpace { free: bytes(statistics.f_bavail), total: bytes(statistics.f_blocks) })
}

/// Returns the space on the disk of a folder: the disk mounted at the longest part of its path. `None`: the system does not
/// report it.
#[cfg(not(unix))]
pub fn space(folder: &Path) -> Option<DiskSpace> {
    let folder = std::path::absolute(folder).ok()?;
    let disks = sysinfo::Disks::new_with_refreshed_list().ok()?;
    let of_folder = disks.iter().filter(|disk| folder.starts_with(disk.mount_point()));
    let disk = of_folder.max_by_key(|disk| disk.mount_point().as_os_str().len())?;
    Some(DiskSpace { free: disk.available_space(), total: disk.total_space() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_has_room_and_no_more_than_all_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let space = space(folder.path()).expect("every system that is known tells");
        assert!(space.total > 0 && space.free <= space.total, "{space:?}");
    }
}
