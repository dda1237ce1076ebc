//! Samples for a viewport of another process.

use std::{ops::Range, sync::Arc};

use bottega_engines::{BuiltinEngine, CancelSwitch};
use bottega_image::{Layout, Rect, Tile};
use bottega_scene::{Camera, Scene};

use super::{follower::ViewportLook, painter::pass, samples::ViewportSamples};
use crate::{
    error::Error,
    request::Request,
    session::{Session, SessionOptions, Urgency},
};

/// A renderer of samples of looks that a viewport of another process shows ([`super::Viewport::add`]). Other pictures of this
/// process wait meanwhile.
pub struct ViewportSampler {
    session: Session,
    scene: Arc<Scene>,
}

/// A switch that ends the rendering of a look at once; clones do the same.
#[derive(Clone)]
pub struct LookEnd {
    engine: Arc<BuiltinEngine>,
    cancel: CancelSwitch,
}

impl LookEnd {
    /// Drops the queued units of work, and ends the running ones soon.
    pub fn end(&self) {
        // Expire the queued units first, so that all of them are counted.
        self.engine.leave();
        self.cancel.cancel();
    }
}

impl ViewportSampler {
    /// Prepares a scene for a look. Returns the renderer of its samples.
    ///
    /// - `request`, `camera`: request and camera of the look ([`ViewportLook`]), with threads and devices of this machine.
    ///
    /// # Errors
    /// The scene or the request cannot be used.
    pub fn open(request: &Request, scene: Arc<Scene>, camera: Camera) -> Result<Self, Error> {
        ViewportLook::check(request)?;
        let options = SessionOptions { urgency: Urgency::Look, ..SessionOptions::default() };
        let session = Session::of_scene_with(request, ViewportLook::aimed(&scene, camera), options)?;
        Ok(Self { session, scene })
    }

    /// Returns the renderer for another look at the same scene.
    ///
    /// - `request`, `camera`: request and camera of the look.
    ///
    /// # Errors
    /// The request or the camera cannot be used.
    pub fn look(self, request: &Request, camera: Camera) -> Result<Self, Error> {
        ViewportLook::check(request)?;
        let Self { session, scene } = self;
        Ok(Self { session: session.edited(request, ViewportLook::aimed(&scene, camera))?, scene })
    }

    /// Returns the rectangle that is rendered, in pixels of the picture.
    pub fn region(&self) -> Rect {
        self.session.settings().crop
    }

    /// Returns a new switch for [`Self::render`], with which another thread ends the rendering of the current look.
    ///
    /// # Errors
    /// The session uses an external engine.
    pub fn end(&self) -> Result<LookEnd, Error> {
        let engine = Arc::clone(self.engine()?);
        Ok(LookEnd { engine, cancel: CancelSwitch::default() })
    }

    /// Renders samples of all pixels, and returns them; `None`: the look was ended.
    ///
    /// - `look`: the number of the look, for the receiver.
    /// - `samples`: the range of sample indices, which no other process renders.
    ///
    /// # Errors
    /// The engine fails.
    pub fn render(&self, look: u64, samples: Range<u32>, end: &LookEnd) -> Result<Option<ViewportSamples>, Error> {
        let settings = self.session.settings();
        let tile = Tile::new(settings.crop, settings.layout.clone());
        let count = samples.end - samples.start;
        let rendered = pass(self.engine()?, settings, (samples, Some(tile)), end.cancel.clone())?;
        Ok(rendered.map(|tile| ViewportSamples { look, rect: tile.rect(), samples: count, means: means_of(&tile) }))
    }

    fn engine(&self) -> Result<&Arc<BuiltinEngine>, Error> {
        let none = || Error::usage("only the built-in engine renders samples for viewports", "leave out the engine");
        self.session.own_engine().ok_or_else(none)
    }
}

/// Returns mean radiance and alpha of each pixel.
fn means_of(tile: &Tile) -> Vec<[f32; 4]> {
    let pixels = tile.rect().pixels();
    let mean = |(x, y)| {
        let sums = tile.pixel(x, y);
        let count = sums[Layout::SAMPLE_COUNT].max(1.0);
        [sums[0], sums[1], sums[2], sums[Layout::ALPHA]].map(|sum| sum / count)
    };
    pixels.map(mean).collect()
}
