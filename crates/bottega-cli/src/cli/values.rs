//! Parsers of option values.

use std::{convert::Infallible, path::PathBuf, str::FromStr, time::Duration};

use bottega::request::{
    BAND_PIXELS_MAX, BandChoice, COMPLEXITY_SHARE, ERROR, EnvironmentLight, ORACLE_ERROR, SECONDS, STOPS_MAX,
    check_sides,
};

use bottega_farm::Channel;
use bottega_image::Rect;
use bottega_render::ala::Criterion;

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

pub(crate) fn parse_size(text: &str) -> Result<Size, String> {
    let (width, height) = text.split_once(['x', 'X']).ok_or("two numbers with an x between, such as 1280x720")?;
    let side = |text: &str| text.trim().parse::<u32>().map_err(|_| format!("`{text}` is not a number of pixels"));
    let size = Size { width: side(width)?, height: side(height)? };
    // A crop may reduce the number of pixels, so only the sides are checked.
    check_sides([size.width, size.height]).map_err(|error| error.to_string())?;
    Ok(size)
}

/// Parses a share above 0 and at most 1.
pub(super) fn parse_share(text: &str) -> Result<f32, String> {
    let share = text.trim().parse().map_err(|_| format!("`{text}` is not a number"))?;
    if share > 0.0 && share <= 1.0 { Ok(share) } else { Err("it must be above 0 and at most 1".to_owned()) }
}

/// Parses a share of the image's complexity.
pub(super) fn parse_complexity(text: &str) -> Result<f64, String> {
    let share = text.trim().parse().ok().filter(|share: &f64| COMPLEXITY_SHARE.contains(share));
    share.ok_or_else(|| "a share from 0.000001 to 1 is needed, such as 0.01".to_owned())
}

/// Parses a relative difference.
pub(super) fn parse_similarity(text: &str) -> Result<f64, String> {
    let share = text.trim().parse().ok().filter(|share: &f64| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "a share from 0 to 1 is needed, such as 0.15".to_owned())
}

/// Parses the width of the bands between zones.
pub(super) fn parse_bands(text: &str) -> Result<BandChoice, String> {
    match text {
        "off" => Ok(BandChoice::Off),
        "rules" => Ok(BandChoice::Rules),
        number => {
            let pixels = number.parse().ok().filter(|pixels: &u32| (1..=BAND_PIXELS_MAX).contains(pixels));
            pixels
                .map(BandChoice::Pixels)
                .ok_or_else(|| format!("off, rules, or a number of pixels from 1 to {BAND_PIXELS_MAX} is needed"))
        }
    }
}

pub(super) fn parse_rect(text: &str) -> Result<Rect, String> {
    let numbers: Vec<u32> = text
        .split(',')
        .map(|part| part.trim().parse().map_err(|_| format!("`{part}` is not a number of pixels")))
        .collect::<Result<_, String>>()?;
    match numbers[..] {
        [x0, y0, x1, y1] if x0 < x1 && y0 < y1 => Ok(Rect::new(x0, y0, x1, y1)),
        [..] if numbers.len() == 4 => Err("it must have x0 < x1 and y0 < y1".to_owned()),
        _ => Err("four numbers x0,y0,x1,y1 are needed; x1 and y1 lie one past the part".to_owned()),
    }
}

pub(super) fn parse_environment(text: &str) -> Result<EnvironmentLight, String> {
    if text == "sky" {
        return Ok(EnvironmentLight::Sky);
    }
    let numbers: Option<Vec<f32>> = text.split(',').map(|part| part.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[r, g, b]) if [r, g, b].iter().all(|value| value.is_finite() && *value >= 0.0) => {
            Ok(EnvironmentLight::Radiance([r, g, b]))
        }
        Some(_) => Err("a radiance is three numbers from 0 up, such as 0.5,0.6,0.8".to_owned()),
        None => Ok(EnvironmentLight::File(PathBuf::from(text))),
    }
}

pub(super) fn parse_channel(text: &str) -> Result<Channel, String> {
    text.parse().map_err(|error: bottega_farm::UnknownChannel| error.to_string())
}

