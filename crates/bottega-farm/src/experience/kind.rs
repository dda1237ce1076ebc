//! Names of the kinds of tasks.

use std::fmt::Write;

use crate::TaskFeatures;

/// Least share at which a feature counts as `most`, `much` or `some`.
const CLASSES: [(f64, &str); 3] = [(0.5, "most"), (0.15, "much"), (0.02, "some")];
/// Maximum length of a technique's name.
const TECHNIQUE_MAX: usize = 64;

/// The kinds that a picture belongs to.
pub(super) struct TaskKind {
    /// Names of the kinds, from the widest to the narrowest.
    names: Vec<String>,
}

impl TaskKind {
    /// Makes the kinds of a whole picture: its technique, and technique with features.
    pub(super) fn of_picture(technique: &str, features: &TaskFeatures) -> Self {
        let technique = plain(technique);
        let picture = format!("{technique}, picture: {}", in_words(features));
        Self { names: vec![technique, picture] }
    }

    pub(super) fn names(self) -> Vec<String> {
        self.names
    }
}

/// Returns the technique's name reduced to printable ASCII and [`TECHNIQUE_MAX`] characters.
pub(crate) fn plain(technique: &str) -> String {
    technique.chars().filter(|c| c.is_ascii_graphic() || *c == ' ').take(TECHNIQUE_MAX).collect()
}

fn in_words(features: &TaskFeatures) -> String {
    let TaskFeatures { glass, texture, media, .. } = *features;
    let mut words = String::new();
    for (share, name) in [(glass, "glass"), (texture, "texture"), (media, "media")] {
        if let Some((_, class)) = CLASSES.iter().find(|(least, _)| share >= *least) {
            let gap = if words.is_empty() { "" } else { " " };
            _ = write!(words, "{gap}{class} {name}");
        }
    }
    if words.is_empty() { "plain".to_owned() } else { words }
}
