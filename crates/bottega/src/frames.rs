//! Animations: the same scene at several times, a picture each.

mod list;
mod name;

use std::{path::Path, process::ExitCode};

use bottega_farm::StopSwitch;

pub(crate) use self::list::Frames;
use self::name::{FrameName, NameError};
use crate::{cli::RenderArgs, error::CliError, farm, keeping::journal_of, render};

impl RenderArgs {
    /// What is asked for one frame: its time, and where its picture goes.
    ///
    /// # Errors
    /// The name of the output has no place for the number of a frame, or several.
    pub(crate) fn at_frame(&self, frame: i32) -> Result<Self, CliError> {
        let mut args = self.clone();
        args.scene.file.at = Some(frame as f32 / self.fps);
        if !self.engines.is_builtin() {
            args.engines.frame = Some(frame);
        }
        args.output = frame_name(&self.output)?.of(frame);
        args.frames = None;
        // A frame that nobody has begun is begun.
        args.resume &= journal_of(&args.output).is_file();
        Ok(args)
    }

    /// The frames that are to be painted: with `--resume` those of which not all is there.
    ///
    /// # Errors
    /// As of [`Self::at_frame`].
    pub(crate) fn missing_frames(&self, frames: &Frames) -> Result<Vec<i32>, CliError> {
        let name = frame_name(&self.output)?;
        let has = |frame: i32| {
            let output = name.of(frame);
            self.resume && output.is_file() && !journal_of(&output).is_file()
        };
        Ok(frames.iter().filter(|frame| !has(*frame)).collect())
    }
}

fn frame_name(output: &Path) -> Result<FrameName, CliError> {
    FrameName::new(output).map_err(|error| {
        let remedy = match error {
            NameError::SeveralPlaces { .. } => "leave one place for it: film.####.exr or film.%04d.exr",
            NameError::NoPlace { .. } => "a place for the number is written #### or %04d; a percent sign is written %%",
            NameError::NotUnicode => "give the output a name in Unicode",
        };
        CliError::usage(error.to_string(), remedy)
    })
}

/// Paints the frames, one after the other; with a farm, all of them at once.
pub(crate) fn run(args: &RenderArgs, frames: &Frames, stop: &StopSwitch) -> Result<ExitCode, CliError> {
    if args.farm.is_some() {
        return farm::animate(args, frames, stop);
    }
    for frame in args.missing_frames(frames)? {
        let code = render::one(&args.at_frame(frame)?, stop)?;
        if stop.is_requested() {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}
