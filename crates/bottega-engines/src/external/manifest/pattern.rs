//! Regular expressions in manifests.

use regex::Regex;
use serde::{Deserialize, Deserializer, de::Error};

/// The most memory of a compiled pattern, in bytes.
const SIZE_MAX: usize = 1 << 20;

/// A regular expression. Matching takes linear time, so a manifest cannot hang the program.
#[derive(Clone, Debug)]
pub struct Pattern(Regex);

impl Pattern {
    /// Returns group 1 of the first match, or the whole match if there is no group; `None`: nothing matches.
    pub fn find<'a>(&self, text: &'a str) -> Option<&'a str> {
        let found = self.0.captures(text)?;
        found.get(1).or_else(|| found.get(0)).map(|it| it.as_str())
    }

    /// Returns group 1 of each match, in the order of the text; matches without it are left out.
    pub fn find_all<'a>(&self, text: &'a str) -> impl Iterator<Item = &'a str> {
        self.0.captures_iter(text).filter_map(|found| found.get(1)).map(|it| it.as_str())
    }

    /// Returns the last match as a fraction in 0..=1: group 1 in per cent, or group 1 divided by group 2. `None`: no
    /// match, or no number.
    pub fn share(&self, text: &str) -> Option<f64> {
        let found = self.0.captures_iter(text).last()?;
        let number = |i: usize| found.get(i).and_then(|it| it.as_str().parse::<f64>().ok());
        let share = match (number(1)?, number(2)) {
            (done, Some(of)) => done / of,
            (percent, None) => percent / 100.0,
        };
        share.is_finite().then(|| share.clamp(0.0, 1.0))
    }

    /// Returns true if the pattern has a group.
    pub fn has_group(&self) -> bool {
        self.0.captures_len() > 1
    }
}

impl PartialEq for Pattern {
    fn eq(&self, other: &Self) -> bool {
        self.0.as_str() == other.0.as_str()
    }
}

impl<'de> Deserialize<'de> for Pattern {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        let pattern = regex::RegexBuilder::new(&text).size_limit(SIZE_MAX).build();
        pattern.map(Self).map_err(|error| D::Error::custom(format!("this is not a regular expression: {error}")))
    }
}
