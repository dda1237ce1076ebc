//! JSON from users and other programs, read with errors that name the field, its value and what is needed there.
//!
//! Requests, bodies of the HTTP API and values from Python are read here, so all of them get the same messages. Messages of
//! serde (`invalid value: integer `-1`, expected u32 at line 1 column 479`) are reworded so that they need no knowledge of
//! Rust.

use std::fmt;

use bottega_scene::objects_only::ObjectsOnly;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// The reason why a JSON text is refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum JsonError {
    /// The text is not JSON.
    Syntax {
        /// Path of the field with the syntax error, such as `film.size`; empty: the whole text.
        field: String,
        /// Line of the error, from 1.
        line: usize,
        /// Column of the error, from 1.
        column: usize,
        /// The problem, in one clause.
        problem: String,
    },
    /// A field has a value of the wrong kind, or one out of range.
    Value {
        /// Path of the field, such as `film.size`; empty: the whole value.
        field: String,
        /// The value that was found, as readable text.
        value: String,
        /// The kind of value that is needed.
        needed: String,
        /// The kind of number, if one is needed: `a whole number` or `a number`.
        number: Option<&'static str>,
    },
    /// A field is missing, unknown or wrong in another way.
    Field {
        /// Path of the field, such as `film.size`; empty: the whole value.
        field: String,
        /// The problem, in one clause.
        problem: String,
    },
}

impl fmt::Display for JsonError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let named = |field: &str| if field.is_empty() { String::new() } else { format!("`{field}`: ") };
        match self {
            Self::Syntax { field, line, column, problem } => {
                write!(f, "{}it is not JSON: line {line}, column {column}: {problem}", named(field))
            }
            Self::Value { field, value, needed, .. } if field.is_empty() => {
                write!(f, "it is {value}: {needed} is needed")
            }
            Self::Value { field, value, needed, .. } => write!(f, "`{field}` is {value}: {needed} is needed"),
            Self::Field { field, problem } => write!(f, "{}{problem}", named(field)),
        }
    }
}

impl std::error::Error for JsonError {}

impl JsonError {
    /// Returns true if the text is valid JSON, but a field is wrong.
    pub fn is_data(&self) -> bool {
        !matches!(self, Self::Syntax { .. })
    }

    /// Returns the path of the wrong field, such as `film.size`; empty: the whole text.
    pub fn field(&self) -> &str {
        match self {
            Self::Syntax { field, .. } | Self::Value { field, .. } | Self::Field { field, .. } => field,
        }
    }

    /// Returns the error with the path of its field prefixed by `section`.
    #[must_use]
    pub fn within(mut self, section: &str) -> Self {
        let (Self::Syntax { field, .. } | Self::Value { field, .. } | Self::Field { field, .. }) = &mut self;
        *field = if field.is_empty() { section.to_owned() } else { format!("{section}.{field}") };
        self
    }

    fn of_path(error: &serde_path_to_error::Error<serde_json::Error>) -> Self {
        let path = error.path().to_string();
        // The path ends in a question mark if the name of the field was not read yet.
        let known = path.trim_end_matches('?').trim_end_matches('.');
        Self::of(known.to_owned(), error.inner())
    }

    fn of(field: String, error: &serde_json::Error) -> Self {
        let (line, column) = (error.line(), error.column());
        let text = error.to_string();
        let message = text.strip_suffix(&format!(" at line {line} column {column}")).unwrap_or(&text);
        if message == "number out of range" {
            return Self::Field { field, problem: "the number is too large".to_owned() };
        }
        if error.is_data() {
            return Self::of_data(&field, message);
        }
        Self::Syntax { field, line, column, problem: syntax(message) }
    }

    fn of_data(field: &str, message: &str) -> Self {
        let starts = |start: &str| message.strip_prefix(start);
        let value = |found: String, expected: &str| {
            let (needed, number) = needed(expected);
            Self::Value { field: field.to_owned(), value: found, needed, number }
        };
        let field_error = |problem: String| Self::Field { field: field.to_owned(), problem };
        // A value of the wrong type, or out of range
        let expected = message.rsplit_once(", expected ");
        if let (Some(_), Some((found, expected))) = (starts("invalid type: ").or(starts("invalid value: ")), expected) {
            return value(found_value(found.split_once(": ").map_or(found, |(_, found)| found)), expected);
        }
        // A list of the wrong length
        if let (Some(rest), Some((_, expected))) = (starts("invalid length "), expected) {
            let count = rest.split(',').next().unwrap_or_default();
            return match expected {
                "fewer elements in array" => field_error(format!("it has {count} values, which are too many")),
                expected => value(format!("a list of {count}"), expected),
            };
        }
        // An unknown word
        if let Some(rest) = starts("unknown variant ") {
            let (found, list) = rest.split_once(", expected ").unwrap_or((rest, ""));
            return value(found.to_owned(), list);
        }
        // A field that is unknown, missing or repeated
        if let Some(rest) = starts("unknown field ") {
            let (found, list) = rest.split_once(", expected ").unwrap_or((rest, ""));
            let known = list.strip_prefix("one of ").unwrap_or(list);
            return field_error(match known {
                "" => format!("there is no field {found} here"),
                known => format!("there is no field {found} here; there are {known}"),
            });
        }
        if let Some(rest) = starts("missing field ") {
            return field_error(format!("the field {rest} is missing"));
        }
        match starts("duplicate field ") {
            Some(rest) => field_error(format!("the field {rest} is given twice")),
            None => field_error(message.to_owned()),
        }
    }
}

