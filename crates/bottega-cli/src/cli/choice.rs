//! Options that take one of a few words; the words and their meanings come from the request.

use bottega::request::WordChoice;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Parses one of the words of a choice; `--help` shows the meaning of each.
pub(crate) fn choice<T: WordChoice>() -> impl TypedValueParser<Value = T> {
    let values = T::VARIANTS.iter().map(|choice| PossibleValue::new(choice.word()).help(choice.meaning()));
    PossibleValuesParser::new(values.collect::<Vec<_>>()).try_map(|word| T::of_word(&word).ok_or("no such word"))
}
