//! The preview of a job while it is rendered, from what the farm stores, so it does not depend on the leader.

use std::path::Path;

use bottega::settings::tone;
use bottega_image::{Canvas, Preview, ReadLimits, Rect, ToneMap, read_image_bytes};

use crate::{
    error::Error,
    job::{
        board::JobBoard,
        first_look::FirstLook,
        record::Job,
        zone_pixels::{ZonePixels, around},
    },
};

/// The largest picture that is shown, in pixels.
const PIXELS_MAX: u64 = 1 << 26;

/// The preview of a job, tone mapped for display.
pub struct JobPreview {
    exposure: f32,
    tone: ToneMap,
    /// The preview and the rectangle it covers; none before the picture is divided into zones.
    canvas: Option<(Rect, Preview)>,
    /// The zones that are shown.
    shown: ZonePixels,
    png: Option<Vec<u8>>,
    /// The state of the job when a stored picture was loaded: the number of its painting, and whether it was over.
    is_final: Option<(u64, bool)>,
}

impl JobPreview {
    /// Returns an empty preview with the exposure and tone mapping of a job.
    ///
    /// # Errors
    /// The farm does not answer, or has no readable specification of the job.
    pub fn new(board: &JobBoard, job: &Job) -> Result<Self, Error> {
        let output = board.spec(job)?.request.output;
        let (exposure, tone) = (output.exposure, tone(output.tonemap));
        Ok(Self { exposure, tone, canvas: None, shown: ZonePixels::default(), png: None, is_final: None })
    }

    /// Returns the current preview as the bytes of a PNG file. Of a finished job it is the picture, or, if the farm does not
    /// store that, the last preview fetched before; while a job is rendered again, its previous picture until the new one is
    /// complete. `None`: there is nothing to show yet.
    ///
    /// # Errors
    /// The farm does not answer, or the picture is too large to show or cannot be read.
    pub fn renew(&mut self, board: &JobBoard, job: &Job) -> Result<Option<Vec<u8>>, Error> {
        let is_whole = job.state.is_over() || job.kept;
        let shown = Some((job.work, job.state.is_over()));
        if is_whole && self.is_final == shown {
            return Ok(self.png.clone());
        }
        if !is_whole {
            if self.fetch_new(board, job)?
                && let Some((_, preview)) = &self.canvas
            {
                self.png = Some(preview.to_png()?);
            }
            return Ok(self.png.clone());
        }
        if let Some(picture) = board.picture(job)? {
            self.png = Some(self.of_picture(&job.output, picture)?);
        }
        self.is_final = shown;
        Ok(self.png.clone())
    }

    /// Returns a finished picture as a PNG file, tone mapped like the preview.
    fn of_picture(&self, name: &str, picture: Vec<u8>) -> Result<Vec<u8>, Error> {
        const PNG: &[u8] = b"\x89PNG";
        if picture.starts_with(PNG) {
            return Ok(picture);
        }
        let read = read_image_bytes(Path::new(name), &picture, ReadLimits::default())?.picture;
        Ok(Canvas::of_picture(&read, self.exposure, self.tone).to_png()?)
    }

    /// Fetches the new pixels. Returns `true` if there are any.
    fn fetch_new(&mut self, board: &JobBoard, job: &Job) -> Result<bool, Error> {
        let rows = board.zone_rows(job)?;
        // Rows arrive one by one: the canvas grows unless the first look told the size of the picture.
        let zones = rows.iter().map(|row| row.rect).reduce(around);
        let is_covered = self.canvas.as_ref().is_some_and(|(rect, _)| zones.is_none_or(|zones| rect.encloses(&zones)));
        let has_look = !is_covered && self.begin(board, job, zones)?;
        let Some((_, preview)) = &self.canvas else { return Ok(false) };
        let has_tiles = self.shown.fetch_new(board, job, &rows, &|tile| preview.show(tile))?;
        Ok(has_look || has_tiles)
    }

    /// Begins a new canvas over the leader's first look and the zones. Returns `true` if a first look is shown on it.
    fn begin(&mut self, board: &JobBoard, job: &Job, zones: Option<Rect>) -> Result<bool, Error> {
        let look = board.first_look(job)?;
        let crop = look.as_ref().map(FirstLook::crop);
        let Some(rect) = crop.into_iter().chain(zones).reduce(around) else { return Ok(false) };
        if rect.area() > PIXELS_MAX {
            let problem = format!("the picture has {} pixels, and at most {PIXELS_MAX} are shown", rect.area());
            return Err(Error::usage(problem, "wait until it is done, then fetch it"));
        }
        let preview = Preview::new(rect, self.exposure, self.tone);
        look.iter().for_each(|look| look.show(&preview));
        self.canvas = Some((rect, preview));
        self.shown = ZonePixels::default();
        Ok(look.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_that_is_done_is_shown_as_its_display_would() {
        let preview = JobPreview {
            exposure: 0.0,
            tone: ToneMap::Linear,
            canvas: None,
            shown: ZonePixels::default(),
            png: None,
            is_final: None,
        };
        let png = Canvas::new(2, 1, [9; 3]).to_png().unwrap();
        assert_eq!(preview.of_picture("a.png", png.clone()).unwrap(), png, "a PNG file is shown as it is");
        let radiance = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x00\x00\x00\x00".to_vec();
        let shown = preview.of_picture("a.hdr", radiance).unwrap();
        let read = read_image_bytes("shown.png", &shown, ReadLimits::default()).unwrap().picture;
        assert_eq!((read.width, read.height), (2, 1));
        assert!(read.data[0][0] > 0.9 && read.data[1][0] < 0.01, "{:?}", read.data);
        assert!(preview.of_picture("a.exr", b"nothing".to_vec()).is_err());
    }
}
