//! Parameter lists, such as `"float radius" [ 1 ]`.

use std::cell::Cell;
use std::rc::Rc;

use glam::{DVec2, DVec3};

use super::token::{Token, Tokens};
use crate::import::text_place::{TextFault, TextPlace};
use crate::spectrum::color_space::ColorSpace;
use crate::text::shortened;

/// The values of a parameter, all of one type.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
    Bools(Vec<bool>),
}

/// A parameter of a directive: its declaration and values.
#[derive(Clone, Debug)]
pub(super) struct Param {
    /// Type, such as `float` or `rgb`.
    pub(super) kind: String,
    pub(super) name: String,
    pub(super) values: Values,
    /// Location of the declaration.
    pub(super) at: TextPlace,
    /// Colour space of its `rgb` values, if set by an attribute rather than by its list.
    color_space: Option<ColorSpace>,
    /// `true`: the parameter was read.
    used: Cell<bool>,
    /// `true`: the parameter is not reported if it was not read.
    may_be_unused: bool,
}

/// A parameter list.
#[derive(Clone, Debug, Default)]
pub(super) struct Params {
    /// Location of the list's directive.
    pub(super) at: TextPlace,
    /// Parameters; later ones take precedence.
    list: Vec<Rc<Param>>,
    color_space: ColorSpace,
}

const KINDS: &[&str] = &[
    "bool",
    "integer",
    "float",
    "point2",
    "vector2",
    "point3",
    "vector3",
    "normal",
    "rgb",
    "spectrum",
    "blackbody",
    "string",
    "texture",
];

