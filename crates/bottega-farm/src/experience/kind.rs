//! Names of the kinds of tasks.

use std::fmt::Write;

use crate::{TaskFeatures, TaskOutlook};

/// Least share at which a feature counts as `most`, `much` or `some`.
const CLASSES: [(f64, &str); 3] = [(0.5, "most"), (0.15, "much"), (0.02, "some")];
/// Maximum length of a technique's name.
const TECHNIQUE_MAX: usize = 64;
/// Range of the exponents n of size classes; a class is about 4ⁿ s.
const SIZE_RANGE: (f64, f64) = (-6.0, 8.0);

/// The kinds that a picture or zone belongs to.
pub(super) struct TaskKind {
    /// Names of the kinds, from the widest to the narrowest.
    names: Vec<String>,
}

impl TaskKind {
    /// The kinds of a whole picture: its technique, and technique with features.
    pub(super) fn of_picture(technique: &str, features: &TaskFeatures) -> Self {
        let technique = plain(technique);
        let picture = format!("{technique}, picture: {}", in_words(features));
        Self { names: vec![technique, picture] }
    }

    /// The kinds of a zone: those of its picture, and three with the zone's features and size.
    ///
    /// - `samples`: samples per pixel.
    pub(super) fn of_zone(technique: &str, picture: &TaskFeatures, zone: &TaskOutlook, samples: u32) -> Self {
        let mut kind = Self::of_picture(technique, picture);
        let features = in_words(&zone.features);
        let of_zone = format!("{}, zone: {features}", kind.names[0]);
        let of_both = format!("{}, zone: {features}", kind.names[1]);
        let size = format!("{}, size: {}", kind.names[0], size(zone.sample_time * f64::from(samples)));
        kind.names.extend([of_zone, of_both, size]);
        kind
    }

    pub(super) fn names(self) -> Vec<String> {
        self.names
    }
}

/// The technique's name reduced to printable ASCII and [`TECHNIQUE_MAX`] characters.
fn plain(technique: &str) -> String {
    technique.chars().filter(|c| c.is_ascii_graphic() || *c == ' ').take(TECHNIQUE_MAX).collect()
}

fn in_words(features: &TaskFeatures) -> String {
    let TaskFeatures { glass, texture, media } = *features;
    let mut words = String::new();
    for (share, name) in [(glass, "glass"), (texture, "texture"), (media, "media")] {
        if let Some((_, class)) = CLASSES.iter().find(|(least, _)| share >= *least) {
            let gap = if words.is_empty() { "" } else { " " };
            _ = write!(words, "{gap}{class} {name}");
        }
    }
    if words.is_empty() { "plain".to_owned() } else { words }
}

/// The size class of a zone with this predicted time.
fn size(seconds: f64) -> String {
    let exponent = (seconds.max(1e-9).log2() / 2.0).round().clamp(SIZE_RANGE.0, SIZE_RANGE.1);
    format!("about {} s", 4.0_f64.powf(exponent))
}
