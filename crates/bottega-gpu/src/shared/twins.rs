//! Tests that compare shaders with their twins: the Rust files that compute the same.
//!
//! The first line of a shader names its twin: the file with the same name in the same folder, below another `src`. Functions with
//! the same name in both are in the same order; the name of a shader's function is the Rust function's name, prefixed by its type
//! or file. Distinctive numbers of a formula must occur in both.

use std::fs;
use std::path::PathBuf;

use super::check::{Number, is_particular, number, shaders, tokens};

/// Returns the path of the twin below `crates/`; `None`: there is none.
fn twin_of(name: &str, text: &str) -> Option<String> {
    let first = text.lines().next().unwrap_or_default();
    if first == "// No twin." {
        return None;
    }
    let twin = first.strip_prefix("// Twin: `").and_then(|rest| rest.strip_suffix("`."));
    let twin = twin.unwrap_or_else(|| panic!("src/wgsl/{name}.wgsl:1: neither `// Twin: …` nor `// No twin.`"));
    let (_, place) = twin.split_once("/src/").expect("a path below `crates/`");
    assert_eq!(place, format!("{name}.rs"), "src/wgsl/{name}.wgsl:1: a twin has the same name");
    Some(twin.to_owned())
}

fn rust(twin: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("..").join(twin);
    let text = fs::read_to_string(&path).unwrap_or_else(|error| panic!("{twin}: {error}"));
    text.split("\n#[cfg(test)]\nmod tests {").next().unwrap_or_default().to_owned()
}

/// A function, and the type that it belongs to.
#[derive(Debug, PartialEq)]
struct Function {
    of: Option<String>,
    name: String,
}

fn functions(text: &str) -> Vec<Function> {
    let (mut functions, mut of) = (Vec::new(), None);
    for line in text.lines() {
        let tokens = tokens(line);
        if line.starts_with("impl") || line.starts_with("pub(super) trait") || line.starts_with("pub trait") {
            of = self_type(&tokens);
        } else if line.starts_with('}') {
            of = None;
        }
        if let Some(pair) = tokens.windows(2).find(|pair| pair[0] == "fn") {
            functions.push(Function { of: of.clone(), name: pair[1].to_owned() });
        }
    }
    functions
}

/// Returns `Type` of `impl Trait for Type<…> {`, in lower case.
fn self_type(tokens: &[&str]) -> Option<String> {
    let place = tokens.iter().position(|&token| token == "for" || token == "trait");
    let mut rest = match place {
        Some(place) => &tokens[place + 1..],
        None => &tokens[1..],
    };
    if place.is_none() && rest.first() == Some(&"<") {
        rest = &rest[rest.iter().position(|&token| token == ">")? + 1..];
    }
    rest.iter().find(|token| token.starts_with(char::is_uppercase)).map(|name| snake(name))
}

fn snake(name: &str) -> String {
    name.char_indices().fold(String::new(), |mut snake, (place, sign)| {
        if sign.is_uppercase() && place > 0 {
            snake.push('_');
        }
        snake.extend(sign.to_lowercase());
        snake
    })
}

/// Ranks how well a shader's function matches a Rust function by name; lower is closer, `None`: not a match.
fn likeness(name: &str, stem: &str, function: &Function) -> Option<u8> {
    let Function { of, name: own } = function;
    let is = |prefix: &str| name.strip_suffix(own.as_str()).and_then(|rest| rest.strip_suffix('_')) == Some(prefix);
    match of {
        None => (name == own || is(stem)).then_some(0),
        Some(of) if is(of) || of.strip_suffix("_at").is_some_and(is) => Some(0),
        Some(_) if name == own => Some(1),
        Some(of) if is(&format!("{stem}_{of}")) => Some(2),
        Some(_) => is(stem).then_some(3),
    }
}

/// Returns the index of the Rust function that matches a shader's function best.
fn place_of(name: &str, stem: &str, rust: &[Function]) -> Option<usize> {
    let like = rust.iter().enumerate().filter_map(|(place, it)| Some((likeness(name, stem, it)?, place)));
    like.min().map(|(_, place)| place)
}

