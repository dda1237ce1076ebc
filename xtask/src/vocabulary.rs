//! A test of the words of `bottega-agents`: it knows nothing of rendering.

use std::{
    fs,
    path::{Path, PathBuf},
};

use proc_macro2::{TokenStream, TokenTree};

use crate::bars::root;

/// The beginnings of words of rendering, in lower case.
const RENDERING: [&str; 18] = [
    "aov",
    "bsdf",
    "camera",
    "film",
    "integrator",
    "material",
    "paint",
    "photon",
    "picture",
    "pixel",
    "radiance",
    "render",
    "sample",
    "scene",
    "shader",
    "spp",
    "texture",
    "tile",
];

/// Returns the words of an identifier, in lower case: `NatsTiles` and `nats_tiles` have `nats` and `tiles`.
fn words(identifier: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut is_after_small = false;
    for letter in identifier.chars() {
        if letter == '_' || letter.is_uppercase() && is_after_small {
            words.push(String::new());
        }
        if letter != '_' {
            words.last_mut().into_iter().for_each(|word| word.extend(letter.to_lowercase()));
        }
        is_after_small = letter.is_lowercase() || letter.is_ascii_digit();
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Returns the identifiers that contain a word of rendering, with their lines.
fn found_in(tokens: TokenStream) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    for token in tokens {
        match token {
            TokenTree::Group(group) => found.extend(found_in(group.stream())),
            TokenTree::Ident(ident) => {
                let name = ident.to_string();
                let is_rendering = |word: &String| {
                    word == "zone" || word == "zones" || RENDERING.iter().any(|start| word.starts_with(start))
                };
                if words(&name).iter().any(is_rendering) {
                    found.push((name, ident.span().start().line));
                }
            }
            TokenTree::Punct(_) | TokenTree::Literal(_) => {}
        }
    }
    found
}

fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let is_source = |path: &PathBuf| path.extension().is_some_and(|it| it == "rs");
    files.into_iter().filter(is_source).chain(folders.iter().flat_map(|folder| sources(folder))).collect()
}

#[test]
fn agents_have_no_words_of_rendering() {
    let files = sources(&root().join("crates/bottega-agents/src"));
    assert!(files.len() > 50, "{} files", files.len());
    let mut problems = Vec::new();
    for file in files {
        let tokens: TokenStream = fs::read_to_string(&file).expect("a source").parse().expect("Rust");
        problems.extend(found_in(tokens).into_iter().map(|(name, line)| format!("{}:{line}: {name}", file.display())));
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let is_named = !found_in(name.parse().unwrap_or_default()).is_empty();
        problems.extend(is_named.then(|| format!("{}: the file's name", file.display())));
    }
    assert!(problems.is_empty(), "words of rendering in bottega-agents:\n{}", problems.join("\n"));
}

#[test]
fn words_are_found_in_every_spelling() {
    assert_eq!(words("NatsTiles"), ["nats", "tiles"]);
    assert_eq!(words("UNDER_WAY_MAX"), ["under", "way", "max"]);
    let found =
        |text: &str| found_in(text.parse().expect("tokens")).into_iter().map(|(name, _)| name).collect::<Vec<_>>();
    assert_eq!(found("fn put(tile_of: NatsTiles) { a.zone(); horizon(compile) }"), ["tile_of", "NatsTiles", "zone"]);
}
