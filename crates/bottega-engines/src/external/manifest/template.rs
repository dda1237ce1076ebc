//! Command lines with placeholders.

use std::{collections::BTreeMap, fmt};

use serde::{
    Deserialize, Deserializer,
    de::{self, SeqAccess, Visitor},
};

/// The supported placeholders.
const PLACEHOLDERS: &[&str] = &[
    "program",
    "folder",
    "scene",
    "scratch",
    "output",
    "width",
    "height",
    "x0",
    "y0",
    "x1",
    "y1",
    "b0",
    "b1",
    "w",
    "h",
    "samples",
    "max_depth",
    "light_samples",
    "time",
    "seed",
    "first_sample",
    "frame",
    "threads",
];

/// The values of placeholders by their names.
pub type Values = BTreeMap<&'static str, String>;

/// A text with placeholders such as `{x0}` or `{x0+1}`; `{{` and `}}` are literal braces.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Template(Vec<TemplatePart>);

#[derive(Clone, Debug, PartialEq, Eq)]
enum TemplatePart {
    Text(String),
    Value { name: &'static str, plus: i64 },
}

/// The error of a placeholder without a value, with its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Missing(pub &'static str);

impl Template {
    fn parse(text: &str) -> Result<Self, String> {
        let mut parts = vec![TemplatePart::Text(String::new())];
        let mut rest = text;
        while let Some(at) = rest.find(['{', '}']) {
            push(&mut parts, &rest[..at]);
            let brace = &rest[at..=at];
            rest = &rest[at + 1..];
            if rest.starts_with(brace) {
                push(&mut parts, brace);
                rest = &rest[1..];
                continue;
            }
            let ("{", Some((inner, after))) = (brace, rest.split_once('}')) else {
                return Err(format!(
                    "a `{brace}` stands alone in `{text}`; write `{brace}{brace}` for the sign itself"
                ));
            };
            parts.push(placeholder(inner)?);
            rest = after;
        }
        push(&mut parts, rest);
        Ok(Self(parts))
    }

    /// Returns the text with all placeholders replaced.
    ///
    /// # Errors
    /// A placeholder has no value.
    pub fn fill(&self, values: &Values) -> Result<String, Missing> {
        let mut text = String::new();
        for part in &self.0 {
            match part {
                TemplatePart::Text(plain) => text += plain,
                TemplatePart::Value { name, plus } => {
                    let value = values.get(name).ok_or(Missing(name))?;
                    match value.parse::<i64>() {
                        Ok(number) if *plus != 0 => text += &number.saturating_add(*plus).to_string(),
                        _ => text += value,
                    }
                }
            }
        }
        Ok(text)
    }

    fn uses(&self, wanted: &str) -> bool {
        self.0.iter().any(|part| matches!(part, TemplatePart::Value { name, .. } if *name == wanted))
    }
}

fn push(parts: &mut Vec<TemplatePart>, text: &str) {
    match parts.last_mut() {
        Some(TemplatePart::Text(last)) => last.push_str(text),
        _ => parts.push(TemplatePart::Text(text.to_owned())),
    }
}

fn placeholder(inner: &str) -> Result<TemplatePart, String> {
    let end = inner.find(['+', '-']).unwrap_or(inner.len());
    let (name, plus) = inner.split_at(end);
    let name = PLACEHOLDERS.iter().find(|known| **known == name);
    let name =
        name.ok_or_else(|| format!("there is no placeholder {{{inner}}}; there are {}", PLACEHOLDERS.join(", ")))?;
    let plus = if plus.is_empty() { Ok(0) } else { plus.parse::<i32>() };
    let plus = plus.map_err(|_| format!("{{{inner}}}: only a whole number may be added"))?;
    Ok(TemplatePart::Value { name, plus: i64::from(plus) })
}

/// An argument, or a group of arguments that is omitted if one of them has no value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Argument {
    /// A single argument, omitted if a placeholder has no value.
    One(Template),
    /// Arguments of which all or none are used.
    Group(Vec<Template>),
}

impl Argument {
    /// Returns true if the argument contains this placeholder.
    pub(super) fn uses(&self, name: &str) -> bool {
        match self {
            Self::One(template) => template.uses(name),
            Self::Group(templates) => templates.iter().any(|template| template.uses(name)),
        }
    }

    /// Returns the command line, without arguments and groups in which a placeholder has no value.
    pub fn fill_all(arguments: &[Self], values: &Values) -> Vec<String> {
        let filled = arguments.iter().filter_map(|argument| match argument {
            Self::One(template) => template.fill(values).ok().map(|one| vec![one]),
            Self::Group(group) => group.iter().map(|template| template.fill(values).ok()).collect(),
        });
        filled.flatten().collect()
    }
}

impl<'de> Deserialize<'de> for Argument {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Argument;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a string, or an array of strings")
            }

            fn visit_str<E: de::Error>(self, text: &str) -> Result<Argument, E> {
                Template::parse(text).map(Argument::One).map_err(E::custom)
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut all: A) -> Result<Argument, A::Error> {
                let mut group = Vec::new();
                while let Some(text) = all.next_element::<String>()? {
                    group.push(Template::parse(&text).map_err(de::Error::custom)?);
                }
                Ok(Argument::Group(group))
            }
        }
        from.deserialize_any(Either)
    }
}