impl Params {
    /// Reads a list up to the next directive.
    pub(super) fn read(tokens: &mut Tokens<'_>, at: TextPlace, color_space: ColorSpace) -> Result<Self, TextFault> {
        let mut list = Vec::new();
        while let Some((Token::Text(_), _)) = tokens.peek()? {
            let Some((Token::Text(declaration), at)) = tokens.next()? else { break };
            let mut words = declaration.split([' ', '\t']).filter(|word| !word.is_empty());
            let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
                let problem = format!("\"{}\" is not a parameter: it should be \"type name\"", shortened(&declaration));
                return Err(at.fault(problem));
            };
            let kind = match kind {
                "point" => "point3",
                "vector" => "vector3",
                "normal3" => "normal",
                kind => kind,
            };
            if kind == "color" || kind == "xyz" {
                return Err(at.fault(format!("parameters of type \"{kind}\" are those of pbrt-v3; {UPGRADE}")));
            }
            if !KINDS.contains(&kind) {
                return Err(at.fault(format!("\"{}\" is not a type of parameter", shortened(kind))));
            }
            let values = read_values(tokens, at, kind)?;
            list.push(Rc::new(Param {
                kind: kind.into(),
                name: name.into(),
                values,
                at,
                color_space: None,
                used: Cell::new(false),
                may_be_unused: false,
            }));
        }
        list.reverse();
        Ok(Self { at, list, color_space })
    }

    /// Returns the parameters as attributes, defaults of later lists.
    pub(super) fn into_attributes(self) -> impl Iterator<Item = Rc<Param>> {
        let color_space = self.color_space;
        self.list.into_iter().rev().map(move |param| {
            let param = Rc::try_unwrap(param).unwrap_or_else(|shared| (*shared).clone());
            Rc::new(Param { color_space: Some(color_space), may_be_unused: true, ..param })
        })
    }

    /// Adds attributes as defaults; the last attribute takes precedence.
    pub(super) fn with_attributes(mut self, attributes: &[Rc<Param>]) -> Self {
        self.list.extend(attributes.iter().rev().cloned());
        self
    }

    /// Returns the parameter that takes precedence among those with this name and one of these types; `None`: there is
    /// none. Marks them as read.
    pub(super) fn find(&self, name: &str, kinds: &[&str]) -> Option<&Param> {
        let found = self.list.iter().find(|param| param.name == name && kinds.contains(&param.kind.as_str()))?;
        // Mark the overridden ones as read, too.
        let same = |param: &&Rc<Param>| param.name == name && kinds.contains(&param.kind.as_str());
        self.list.iter().filter(same).for_each(|param| param.used.set(true));
        Some(found)
    }

    /// Returns the colour space of the `rgb` values of a parameter of this list.
    pub(super) fn color_space_of(&self, param: &Param) -> ColorSpace {
        param.color_space.unwrap_or(self.color_space)
    }

    /// Returns the colour space at the location of the list.
    pub(super) fn color_space(&self) -> ColorSpace {
        self.color_space
    }

    /// Returns the memory of the list, in bytes.
    pub(super) fn memory_bytes(&self) -> usize {
        let values = |param: &Rc<Param>| match &param.values {
            Values::Numbers(numbers) => size_of_val(&numbers[..]),
            Values::Texts(texts) => texts.iter().map(|text| size_of::<String>() + text.len()).sum(),
            Values::Bools(bools) => bools.len(),
        };
        self.list.iter().map(|param| size_of::<Param>() + param.name.len() + param.kind.len() + values(param)).sum()
    }

    /// Returns the location of the parameter, or else of the list.
    pub(super) fn place_of(&self, name: &str) -> TextPlace {
        self.list.iter().find(|param| param.name == name).map_or(self.at, |param| param.at)
    }

    /// Marks parameters as read that belong to a feature already reported as replaced or left out.
    pub(super) fn mark_reported(&self, names: &[&str]) {
        let ignored = self.list.iter().filter(|param| names.contains(&param.name.as_str()));
        ignored.for_each(|param| param.used.set(true));
    }

    /// Iterates over the parameters that were not read.
    pub(super) fn unused(&self) -> impl Iterator<Item = &Param> {
        self.list.iter().map(AsRef::as_ref).filter(|param| !param.used.get() && !param.may_be_unused)
    }

    fn numbers(&self, name: &str, kind: &str) -> Option<(&[f64], TextPlace)> {
        let param = self.find(name, &[kind])?;
        if let Values::Numbers(numbers) = &param.values { Some((numbers, param.at)) } else { None }
    }

    /// Returns a single number by its name; `None`: not given.
    pub(super) fn float(&self, name: &str) -> Result<Option<f64>, TextFault> {
        self.numbers(name, "float").map(|(numbers, at)| one(numbers, at, name)).transpose()
    }

    /// Returns a single integer by its name; `None`: not given.
    pub(super) fn integer(&self, name: &str) -> Result<Option<i64>, TextFault> {
        self.numbers(name, "integer").map(|(numbers, at)| one(numbers, at, name).map(|x| x as i64)).transpose()
    }

    /// Returns a single boolean by its name; `None`: not given.
    pub(super) fn bool(&self, name: &str) -> Result<Option<bool>, TextFault> {
        let Some(param) = self.find(name, &["bool"]) else { return Ok(None) };
        match &param.values {
            Values::Bools(bools) => one(bools, param.at, name).map(Some),
            _ => Ok(None),
        }
    }

    /// Returns a single text by its name; `None`: not given.
    pub(super) fn text(&self, name: &str) -> Result<Option<&str>, TextFault> {
        self.texts(name).map(|(texts, at)| one_of(texts, at, name).map(String::as_str)).transpose()
    }

    /// Returns a list of texts by its name; `None`: not given.
    pub(super) fn texts(&self, name: &str) -> Option<(&[String], TextPlace)> {
        let param = self.find(name, &["string"])?;
        if let Values::Texts(texts) = &param.values { Some((texts, param.at)) } else { None }
    }

    /// Returns the name of the texture that a parameter refers to; `None`: the parameter is not a texture.
    pub(super) fn texture(&self, name: &str) -> Result<Option<(&str, TextPlace)>, TextFault> {
        let Some(param) = self.find(name, &["texture"]) else { return Ok(None) };
        match &param.values {
            Values::Texts(texts) => Ok(Some((one_of(texts, param.at, name)?, param.at))),
            _ => Ok(None),
        }
    }

    /// Returns a list of numbers by its name; `None`: not given.
    pub(super) fn floats(&self, name: &str) -> Option<&[f64]> {
        self.numbers(name, "float").map(|(numbers, _)| numbers)
    }

    /// Returns a list of integers by its name; `None`: not given.
    pub(super) fn integers(&self, name: &str) -> Option<&[f64]> {
        self.numbers(name, "integer").map(|(numbers, _)| numbers)
    }

    /// Returns a list of 2D points by its name; `None`: not given.
    pub(super) fn points2(&self, name: &str) -> Result<Option<Vec<DVec2>>, TextFault> {
        self.tuples(name, "point2", |[x, y]| DVec2::new(x, y))
    }

    /// Returns a list of 3D points, or normals or vectors for `kind` `normal` or `vector3`; `None`: not given.
    pub(super) fn points3(&self, name: &str, kind: &str) -> Result<Option<Vec<DVec3>>, TextFault> {
        self.tuples(name, kind, |[x, y, z]| DVec3::new(x, y, z))
    }

    /// Returns a single point or vector; `None`: not given.
    pub(super) fn point3(&self, name: &str, kind: &str) -> Result<Option<DVec3>, TextFault> {
        let Some(points) = self.points3(name, kind)? else { return Ok(None) };
        one(&points, self.place_of(name), name).map(Some)
    }

    fn tuples<const N: usize, T>(
        &self,
        name: &str,
        kind: &str,
        make: impl Fn([f64; N]) -> T,
    ) -> Result<Option<Vec<T>>, TextFault> {
        let Some((numbers, at)) = self.numbers(name, kind) else { return Ok(None) };
        let (tuples, rest) = numbers.as_chunks::<N>();
        if !rest.is_empty() {
            return Err(at.fault(format!("`{name}` has {} numbers, which is not a multiple of {N}", numbers.len())));
        }
        Ok(Some(tuples.iter().map(|&tuple| make(tuple)).collect()))
    }
}

/// The remedy for a pbrt-v3 file.
pub(super) const UPGRADE: &str = "convert the file with `pbrt --upgrade old.pbrt > new.pbrt`";

