//! A test of the first lines of modules: noun phrases that say what the module is.

mod tests {
    use std::{
        fs,
        path::{Path, PathBuf},
    };

    use crate::bars::root;

    /// Words that must not begin the first line.
    const RIDDLES: &[&str] = &["What", "How", "Where", "Who", "When", "Whether", "Which", "From"];

    fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() && !path.ends_with("target") {
                sources(&path, found);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                found.push(path);
            }
        }
    }

    #[test]
    fn the_first_line_of_a_module_names_what_it_is() {
        let mut files = Vec::new();
        for folder in ["crates", "xtask/src"] {
            sources(&root().join(folder), &mut files);
        }
        assert!(files.len() > 500, "{} files", files.len());
        let problems: Vec<String> = files
            .iter()
            .filter_map(|file| {
                let text = fs::read_to_string(file).unwrap();
                let head = text.lines().next()?.strip_prefix("//! ")?;
                let first = head.split(' ').next()?;
                RIDDLES.contains(&first).then(|| format!("{}: {head}", file.display()))
            })
            .collect();
        assert!(problems.is_empty(), "begin with the noun:\n{}", problems.join("\n"));
    }
}
