//! Read permissions of files.

use std::{fs, io, path::Path};

/// Restricts a file or a folder to the user: mode 0600 or 0700. Changes nothing on Windows, where a user's profile is private.
///
/// # Errors
/// The path does not exist, or the system refuses the change.
pub fn make_private(path: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = if fs::metadata(path)?.is_dir() { 0o700 } else { 0o600 };
        fs::set_permissions(path, fs::Permissions::from_mode(mode))
    }
    #[cfg(not(unix))]
    fs::metadata(path).map(drop)
}

/// Returns the permissions to create a file with, 0666, so that the system applies the user's umask to them; `None`: the system
/// has no umask.
pub fn by_mask() -> Option<fs::Permissions> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        Some(fs::Permissions::from_mode(0o666))
    }
    #[cfg(not(unix))]
    None
}

/// Returns true if every user may read a file; false if it does not exist. On Windows true for every existing file.
pub fn is_for_all(path: &Path) -> bool {
    let Ok(found) = fs::metadata(path) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        found.permissions().mode() & 0o004 != 0
    }
    #[cfg(not(unix))]
    {
        drop(found);
        true
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn what_is_private_is_read_by_its_user_alone() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("secret");
        fs::write(&file, "x").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o644)).unwrap();
        assert!(is_for_all(&file));
        make_private(&file).unwrap();
        make_private(folder.path()).unwrap();
        assert!(!is_for_all(&file) && !is_for_all(&folder.path().join("none")));
        assert_eq!(fs::metadata(folder.path()).unwrap().permissions().mode() & 0o777, 0o700);
        assert!(make_private(&folder.path().join("none")).is_err());
    }
}