fn one_of<'a, T>(values: &'a [T], at: TextPlace, name: &str) -> Result<&'a T, TextFault> {
    match values {
        [value] => Ok(value),
        _ => Err(at.fault(format!("`{}` has {} values instead of one", shortened(name), values.len()))),
    }
}

fn one<T: Copy>(values: &[T], at: TextPlace, name: &str) -> Result<T, TextFault> {
    one_of(values, at, name).copied()
}

fn read_values(tokens: &mut Tokens<'_>, at: TextPlace, kind: &str) -> Result<Values, TextFault> {
    let ended = || at.fault("the file ends before the value of this parameter");
    let mut values = match kind {
        "bool" => Values::Bools(Vec::new()),
        "string" | "texture" => Values::Texts(Vec::new()),
        // A spectrum is given by numbers or names: the first value decides.
        _ => Values::Numbers(Vec::new()),
    };
    let (first, place) = tokens.next()?.ok_or_else(ended)?;
    if first != Token::Open {
        push_value(&mut values, &first, place, kind)?;
        return Ok(values);
    }
    loop {
        let (token, place) = tokens.next()?.ok_or_else(ended)?;
        if token == Token::Close {
            return Ok(values);
        }
        push_value(&mut values, &token, place, kind)?;
    }
}

fn push_value(values: &mut Values, token: &Token<'_>, at: TextPlace, kind: &str) -> Result<(), TextFault> {
    let expected = |what: &str| Err(at.fault(format!("a parameter of type \"{kind}\" takes {what}")));
    match (&mut *values, token) {
        (Values::Numbers(numbers), Token::Word(word)) => {
            let number = number(word).ok_or_else(|| at.fault(format!("`{}` is not a number", shortened(word))))?;
            if kind == "integer" && (number.fract() != 0.0 || number.abs() > f64::from(i32::MAX)) {
                return Err(at.fault(format!("`{}` is not an integer of 32 bits", shortened(word))));
            }
            numbers.push(number);
        }
        (Values::Numbers(numbers), Token::Text(text)) if kind == "spectrum" && numbers.is_empty() => {
            *values = Values::Texts(vec![text.clone().into_owned()]);
        }
        (Values::Texts(texts), Token::Text(text)) => texts.push(text.clone().into_owned()),
        // pbrt-v3 has booleans in quotes.
        (Values::Bools(bools), Token::Word(word) | Token::Text(word)) => match word.as_ref() {
            "true" => bools.push(true),
            "false" => bools.push(false),
            _ => return expected("true or false"),
        },
        (Values::Numbers(_), _) => return expected("numbers"),
        (Values::Texts(_), _) => return expected("texts in quotes"),
        (Values::Bools(_), _) => return expected("true or false"),
    }
    Ok(())
}

/// Parses a finite number; `None`: it is not one.
pub(super) fn number(word: &str) -> Option<f64> {
    // Other words that `f64` parses start with a letter: inf, nan, infinity.
    let is_number = word.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E'));
    if !is_number {
        return None;
    }
    word.parse().ok().filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Params, TextFault> {
        let mut tokens = Tokens::new(0, text);
        Params::read(&mut tokens, TextPlace::default(), ColorSpace::default())
    }

    #[test]
    fn values_have_the_type_that_is_declared() {
        let params = read(r#""float r" 2 "point3 P" [0 1 2 3 4 5] "bool b" true "bool c" "false" "string s" ["x"]"#);
        let params = params.unwrap();
        assert_eq!(params.float("r").unwrap(), Some(2.0));
        assert_eq!(params.points3("P", "point3").unwrap().unwrap()[1], DVec3::new(3.0, 4.0, 5.0));
        assert_eq!((params.bool("b").unwrap(), params.bool("c").unwrap()), (Some(true), Some(false)));
        assert_eq!(params.text("s").unwrap(), Some("x"));
        assert_eq!(params.unused().count(), 0);
        assert_eq!(params.float("absent").unwrap(), None);
        for bad in [
            r#""float r" nan"#,
            r#""float r" inf"#,
            r#""float r" 1e999"#,
            r#""float r" "1""#,
            r#""float r" "#,
            r#""float r" [1 2"#,
            r#""integer i" 1.5"#,
            r#""integer i" 3000000000"#,
            r#""bool b" 1"#,
            r#""string s" 1"#,
            r#""float" 1"#,
            r#""quaternion q" 1"#,
            r#""color c" [1 1 1]"#,
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
        assert!(read(r#""float r" [1 2]"#).unwrap().float("r").is_err());
        assert!(read(r#""point3 P" [1 2]"#).unwrap().points3("P", "point3").is_err());
    }

    #[test]
    fn later_parameters_hide_earlier_ones_and_attributes() {
        let attributes: Vec<_> = read(r#""float r" 1 "float s" 5 "float t" 6"#).unwrap().into_attributes().collect();
        let params = read(r#""float r" 2 "float r" 3 "float q" 1"#).unwrap().with_attributes(&attributes);
        assert_eq!(params.float("r").unwrap(), Some(3.0));
        assert_eq!(params.float("s").unwrap(), Some(5.0));
        let unused: Vec<&str> = params.unused().map(|param| param.name.as_str()).collect();
        assert_eq!(unused, ["q"]);
    }
}
