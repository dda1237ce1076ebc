//! Escaping of foreign names for terminals.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::path::Path;

/// Returns true if a character has an effect on a terminal: moves the cursor, ends a line, changes colors, or changes
/// the writing direction.
fn acts(c: char) -> bool {
    c.is_control()
        || matches!(
            c,
            '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}' | '\u{2029}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}'
        )
}

/// Returns a text whose characters with an effect on a terminal are escaped as in JSON: `\n`, `\r`, `\t`, `\u001b`. The
/// text then keeps its line, column and color.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, acts)
}

/// Returns a text of several lines, escaped like [`printable`], but with its newlines and tabs.
pub fn printable_lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| acts(c) && c != '\n' && c != '\t')
}

/// Returns the path of a file as text, escaped like [`printable`].
pub fn printable_path(path: &Path) -> String {
    printable(&path.to_string_lossy()).into_owned()
}

fn escaped(text: &str, acts: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.chars().any(&acts) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            c if !acts(c) => escaped.push(c),
            '\n' => escaped.push_str("\\n"),
            '\r' => escaped.push_str("\\r"),
            '\t' => escaped.push_str("\\t"),
            // All these characters have four hexadecimal digits.
            c => _ = write!(escaped, "\\u{:04x}", u32::from(c)),
        }
    }
    Cow::Owned(escaped)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_acts_is_escaped_as_in_json() {
        let name = "red\u{1b}[31mALERT\r\n\u{9b}1m\u{202e}gnp.exe\u{7f}\t.glb";
        let shown = printable(name);
        assert_eq!(shown, "red\\u001b[31mALERT\\r\\n\\u009b1m\\u202egnp.exe\\u007f\\t.glb");
        assert!(!shown.chars().any(acts));
        assert_eq!(printable_lines("a\n\tb\u{7}"), "a\n\tb\\u0007");
        assert_eq!(printable_path(Path::new("a\nb")), "a\\nb");
    }

    #[test]
    fn other_names_stay_as_they_are() {
        for name in ["", "plain.glb", "größe 3.glb", "日本語", "👩‍🚀", "שלום", "C:\\scenes\\new"] {
            assert!(matches!(printable(name), Cow::Borrowed(same) if same == name), "{name}");
        }
    }
}
