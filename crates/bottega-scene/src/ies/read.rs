//! The reader of IES LM-63: versions of 1986, 1991, 1995, 2002 and 2019.

use std::path::Path;

use super::planes::full_circle;
use super::profile::IesProfile;
use super::spherical::Goniometer;
use super::words::{IesFault, IesLines, IesNumbers};
use crate::error::SceneError;
use crate::text::shortened;

/// Largest file in bytes.
const BYTES_MAX: usize = 64 << 20;
/// Most angles along one direction.
const ANGLES_MAX: usize = 20_000;
/// Most lines before the line `TILT=`.
const LABELS_MAX: usize = 10_000;

impl IesProfile {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, is larger than 64 MiB, or is not a file of IES LM-63; with its line.
    pub fn read(path: &Path) -> Result<Self, SceneError> {
        let unreadable = |source| SceneError::Read { path: path.into(), by: String::new(), source };
        let size = std::fs::metadata(path).map_err(unreadable)?.len();
        if size > BYTES_MAX as u64 {
            return Err(too_large(path));
        }
        Self::of_bytes(&std::fs::read(path).map_err(unreadable)?, path)
    }

    /// Reads the contents of a file. `path`: names it in errors.
    ///
    /// # Errors
    /// The same as [`Self::read`].
    pub fn of_bytes(bytes: &[u8], path: &Path) -> Result<Self, SceneError> {
        if bytes.len() > BYTES_MAX {
            return Err(too_large(path));
        }
        // Labels may have any code page; numbers are ASCII
        let text = String::from_utf8_lossy(bytes);
        parse(text.trim_start_matches('\u{feff}')).map_err(|IesFault { line, problem }| SceneError::Text {
            path: path.into(),
            line,
            column: 1,
            problem,
        })
    }
}

fn too_large(path: &Path) -> SceneError {
    SceneError::Limit {
        path: path.into(),
        place: String::new(),
        problem: format!("a profile has at most {} MiB", BYTES_MAX >> 20),
        remedy: "check that it is a file of IES LM-63",
    }
}

/// Reads the text of a file.
fn parse(text: &str) -> Result<IesProfile, IesFault> {
    let mut lines = IesLines::new(text);
    let (version, tilt, line) = labels(&mut lines)?;
    let mut numbers = lines.numbers();
    match tilt.to_ascii_uppercase().as_str() {
        // The factors of a lamp that is tilted; that of one that is not is 1
        "INCLUDE" => skip_tilt(&mut numbers)?,
        "" => return Err(IesFault { line, problem: "`TILT=` names nothing; write `TILT=NONE`".into() }),
        // A file with the same factors
        _ => {}
    }
    let lamps = numbers.number("the number of lamps")?;
    let lumens_per_lamp = numbers.number("the lumens of a lamp")?;
    let multiplier = numbers.number("the multiplier of the candelas")?;
    let vertical_count = numbers.count("the number of vertical angles", [2, ANGLES_MAX])?;
    let horizontal_count = numbers.count("the number of horizontal angles", [1, ANGLES_MAX])?;
    let kind = numbers.count("the photometric type", [1, 3])?;
    for what in ["the unit of lengths", "the width", "the length", "the height"] {
        numbers.number(what)?;
    }
    let ballast = numbers.number("the factor of the ballast")?;
    // Until 1991 a factor of ballast and lamp, then reserved; since 2019 digits that say how the file was made
    let second = numbers.number("the second factor of the ballast")?;
    numbers.number("the power in watts")?;
    let factor = multiplier * ballast * if version == IesVersion::Of2019 { 1.0 } else { second };
    if !(factor.is_finite() && factor >= 0.0) {
        return Err(numbers.fault(format!("the factor of the candelas is {factor}; it must not be negative")));
    }
    let vertical = angles(&mut numbers, "a vertical angle", vertical_count)?;
    let horizontal = angles(&mut numbers, "a horizontal angle", horizontal_count)?;
    let mut candela = numbers.list("the candelas", vertical_count * horizontal_count)?;
    for value in &mut candela {
        *value *= factor;
        // A few files have small negative values, which are noise of the measurement
        *value = value.max(0.0);
        if *value > f64::from(crate::values::VALUE_MAX) {
            return Err(numbers.fault(format!("an intensity of {value} cd is more than can be computed with")));
        }
    }
    let at_end = |problem: String| numbers.fault(problem);
    let lumens = lamps * lumens_per_lamp;
    let lamp_lumens = (lumens_per_lamp > 0.0 && lumens.is_finite() && lumens > 0.0).then_some(lumens);
    if kind == 1 {
        let planes = full_circle(&horizontal).map_err(at_end)?;
        check_vertical(&vertical, 0.0, 180.0).map_err(at_end)?;
        return Ok(IesProfile::new(vertical, &planes, &candela, lamp_lumens));
    }
    check_vertical(&vertical, -90.0, 90.0).map_err(at_end)?;
    let goniometer = Goniometer::new(kind, vertical, horizontal, candela).map_err(at_end)?;
    Ok(goniometer.profile(lamp_lumens))
}

/// The version of a file, as far as it matters.
#[derive(Clone, Copy, PartialEq, Eq)]
enum IesVersion {
    Before2019,
    Of2019,
}

/// Reads the first line, the labels and the line `TILT=`. Returns the version, the value of `TILT` and its line.
fn labels<'a>(lines: &mut IesLines<'a>) -> Result<(IesVersion, &'a str, usize), IesFault> {
    let mut version = IesVersion::Before2019;
    while let Some((line, number)) = lines.next() {
        if number == 1 && line.contains("LM-63-2019") {
            version = IesVersion::Of2019;
        }
        let line = line.trim();
        if let Some(start) = line.get(..4)
            && start.eq_ignore_ascii_case("TILT")
            && let Some(value) = line[4..].trim_start().strip_prefix('=')
        {
            return Ok((version, value.trim(), number));
        }
        if number > LABELS_MAX {
            break;
        }
    }
    let problem = "there is no line `TILT=`: this is not a file of IES LM-63; export the profile as one".into();
    Err(IesFault { line: 1, problem })
}

/// Skips the angles and factors of `TILT=INCLUDE`.
fn skip_tilt(numbers: &mut IesNumbers<'_>) -> Result<(), IesFault> {
    numbers.number("the position of the lamp")?;
    let count = numbers.count("the number of tilt angles", [0, ANGLES_MAX])?;
    numbers.list("tilt angles and their factors", 2 * count).map(drop)
}

/// Reads angles, which must ascend.
fn angles(numbers: &mut IesNumbers<'_>, what: &str, count: usize) -> Result<Vec<f64>, IesFault> {
    let list = numbers.list(what, count)?;
    match list.windows(2).find(|pair| pair[0] >= pair[1]) {
        Some(pair) => {
            Err(numbers.fault(format!("{what} of {}° follows one of {}°; angles must ascend", pair[1], pair[0])))
        }
        None => Ok(list),
    }
}

/// Checks the range of vertical angles.
fn check_vertical(vertical: &[f64], low: f64, high: f64) -> Result<(), String> {
    match vertical.iter().find(|angle| !(low..=high).contains(*angle)) {
        Some(angle) => {
            Err(format!("a vertical angle is {}°; {low}° to {high}° are possible", shortened(&angle.to_string())))
        }
        None => Ok(()),
    }
}
