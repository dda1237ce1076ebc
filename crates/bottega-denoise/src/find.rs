//! The search for the library.

use std::{
    env,
    path::{Path, PathBuf},
};

use crate::{DenoiseError, library::Library};

/// Environment variable with the library's file, or a folder that contains it.
pub const VARIABLE: &str = "BOTTEGA_OIDN";

/// File names of the library, newest first.
const NAMES: &[&str] = if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib", "libOpenImageDenoise.1.dylib"]
} else if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so", "libOpenImageDenoise.so.1"]
};
/// Subfolders in which archives and package managers put the library.
const FOLDERS: [&str; 4] = ["", "lib", "lib64", "bin"];

/// Returns advice on installing the library on this system, as one clause for messages.
pub fn install_hint() -> String {
    let way = if cfg!(target_os = "macos") {
        "brew install open-image-denoise"
    } else if cfg!(windows) {
        "take the archive for Windows from https://www.openimagedenoise.org"
    } else {
        "install your system's package of Open Image Denoise, if it has one (Debian 12 has none), or unpack the archive for \
         Linux from https://www.openimagedenoise.org"
    };
    format!("{way}; if it is not found, set {VARIABLE} to its file or folder")
}

/// Loads the library: from the place in [`VARIABLE`], else from the system's.
pub(crate) fn library() -> Result<Library, DenoiseError> {
    match env::var_os(VARIABLE).filter(|value| !value.is_empty()) {
        Some(place) => named(Path::new(&place)),
        None => usual(),
    }
}

/// Loads the library from a file or folder given by the user.
fn named(place: &Path) -> Result<Library, DenoiseError> {
    if place.is_file() {
        return Library::open(place);
    }
    let files = FOLDERS.iter().flat_map(|folder| NAMES.iter().map(move |name| place.join(folder).join(name)));
    match files.into_iter().find(|file| file.is_file()) {
        Some(file) => Library::open(&file),
        None => Err(DenoiseError::NotFound {
            tried: format!("{VARIABLE} is `{}`, which contains no {}", place.display(), NAMES.join(", ")),
        }),
    }
}

/// Loads the library from the search path of the system.
fn usual() -> Result<Library, DenoiseError> {
    // An unusable library that was found is reported in preference to a missing one.
    let mut homebrew = Vec::new();
    if cfg!(target_os = "macos") {
        let lib = ["/opt/homebrew/lib", "/usr/local/lib"];
        homebrew = lib.iter().flat_map(|folder| NAMES.iter().map(|name| Path::new(folder).join(name))).collect();
    }
    let places: Vec<PathBuf> = NAMES.iter().map(PathBuf::from).chain(homebrew).collect();
    let mut unfit = None;
    for place in &places {
        match Library::open(place) {
            Ok(library) => return Ok(library),
            Err(error @ DenoiseError::Unfit { .. }) => unfit = unfit.or(Some(error)),
            Err(_) => {}
        }
    }
    Err(unfit.unwrap_or_else(|| DenoiseError::NotFound { tried: format!("no {} in the system", NAMES.join(", ")) }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_without_the_library_and_a_file_of_another_kind_are_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = named(folder.path()).expect_err("nothing there").to_string();
        assert!(missing.contains("not installed") && missing.contains(NAMES[0]), "{missing}");
        let file = folder.path().join("lib").join(NAMES[0]);
        std::fs::create_dir(folder.path().join("lib")).expect("a folder");
        std::fs::write(&file, "no library").expect("written");
        for place in [file.as_path(), folder.path()] {
            let unfit = named(place).expect_err("no library");
            assert!(matches!(&unfit, DenoiseError::Unfit { path, .. } if *path == file), "{unfit}");
        }
        assert!(install_hint().contains(VARIABLE));
    }
}
