//! A test that the files named in ARCHITECTURE.md and in the crates' tables *Modules* exist.

#[cfg(test)]
mod tests {
    use std::{
        fs,
        path::{Path, PathBuf},
    };

    /// The heading of a crate's table.
    const HEADING: &str = "//! # Modules";

    /// Returns words in backticks that are paths: they contain a slash, and only letters, digits, `.`, `_` and `-`. `NAME` stands
    /// for any name.
    fn paths(text: &str) -> impl Iterator<Item = &str> {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "._-/".contains(c);
        let is_path = move |word: &&str| {
            word.contains('/') && !word.starts_with('/') && word.chars().all(is_plain) && !word.contains("NAME")
        };
        text.split('`').skip(1).step_by(2).filter(is_path)
    }

    /// Returns the rows of a crate's table; `None`: it has no table.
    fn table(source: &Path) -> Option<String> {
        let text = fs::read_to_string(source).ok()?;
        let (_, after) = text.split_once(HEADING)?;
        let rows = after.lines().filter(|line| line.starts_with("//! |") || line.starts_with("//! -"));
        Some(rows.collect::<Vec<_>>().join("\n"))
    }

    /// True if a path exists relative to `folder`, the root, or the folder of crates.
    fn exists(path: &str, root: &Path, folder: &Path) -> bool {
        [folder, root, &root.join("crates")].iter().any(|from| from.join(path).exists())
    }

    #[test]
    fn the_files_that_maps_name_exist() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the root of the repository");
        let mut missing = Vec::new();
        let look = |text: &str, folder: &Path, map: &Path, missing: &mut Vec<String>| {
            for path in paths(text).filter(|path| !exists(path, root, folder)) {
                missing.push(format!("{}: `{path}`", map.strip_prefix(root).unwrap_or(map).display()));
            }
        };
        let page = root.join("ARCHITECTURE.md");
        look(&fs::read_to_string(&page).expect("a page"), root, &page, &mut missing);
        let crates: Vec<PathBuf> =
            fs::read_dir(root.join("crates")).expect("a folder").flatten().map(|entry| entry.path()).collect();
        assert!(crates.len() > 12, "{crates:?}");
        for folder in &crates {
            let mut sources = ["src/lib.rs", "src/main.rs"].map(|name| folder.join(name)).into_iter();
            let Some((source, table)) = sources.find_map(|source| Some((source.clone(), table(&source)?))) else {
                missing.push(format!("{}: no table `{HEADING}`", folder.display()));
                continue;
            };
            look(&table, folder, &source, &mut missing);
        }
        assert!(missing.is_empty(), "\n{}", missing.join("\n"));
    }
}
