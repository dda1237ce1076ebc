//! A coarse first image of a job, shown before profiling and painting start.

use bottega_engines::RenderEngine;
use bottega_farm::JobSettings;
use bottega_image::{Picture, Preview, Rect};

use crate::{
    error::Error,
    job::{board::JobBoard, record::Job},
};

/// Side of a cell in pixels, unless the picture is large.
const CELL: u32 = 8;
/// The most columns and rows.
const CELLS_MAX: u32 = 96;
/// The largest first look that is read, in bytes.
const BYTES_MAX: usize = 1 << 20;
/// Number of integers before the colors.
const HEADER: usize = 8;

/// A coarse image, and its position.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FirstLook {
    /// All pixels of the picture.
    frame: Rect,
    /// The pixels that are rendered.
    crop: Rect,
    /// Radiance of cells that divide the frame evenly.
    coarse: Picture,
}

impl FirstLook {
    /// Renders the first look. `None`: the engine starts too slowly or does not support it.
    pub(crate) fn take(settings: &JobSettings, engine: &dyn RenderEngine) -> Option<Self> {
        if !engine.describe().is_profiled {
            return None;
        }
        let frame = Rect::of_size(settings.width, settings.height);
        let scale = f64::from(CELL).max(f64::from(frame.width().max(frame.height())) / f64::from(CELLS_MAX));
        let cells = |side: u32| ((f64::from(side) / scale) as u32).max(1);
        let survey = engine.survey(cells(frame.width()), cells(frame.height())).ok()?;
        let data = survey.pixels.iter().map(|pixel| pixel.color).collect();
        Some(Self { frame, crop: settings.crop, coarse: Picture { width: survey.width, height: survey.height, data } })
    }

    /// Returns the rectangle of pixels that are rendered.
    pub(crate) fn crop(&self) -> Rect {
        self.crop
    }

    /// Draws it into a preview.
    pub(crate) fn show(&self, preview: &Preview) {
        preview.show_coarse(&self.coarse, self.frame);
    }

    fn to_bytes(&self) -> Vec<u8> {
        let Self { frame, crop, coarse } = self;
        let numbers = [frame.x1, frame.y1, crop.x0, crop.y0, crop.x1, crop.y1, coarse.width, coarse.height];
        let colors = coarse.data.iter().flatten().flat_map(|value| value.to_le_bytes());
        numbers.into_iter().flat_map(u32::to_le_bytes).chain(colors).collect()
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let words: Vec<[u8; 4]> = bytes.chunks_exact(4).filter_map(|word| word.try_into().ok()).collect();
        let (header, colors) = words.split_at_checked(HEADER)?;
        let numbers: Vec<u32> = header.iter().map(|word| u32::from_le_bytes(*word)).collect();
        let [x1, y1, crop_x0, crop_y0, crop_x1, crop_y1, width, height] = numbers[..] else { return None };
        let (frame, crop) = (Rect::of_size(x1, y1), Rect::new(crop_x0, crop_y0, crop_x1, crop_y1));
        let values: Vec<f32> = colors.iter().map(|word| f32::from_le_bytes(*word)).collect();
        let data: Vec<[f32; 3]> = values.chunks_exact(3).map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect();
        let is_sound = data.len() as u64 == u64::from(width) * u64::from(height)
            && crop_x0 < crop_x1
            && crop_y0 < crop_y1
            && frame.encloses(&crop);
        is_sound.then_some(Self { frame, crop, coarse: Picture { width, height, data } })
    }
}

impl JobBoard {
    /// Returns the first look of a job; `None`: its leader has not stored one, or it is invalid.
    ///
    /// # Errors
    /// The farm does not answer.
    pub(crate) fn first_look(&self, job: &Job) -> Result<Option<FirstLook>, Error> {
        let bytes = self.uplink.blobs().get(&blob(job.work), BYTES_MAX).map_err(Error::Blob)?;
        Ok(bytes.and_then(|bytes| FirstLook::from_bytes(&bytes)))
    }

    /// Stores the first look. Returns `true` if it was stored; failures are only logged.
    pub(crate) fn keep_first_look(&self, work: u64, look: &FirstLook) -> bool {
        let kept = self.uplink.blobs().put(&blob(work), &look.to_bytes());
        kept.inspect_err(|error| tracing::debug!(%error, "cannot publish the first look")).is_ok()
    }

    /// Deletes the first look of a finished picture.
    pub(crate) fn forget_first_look(&self, work: u64) {
        self.uplink.blobs().forget(&blob(work));
    }
}

fn blob(work: u64) -> String {
    format!("job-{work}/look")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_look_is_read_as_it_was_written_and_nothing_else_is_one() {
        let data = vec![[0.5, 1.0, 2.0], [0.0, 0.25, 3.0]];
        let coarse = Picture { width: 2, height: 1, data };
        let look = FirstLook { frame: Rect::of_size(16, 8), crop: Rect::new(4, 0, 16, 8), coarse };
        let bytes = look.to_bytes();
        assert_eq!(FirstLook::from_bytes(&bytes), Some(look));
        let mut beyond = bytes.clone();
        beyond[16] = 17;
        for wrong in [&bytes[..bytes.len() - 4], &bytes[..20], &beyond, &[0; 32]] {
            assert_eq!(FirstLook::from_bytes(wrong), None, "{} bytes", wrong.len());
        }
    }
}