/// Reads a value from a JSON text, which must end after it. Lists are not accepted for objects.
///
/// # Errors
/// The text is not JSON, or a field is wrong.
pub fn from_slice<T: DeserializeOwned>(text: &[u8]) -> Result<T, JsonError> {
    let mut json = serde_json::Deserializer::from_slice(text);
    match serde_path_to_error::deserialize(ObjectsOnly(&mut json)) {
        Ok(value) => match json.end() {
            Ok(()) => Ok(value),
            Err(error) => Err(JsonError::of(String::new(), &error)),
        },
        Err(error) if !error.inner().is_data() => {
            // Reading member by member reports a list with too many members as a syntax error; the tree gives the real problem.
            let tree = serde_json::from_slice::<Value>(text).ok();
            let of_tree = tree.and_then(|tree| from_value::<T>(tree).err());
            Err(of_tree.unwrap_or_else(|| JsonError::of_path(&error)))
        }
        Err(error) => Err(JsonError::of_path(&error)),
    }
}

/// Reads a value from a tree of JSON values. Lists are not accepted for objects.
///
/// # Errors
/// A field is wrong.
pub fn from_value<T: DeserializeOwned>(tree: Value) -> Result<T, JsonError> {
    serde_path_to_error::deserialize(ObjectsOnly(tree)).map_err(|error| JsonError::of_path(&error))
}

/// Returns the readable text of a value in a message of serde.
fn found_value(found: &str) -> String {
    for kind in ["integer ", "floating point ", "boolean "] {
        if let Some(value) = found.strip_prefix(kind) {
            return value.trim_matches('`').to_owned();
        }
    }
    match found {
        "null" | "unit value" | "Option value" => "null".to_owned(),
        "sequence" => "a list".to_owned(),
        "map" => "an object".to_owned(),
        found => found.strip_prefix("string ").unwrap_or(found).to_owned(),
    }
}

/// Returns the readable text of what serde expects, and the kind of number if it is one.
fn needed(expected: &str) -> (String, Option<&'static str>) {
    const WHOLE: &str = "a whole number";
    let whole = |from: i128, to: i128| (format!("{WHOLE} from {from} to {to}"), Some(WHOLE));
    let count = |start: &str, end: &str| expected.strip_prefix(start).and_then(|rest| rest.strip_suffix(end));
    match expected {
        "u8" => return whole(0, u8::MAX.into()),
        "u16" => return whole(0, u16::MAX.into()),
        "u32" => return whole(0, u32::MAX.into()),
        "u64" | "usize" => return whole(0, u64::MAX.into()),
        "i32" => return whole(i32::MIN.into(), i32::MAX.into()),
        "i64" | "isize" => return whole(i64::MIN.into(), i64::MAX.into()),
        "f32" | "f64" => return ("a number".to_owned(), Some("a number")),
        _ => {}
    }
    let list = count("an array of length ", "").or(count("a tuple of size ", ""));
    let plain = match expected {
        "a string" | "a borrowed string" => "text",
        "path string" => "the name of a file, as text,",
        "a boolean" => "true or false",
        "a sequence" => "a list",
        "variant identifier" => "a word",
        "string or map" => "a word or an object",
        "map with a single key" => "an object with one field",
        "a map" | "an object" => "an object",
        expected if expected.starts_with("struct ") => "an object",
        expected if expected.starts_with("enum ") => "a word or an object",
        expected => {
            return (list.map_or_else(|| expected.to_owned(), |count| format!("a list of {count} values")), None);
        }
    };
    (plain.to_owned(), None)
}

