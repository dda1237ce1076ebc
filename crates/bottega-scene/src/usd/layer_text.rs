//! Text layers, as the USD library can parse them.
//!
//! The library refuses some text that the format allows, which is written in another way here, with the same meaning and the
//! same lines:
//!
//! | text | becomes |
//! |---|---|
//! | names of types from before USD 0.8 (`Vec3f`, `PointIndex`) | today's names (`float3`, `int`) |
//! | arrays of `uint` | arrays of `int64` |
//! | arrays of `uint64` | arrays of `double` |
//! | an asset path in the metadata or time samples of a property | a string |
//! | numbers that begin or end with their point (`.5`, `1.`) | numbers with a zero there |
//!
//! Nesting is limited, because the library's parser calls itself for each level, and names are checked.

use super::names;
use crate::text::shortened;

/// Greatest depth of brackets. Programs write some ten.
const DEPTH_MAX: usize = 256;

/// Stands for the parenthesis around the metadata of a prim or variant.
const HEAD: u8 = b'p';

/// Stands for the bracket around a list that is a time sample.
const SAMPLE: u8 = b's';

/// Stands for the brace around selections of variants.
const VARIANTS: u8 = b'v';

/// A fault of a text layer.
#[derive(Debug, PartialEq)]
pub(super) struct TextFault {
    /// Line, counted from 1.
    pub(super) line: usize,
    /// The problem and the remedy.
    pub(super) problem: String,
}

/// Names of types from before USD 0.8, and today's.
const TYPES: &[(&str, &str)] = &[
    ("Vec2i", "int2"),
    ("Vec2h", "half2"),
    ("Vec2f", "float2"),
    ("Vec2d", "double2"),
    ("Vec3i", "int3"),
    ("Vec3h", "half3"),
    ("Vec3f", "float3"),
    ("Vec3d", "double3"),
    ("Vec4i", "int4"),
    ("Vec4h", "half4"),
    ("Vec4f", "float4"),
    ("Vec4d", "double4"),
    ("PointFloat", "point3f"),
    ("Point", "point3d"),
    ("NormalFloat", "normal3f"),
    ("Normal", "normal3d"),
    ("VectorFloat", "vector3f"),
    ("Vector", "vector3d"),
    ("ColorFloat", "color3f"),
    ("Color", "color3d"),
    ("Quath", "quath"),
    ("Quatf", "quatf"),
    ("Quatd", "quatd"),
    ("Matrix2d", "matrix2d"),
    ("Matrix3d", "matrix3d"),
    ("Matrix4d", "matrix4d"),
    ("Frame", "frame4d"),
    ("Transform", "matrix4d"),
    ("PointIndex", "int"),
    ("EdgeIndex", "int"),
    ("FaceIndex", "int"),
];

/// Rewrites a text layer for the library's parser.
pub(super) fn mended(text: &str) -> Result<String, TextFault> {
    let mut scanner = Scanner { text, at: 0, out: String::with_capacity(text.len()), brackets: Vec::new() };
    while scanner.at < text.len() {
        scanner.step()?;
    }
    Ok(scanner.out)
}

struct Scanner<'a> {
    text: &'a str,
    /// Offset of the next byte.
    at: usize,
    out: String,
    /// Open brackets.
    brackets: Vec<u8>,
}