pub(super) fn parse_criterion(text: &str) -> Result<Criterion, String> {
    text.parse().map_err(|error: bottega_render::ala::UnknownCriterion| error.to_string())
}

pub(crate) fn parse_define(text: &str) -> Result<(String, String), String> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), value.to_owned())),
        _ => Err("a name, `=` and a value are needed, such as spp=64".to_owned()),
    }
}

pub(super) fn parse_factor(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(factor) if factor.is_finite() && factor >= 0.0 => Ok(factor),
        _ => Err("a number from 0 up is needed".to_owned()),
    }
}

/// Parses a number above 0.
pub(super) fn parse_rate(text: &str) -> Result<f32, String> {
    let rate = text.parse().ok().filter(|rate: &f32| rate.is_finite() && *rate > 0.0);
    rate.ok_or_else(|| "a number above 0 is needed".to_owned())
}

pub(super) fn parse_time(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|time| time.is_finite()).ok_or_else(|| "a number of seconds is needed".to_owned())
}

pub(super) fn parse_number(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|number| number.is_finite()).ok_or_else(|| "a number is needed".to_owned())
}

pub(super) fn parse_error(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(error) if ERROR.contains(&error) => Ok(error),
        _ => Err("a relative error such as 0.05 is needed, from 0.000001 to 10".to_owned()),
    }
}

pub(super) fn parse_oracle_error(text: &str) -> Result<f64, String> {
    let error: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if ORACLE_ERROR.contains(&error) { Ok(error) } else { Err("from 0.001 to 1".to_owned()) }
}

pub(crate) fn parse_duration(text: &str) -> Result<Duration, String> {
    parse_seconds(text).map(Duration::from_secs_f64)
}

/// Parses a duration, in seconds.
pub(super) fn parse_seconds(text: &str) -> Result<f64, String> {
    let units = [("h", 3600.0), ("m", 60.0), ("s", 1.0)];
    let (number, unit) =
        units.iter().find_map(|(name, unit)| Some((text.strip_suffix(name)?, *unit))).unwrap_or((text, 1.0));
    match number.trim().parse::<f64>() {
        Ok(time) if SECONDS.contains(&(time * unit)) => Ok(time * unit),
        _ => Err("a time such as 90, 90s, 10m or 1.5h is needed, of 0.1 seconds at least".to_owned()),
    }
}

pub(super) fn parse_distance(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(distance) if distance.is_finite() && distance > 0.0 => Ok(distance),
        _ => Err("a number above 0 is needed".to_owned()),
    }
}

pub(super) fn parse_stops(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(stops) if stops.abs() <= STOPS_MAX => Ok(stops),
        _ => Err("a number from -40 to 40 is needed".to_owned()),
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
    fn bands_and_shares_are_checked() {
        assert_eq!(parse_bands("off"), Ok(BandChoice::Off));
        assert_eq!(parse_bands("rules"), Ok(BandChoice::Rules));
        assert_eq!(parse_bands("12"), Ok(BandChoice::Pixels(12)));
        for absurd in ["", "0", "-1", "65", "on", "1.5"] {
            assert!(parse_bands(absurd).is_err(), "{absurd}");
        }
        assert_eq!((parse_complexity("0.01"), parse_similarity("0")), (Ok(0.01), Ok(0.0)));
        for absurd in ["", "-0.1", "1.01", "nan", "1%"] {
            assert!(parse_complexity(absurd).is_err() && parse_similarity(absurd).is_err(), "{absurd}");
        }
        assert!(parse_complexity("0").is_err());
    }

    #[test]
    fn an_environment_is_a_file_or_a_radiance() {
        assert_eq!(parse_environment("1,0.5,0"), Ok(EnvironmentLight::Radiance([1.0, 0.5, 0.0])));
        assert_eq!(parse_environment("sky"), Ok(EnvironmentLight::Sky));
        assert_eq!(parse_environment("sky.hdr"), Ok(EnvironmentLight::File("sky.hdr".into())));
        assert!(parse_environment("1,2").is_err());
        assert!(parse_environment("1,-2,0").is_err());
        assert!(parse_environment("nan,0,0").is_err());
    }
}
