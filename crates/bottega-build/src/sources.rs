//! The digest of a program's sources.

use std::{
    fs,
    path::{Path, PathBuf},
};

/// The places of the sources, relative to the root of the workspace.
pub(crate) const PLACES: [&str; 5] = ["Cargo.toml", "Cargo.lock", "crates", "rules", "engines"];
/// The folders of a crate that are not part of the program.
const NOT_OF_PROGRAM: [&str; 3] = ["tests", "benches", "examples"];
/// The number of hexadecimal digits of the digest.
const DIGITS: usize = 12;

/// Returns the digest of the sources below `root` as hexadecimal digits, independent of their location and of line endings.
///
/// - `without`: crates to leave out.
///
/// # Errors
/// A file or folder cannot be read: the text names it.
pub(crate) fn digest(root: &Path, without: &[&str]) -> Result<String, String> {
    let mut files = Vec::new();
    for place in PLACES {
        gather(&root.join(place), &mut files)?;
    }
    let crates = root.join("crates");
    files.retain(|file| !without.iter().any(|name| !name.is_empty() && file.starts_with(crates.join(name))));
    files.sort();
    let mut hasher = blake3::Hasher::new();
    for path in &files {
        let bytes = fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
        let bytes = with_plain_line_ends(bytes);
        let name = path.strip_prefix(root).unwrap_or(path).to_string_lossy().replace('\\', "/");
        hasher.update(format!("{name}\n{}\n", bytes.len()).as_bytes()).update(&bytes);
    }
    Ok(hasher.finalize().to_hex()[..DIGITS].to_owned())
}

/// Collects the files at or below a place that are part of the program.
fn gather(place: &Path, files: &mut Vec<PathBuf>) -> Result<(), String> {
    let wrong = |error: std::io::Error| format!("cannot read {}: {error}", place.display());
    if place.is_file() {
        files.push(place.to_owned());
        return Ok(());
    }
    for entry in fs::read_dir(place).map_err(wrong)? {
        let path = entry.map_err(wrong)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        // Skip files of editors and interpreters.
        if !NOT_OF_PROGRAM.contains(&&*name) && !name.starts_with(['.', '_']) {
            gather(&path, files)?;
        }
    }
    Ok(())
}

/// Converts line endings of text files, which git may change at checkout; other files stay unchanged.
fn with_plain_line_ends(bytes: Vec<u8>) -> Vec<u8> {
    match String::from_utf8(bytes) {
        Ok(text) => text.replace("\r\n", "\n").into_bytes(),
        Err(error) => error.into_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, name: &str, text: &str) {
        let path = root.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    #[test]
    fn what_changes_the_program_changes_the_digest_and_nothing_else_does() {
        let folders = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let [one, two] = [&folders[0], &folders[1]].map(tempfile::TempDir::path);
        for (root, end) in [(one, "\n"), (two, "\r\n")] {
            for name in ["Cargo.toml", "Cargo.lock", "crates/a/src/lib.rs", "rules/a.fcl", "engines/a.toml"] {
                write(root, name, &format!("a{end}b{end}"));
            }
        }
        let before = digest(one, &[]).unwrap();
        assert_eq!(before.len(), DIGITS);
        assert_eq!(digest(two, &[]).unwrap(), before, "line ends make no difference");
        for name in ["README.md", "crates/a/tests/a.rs", "crates/a/.a.swp", "scenes/a.glb"] {
            write(one, name, "other");
            assert_eq!(digest(one, &[]).unwrap(), before, "{name}");
        }
        let mut seen = vec![before];
        for name in ["crates/a/src/lib.rs", "crates/a/src/new.wgsl", "rules/a.fcl", "Cargo.lock"] {
            write(one, name, "other");
            let now = digest(one, &[]).unwrap();
            assert!(!seen.contains(&now), "{name}");
            seen.push(now);
        }
        write(two, "crates/b/src/lib.rs", "above");
        assert_eq!(digest(two, &["b"]).unwrap(), seen[0], "a crate that is left out");
    }
}
