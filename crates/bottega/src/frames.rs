//! Animations: the same scene at several times, a picture each.

use std::{
    ops::RangeInclusive,
    path::{Path, PathBuf},
    process::ExitCode,
    str::FromStr,
};

use bottega_farm::StopSwitch;

use crate::{cli::RenderArgs, error::CliError, farm, keeping::journal_of, render};

/// The largest number of a frame.
const FRAME_MAX: u32 = 1_000_000;
/// Digits of a frame's number where the name of the output does not say.
const DIGITS: usize = 4;

/// Frames of an animation, both ends included.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Frames(RangeInclusive<u32>);

impl Frames {
    pub(crate) fn iter(&self) -> impl Iterator<Item = u32> + use<> {
        self.0.clone()
    }
}

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (first, last) = text.split_once("..").unwrap_or((text, text));
        let number = |text: &str| text.trim().parse().ok().filter(|number| *number <= FRAME_MAX);
        match (number(first), number(last)) {
            (Some(first), Some(last)) if first <= last => Ok(Self(first..=last)),
            _ => Err(format!("frames are written FIRST..LAST, such as 1..24, up to {FRAME_MAX}")),
        }
    }
}

impl RenderArgs {
    /// What is asked for one frame: its time, and where its picture goes.
    pub(crate) fn at_frame(mut self, frame: u32) -> Self {
        self.scene.file.at = Some(frame as f32 / self.fps);
        if !self.engines.is_builtin() {
            self.engines.frame = Some(frame);
        }
        self.output = numbered(&self.output, frame);
        self.frames = None;
        // A frame that nobody has begun is begun.
        self.resume &= journal_of(&self.output).is_file();
        self
    }

    /// Whether a frame need not be painted: it is there, and all of it.
    pub(crate) fn has_frame(&self, frame: u32) -> bool {
        let output = numbered(&self.output, frame);
        self.resume && output.is_file() && !journal_of(&output).is_file()
    }
}

/// The file of a frame's picture: its number takes the place of the last run of `#` in the name, or stands before the
/// extension.
fn numbered(output: &Path, frame: u32) -> PathBuf {
    let name = output.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let name = if let Some(end) = name.rfind('#') {
        let begin = name[..end].trim_end_matches('#').len();
        format!("{}{frame:0digits$}{}", &name[..begin], &name[end + 1..], digits = end + 1 - begin)
    } else {
        match name.rsplit_once('.') {
            Some((stem, extension)) => format!("{stem}.{frame:0DIGITS$}.{extension}"),
            None => format!("{name}.{frame:0DIGITS$}"),
        }
    };
    output.with_file_name(name)
}

/// Paints the frames, one after the other; with a farm, all of them at once.
pub(crate) fn run(args: &RenderArgs, frames: &Frames, stop: &StopSwitch) -> Result<ExitCode, CliError> {
    if args.farm.is_some() {
        return farm::animate(args, frames, stop);
    }
    for frame in frames.iter().filter(|frame| !args.has_frame(*frame)) {
        let code = render::one(&args.clone().at_frame(frame), stop)?;
        if stop.is_requested() {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_read() {
        assert_eq!("3..5".parse::<Frames>().unwrap().iter().collect::<Vec<_>>(), [3, 4, 5]);
        assert_eq!("7".parse::<Frames>().unwrap().iter().collect::<Vec<_>>(), [7]);
        for wrong in ["", "5..3", "a..b", "1..", "-1..2", "1..9999999"] {
            assert!(wrong.parse::<Frames>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_picture_has_the_number_of_its_frame() {
        for (output, expected) in [
            ("a/b.exr", "a/b.0012.exr"),
            ("a/b-##.exr", "a/b-12.exr"),
            ("###/b_#####_c.png", "###/b_00012_c.png"),
            ("#-##.png", "#-12.png"),
        ] {
            assert_eq!(numbered(Path::new(output), 12), Path::new(expected));
        }
    }
}