#[test]
fn twins_have_the_same_name_and_the_same_order() {
    let (mut twins, mut paired, mut all) = (0, 0, 0);
    for (name, text) in shaders() {
        let Some(twin) = twin_of(&name, &text) else { continue };
        let (stem, rust) = (name.rsplit('/').next().unwrap_or_default(), functions(&rust(&twin)));
        let own = functions(&text);
        let places: Vec<_> = own.iter().filter_map(|it| Some((place_of(&it.name, stem, &rust)?, &it.name))).collect();
        assert!(!places.is_empty(), "src/wgsl/{name}.wgsl has no function of {twin}");
        for pair in places.windows(2) {
            assert!(
                pair[0].0 < pair[1].0,
                "src/wgsl/{name}.wgsl: `{}` comes before `{}` in {twin}",
                pair[1].1,
                pair[0].1
            );
        }
        (twins, paired, all) = (twins + 1, paired + places.len(), all + own.len());
    }
    eprintln!("{twins} twins, in which {paired} of {all} functions have one");
    assert!(twins > 40 && 3 * paired > 2 * all);
}

/// Returns a number and the two halves of its 64 bits, which shaders have as two words.
fn parts(number: Number) -> Vec<u64> {
    match number {
        Number::Whole(whole) => vec![whole, whole & 0xffff_ffff, whole >> 32],
        Number::Real(_) => Vec::new(),
    }
}

/// Files whose formulas differ from Rust's, for lack of double precision.
const OTHER_FORMULAS: &[&str] = &["math"];

/// Files of formulas that several Rust twins share; shaders repeat them.
const SHARED_FORMULAS: &[&str] = &["bottega-kernels/src/split_mix.rs", "bottega-render/src/bsdf/fresnel.rs"];

#[test]
fn particular_numbers_of_formulas_stand_in_both_twins() {
    let mut lonely = Vec::new();
    for (name, text) in shaders() {
        let Some(twin) = twin_of(&name, &text).filter(|_| !OTHER_FORMULAS.contains(&name.as_str())) else { continue };
        let texts = std::iter::once(twin.as_str()).chain(SHARED_FORMULAS.iter().copied()).map(rust);
        let known: Vec<_> =
            texts.flat_map(|text| text.lines().flat_map(tokens).filter_map(number).collect::<Vec<_>>()).collect();
        let stands_there = |wanted: Number| {
            known.iter().any(|&it| match (wanted, it) {
                (Number::Real(a), Number::Real(b)) => (a as f32).to_bits() == (b as f32).to_bits(),
                (Number::Whole(whole), it) => parts(it).contains(&whole),
                (Number::Real(_), Number::Whole(_)) => false,
            })
        };
        for (line, row) in text.lines().zip(1..) {
            let particular = tokens(line).into_iter().filter_map(number).filter(|&it| is_particular(it));
            lonely.extend(
                particular
                    .filter(|&it| !stands_there(it))
                    .map(|it| format!("src/wgsl/{name}.wgsl:{row}: {it:?} does not stand in {twin}")),
            );
        }
    }
    assert!(lonely.is_empty(), "{}", lonely.join("\n"));
}

#[test]
fn functions_are_found_by_their_names() {
    let rust = functions("impl<'a> Scatter for Metal<'a> {\n    fn eval(&self) {\n    }\n}\nfn mixed() {}\n");
    let names: Vec<_> = rust.iter().map(|it| (it.of.as_deref(), it.name.as_str())).collect();
    assert_eq!(names, [(Some("metal"), "eval"), (None, "mixed")]);
    let place = |name| place_of(name, "conductor", &rust);
    assert_eq!([place("metal_eval"), place("conductor_eval"), place("conductor_mixed")], [Some(0), Some(0), Some(1)]);
    assert_eq!([place("glass_eval"), place("eval_metal")], [None, None]);
}