impl<'a> Scanner<'a> {
    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    /// Copies text up to a length.
    fn copy(&mut self, length: usize) -> &'a str {
        let piece = &self.rest()[..length];
        self.out.push_str(piece);
        self.at += length;
        piece
    }

    /// Copies or rewrites the next token.
    fn step(&mut self) -> Result<(), TextFault> {
        let rest = self.rest();
        let bytes = rest.as_bytes();
        match bytes[0] {
            b'#' => _ = self.copy(rest.find('\n').unwrap_or(rest.len())),
            b'"' | b'\'' => {
                let length = string_length(rest);
                if !is_closed(&rest[..length]) {
                    return Err(self
                        .fault("the text in quotes is not closed; close it, or take three quotes for several lines"));
                }
                self.check_name(&rest[..length])?;
                self.copy(length);
            }
            b'@' => self.asset(),
            b'<' => {
                let length = rest.find(['>', '\n']).map_or(rest.len(), |end| end + 1);
                // The library follows a path over several lines without end
                if !rest[..length].ends_with('>') {
                    return Err(self.fault("the path does not end with `>` in its line; repair it"));
                }
                if !names::has_sound_braces(&rest[..length]) {
                    return Err(self.fault("the path has a brace without its counterpart; repair it"));
                }
                self.copy(length);
            }
            open @ (b'(' | b'[' | b'{') => {
                if self.brackets.len() >= DEPTH_MAX {
                    return Err(self.fault(format!("brackets are nested more than {DEPTH_MAX} deep; divide the layer")));
                }
                let kind = match open {
                    b'(' if self.is_after_head() => HEAD,
                    b'[' if self.is_after_time() => SAMPLE,
                    b'{' if self.is_after_variants() => VARIANTS,
                    open => open,
                };
                self.brackets.push(kind);
                self.copy(1);
            }
            b')' | b']' | b'}' => {
                self.brackets.pop();
                self.copy(1);
            }
            b'0'..=b'9' | b'.' | b'-' | b'+' => self.number(),
            letter if letter.is_ascii_alphabetic() || letter == b'_' => self.word(),
            _ => {
                let length = rest.chars().next().map_or(1, char::len_utf8);
                self.copy(length);
            }
        }
        Ok(())
    }

    /// Returns true behind the name of a prim or variant, whose metadata follows.
    fn is_after_head(&self) -> bool {
        let before = self.out.trim_end();
        let line = before.rsplit('\n').next().unwrap_or_default();
        before.ends_with('"') && !line.contains('=')
    }

    fn fault(&self, problem: impl Into<String>) -> TextFault {
        TextFault { line: 1 + self.text[..self.at].matches('\n').count(), problem: problem.into() }
    }

    /// Checks a string that is the name of a prim, variant or set of variants.
    fn check_name(&self, quoted: &str) -> Result<(), TextFault> {
        let line = self.out.rsplit(['\n', '{', '}', ';']).next().unwrap_or_default();
        let mut words = line.split_whitespace();
        let first = words.next();
        let others = words.count();
        let name = quoted.trim_matches(['"', '\'']);
        let (is_sound, what) = match first {
            Some("def" | "over" | "class") if others <= 1 => (names::is_prim(name), "a prim"),
            Some("variantSet") => (names::is_prim(name), "a set of variants"),
            _ if self.brackets.last() == Some(&VARIANTS) => (names::is_variant(name), "a variant"),
            None if self.rest()[quoted.len()..].trim_start().starts_with(['{', '(']) => {
                (names::is_variant(name), "a variant")
            }
            _ => return Ok(()),
        };
        if is_sound {
            return Ok(());
        }
        Err(self
            .fault(format!("`{}` is not the name of {what}: it has other characters than names have", shortened(name))))
    }

    /// Returns true behind `variants =`.
    fn is_after_variants(&self) -> bool {
        let before = self.out.trim_end().strip_suffix('=');
        before.is_some_and(|before| before.trim_end().ends_with("variants"))
    }

    /// Returns true behind the colon of a time sample.
    fn is_after_time(&self) -> bool {
        let Some(before) = self.out.trim_end().strip_suffix(':') else { return false };
        before.trim_end().ends_with(|letter: char| letter.is_ascii_digit()) && self.brackets.last() == Some(&b'{')
    }

    /// Returns true within the metadata of a property, or within a dictionary there.
    fn is_metadata_of_property(&self) -> bool {
        let Some(open) = self.brackets.iter().rposition(|&bracket| bracket != b'{') else { return false };
        self.brackets[open] == b'(' && open > 0 && self.brackets[open - 1] == b'{'
    }

    /// Copies an asset path, or writes it as a string.
    fn asset(&mut self) {
        let rest = self.rest();
        let (fence, start) = if rest.starts_with("@@@") { ("@@@", 3) } else { ("@", 1) };
        let Some(end) = rest[start..].find(fence) else {
            self.copy(rest.len());
            return;
        };
        let (path, length) = (&rest[start..start + end], start + end + fence.len());
        // `@@@` fences are rare; `@@` is an empty path
        let is_string = self.is_after_time() || self.brackets.last() == Some(&SAMPLE) || self.is_metadata_of_property();
        if fence == "@@@" || !is_string || path.contains('\n') {
            self.copy(length);
            return;
        }
        self.out.push('"');
        self.out.push_str(&path.replace('\\', "/").replace('"', "'"));
        self.out.push('"');
        self.at += length;
    }

    /// Copies a number, with zeros before and after its point.
    fn number(&mut self) {
        let rest = self.rest();
        let sign = usize::from(rest.starts_with(['-', '+']));
        self.copy(sign);
        let rest = self.rest();
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        let whole = digits(rest);
        let has_point = rest[whole..].starts_with('.');
        let part = if has_point { digits(&rest[whole + 1..]) } else { 0 };
        if whole + part == 0 {
            // A point of a path or name, or a sign
            if sign == 0 {
                self.copy(1);
            }
            return;
        }
        if whole == 0 {
            self.out.push('0');
        }
        self.copy(whole + usize::from(has_point) + part);
        let ends = !self.rest().starts_with(|next: char| next.is_ascii_alphanumeric() && !matches!(next, 'e' | 'E'));
        if has_point && part == 0 && ends {
            self.out.push('0');
        }
        let rest = self.rest();
        if rest.starts_with(['e', 'E']) {
            let sign = usize::from(rest[1..].starts_with(['-', '+']));
            self.copy(1 + sign);
            let rest = self.rest();
            self.copy(digits(rest));
        }
        // The rest of a name that begins with a digit
        let rest = self.rest();
        let name = rest.bytes().take_while(|byte| byte.is_ascii_alphanumeric() || *byte == b'_').count();
        self.copy(name);
    }

    /// Copies a word, or writes a type by its name of today.
    fn word(&mut self) {
        let rest = self.rest();
        // Names of properties have colons and points, which are not part of the name of a type
        let is_part = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b':' | b'.') || byte >= 0x80;
        let length = rest.bytes().take_while(|&byte| is_part(byte)).count();
        let word = &rest[..length];
        let after = &rest[length..];
        let is_array = after.starts_with("[]");
        let name = after.strip_prefix("[]").unwrap_or(after);
        let is_type = name.starts_with([' ', '\t'])
            && name.trim_start().starts_with(|next: char| next.is_alphabetic() || next == '_' || next == '"')
            && !matches!(self.last_word(), "def" | "over" | "class");
        let new = match word {
            "uint" if is_array => Some("int64"),
            "uint64" if is_array => Some("double"),
            _ => TYPES.iter().find(|(old, _)| *old == word).map(|(_, new)| *new),
        };
        match new.filter(|_| is_type) {
            Some(new) => {
                self.out.push_str(new);
                self.at += length;
            }
            None => _ = self.copy(length),
        }
    }

    /// Returns the word before.
    fn last_word(&self) -> &str {
        let before = self.out.trim_end_matches([' ', '\t']);
        let start = before.rfind(|letter: char| !letter.is_ascii_alphanumeric()).map_or(0, |at| at + 1);
        before.get(start..).unwrap_or_default()
    }
}

