//! Spectrum files: a wavelength in nanometres and a value per line, as in Mitsuba and pbrt.

use std::path::Path;

use super::sampled::SampledSpectrum;
use crate::budget::MemoryBudget;
use crate::error::SceneError;
use crate::text::{column, decode, shortened};

/// Reads a file such as `gold.eta.spd`. `#` starts a comment.
///
/// - `path`: for errors.
/// - `bytes`: the file.
pub(crate) fn read_spd(path: &Path, bytes: &[u8], budget: &MemoryBudget) -> Result<SampledSpectrum, SceneError> {
    let text = decode(path, bytes, budget)?.text;
    let mut samples: Vec<(f64, f64)> = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        let invalid = |word: &str, problem: String| SceneError::Text {
            path: path.into(),
            line: number + 1,
            column: column(line.as_bytes(), word.as_bytes()),
            problem,
        };
        let mut words = line.split([' ', '\t', ',', '\r']).filter(|word| !word.is_empty());
        let Some(first) = words.next() else { continue };
        let (Some(second), None) = (words.next(), words.next()) else {
            return Err(invalid(first, "a line of a spectrum holds a wavelength and a value".into()));
        };
        let parse = |word: &str| {
            let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| invalid(word, format!("`{}` is not a number", shortened(word))))
        };
        let (nm, value) = (parse(first)?, parse(second)?);
        if nm <= 0.0 {
            return Err(invalid(first, format!("{nm} nm is not a wavelength")));
        }
        if value < 0.0 {
            return Err(invalid(second, format!("the value {value} is negative")));
        }
        if let Some((last, _)) = samples.last().filter(|(last, _)| *last >= nm) {
            return Err(invalid(first, format!("the wavelengths must increase, but {nm} nm follows {last} nm")));
        }
        samples.push((nm, value));
    }
    SampledSpectrum::new(samples)
        .map_err(|problem| SceneError::Damaged { path: path.into(), problem: problem.to_string() })
}
