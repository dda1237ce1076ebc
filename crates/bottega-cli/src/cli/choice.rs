//! Options that are one of a few words: the words, and what they mean, are those of the request.

use bottega::request::WordChoice;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// Reads one of the words of a choice; `--help` says what each of them means.
pub(crate) fn choice<T: WordChoice>() -> impl TypedValueParser<Value = T> {
    let values = T::VARIANTS.iter().map(|choice| PossibleValue::new(choice.word()).help(choice.meaning()));
    PossibleValuesParser::new(values.collect::<Vec<_>>()).try_map(|word| T::of_word(&word).ok_or("no such word"))
}