/// Returns a readable message of a syntax error.
fn syntax(message: &str) -> String {
    if let Some(part) = message.strip_prefix("EOF while parsing ") {
        return format!("the text ends in the middle of {part}");
    }
    let plain = match message {
        "expected value" => "a value is needed here",
        "expected ident" => "`true`, `false` or `null` is needed here",
        "key must be a string" => "the name of a field, in quotes, is needed here",
        "trailing comma" => "nothing follows the comma",
        "trailing characters" => "something follows the end",
        "recursion limit exceeded" => "too many lists and objects are in each other",
        "invalid number" => "this is not a number",
        "invalid escape" => "the character after `\\` is not allowed there",
        _ if message.starts_with("control character") => "a control character, such as the end of a line, is in a text",
        message => {
            let missing = message.strip_prefix("expected ").map(|sign| format!("{sign} is needed here"));
            return missing.unwrap_or_else(|| message.to_owned());
        }
    };
    plain.to_owned()
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields, rename_all = "kebab-case")]
    #[allow(dead_code, reason = "read alone")]
    struct Shelf {
        count: u32,
        #[serde(default)]
        weight: f32,
        #[serde(default)]
        place: [u16; 2],
        #[serde(default)]
        kind: Option<Kind>,
        #[serde(default)]
        file: PathBuf,
        #[serde(default)]
        is_open: bool,
        #[serde(default)]
        inner: Option<Box<Shelf>>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    #[allow(dead_code, reason = "read alone")]
    enum Kind {
        Plain,
        Tall(u32),
    }

    #[test]
    fn an_error_says_which_field_is_wrong_and_what_is_needed_in_words_without_rust() {
        for (text, said) in [
            (r#"{"count": -1}"#, "`count` is -1: a whole number from 0 to 4294967295 is needed"),
            (r#"{"count": 1.5}"#, "`count` is 1.5: a whole number from 0 to 4294967295 is needed"),
            (r#"{"count": "many"}"#, "`count` is \"many\": a whole number from 0 to 4294967295 is needed"),
            (r#"{"count": null}"#, "`count` is null: a whole number from 0 to 4294967295 is needed"),
            (r#"{"count": 1, "weight": "2"}"#, "`weight` is \"2\": a number is needed"),
            (r#"{"count": 1, "weight": true}"#, "`weight` is true: a number is needed"),
            (r#"{"count": 1, "place": [1]}"#, "`place` is a list of 1: a list of 2 values is needed"),
            (r#"{"count": 1, "place": [1, 2, 3]}"#, "`place`: it has 3 values, which are too many"),
            (r#"{"count": 1, "place": [1, 70000]}"#, "`place[1]` is 70000: a whole number from 0 to 65535 is needed"),
            (r#"{"count": 1, "place": 3}"#, "`place` is 3: a list of 2 values is needed"),
            (r#"{"count": 1, "kind": "wide"}"#, "`kind` is `wide`: `plain` or `tall` is needed"),
            (r#"{"count": 1, "file": 5}"#, "`file` is 5: the name of a file, as text, is needed"),
            (r#"{"count": 1, "is-open": "yes"}"#, "`is-open` is \"yes\": true or false is needed"),
            (
                r#"{"count": 1, "inner": {"count": -2}}"#,
                "`inner.count` is -2: a whole number from 0 to 4294967295 is needed",
            ),
            (r#"{"count": 1, "inner": [1]}"#, "`inner` is a list: an object is needed"),
            (r#"{"count": 1, "count": 2}"#, "the field `count` is given twice"),
            ("{}", "the field `count` is missing"),
            ("[]", "it is a list: an object is needed"),
            ("{", "it is not JSON: line 1, column 1: the text ends in the middle of an object"),
            ("{\"count\":\n 1,}", "it is not JSON: line 2, column 4: nothing follows the comma"),
            (r#"{"count": 1} 2"#, "it is not JSON: line 1, column 14: something follows the end"),
            (r#"{"count": 1 2}"#, "it is not JSON: line 1, column 13: `,` or `}` is needed here"),
            (
                r#"{"count": 1, "inner": {"count": 2,}}"#,
                "`inner`: it is not JSON: line 1, column 35: nothing follows the comma",
            ),
            (r#"{"count": 1, "weight": 1e999}"#, "`weight`: the number is too large"),
            (r#"{count: 1}"#, "it is not JSON: line 1, column 2: the name of a field, in quotes, is needed here"),
        ] {
            let error = from_slice::<Shelf>(text.as_bytes()).unwrap_err();
            assert_eq!(error.to_string(), said, "{text}");
            assert_eq!(error.is_data(), !said.contains("not JSON"), "{text}");
        }
        let unknown = from_slice::<Shelf>(br#"{"cuont": 1}"#).unwrap_err().to_string();
        assert!(
            unknown.starts_with("`cuont`: there is no field `cuont` here; there are `count`, `weight`"),
            "{unknown}"
        );
        let number = from_slice::<Shelf>(br#"{"count": 1, "weight": NaN}"#).unwrap_err();
        assert_eq!(number.to_string(), "`weight`: it is not JSON: line 1, column 24: a value is needed here");
    }

    #[test]
    fn a_tree_is_read_as_its_text_is_and_a_part_says_where_it_stands() {
        let tree = serde_json::json!({ "count": 1, "place": [1] });
        let error = from_value::<Shelf>(tree).unwrap_err();
        assert_eq!(error.clone().within("shelf").field(), "shelf.place");
        assert_eq!(error.to_string(), "`place` is a list of 1: a list of 2 values is needed");
        let whole = from_value::<Shelf>(serde_json::json!(3)).unwrap_err();
        assert_eq!(whole.within("shelf").to_string(), "`shelf` is 3: an object is needed");
    }
}
