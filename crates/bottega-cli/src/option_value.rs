//! The error of option values, and parsers that several commands share.

use std::time::Duration;

use bottega::request::SECONDS;

/// The reason why a text is not the value of an option, with what is needed instead.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct InvalidValue(String);

impl From<String> for InvalidValue {
    fn from(needed: String) -> Self {
        Self(needed)
    }
}

impl From<&str> for InvalidValue {
    fn from(needed: &str) -> Self {
        Self(needed.to_owned())
    }
}

/// Parses a duration, such as 90s.
pub(crate) fn parse_duration(text: &str) -> Result<Duration, InvalidValue> {
    parse_seconds(text).map(Duration::from_secs_f64)
}

/// Parses a duration, in seconds.
pub(crate) fn parse_seconds(text: &str) -> Result<f64, InvalidValue> {
    let units = [("h", 3600.0), ("m", 60.0), ("s", 1.0)];
    let (number, unit) =
        units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
    match number.trim().parse::<f64>() {
        Ok(time) if SECONDS.contains(&(time * unit)) => Ok(time * unit),
        _ => Err("a time such as 90, 90s, 10m or 1.5h is needed, of 0.1 seconds at least".into()),
    }
}
