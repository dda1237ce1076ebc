//! Parsers of option values.

use std::{convert::Infallible, path::PathBuf, str::FromStr};

use bottega::request::{EnvironmentLight, ShutterTimes, check_sides};
use bottega_image::Rect;
use bottega_render::ala::Criterion;

use crate::option_value::InvalidValue;

/// The names of layers, as listed by `--aov`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct LayerNames(pub(crate) Vec<String>);

impl FromStr for LayerNames {
    type Err = Infallible;

    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(Self(match text.trim() {
            "none" => Vec::new(),
            list => list.split(',').map(|name| name.trim().to_owned()).collect(),
        }))
    }
}

/// Width and height of an image, both at least 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

pub(crate) fn parse_size(text: &str) -> Result<Size, InvalidValue> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("two numbers with an x between, such as 1280x720")?;
    let side = |text: &str| text.trim().parse::<u32>().map_err(|_| format!("`{text}` is not a number of pixels"));
    let size = Size { width: side(width)?, height: side(height)? };
    // A crop may reduce the number of pixels, so only the sides are checked.
    check_sides([size.width, size.height]).map_err(|error| error.to_string())?;
    Ok(size)
}

/// Parses the times of a shutter: `OPEN:CLOSE` or `OPEN:CLOSE:RAMP`.
pub(super) fn parse_shutter(text: &str) -> Result<ShutterTimes, InvalidValue> {
    let number = |part: &str| part.trim().parse::<f64>().map_err(|_| format!("`{part}` is not a number"));
    let numbers: Vec<f64> = text.split(':').map(number).collect::<Result<_, String>>()?;
    match numbers[..] {
        [open, close] => Ok(ShutterTimes { open, close, ramp: 0.0 }),
        [open, close, ramp] => Ok(ShutterTimes { open, close, ramp }),
        _ => Err("two times with a colon between, such as 0:0.02".into()),
    }
}

/// Parses a share above 0 and at most 1.
pub(super) fn parse_share(text: &str) -> Result<f32, InvalidValue> {
    let share = text.trim().parse().map_err(|_| format!("`{text}` is not a number"))?;
    if share > 0.0 && share <= 1.0 { Ok(share) } else { Err("it must be above 0 and at most 1".into()) }
}

pub(super) fn parse_rect(text: &str) -> Result<Rect, InvalidValue> {
    let numbers: Vec<u32> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| format!("`{part}` is not a number of pixels")))
        .collect::<Result<_, String>>()?;
    match numbers[..] {
        [x0, y0, x1, y1] if x0 < x1 && y0 < y1 => Ok(Rect::new(x0, y0, x1, y1)),
        [..] if numbers.len() == 4 => Err("it must have x0 < x1 and y0 < y1".into()),
        _ => Err("four numbers x0,y0,x1,y1 are needed; x1 and y1 lie one past the part".into()),
    }
}

pub(super) fn parse_environment(text: &str) -> Result<EnvironmentLight, InvalidValue> {
    if text == "sky" {
        return Ok(EnvironmentLight::Sky);
    }
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[r, g, b]) => Ok(EnvironmentLight::Radiance([r, g, b])),
        Some(_) => Err("a radiance is three numbers from 0 up, such as 0.5,0.6,0.8".into()),
        None => Ok(EnvironmentLight::File(PathBuf::from(text))),
    }
}

pub(super) fn parse_criterion(text: &str) -> Result<Criterion, InvalidValue> {
    Ok(text.parse::<Criterion>().map_err(|error| error.to_string())?)
}

pub(crate) fn parse_define(text: &str) -> Result<(String, String), InvalidValue> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("a name, `=` and a value are needed, such as spp=64".into()),
    }
}

pub(crate) fn parse_light_group(text: &str) -> Result<(String, String), InvalidValue> {
    match text.split_once('=') {
        Some((name, pattern)) if !(name.is_empty() || pattern.is_empty()) => Ok((name.to_owned(), pattern.to_owned())),
        _ => Err("a name, `=` and a pattern are needed, such as key=Lamp*".into()),
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn sizes_are_checked() {
        assert_eq!(parse_size("640x480"), Ok(Size { width: 640, height: 480 }));
        for absurd in ["", "x", "0x0", "640", "640x", "-1x5", "99999999999x1", "65537x1", "1e3x5"] {
            assert!(parse_size(absurd).is_err(), "{absurd}");
        }
    }

    #[test]
    fn crops_are_checked() {
        assert_eq!(parse_rect("1, 2,3,4"), Ok(Rect::new(1, 2, 3, 4)));
        for absurd in ["", "1,2,3", "1,2,1,4", "3,2,1,4", "1,2,3,4,5", "a,b,c,d", "-1,0,1,1"] {
            assert!(parse_rect(absurd).is_err(), "{absurd}");
        }
    }

    #[test]
    fn an_environment_is_a_file_or_a_radiance() {
        assert_eq!(parse_environment("1,0.5,0"), Ok(EnvironmentLight::Radiance([1.0, 0.5, 0.0])));
        assert_eq!(parse_environment("sky"), Ok(EnvironmentLight::Sky));
        assert_eq!(parse_environment("sky.hdr"), Ok(EnvironmentLight::File("sky.hdr".into())));
        assert!(parse_environment("1,2").is_err());
    }
}
