//! Ranges and versions in manifests.

use std::{cmp::Ordering, fmt};

use serde::{Deserialize, Deserializer, de::Error};

/// The range of a tunable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "RangeText")]
pub struct Range {
    /// The least value.
    pub least: u32,
    /// The greatest value.
    pub most: u32,
    /// The default value.
    pub default: Option<u32>,
    /// True if the number must be a power of two.
    pub powers_of_two: bool,
    /// True if the number must be the square of a whole number.
    pub squares: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RangeText {
    least: u32,
    most: u32,
    default: Option<u32>,
    #[serde(default)]
    powers_of_two: bool,
    #[serde(default)]
    squares: bool,
}

impl TryFrom<RangeText> for Range {
    type Error = String;

    fn try_from(text: RangeText) -> Result<Self, String> {
        let RangeText { least, most, default, powers_of_two, squares } = text;
        if least > most {
            return Err(format!("least is {least} and most {most}: the range is empty"));
        }
        if default.is_some_and(|default| default < least || default > most) {
            return Err(format!("the default must be from {least} to {most}"));
        }
        if powers_of_two && squares {
            return Err("it cannot be of powers of two and of squares".to_owned());
        }
        Ok(Self { least, most, default, powers_of_two, squares })
    }
}

impl Range {
    /// Returns an allowed value for `wanted`: the next power of two that is not less, or the square with the nearest
    /// root, where the range has only those; then clamped to the range.
    pub fn fit(&self, wanted: u32) -> u32 {
        let fitting = if self.powers_of_two {
            wanted.checked_next_power_of_two().unwrap_or(u32::MAX)
        } else if self.squares {
            let root = f64::from(wanted).sqrt().round() as u32;
            root.saturating_mul(root)
        } else {
            wanted
        };
        fitting.clamp(self.least, self.most)
    }
}

/// A version: numbers separated by periods. What follows is ignored in comparisons: 4.2.0-beta equals 4.2.0.
#[derive(Clone, Debug)]
pub struct Version {
    numbers: Vec<u64>,
    text: String,
}

impl Version {
    /// Parses a version; `None`: it does not begin with a number.
    pub fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let numbers: Option<Vec<u64>> =
            text[..end].trim_end_matches('.').split('.').map(|part| part.parse().ok()).collect();
        Some(Self { numbers: numbers?, text: text.to_owned() })
    }

    fn numbers(&self) -> impl Iterator<Item = u64> + '_ {
        self.numbers.iter().copied().chain(std::iter::repeat(0)).take(8)
    }
}

impl Ord for Version {
    fn cmp(&self, other: &Self) -> Ordering {
        self.numbers().cmp(other.numbers())
    }
}

impl PartialOrd for Version {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Version {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Version {}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for Version {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let text = String::deserialize(from)?;
        Self::parse(&text).ok_or_else(|| D::Error::custom(format!("`{text}` is not a version such as 3.5.1")))
    }
}

/// A range of supported versions.
#[derive(Clone, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Versions {
    /// The first supported version; none: no lower bound.
    pub least: Option<Version>,
    /// The first version that is too new; none: no upper bound.
    pub below: Option<Version>,
}

impl Versions {
    /// Returns true if a version is in the range.
    pub fn include(&self, version: &Version) -> bool {
        self.least.as_ref().is_none_or(|least| version >= least)
            && self.below.as_ref().is_none_or(|below| version < below)
    }
}

impl fmt::Display for Versions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.least, &self.below) {
            (Some(least), Some(below)) => write!(f, "{least} or newer, and older than {below}"),
            (Some(least), None) => write!(f, "{least} or newer"),
            (None, Some(below)) => write!(f, "older than {below}"),
            (None, None) => f.write_str("any"),
        }
    }
}
