//! Tests that shaders do not repeat shared constants by hand.
//!
//! A line is at fault if it has a constant that is a number or a vector of numbers; a number that equals a shared constant and is
//! distinctive enough to be no coincidence; or a bare number as a place in a record, a code, a flag or a parameter.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::declare::{Layout, Value};
use super::{constants, layouts};

/// Variable names by which shaders hold the place of a record.
const RECORDS: &[&str] = &[
    "block",
    "camera",
    "environment",
    "filter_at",
    "head",
    "image",
    "instance",
    "job",
    "level",
    "levels",
    "light",
    "map",
    "mesh",
    "node",
    "place",
    "record",
    "slot",
    "sphere",
    "table",
];
/// Functions that read one or more words at a place.
const READERS: &[&str] = &[
    "batch_number",
    "batch_vec2",
    "batch_vec3",
    "color_param_eval",
    "lookup_f32",
    "lookup_vec2",
    "mat3_at",
    "material_f32",
    "material_vec2",
    "material_vec3",
    "number_at",
    "triple_at",
    "vec2_at",
    "vec3_at",
    "vec4_at",
];
/// Variable names by which shaders hold codes and flags.
const CODES: &[&str] = &["flags", "format", "handle", "kind", "shape"];

/// Returns all shaders: the path below `wgsl/` without the ending, and the text.
pub(super) fn shaders() -> BTreeMap<String, String> {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("src/wgsl");
    let mut all = BTreeMap::new();
    collect(&root, &root, &mut all);
    assert!(all.len() > 40, "the shaders are somewhere else");
    all
}

fn collect(root: &Path, folder: &Path, all: &mut BTreeMap<String, String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(root, &path, all);
        } else if path.extension().is_some_and(|ending| ending == "wgsl") {
            let name = path.strip_prefix(root).unwrap().with_extension("");
            all.insert(name.to_str().unwrap().replace('\\', "/"), fs::read_to_string(&path).unwrap());
        }
    }
}

/// Returns the words, numbers and signs of a line, without its comment.
pub(super) fn tokens(line: &str) -> Vec<&str> {
    let line = line.split("//").next().unwrap_or_default();
    let (mut tokens, mut rest) = (Vec::new(), line.trim_start());
    while let Some(first) = rest.chars().next() {
        let length = if first.is_ascii_digit() { number_length(rest) } else { word_length(rest) };
        let (token, after) = rest.split_at(length.max(first.len_utf8()));
        tokens.push(token);
        rest = after.trim_start();
    }
    tokens
}

fn word_length(text: &str) -> usize {
    text.find(|sign: char| !sign.is_alphanumeric() && sign != '_').unwrap_or(text.len())
}

/// Returns the length of a number: digits, a point, and a sign after the `e` of an exponent.
fn number_length(text: &str) -> usize {
    let mut before = ' ';
    let is_hexadecimal = text.starts_with("0x");
    for (place, sign) in text.char_indices() {
        let in_exponent = (sign == '-' || sign == '+') && before == 'e' && !is_hexadecimal;
        if !(sign.is_alphanumeric() || sign == '_' || sign == '.' || in_exponent) {
            return place;
        }
        before = sign;
    }
    text.len()
}

/// A number literal of Rust or WGSL.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Number {
    Whole(u64),
    Real(f64),
}

pub(super) fn number(token: &str) -> Option<Number> {
    let plain = token.replace('_', "");
    if let Some(digits) = plain.strip_prefix("0x") {
        return u64::from_str_radix(digits.trim_end_matches(['u', 'i']), 16).ok().map(Number::Whole);
    }
    if !plain.starts_with(|sign: char| sign.is_ascii_digit()) {
        return None;
    }
    let suffixes = ["u32", "u64", "f32", "f64", "usize", "u", "i", "f"];
    let bare = suffixes.iter().find_map(|suffix| plain.strip_suffix(suffix)).unwrap_or(&plain);
    match bare.parse() {
        Ok(whole) => Some(Number::Whole(whole)),
        Err(_) => bare.parse().ok().map(Number::Real),
    }
}

/// Returns true if a number is distinctive: three significant digits, or a large power.
pub(super) fn is_particular(number: Number) -> bool {
    match number {
        Number::Whole(whole) => whole > 0xffff,
        Number::Real(real) => {
            let digits = format!("{real:e}");
            let mantissa = digits.split('e').next().unwrap_or_default();
            mantissa.chars().filter(char::is_ascii_digit).count() >= 3 || real.abs() > 1e30
        }
    }
}

