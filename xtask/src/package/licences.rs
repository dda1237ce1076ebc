//! The licences of everything compiled into the program, with their texts.

use std::{
    collections::BTreeMap,
    fmt::Write,
    fs,
    path::{Path, PathBuf},
};

use anyhow::{Result, bail};

use super::components::Component;
use crate::bars::root;

/// The prefixes of the names of licence files.
const NAMES: [&str; 6] = ["licen", "copying", "notice", "unlicense", "copyright", "eula"];
/// Texts for parts other than crates: the part, its licence in words, its file.
const OTHERS: [(&str, &str, &str); 1] = [(
    "the font DejaVu Sans (letters of charts)",
    "Bitstream Vera",
    "crates/bottega-cli/assets/LICENSE-DejaVuSans.txt",
)];

/// Returns all licences as one text: a list of crates, and each text once with the crates that it applies to.
///
/// # Errors
/// A crate has no text, and `packaging/licences` has none for it.
pub(super) fn text(components: &[Component]) -> Result<String> {
    let mut list = String::new();
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut missing = Vec::new();
    for component in components.iter().filter(|component| component.is_foreign()) {
        let name = format!("{} {}", component.package.name, component.package.version);
        // Writing to a `String` cannot fail.
        _ = writeln!(list, "{name}: {}", component.expression());
        let found = texts_of(component);
        if found.is_empty() {
            missing.push(format!("{name}: {}", component.expression()));
        }
        for text in found {
            texts.entry(text).or_default().push(name.clone());
        }
    }
    for (name, licence, file) in OTHERS {
        _ = writeln!(list, "{name}: {licence}");
        texts.entry(fs::read_to_string(root().join(file))?).or_default().push(name.to_owned());
    }
    if !missing.is_empty() {
        bail!("these crates have no licence text; lay one into packaging/licences/NAME.txt:\n{}", missing.join("\n"));
    }
    let mut whole = format!(
        "Bottega is MIT or Apache-2.0, as you like. The program holds code of others, under these licences.\n\n{list}"
    );
    let mut texts: Vec<(String, Vec<String>)> = texts.into_iter().collect();
    texts.sort_by(|a, b| a.1.cmp(&b.1));
    for (text, names) in texts {
        _ = write!(whole, "\n{}\n{}\n\n{}\n", "=".repeat(80), names.join(", "), text.trim_end());
    }
    Ok(whole)
}

/// Returns the texts of a crate: those in its archive; else the one in `packaging/licences`; else the standard text of its
/// licence.
fn texts_of(component: &Component) -> Vec<String> {
    let package = &component.package;
    let folder = package.manifest_path.as_std_path().parent().unwrap_or(Path::new("."));
    let mut files = licence_files(folder);
    files.extend(package.license_file.iter().map(|file| folder.join(file)));
    files.sort();
    files.dedup();
    let read = |file: &PathBuf| fs::read_to_string(file).ok().filter(|text| !text.trim().is_empty());
    let found: Vec<String> = files.iter().filter_map(read).collect();
    if !found.is_empty() {
        return found;
    }
    if let Ok(kept) = fs::read_to_string(root().join(format!("packaging/licences/{}.txt", package.name))) {
        return vec![kept];
    }
    let expression = component.expression();
    let is_choice = |name: &str| expression.split(" OR ").any(|part| part.trim_matches(['(', ')']) == name);
    if is_choice("Apache-2.0") {
        return fs::read_to_string(root().join("LICENSE-APACHE")).into_iter().collect();
    }
    if is_choice("MIT") && !package.authors.is_empty() {
        let terms = fs::read_to_string(root().join("LICENSE-MIT")).unwrap_or_default();
        let terms = terms.split_once("Permission is hereby granted").map(|(_, rest)| rest.to_owned());
        let authors = package.authors.join(", ");
        return terms
            .map(|rest| format!("MIT License\n\nCopyright (c) {authors}\n\nPermission is hereby granted{rest}"))
            .into_iter()
            .collect();
    }
    Vec::new()
}

/// Returns the licence files in a folder, and in its folders of licences.
fn licence_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_named = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        NAMES.iter().any(|start| name.starts_with(start)) && !name.ends_with(".rs")
    };
    let all = entries.filter(is_named);
    all.flat_map(|path| if path.is_dir() { inner_files(&path) } else { vec![path] }).collect()
}

fn inner_files(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.is_file())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{
        super::{components::components, sbom},
        *,
    };

    #[test]
    fn every_crate_has_a_licence_text_and_stands_in_the_bill() {
        let components = components().expect("cargo metadata runs");
        let text = text(&components).expect("each has a text");
        for component in components.iter().filter(|it| it.is_foreign()) {
            let line = format!("{} {}: ", component.package.name, component.package.version);
            assert!(text.contains(&line), "{line}");
        }
        assert!(text.contains("Permission is hereby granted") && text.contains("Apache License"));
        let names = |name: &str| components.iter().any(|it| it.package.name.as_str() == name);
        assert!(names("ring") && names("wgpu") && names("bottega-farm"));
        // Crates that only build, test or generate code are not in the program.
        assert!(!names("serde_derive") && !names("proptest") && !names("xtask"));
        sbom::check(&sbom::bill(&components));
    }
}
