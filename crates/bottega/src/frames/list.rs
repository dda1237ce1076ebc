//! The list of frames of an animation that a request asks for.

use std::{collections::BTreeSet, str::FromStr};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The largest frame number; the smallest one is its negative.
const NUMBER_MAX: i32 = 1_000_000;
/// The largest number of frames in one request.
const COUNT_MAX: usize = 1_000_000;

/// Frames of an animation in rendering order, each at most once.
///
/// Written as a list of numbers and ranges, such as `1..24`, `1..9:2` (1, 3, 5, 7, 9), `9..1:-2`, `-5..5` or `1,4,7..9`. Both
/// ends of a range are included. A repeated frame is rendered at its first position, so `1..100:10,1..100` renders every tenth
/// frame first.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
#[schemars(with = "String")]
pub struct Frames {
    text: String,
    numbers: Vec<i32>,
}

/// The reason why a text is not a list of frames.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FramesError {
    /// A part of the list is neither a number nor a range.
    #[error(
        "`{found}` is neither a frame nor a range of frames: write 7, 1..24, 1..24:2, -5..5 or a list such as 1,4,7..9"
    )]
    Selection {
        /// The part of the list.
        found: String,
    },
    /// A number is not a frame number.
    #[error("`{found}` is not a frame number: these are whole numbers from -{most} to {most}", most = NUMBER_MAX)]
    Number {
        /// The text in place of the number.
        found: String,
    },
    /// A step of 0.
    #[error("`{found}` has a step of 0 and never ends; leave the step out for every frame")]
    NoStep {
        /// The range as written in the list.
        found: String,
    },
    /// A step whose sign leads away from the last frame.
    #[error("`{found}` goes from {first} {direction} to {last} in steps that lead away from it; write {right}")]
    WrongWay {
        /// The range as written in the list.
        found: String,
        /// Number of the first frame.
        first: i32,
        /// Number of the last frame.
        last: i32,
        /// The direction from the first to the last frame: `up` or `down`.
        direction: &'static str,
        /// The range with the correct sign of the step.
        right: String,
    },
    /// More frames than one request may have.
    #[error("more than {most} frames: request fewer at a time", most = COUNT_MAX)]
    TooMany,
}

impl Frames {
    /// Returns the frame numbers, in the order of rendering.
    pub fn iter(&self) -> impl Iterator<Item = i32> + use<'_> {
        self.numbers.iter().copied()
    }
}

impl TryFrom<String> for Frames {
    type Error = FramesError;

    fn try_from(text: String) -> Result<Self, FramesError> {
        text.parse()
    }
}

impl From<Frames> for String {
    fn from(frames: Frames) -> Self {
        frames.text
    }
}

impl FromStr for Frames {
    type Err = FramesError;

    fn from_str(text: &str) -> Result<Self, FramesError> {
        let (mut frames, mut seen) = (Vec::new(), BTreeSet::new());
        for part in text.split(',') {
            let FrameSelection { mut next, count, step } = part.trim().parse()?;
            if count as usize > COUNT_MAX {
                return Err(FramesError::TooMany);
            }
            for _ in 0..count {
                if seen.insert(next) {
                    frames.push(next);
                }
                // One step past the end may leave the range of frame numbers, but stays within `i32`.
                next = next.saturating_add(step);
            }
            if frames.len() > COUNT_MAX {
                return Err(FramesError::TooMany);
            }
        }
        Ok(Self { text: text.to_owned(), numbers: frames })
    }
}

/// A single frame or a range of frames.
struct FrameSelection {
    next: i32,
    count: u32,
    step: i32,
}

impl FromStr for FrameSelection {
    type Err = FramesError;

    fn from_str(text: &str) -> Result<Self, FramesError> {
        let not_a_selection = || FramesError::Selection { found: text.to_owned() };
        let Some((first, rest)) = text.split_once("..") else {
            return if text.is_empty() || text.contains(':') {
                Err(not_a_selection())
            } else {
                Ok(Self { next: number(text)?, count: 1, step: 1 })
            };
        };
        let (last, step) = rest.split_once(':').map_or((rest, None), |(last, step)| (last, Some(step)));
        if [first, last].iter().any(|end| end.trim().is_empty()) || step.is_some_and(|step| step.trim().is_empty()) {
            return Err(not_a_selection());
        }
        let (first, last) = (number(first)?, number(last)?);
        let step = step.map_or(Ok(1), number)?;
        if step == 0 {
            return Err(FramesError::NoStep { found: text.to_owned() });
        }
        let way = last - first;
        if way != 0 && (way > 0) != (step > 0) {
            let direction = if way > 0 { "up" } else { "down" };
            let right = if step == -1 { format!("{first}..{last}") } else { format!("{first}..{last}:{}", -step) };
            return Err(FramesError::WrongWay { found: text.to_owned(), first, last, direction, right });
        }
        Ok(Self { next: first, count: way.unsigned_abs() / step.unsigned_abs() + 1, step })
    }
}

fn number(text: &str) -> Result<i32, FramesError> {
    let number = text.trim().parse().ok().filter(|number| (-NUMBER_MAX..=NUMBER_MAX).contains(number));
    number.ok_or_else(|| FramesError::Number { found: text.trim().to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Vec<i32> {
        text.parse::<Frames>().unwrap_or_else(|error| panic!("{text}: {error}")).iter().collect()
    }

    #[test]
    fn frames_are_numbers_ranges_steps_and_lists_of_these() {
        for (text, frames) in [
            ("3..5", &[3, 4, 5][..]),
            ("7", &[7]),
            ("7..7", &[7]),
            (" 1 .. 3 ", &[1, 2, 3]),
            ("1..9:2", &[1, 3, 5, 7, 9]),
            ("1..10:4", &[1, 5, 9]),
            ("1..3:100", &[1]),
            ("9..1:-3", &[9, 6, 3]),
            ("-2..2", &[-2, -1, 0, 1, 2]),
            ("-9..-1:4", &[-9, -5, -1]),
            ("-3", &[-3]),
            ("1,4,7..9", &[1, 4, 7, 8, 9]),
            ("7..9, -1, 1..5:2", &[7, 8, 9, -1, 1, 3, 5]),
            ("0..8:4,0..4", &[0, 4, 8, 1, 2, 3]),
            ("1000000,-1000000", &[1_000_000, -1_000_000]),
        ] {
            assert_eq!(read(text), frames, "{text}");
        }
    }

    #[test]
    fn errors_in_a_list_of_frames_name_place_and_remedy() {
        for (text, words) in [
            ("", "neither"),
            ("1,", "neither"),
            ("1..", "`1..` is neither"),
            ("..4", "neither"),
            ("3:2", "`3:2` is neither"),
            ("1..4:", "neither"),
            ("a..b", "`a` is not a frame number"),
            ("1.5", "`1.5` is not a frame number"),
            ("1..2..3", "`2..3` is not a frame number"),
            ("1..9999999", "to 1000000"),
            ("1..99999999999999999999", "to 1000000"),
            ("1..9:0", "a step of 0"),
            ("5..3", "write 5..3:-1"),
            ("3..5:-2", "write 3..5:2"),
            ("3..5:-1", "write 3..5"),
            ("1,5..2", "`5..2` goes from 5 down"),
            ("-1000000..1000000", "more than 1000000"),
            ("1-5", "`1-5` is not a frame number"),
        ] {
            let error = text.parse::<Frames>().expect_err(text).to_string();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
