//! The picture while it is painted: a file that is made anew again and again, and what a watcher is shown.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bottega_engines::Survey;
use bottega_image::{ImageError, OutputFormat, Picture, Preview, Rect, Tile, ToneMap, check_writable, write_whole};

use crate::{error::Error, session::Watcher};

/// How often the preview is made anew, at most.
const RENEW_EVERY: Duration = Duration::from_secs(1);

/// Making it takes at most one part in so many of the time.
const SHARE: u32 = 100;

/// What of the picture is shown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PreviewView {
    /// All pixels of the picture.
    pub(crate) frame: Rect,
    /// Those that are painted.
    pub(crate) crop: Rect,
    /// Stops by which it is brighter.
    pub(crate) exposure: f32,
    /// How highlights are brought into range.
    pub(crate) tone: ToneMap,
}

/// Shows the picture while it is painted.
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

/// The file of a preview, if it can be written.
pub(crate) fn check_preview(path: &Path) -> Result<(), Error> {
    if check_writable(path)? == OutputFormat::Png {
        return Ok(());
    }
    Err(Error::usage(
        format!("`{}` cannot hold a preview: it is no PNG file", path.display()),
        "name a file that ends in .png",
    ))
}

impl LivePreview {
    pub(crate) fn new(look: PreviewView, file: Option<PathBuf>, watcher: Option<Arc<dyn Watcher>>) -> Self {
        let preview = Preview::new(look.crop, look.exposure, look.tone);
        Self { frame: look.frame, preview, file, watcher, state: Mutex::default(), woken: Condvar::new() }
    }

    /// The first look at the whole picture: from now on there is a color for every pixel.
    pub(crate) fn begin(&self, survey: &Survey) {
        let data = survey.pixels.iter().map(|pixel| pixel.color).collect();
        self.preview.show_coarse(&Picture { width: survey.width, height: survey.height, data }, self.frame);
        self.state().is_begun = true;
        self.changed();
    }

    /// Some pixels are painted.
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

    /// Nothing more will be painted.
    pub(crate) fn end(&self) {
        self.state().has_ended = true;
        self.woken.notify_all();
    }

    /// Makes the preview anew whenever something was painted, but with pauses, until the end and once more then. After
    /// each tells `renewed` how many there were.
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
