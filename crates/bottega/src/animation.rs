//! Animations: one picture per frame of a scene.

use std::path::Path;

use crate::{
    error::Error,
    frames::{FrameName, frame_name_help},
    journal::journal_of,
    request::Request,
};

impl Request {
    /// Returns the request of one frame of an animation: with the frame's time and output file, and without `frames`. A request
    /// without `frames` is returned as it is.
    ///
    /// # Errors
    /// The name of the output has an invalid place for the number of a frame, or several.
    pub fn at_frame(&self, frame: i32) -> Result<Self, Error> {
        let Some(frames) = &self.frames else { return Ok(self.clone()) };
        let mut request = self.clone();
        request.scene.time = Some(frame as f32 / frames.fps);
        if !request.engine.is_builtin() {
            request.engine.frame = Some(frame);
        }
        if let Some(file) = &self.output.file {
            request.output.file = Some(frame_name(file)?.of(frame));
        }
        request.frames = None;
        Ok(request)
    }

    /// Returns the frames to render, in order; none for a request without `frames`.
    ///
    /// - `resume`: true to leave out frames whose picture is finished.
    ///
    /// # Errors
    /// Those of [`Self::at_frame`].
    pub fn missing_frames(&self, resume: bool) -> Result<Vec<i32>, Error> {
        let Some(frames) = &self.frames else { return Ok(Vec::new()) };
        let Some(file) = &self.output.file else { return Ok(frames.list.iter().collect()) };
        let name = frame_name(file)?;
        let has = |frame: i32| {
            let output = name.of(frame);
            resume && output.is_file() && !journal_of(&output).is_file()
        };
        Ok(frames.list.iter().filter(|frame| !has(*frame)).collect())
    }
}

fn frame_name(output: &Path) -> Result<FrameName, Error> {
    FrameName::new(output).map_err(|error| Error::usage(error.to_string(), frame_name_help(&error)))
}