/// Returns the shared constant whose value a literal repeats.
fn repeated(token: &str) -> Option<String> {
    let number = number(token).filter(|&number| is_particular(number))?;
    let is_same = |value: &Value| match (value, number) {
        (Value::U32(shared), Number::Whole(whole)) => u64::from(*shared) == whole,
        (Value::F32(shared), Number::Real(real)) => shared.to_bits() == (real as f32).to_bits(),
        (Value::Floats(shared), Number::Real(real)) => shared.iter().any(|it| it.to_bits() == (real as f32).to_bits()),
        _ => false,
    };
    constants().into_iter().find(|constant| is_same(&constant.value)).map(|constant| constant.name.into_owned())
}

/// Returns the reason why a line is not allowed in a shader.
fn fault(line: &str) -> Option<String> {
    let tokens = tokens(line);
    if let ["const", name, ":", type_name, ..] = tokens[..] {
        let is_shared = constants().iter().any(|constant| constant.name == name)
            || layouts().flat_map(Layout::constants).any(|constant| constant.name == name);
        let is_numeric = ["u32", "i32", "f32", "bool"].contains(&type_name) || type_name.starts_with("vec");
        if is_shared || is_numeric {
            return Some(format!("the constant `{name}` is declared here and not in `shared/`"));
        }
    }
    if let Some((token, name)) = tokens.iter().find_map(|token| Some((token, repeated(token)?))) {
        return Some(format!("`{token}` is `{name}`"));
    }
    let is_number = |token: &str| number(token).is_some();
    for window in tokens.windows(4) {
        let found = match *window {
            ["case", code, ..] if is_number(code) => Some(format!("the code {code} has no name")),
            ["workgroup_size", "(", size, ..] if is_number(size) && size != "1" => {
                Some(format!("{size} threads in a group are not `GROUP_SIZE`"))
            }
            [record, "+", place, _] if RECORDS.contains(&record) && is_number(place) => {
                Some(format!("the place {place} in `{record}` has no name"))
            }
            [words, "[", record, "]"] if words.ends_with("_words") && RECORDS.contains(&record) => {
                Some(format!("the first place in `{record}` has no name"))
            }
            [reader, "(", record, ")" | ","] if READERS.contains(&reader) && RECORDS.contains(&record) => {
                Some(format!("the first place in `{record}` has no name"))
            }
            [code, "&", flag, _] if CODES.contains(&code) && is_number(flag) => {
                Some(format!("the flag {flag} of `{code}` has no name"))
            }
            [code, ">", ">", shift] if CODES.contains(&code) && is_number(shift) => {
                Some(format!("the shift {shift} of `{code}` has no name"))
            }
            ["p", ")", "[", index] if is_number(index) => Some(format!("the parameter {index} has no name")),
            ["first", "+", index, "]"] if is_number(index) => Some(format!("the parameter {index} has no name")),
            _ => None,
        };
        if found.is_some() {
            return found;
        }
    }
    None
}

#[test]
fn no_shader_repeats_a_shared_constant_by_hand() {
    let mut faults = Vec::new();
    for (name, text) in shaders() {
        let lines = text.lines().zip(1..).filter_map(|(line, number)| Some((number, fault(line)?)));
        faults.extend(lines.map(|(number, fault)| format!("src/wgsl/{name}.wgsl:{number}: {fault}")));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn constants_written_by_hand_are_found() {
    let by_hand = [
        "const LIGHT_WORDS: u32 = 24u;",
        "const ANYTHING: f32 = 0.5;",
        "const WAY: vec3f = vec3f(1.0);",
        "let x = y * 0.159154943;",
        "if t > 3e38 {",
        "if (instance & 0x80000000u) != 0u {",
        "let material = scene_words[sphere + 8u];",
        "let kind = scene_words[record];",
        "let corner = vec3_at(record);",
        "case 2u: {",
        "@compute @workgroup_size(64)",
        "if (flags & 16u) != 0u {",
        "let v = (flags >> 4u) & MAP_WRAP_MASK;",
        "let color = (*p)[3];",
        "let k = (*p)[first + 1u];",
    ];
    for line in by_hand {
        assert!(fault(line).is_some(), "{line}");
    }
    for line in
        ["let half = 0.5 * x; // const PI: f32 = 3.14159265;", "const NOTHING: Bsdf = Bsdf(0u);", "case LIGHT_SPOT: {"]
    {
        assert_eq!(fault(line), None, "{line}");
    }
}
