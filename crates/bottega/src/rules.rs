//! Expert rules, from files or built in. Errors point at the place in the text.

use std::path::{Path, PathBuf};

use bottega_farm::{EngineChoice, Expert, ExpertError};
use bottega_fuzzy::{Aggregate, Document, Explanation, FclErrorKind, FunctionBlock, Position, parse_document};
use serde_json::{Map, Value, json};

use crate::{error::Error, request::RulesText, technique_choice::TechniqueChoice};

/// The parsed text of rules in FCL, the Fuzzy Control Language.
pub struct Source {
    /// The file, or the name of built-in rules, as given by the user.
    pub path: PathBuf,
    /// The whole text of the rules.
    pub text: String,
    /// The parsed form of the text.
    pub document: Document,
}

impl Source {
    /// Reads a rule file. If there is no such file, the name of built-in rules stands for those.
    ///
    /// # Errors
    /// The file cannot be read, or is not valid FCL.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::of(RulesText::read(path)?)
    }

    pub(crate) fn of(RulesText { name: path, text }: RulesText) -> Result<Self, Error> {
        match parse_document(&text) {
            Ok(document) => Ok(Self { path, text, document }),
            Err(error) => Err(at(&path, &text, error.at, error.kind.to_string())),
        }
    }

    /// Returns a function block of the text.
    ///
    /// - `name`: name of the block, letter case ignored; `None`: the only block.
    ///
    /// # Errors
    /// There is no such block; with `None`, also if there are several.
    pub fn block(&self, name: Option<&str>) -> Result<&FunctionBlock, Error> {
        let blocks = &self.document.blocks;
        let names: Vec<&str> = blocks.iter().map(FunctionBlock::name).collect();
        let file = self.path.display();
        match name {
            Some(name) => blocks.iter().find(|block| block.name().eq_ignore_ascii_case(name)).ok_or_else(|| {
                Error::usage(format!("`{file}` has no function block `{name}`"), format!("it has {}", names.join(", ")))
            }),
            None if blocks.len() == 1 => Ok(&blocks[0]),
            None if blocks.is_empty() => Err(self.whole(FclErrorKind::BlockCount(0).to_string())),
            None => Err(Error::usage(
                format!("`{file}` has {} function blocks", blocks.len()),
                format!("choose one by --block: {}", names.join(", ")),
            )),
        }
    }

    /// Converts the only function block by `read`, and locates its errors in the text.
    fn understood<T>(&self, read: impl FnOnce(FunctionBlock) -> Result<T, ExpertError>) -> Result<T, Error> {
        if self.document.blocks.len() != 1 {
            return Err(self.whole(FclErrorKind::BlockCount(self.document.blocks.len()).to_string()));
        }
        read(self.document.blocks[0].clone()).map_err(|error| match &error {
            ExpertError::UnknownInput { name, .. } => match self.document.input_position(0, name) {
                Some(place) => at(&self.path, &self.text, place, error.to_string()),
                None => self.whole(error.to_string()),
            },
            _ => self.whole(error.to_string()),
        })
    }

    /// Makes an error about the whole text.
    fn whole(&self, problem: String) -> Error {
        Error::Rules { path: self.path.clone(), problem }
    }
}

/// Returns the experts of these rule texts, and warnings about them; without texts the built-in expert for path tracing.
///
/// # Errors
/// A text is not valid FCL, or its rules do not fit zones: see [`Expert::new`].
pub fn experts(texts: Vec<RulesText>) -> Result<(Vec<Expert>, Vec<String>), Error> {
    if texts.is_empty() {
        return Ok((vec![Expert::path_tracing()], Vec::new()));
    }
    let (mut experts, mut notes) = (Vec::new(), Vec::new());
    for text in texts {
        let source = Source::of(text)?;
        let expert = source.understood(Expert::new)?;
        let file = source.path.display();
        notes.extend(source.document.verify().into_iter().map(|warning| format!("{file}, {warning}")));
        if !expert.ignored_outputs().is_empty() {
            let names = expert.ignored_outputs().join(", ");
            notes.push(format!("{file}: ignored, because path tracing does not use them: {names}"));
        }
        experts.push(expert);
    }
    Ok((experts, notes))
}

/// Returns the rules that choose the engine of a zone.
///
/// # Errors
/// The text is not valid FCL, or its rules do not choose an engine.
pub fn engine_choice(text: RulesText) -> Result<EngineChoice, Error> {
    Source::of(text)?.understood(EngineChoice::new)
}

/// Returns the rules that choose between paths and photons.
///
/// # Errors
/// The text is not valid FCL, or its rules do not choose a technique.
pub fn technique_choice(text: RulesText) -> Result<TechniqueChoice, Error> {
    let source = Source::of(text)?;
    source.understood(|rules| TechniqueChoice::new(&source.text, rules))
}

/// Returns the names of a block's inputs as a phrase for messages.
pub fn inputs(block: &FunctionBlock) -> String {
    block.inputs().iter().map(|input| input.name.as_str()).collect::<Vec<_>>().join(", ")
}

fn at(path: &Path, text: &str, place: Position, problem: String) -> Error {
    Error::RulesText { path: path.to_owned(), place, problem, text: text.into(), span: place.range_in(text) }
}

/// Returns a function block with the terms of some inputs laid out over intervals of values, such as those found in a scene.
///
/// - `name`: name of the block, if the source has several.
/// - `ranges`: name, minimum and maximum of each input.
///
/// # Errors
/// There is no such block or input, or an interval is invalid.
pub fn laid_out(source: &Source, name: Option<&str>, ranges: &[(&str, f64, f64)]) -> Result<FunctionBlock, Error> {
    let mut block = source.block(name)?.clone();
    let inputs = inputs(&block);
    for (input, min, max) in ranges {
        block
            .layout_inputs(input, *min, *max)
            .map_err(|error| Error::usage(error.to_string(), format!("the inputs are {inputs}")))?;
    }
    Ok(block)
}

/// Returns the result of rules as JSON: `outputs` by name; with `explain` also the degrees of the inputs' terms, the rules that
/// fire, and the aggregated result per output.
pub fn explained(block: &FunctionBlock, why: &Explanation, explain: bool) -> Value {
    let names = || block.outputs().iter().map(|output| output.name.clone());
    let outputs: Map<String, Value> = names().zip(why.outputs.values().iter().map(|value| json!(value))).collect();
    if !explain {
        return json!({"outputs": outputs});
    }
    let inputs: Map<String, Value> = why
        .inputs
        .iter()
        .map(|(name, terms)| {
            let terms: Map<String, Value> = terms.iter().map(|(term, degree)| (term.clone(), json!(degree))).collect();
            (name.clone(), Value::Object(terms))
        })
        .collect();
    let rules: Vec<Value> = why
        .rules
        .iter()
        .map(|rule| json!({"label": rule.label, "degree": rule.degree, "conclusions": rule.conclusions}))
        .collect();
    let aggregate = |aggregate: &Aggregate| match aggregate {
        Aggregate::Singletons(points) => json!({"singletons": points}),
        Aggregate::Linear(points) => json!({"points": points}),
    };
    let together: Map<String, Value> = names().zip(why.aggregates.iter().map(aggregate)).collect();
    json!({"inputs": inputs, "rules": rules, "aggregates": together, "outputs": outputs})
}
