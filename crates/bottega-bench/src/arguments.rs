//! Options shared by several measurements, and parsers of their values.

use std::{path::PathBuf, time::Duration};

use bottega::{
    devices::processors,
    request::{WordChoice, check_size},
};
use clap::{
    Args,
    builder::{PossibleValue, PossibleValuesParser, TypedValueParser},
};

use crate::error::Error;

/// The folder of scenes that do not come with the program.
#[derive(Clone, Debug, Args)]
pub(crate) struct SceneFolder {
    /// The folder of scenes. Default: what the environment variable BOTTEGA_SCENES names.
    #[arg(long = "scenes", value_name = "FOLDER", env = "BOTTEGA_SCENES")]
    folder: Option<PathBuf>,
}

impl SceneFolder {
    /// Returns a file of the folder, if a folder is named.
    pub(crate) fn place(&self, name: &str) -> Option<PathBuf> {
        self.folder.as_ref().map(|folder| folder.join(name))
    }

    /// Returns the requested scene, or else the one with this name in the folder.
    ///
    /// # Errors
    /// Neither a scene nor a folder is named.
    pub(crate) fn scene(&self, requested: Option<&PathBuf>, name: &str) -> Result<PathBuf, Error> {
        requested.cloned().or_else(|| self.place(name)).ok_or(Error::NoScene)
    }
}

/// Returns the requested number of threads, or else that of the processors.
pub(crate) fn threads(requested: Option<u16>) -> usize {
    requested.map_or_else(processors, usize::from)
}

/// Parses one of the words of a choice; `--help` shows the meaning of each.
pub(crate) fn choice<T: WordChoice>() -> impl TypedValueParser<Value = T> {
    let values = T::VARIANTS.iter().map(|choice| PossibleValue::new(choice.word()).help(choice.meaning()));
    PossibleValuesParser::new(values.collect::<Vec<_>>()).try_map(|word| T::of_word(&word).ok_or("no such word"))
}

/// Parses a number within bounds.
pub(crate) fn number(least: f64, greatest: f64) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| match text.parse() {
        Ok(number) if (least..=greatest).contains(&number) => Ok(number),
        _ => Err(format!("a number from {least} to {greatest} is needed")),
    }
}

/// Parses width and height of an image.
pub(crate) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once('x').and_then(|(width, height)| Some((width.parse().ok()?, height.parse().ok()?)));
    let (width, height) = sides.ok_or("two numbers of pixels with an x between are needed, such as 1280x720")?;
    check_size([width, height], None).map_err(|error| error.to_string())?;
    Ok((width, height))
}

/// Parses a name and its value.
pub(crate) fn parse_define(text: &str) -> Result<(String, String), String> {
    let (name, value) = text.split_once('=').ok_or("a name, `=` and a value are needed, such as spp=64")?;
    Ok((name.trim().to_owned(), value.to_owned()))
}

/// Parses a duration with its unit.
pub(crate) fn parse_time(text: &str) -> Result<Duration, String> {
    let units = [("ms", 1e-3), ("s", 1.0)];
    let seconds = units.into_iter().find_map(|(unit, seconds)| {
        let number: f64 = text.strip_suffix(unit)?.parse().ok()?;
        Some(number * seconds).filter(|seconds| (0.0..=3600.0).contains(seconds))
    });
    seconds.map(Duration::from_secs_f64).ok_or_else(|| "a time up to an hour is needed, such as 5ms or 0.1s".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_checked() {
        assert_eq!(parse_size("640x480"), Ok((640, 480)));
        for absurd in ["", "x", "0x0", "640", "640x", "-1x5", "99999999999x1", "1e3x5"] {
            assert!(parse_size(absurd).is_err(), "{absurd}");
        }
        assert_eq!(parse_time("0.5ms"), Ok(Duration::from_micros(500)));
        assert_eq!(parse_time("2s"), Ok(Duration::from_secs(2)));
        for absurd in ["", "5", "ms", "-1s", "1e9s", "nans", "soon"] {
            assert!(parse_time(absurd).is_err(), "{absurd}");
        }
        let scale = number(0.02, 8.0);
        assert_eq!(scale("0.5"), Ok(0.5));
        for absurd in ["", "0.01", "9", "nan", "half"] {
            assert!(scale(absurd).is_err(), "{absurd}");
        }
        assert_eq!(parse_define("spp=a=b"), Ok(("spp".to_owned(), "a=b".to_owned())));
        assert!(parse_define("spp").is_err());
    }
}
