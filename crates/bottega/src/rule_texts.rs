//! Texts of expert rules: from files, from external engines, or built in.

use std::{fs::File, io::Read, path::Path};

use bottega_engines::external::{ShelfEntry, shipped_rules};
use bottega_farm::{EngineChoice, PAPER_RULES, PAPER_RULES_NAME, Technique};
use bottega_fuzzy::Limits;

use crate::{
    error::Error,
    request::{RulesSource, RulesText},
    technique_choice::TechniqueChoice,
};

impl RulesText {
    /// Reads a rule file. If there is no such file, the name of built-in rules stands for those.
    ///
    /// # Errors
    /// The file cannot be read, and there are no built-in rules of that name.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let technique = Technique::ALL.into_iter().find(|technique| Path::new(technique.rules_name()) == path);
        let choice = (Path::new(EngineChoice::RULES_NAME) == path).then_some(EngineChoice::RULES);
        let paper = (Path::new(PAPER_RULES_NAME) == path).then_some(PAPER_RULES);
        let paths_or_photons = (Path::new(TechniqueChoice::RULES_NAME) == path).then_some(TechniqueChoice::RULES);
        let built_in =
            technique.map(Technique::rules).or(choice).or(paths_or_photons).or(paper).or_else(|| shipped_rules(path));
        let text = match built_in {
            Some(text) if !path.is_file() => text.to_owned(),
            _ => read_text(path)?,
        };
        Ok(Self { name: path.to_owned(), text })
    }

    /// Returns the rules of an external engine; `None`: it has none.
    ///
    /// # Errors
    /// The engine's file of rules cannot be read.
    pub fn of_engine(entry: &ShelfEntry) -> Result<Option<Self>, Error> {
        match entry.rules() {
            None => Ok(None),
            Some((path, Some(text))) => Ok(Some(Self { name: path, text: text.to_owned() })),
            Some((path, None)) => Ok(Some(Self { text: read_text(&path)?, name: path })),
        }
    }

    /// Returns the rules of `source`, or the built-in ones of a name without it.
    ///
    /// # Errors
    /// The rules cannot be read.
    pub fn or_built_in(source: Option<&RulesSource>, name: &str) -> Result<Self, Error> {
        match source {
            Some(source) => source.read(),
            None => Self::read(Path::new(name)),
        }
    }
}

impl RulesSource {
    /// Reads the text of the rules.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(&self) -> Result<RulesText, Error> {
        match self {
            Self::File(path) => RulesText::read(path),
            Self::Text(text) => Ok(text.clone()),
        }
    }
}

/// Reads the texts of all rule sources.
///
/// # Errors
/// A file cannot be read.
pub fn rule_texts(sources: &[RulesSource]) -> Result<Vec<RulesText>, Error> {
    sources.iter().map(RulesSource::read).collect()
}

fn read_text(path: &Path) -> Result<String, Error> {
    let unusable = |problem: &str| Error::Rules { path: path.to_owned(), problem: problem.to_owned() };
    if path.is_dir() {
        return Err(unusable("it is a folder; name an .fcl file in it"));
    }
    let read = |source| Error::Read { path: path.to_owned(), source };
    let mut bytes = Vec::new();
    // Read one byte above the limit, which shows that a file is too long without reading all of it
    let most = Limits::TEXT_BYTES_MAX as u64 + 1;
    File::open(path).and_then(|file| file.take(most).read_to_end(&mut bytes)).map_err(read)?;
    if bytes.len() > Limits::TEXT_BYTES_MAX {
        return Err(unusable(&format!(
            "it is longer than {} bytes, the maximum of a rules file",
            Limits::TEXT_BYTES_MAX
        )));
    }
    String::from_utf8(bytes).map_err(|_| unusable("it is not UTF-8 text"))
}