/// Returns the length of the string at the start of a text, with its quotes. One that is not closed ends with its line, or
/// with the text.
fn string_length(text: &str) -> usize {
    let quote = &text[..1];
    let triple = quote.repeat(3);
    let (fence, start, may_break) =
        if text.starts_with(&triple) { (triple.as_str(), 3, true) } else { (quote, 1, false) };
    let mut at = start;
    while at < text.len() {
        let rest = &text[at..];
        if rest.starts_with(fence) {
            return at + fence.len();
        }
        if rest.starts_with('\n') && !may_break {
            return at;
        }
        let skipped = if rest.starts_with('\\') { 1 } else { 0 };
        at += skipped + rest[skipped..].chars().next().map_or(0, char::len_utf8);
    }
    text.len()
}

/// Returns true if a string ends with the quotes with which it begins.
fn is_closed(quoted: &str) -> bool {
    let quote = &quoted[..1];
    let triple = quote.repeat(3);
    let fence = if quoted.starts_with(&triple) { &triple } else { quote };
    quoted.len() >= 2 * fence.len() && quoted.ends_with(fence)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(text: &str, expected: &str) {
        assert_eq!(mended(text).unwrap(), expected);
        assert_eq!(text.matches('\n').count(), expected.matches('\n').count());
    }

    #[test]
    fn old_types_have_todays_names() {
        check("Vec3f[] points = [(1, 2, 3)]", "float3[] points = [(1, 2, 3)]");
        check("custom PointIndex[] faceVertexIndices = [0]", "custom int[] faceVertexIndices = [0]");
        check("uint[] pointIndices = [1]\nuint a = 1", "int64[] pointIndices = [1]\nuint a = 1");
        // A prim of that type, a name and a string stay
        for text in
            ["def Point \"Color\"\n", "float Color = 1", "string a = \"Vec3f b\" # Vec3f c", "rel a = </Vec3f b>"]
        {
            check(text, text);
        }
    }

    #[test]
    fn numbers_have_digits_around_their_point() {
        check("[.5, -.25, 1., 2.e3, -1.5e-3, 7]", "[0.5, -0.25, 1.0, 2.0e3, -1.5e-3, 7]");
        for text in
            ["a.connect = </A.b>", "float2 inputs:st.timeSamples = {", "inf, -inf, nan", "def \"A\" { 1: 2, }", "-"]
        {
            check(text, text);
        }
    }

    #[test]
    fn assets_in_the_metadata_of_properties_are_strings() {
        check(
            "def A \"a\" (\n payload = @b.usd@\n) {\n asset x = @c.png@ (\n customData = {\n asset d = @e\"f@\n }\n )\n}",
            "def A \"a\" (\n payload = @b.usd@\n) {\n asset x = @c.png@ (\n customData = {\n asset d = \"e'f\"\n }\n )\n}",
        );
        check(
            "{ asset a.timeSamples = { 1: @@, 2: @b@, 3: [@c@] } }",
            "{ asset a.timeSamples = { 1: \"\", 2: \"b\", 3: [\"c\"] } }",
        );
        for text in [
            "{ asset a = @@\n}",
            "{ def \"b\" (\n payload = @c.usd@\n) { } }",
            "{ \"v\" ( references = @d.usd@ ) { } }",
        ] {
            check(text, text);
        }
    }

    #[test]
    fn depth_is_limited_and_no_text_is_too_strange() {
        let fault = mended(&format!("\n{}", "(".repeat(DEPTH_MAX + 1))).unwrap_err();
        assert!(fault.line == 2 && fault.problem.contains("nested"), "{fault:?}");
        for text in [
            "def \"a}b\" {}",
            "over Mesh \"\" {}",
            "class \"a\nb\" {}",
            "{ variantSet \"s\" = { \"x}\" { } } }",
            "def \"a\" ( variants = { string s = \"x}\" } ) {}",
            "rel a = </a}b>",
            "rel a = </a\n>",
            "<a",
        ] {
            assert!(mended(text).is_err(), "{text}");
        }
        for text in ["def \"a\" ( variants = { string s = \"x-1\" } ) { string b = \"}\" }", "rel a = </a{s=x}b.c>"] {
            check(text, text);
        }
        for text in ["@never", "\\", "é\u{301}ß -é .é", "1.é", "\"\\é\"", "+", "@@@a@@"] {
            assert_eq!(mended(text).unwrap().is_empty(), text.is_empty());
        }
    }
}
