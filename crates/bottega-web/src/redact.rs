//! Removal of file paths from answers: only the last part of an absolute path is kept.

use serde::Serialize;
use serde_json::Value;

/// The replacement for the folders of a path.
const GONE: &str = "…/";
/// The prefix of API routes, which remedies name and which must stay.
const API: &str = "/api/";
/// Largest number of parts of a route after the prefix.
const PARTS_MAX: usize = 6;
/// Largest number of characters in a part of a route.
const PART_MAX: usize = 80;
/// The first parts of API routes after the prefix.
const COLLECTIONS: [&str; 9] =
    ["about", "jobs", "machines", "openapi.json", "pictures", "schema", "tokens", "uploads", "viewports"];

/// Returns a value as JSON, without absolute paths in its texts.
pub(crate) fn redacted_json(what: &impl Serialize) -> String {
    // Values of the API cannot fail to serialize: they have no maps with non-string keys.
    let text = serde_json::to_string(what).unwrap_or_default();
    without_paths(text)
}

/// Removes absolute paths from the texts in a JSON text.
pub(crate) fn without_paths(text: String) -> String {
    if !text.contains(['/', '\\']) {
        return text;
    }
    match serde_json::from_str::<Value>(&text) {
        Ok(mut value) => {
            redact(&mut value);
            value.to_string()
        }
        Err(_) => String::new(),
    }
}

fn redact(value: &mut Value) {
    match value {
        Value::String(text) => {
            if let Some(redacted) = redacted(text) {
                *text = redacted;
            }
        }
        Value::Array(values) => values.iter_mut().for_each(redact),
        Value::Object(fields) => fields.values_mut().for_each(redact),
        Value::Null | Value::Bool(_) | Value::Number(_) => {}
    }
}

/// Returns a text without absolute paths; `None`: there are none.
fn redacted(text: &str) -> Option<String> {
    if is_absolute(text) && !is_route(text) && !text.contains('\n') && !text.contains(": ") {
        return Some(last(text).to_owned());
    }
    let mut out = String::new();
    let mut rest = text;
    let mut before = None;
    let mut is_changed = false;
    while let Some(c) = rest.chars().next() {
        if begins_path(before) && is_absolute(rest) {
            let end = end_of_path(rest, before);
            let path = &rest[..end];
            // A lone slash is a division.
            if path.len() > 1 && !is_route(path) {
                out.push_str(GONE);
                out.push_str(last(path));
                is_changed = true;
                before = path.chars().next_back();
                rest = &rest[end..];
                continue;
            }
        }
        out.push(c);
        before = Some(c);
        rest = &rest[c.len_utf8()..];
    }
    is_changed.then_some(out)
}

pub(crate) fn is_absolute(text: &str) -> bool {
    let bytes = text.as_bytes();
    let has_drive =
        bytes.len() > 2 && bytes[0].is_ascii_alphabetic() && bytes[1] == b':' && matches!(bytes[2], b'\\' | b'/');
    text.starts_with('/') || text.starts_with("\\\\") || has_drive
}

/// Returns true if a path is an API route, not a file: its parts have only characters that occur in routes.
fn is_route(path: &str) -> bool {
    let Some(rest) = path.strip_prefix(API) else { return false };
    let mut parts = rest.split('/');
    let is_known = parts.next().is_some_and(|first| COLLECTIONS.contains(&first));
    // Files have extensions that routes do not have
    let is_part = |part: &str| match part.rsplit_once('.') {
        Some((_, ending)) => ["png", "exr", "json"].contains(&ending) && part.len() <= PART_MAX,
        None => part.len() <= PART_MAX && part.chars().all(|c| c.is_ascii_alphanumeric() || "_-{}".contains(c)),
    };
    is_known && parts.clone().count() <= PARTS_MAX && parts.all(is_part)
}

fn begins_path(before: Option<char>) -> bool {
    before.is_none_or(|c| c.is_whitespace() || "`'\"([{<=,;|>".contains(c))
}

/// Returns the end of a path: at the closing quote if it is quoted, else at the end of the word.
fn end_of_path(text: &str, before: Option<char>) -> usize {
    let quote = before.filter(|c| "`'\"".contains(*c));
    let ends = |c: char| match quote {
        Some(quote) => c == quote,
        None => c.is_whitespace() || "`'\")]}>,;|".contains(c),
    };
    let end = text.find(ends).unwrap_or(text.len());
    // Punctuation after a path is not part of it
    text[..end].trim_end_matches([':', '.']).len()
}

fn last(path: &str) -> &str {
    path.trim_end_matches(['/', '\\']).rsplit(['/', '\\']).next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_absolute_paths_the_last_part_is_left() {
        for (text, expected) in [
            ("/home/anna/secret/scene.glb", "scene.glb"),
            ("/home/anna b/my scene.glb", "my scene.glb"),
            ("cannot read `/home/a b/x.exr`: no such file", "cannot read `…/x.exr`: no such file"),
            ("cannot read /home/a/x.exr: no such file", "cannot read …/x.exr: no such file"),
            ("C:\\Users\\anna\\x.glb", "x.glb"),
            ("see D:/a/b.log, or \\\\host\\share\\c.", "see …/b.log, or …/c."),
            ("--set file=/root/x", "--set file=…/x"),
        ] {
            assert_eq!(redacted(text).as_deref(), Some(expected));
        }
        for text in
            ["scenes/goblets.glb", "2.5 M samples/s", "http://10.0.0.7:8080/acc", "a / b", "path_tracing: 12 0.83"]
        {
            assert_eq!(redacted(text), None, "{text}");
        }
    }

    #[test]
    fn routes_of_the_api_are_left_in_remedies_and_files_below_such_folders_are_not() {
        for route in crate::openapi_document()["paths"].as_object().unwrap().keys() {
            for text in [format!("GET {route} lists them"), format!("see `{route}`"), route.clone()] {
                assert_eq!(redacted(&text), None, "{text}");
            }
        }
        assert_eq!(
            redacted("POST /api/jobs/3/zones/7/requeue, or /home/a/x").as_deref(),
            Some("POST /api/jobs/3/zones/7/requeue, or …/x")
        );
        for (text, expected) in [
            ("cannot read /api/scenes/x.glb", "cannot read …/x.glb"),
            ("cannot read `/api/jobs/my scene.glb`", "cannot read `…/my scene.glb`"),
            ("/apis/jobs/1", "1"),
        ] {
            assert_eq!(redacted(text).as_deref(), Some(expected));
        }
    }

    #[test]
    fn all_texts_of_a_value_are_looked_at() {
        let value = serde_json::json!({ "a": ["/x/y/z", { "b": "in /tmp/q" }], "n": 1 });
        assert_eq!(redacted_json(&value), r#"{"a":["z",{"b":"in …/q"}],"n":1}"#);
    }
}
