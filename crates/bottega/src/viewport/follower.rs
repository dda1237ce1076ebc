//! The current look of a viewport, for helpers that render samples of it elsewhere.

use std::sync::Arc;

use bottega_scene::{Camera, Scene};

use crate::{
    error::Error,
    request::{Request, WorkOptions},
    session::Session,
};

/// A look of a viewport: all that determines its samples.
#[derive(Clone, Debug)]
pub struct ViewportLook {
    /// Number of the look, from 0.
    pub number: u64,
    /// The request, for a scene in memory: size, crop and render settings. Its view and its environment are empty, because `camera`
    /// and `scene` contain them.
    pub request: Request,
    /// The scene. Looks that share it differ in their camera alone.
    pub scene: Arc<Scene>,
    /// The camera of the look.
    pub camera: Camera,
}

/// The receiver of the looks of a viewport. The functions must return quickly.
pub trait ViewportFollower: Send + Sync {
    /// Announces that another look is wanted: samples of all looks before it are not needed any more. Called from the thread that
    /// wants it; the look may have begun already.
    ///
    /// - `next`: the number of the look that is wanted.
    fn ends_before(&self, next: u64);

    /// Announces that a look begins, and that all before it are over.
    fn begins(&self, look: ViewportLook);

    /// Announces that a look has all its samples.
    ///
    /// - `look`: the number of the look.
    fn rests(&self, look: u64);
}

impl ViewportLook {
    /// Returns the look that a session renders; `None` with an external engine.
    pub(super) fn of(session: &Session, number: u64) -> Option<Self> {
        let subject = session.subject()?;
        let mut request = session.request().clone();
        (request.view, request.environment) = Default::default();
        // Rules may be files of this machine, and choose nothing in a viewport.
        request.work = WorkOptions::default();
        let (scene, camera) = (subject.prepared.shared_scene(), subject.camera().clone());
        // Nothing is denoised elsewhere, and no layers are sent.
        request.film.denoise = false;
        request.film.size = Some([subject.view.width, subject.view.height]);
        Some(Self { number, request, scene, camera })
    }

    /// Returns the scene with the camera of the look as its only one.
    ///
    /// - `scene`: the scene of the look.
    pub(super) fn aimed(scene: &Scene, camera: Camera) -> Scene {
        Scene { cameras: vec![camera], ..scene.clone() }
    }

    /// Checks that a request can be used for a look that another process shows.
    ///
    /// # Errors
    /// The request is invalid, or names an external engine.
    pub(super) fn check(request: &Request) -> Result<(), Error> {
        if !request.engine.is_builtin() {
            return Err(Error::usage("only the built-in engine renders samples for viewports", "leave out the engine"));
        }
        Ok(request.validate()?)
    }
}
