//! A picture painted by another engine in windows of our choice, without the farm.

use std::{
    sync::{Arc, mpsc},
    time::Instant,
};

use bottega_engines::{
    CancelSwitch, EnginePreference, RenderEngine, TaskProgress, Tunables, ZoneTask,
    external::{EngineFault, ExternalEngine, ExternalOptions, LocatedEngine, SceneRequest, Session},
};
use bottega_image::{AovSet, Film, Layout, Rect, Tile};

use crate::Error;

/// An engine with a scene and one seed.
pub struct EngineTrial {
    engine: ExternalEngine,
    frame: Rect,
}

impl EngineTrial {
    /// Starts it with the scene at the size of the request.
    ///
    /// # Errors
    /// The engine cannot open the scene.
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

    /// Paints windows, one after the other. Returns the picture and the seconds that it took.
    ///
    /// # Errors
    /// The engine fails.
    pub fn paint(&self, windows: &[Rect], samples: u32) -> Result<(Film, f64), Error> {
        let layout = Layout::new(AovSet::NONE);
        let mut film = Film::new(self.frame, layout);
        let begun = Instant::now();
        for &rect in windows {
            let (sender, answer) = mpsc::channel();
            let task = ZoneTask {
                rect,
                samples: 0..samples,
                // As the scene says.
                tunables: Tunables { max_depth: 0, light_samples: 0 },
                leaning: EnginePreference::default(),
                tile: None::<Tile>,
                parts: None,
                cancel: CancelSwitch::default(),
                progress: TaskProgress::default(),
            };
            self.engine.start(task, Box::new(move |painted| drop(sender.send(painted))));
            let painted = answer.recv().map_err(|_| Error::EngineEnded)??;
            film.add_tile(&painted.tile, |_, _| 1.0);
        }
        Ok((film, begun.elapsed().as_secs_f64()))
    }
}
