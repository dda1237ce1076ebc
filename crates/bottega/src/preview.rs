//! Previews during rendering: a PNG file that is updated, and PNG bytes for the watcher.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bottega_engines::Survey;
use bottega_image::{ImageError, OutputFormat, Picture, Preview, Rect, Tile, ToneMap, check_writable, write_whole};

use crate::{error::Error, session::Watcher};

/// Shortest interval between two previews.
const RENEW_EVERY: Duration = Duration::from_secs(1);

/// Making previews takes at most 1/`SHARE` of the time.
const SHARE: u32 = 100;

/// The part of the picture that a preview shows, and its tone mapping.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreviewView {
    /// All pixels of the picture.
    pub(crate) frame: Rect,
    /// The pixels that are rendered.
    pub(crate) crop: Rect,
    /// Exposure in stops; 0: as rendered.
    pub(crate) exposure: f32,
    /// The tone curve that maps radiance to the range of a screen.
    pub(crate) tone: ToneMap,
}

/// A preview of the picture during rendering.
pub(crate) struct LivePreview {
    frame: Rect,
    preview: Preview,
    file: Option<PathBuf>,
    watcher: Option<Arc<dyn Watcher>>,
    state: Mutex<PreviewState>,
    woken: Condvar,
}

#[derive(Debug, Default)]
struct PreviewState {
    is_begun: bool,
    has_changed: bool,
    has_ended: bool,
}

/// Checks that a preview file is a .png and can be written.
///
/// # Errors
/// The extension is another one, or the file cannot be written.
pub(crate) fn check_preview(path: &Path) -> Result<(), Error> {
    if check_writable(path)? == OutputFormat::Png {
        return Ok(());
    }
    Err(Error::usage(
        format!("`{}` cannot hold a preview: it is not a PNG file", path.display()),
        "name a file that ends in .png",
    ))
}

impl LivePreview {
    pub(crate) fn new(look: PreviewView, file: Option<PathBuf>, watcher: Option<Arc<dyn Watcher>>) -> Self {
        let preview = Preview::new(look.crop, look.exposure, look.tone);
        Self { frame: look.frame, preview, file, watcher, state: Mutex::default(), woken: Condvar::new() }
    }

    /// Fills the preview with the survey, so that every pixel has a color.
    pub(crate) fn begin(&self, survey: &Survey) {
        let data = survey.pixels.iter().map(|pixel| pixel.color).collect();
        self.preview.show_coarse(&Picture { width: survey.width, height: survey.height, data }, self.frame);
        self.state().is_begun = true;
        self.changed();
    }

    /// Adds the pixels of a rendered tile to the preview.
    pub(crate) fn painted(&self, tile: &Tile) {
        self.preview.show(tile);
        self.changed();
    }

    fn changed(&self) {
        let mut state = self.state();
        if !state.has_changed {
            state.has_changed = true;
            self.woken.notify_all();
        }
    }

    /// Ends the preview; [`Self::keep_fresh`] makes a last one and returns.
    pub(crate) fn end(&self) {
        self.state().has_ended = true;
        self.woken.notify_all();
    }

    /// Makes a new preview after changes, with pauses in between, until [`Self::end`]; then a last one if pixels have changed.
    /// Calls `renewed` with the number of previews after each.
    pub(crate) fn keep_fresh(&self, mut renewed: impl FnMut(u32)) -> Result<(), ImageError> {
        let mut number = 0;
        loop {
            let wait = |state: &mut PreviewState| !(state.is_begun && state.has_changed || state.has_ended);
            let mut state = self.woken.wait_while(self.state(), wait).unwrap_or_else(PoisonError::into_inner);
            if !(state.is_begun && state.has_changed) {
                return Ok(());
            }
            state.has_changed = false;
            drop(state);
            let before = Instant::now();
            self.renew()?;
            number += 1;
            renewed(number);
            let pause = RENEW_EVERY.max(before.elapsed() * SHARE);
            let state = self.woken.wait_timeout_while(self.state(), pause, |state| !state.has_ended);
            drop(state.unwrap_or_else(PoisonError::into_inner));
        }
    }

    fn renew(&self) -> Result<(), ImageError> {
        let png = self.preview.to_png()?;
        if let Some(file) = &self.file {
            write_whole(file, &png)?;
        }
        if let Some(watcher) = &self.watcher {
            watcher.previewed(png);
        }
        Ok(())
    }

    fn state(&self) -> MutexGuard<'_, PreviewState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
