//! A picture rendered by an external engine in given windows, without the farm.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_image::{AovSet, Film, Layout, Rect};

use super::{
    engine::{ExternalEngine, ExternalOptions},
    error::EngineFault,
    locate::LocatedEngine,
    session::{SceneRequest, Session},
};
use crate::{EngineError, RenderEngine, Tunables, ZoneTask};

/// An external engine with a scene and a fixed seed, which renders windows of the frame on request.
pub struct EngineTrial {
    engine: ExternalEngine,
    frame: Rect,
}

impl EngineTrial {
    /// Starts the engine with the scene, in the size of the request, which must be given.
    ///
    /// # Errors
    /// As for [`Session::open`]; or a thread cannot be started.
    pub fn begin(located: &Arc<LocatedEngine>, request: &SceneRequest, seed: u64) -> Result<Self, EngineFault> {
        let session = Session::open(located, request)?;
        let (width, height) = request.size.unwrap_or_default();
        let options = ExternalOptions {
            request: request.clone(),
            seed,
            samples: 0,
            layout: Layout::new(AovSet::NONE),
            scene_depth: Some(0),
            scene_light_samples: Some(0),
            bounds_zones: false,
            time: None,
            surveyor: None,
        };
        let engine = ExternalEngine::new(Arc::clone(located), options, session)?;
        Ok(Self { engine, frame: Rect::of_size(width, height) })
    }

    /// Renders windows of the frame, one after another. Returns the frame, empty outside of the windows, and the elapsed
    /// time.
    ///
    /// - `windows`: disjoint rectangles, in pixels of the frame.
    /// - `samples`: samples per pixel.
    ///
    /// # Errors
    /// The engine fails in one of the windows; the others are not rendered.
    pub fn paint(&self, windows: &[Rect], samples: u32) -> Result<(Film, Duration), EngineError> {
        let mut film = Film::new(self.frame, Layout::new(AovSet::NONE));
        let begun = Instant::now();
        for &rect in windows {
            // Equal to the scene's values, so that the engine uses its own.
            let tunables = Tunables { max_depth: 0, light_samples: 0 };
            let painted = self.engine.paint(ZoneTask::new(rect, 0..samples, tunables))?;
            film.add_tile(&painted.tile, |_, _| 1.0);
        }
        Ok((film, begun.elapsed()))
    }
}
