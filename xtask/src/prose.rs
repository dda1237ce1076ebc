//! A test that finds unclear comments: those of one word, and those with unclear phrases.

use std::{fs, path::Path};

use crate::bars::root;

/// The unclear phrases.
const PUZZLING: [&str; 8] =
    ["whoever", "anew", "gone on with", "what comes of", "what came of", "is none for", "told of", "dearer"];

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

/// Adds the unclear comments of a folder's sources, each as its file and text.
fn find(folder: &Path, found: &mut Vec<String>) {
    for path in fs::read_dir(folder).into_iter().flatten().map(|entry| entry.expect("an entry").path()) {
        if path.is_dir() {
            find(&path, found);
        } else if path.extension().is_some_and(|it| it == "rs") {
            let comments = comments(&fs::read_to_string(&path).expect("a source"));
            let unclear = comments.into_iter().filter(|comment| is_one_word(comment) || is_puzzling(comment));
            found.extend(unclear.map(|comment| format!("{}: {comment}", path.display())));
        }
    }
}

#[test]
fn no_comment_has_one_word_or_a_phrase_that_must_be_read_twice() {
    let mut found = Vec::new();
    for entry in fs::read_dir(root().join("crates")).expect("a folder") {
        find(&entry.expect("an entry").path().join("src"), &mut found);
    }
    find(&root().join("xtask/src"), &mut found);
    assert!(found.is_empty(), "comments of one word, or with one of {PUZZLING:?}:\n{}", found.join("\n"));
}

#[test]
fn a_comment_is_found_out_by_its_words() {
    assert!(is_one_word("Who.") && !is_one_word("The size.") && !is_one_word("https://example.org/a."));
    assert!(is_puzzling("Whoever asks.") && is_puzzling("It is begun anew") && !is_puzzling("A manewer"));
    let source = "//! Head\n//! of two lines.\nlet a = 1; // not a line of its own\n    /// Who.\nfn f() {}\n";
    assert_eq!(comments(source), ["Head of two lines.", "Who."]);
}
