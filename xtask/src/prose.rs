//! A test that counts unclear comments: those of one word, and those with unclear phrases. Their number in each crate must not
//! rise.

use std::{collections::BTreeMap, fs, path::Path};

use crate::bars::root;

/// The unclear phrases.
const PUZZLING: [&str; 8] =
    ["whoever", "anew", "gone on with", "what comes of", "what came of", "is none for", "told of", "dearer"];

/// The maximum numbers per crate, where not zero: comments of one word, and comments with an unclear phrase.
const MOST: &[(&str, [usize; 2])] = &[
    ("bottega", [2, 7]),
    ("bottega-agents", [1, 2]),
    ("bottega-cli", [1, 6]),
    ("bottega-farm", [0, 2]),
    ("bottega-fuzzy", [2, 0]),
    ("bottega-hra", [0, 1]),
    ("bottega-scene", [4, 0]),
    ("xtask", [0, 3]),
];

/// Returns the comments of a source file: the text of each block of `///`, `//!` or `//` lines.
fn comments(source: &str) -> Vec<String> {
    let mut blocks: Vec<String> = Vec::new();
    let mut is_open = false;
    for line in source.lines() {
        let text = line.trim_start().strip_prefix("//").map(|text| text.trim_start_matches(['/', '!']).trim());
        match text {
            Some(text) if is_open => blocks.last_mut().into_iter().for_each(|block| *block = format!("{block} {text}")),
            Some(text) => blocks.push(text.to_owned()),
            None => {}
        }
        is_open = text.is_some();
    }
    blocks
}

fn is_one_word(comment: &str) -> bool {
    let is_word = |word: &str| word.ends_with('.') && word.chars().all(|c| c.is_alphabetic() || c == '.');
    is_word(comment)
}

fn is_puzzling(comment: &str) -> bool {
    let comment = comment.to_lowercase();
    let has = |phrase: &str| {
        comment.match_indices(phrase).any(|(at, _)| {
            let ends = |c: Option<char>| c.is_none_or(|c| !c.is_alphabetic());
            ends(comment[..at].chars().next_back()) && ends(comment[at + phrase.len()..].chars().next())
        })
    };
    PUZZLING.iter().any(|phrase| has(phrase))
}

fn count(folder: &Path, found: &mut [usize; 2]) {
    for path in fs::read_dir(folder).into_iter().flatten().map(|entry| entry.expect("an entry").path()) {
        if path.is_dir() {
            count(&path, found);
        } else if path.extension().is_some_and(|it| it == "rs") {
            for comment in comments(&fs::read_to_string(&path).expect("a source")) {
                found[0] += usize::from(is_one_word(&comment));
                found[1] += usize::from(is_puzzling(&comment));
            }
        }
    }
}

#[test]
fn comments_that_must_be_read_twice_become_fewer() {
    let crates = fs::read_dir(root().join("crates")).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut found: BTreeMap<String, [usize; 2]> = BTreeMap::new();
    for folder in crates {
        let name = folder.file_name().expect("a name").to_string_lossy().into_owned();
        count(&folder.join("src"), found.entry(name).or_default());
    }
    count(&root().join("xtask/src"), found.entry("xtask".to_owned()).or_default());
    let most: BTreeMap<&str, [usize; 2]> = MOST.iter().copied().collect();
    let wrong: Vec<String> = found
        .iter()
        .filter(|(name, counts)| **counts != most.get(name.as_str()).copied().unwrap_or_default())
        .map(|(name, counts)| format!("(\"{name}\", {counts:?}),"))
        .collect();
    assert!(
        wrong.is_empty(),
        "comments of one word, comments with {PUZZLING:?}: reword those that are new, or lower the numbers in MOST to\n{}",
        wrong.join("\n")
    );
}

#[test]
fn a_comment_is_found_out_by_its_words() {
    assert!(is_one_word("Who.") && !is_one_word("The size.") && !is_one_word("https://example.org/a."));
    assert!(is_puzzling("Whoever asks.") && is_puzzling("It is begun anew") && !is_puzzling("A manewer"));
    let source = "//! Head\n//! of two lines.\nlet a = 1; // not a line of its own\n    /// Who.\nfn f() {}\n";
    assert_eq!(comments(source), ["Head of two lines.", "Who."]);
}
