//! A session that looks at its scene from elsewhere.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use bottega_denoise::Denoiser;
use bottega_engines::BuiltinEngine;

use super::{Session, painter::Painter};
use crate::{
    builtin::BuiltinPainter,
    engines::agent_rules,
    error::Error,
    journal::PictureJournal,
    loaded_scene::LoadedScene,
    request::{Request, ViewOptions},
    rules::experts,
    settings::goal,
};

impl Session {
    /// The same picture seen otherwise: by another camera, or from elsewhere. Nothing is read or prepared anew, and the picture has
    /// the same bits as one of a session that was opened so.
    ///
    /// # Errors
    /// The scene has no such camera, or another engine paints, which sees the scene as its file says.
    pub fn look(self, view: &ViewOptions) -> Result<Self, Error> {
        let request = Request { view: view.clone(), ..self.request.clone() };
        self.seen(&request)
    }

    /// The same by a request that differs in its view and the size of its picture.
    pub(crate) fn seen(self, request: &Request) -> Result<Self, Error> {
        let begun = Instant::now();
        let Self { options, painter, denoiser, .. } = self;
        Self::check(request, &options)?;
        let Painter::Own(own) = painter else {
            return Err(Error::usage("other engines see a scene as its file says", "leave out the engine"));
        };
        let BuiltinPainter { subject, .. } = *own;
        let (experts, notes) = experts(agent_rules(request)?)?;
        let (scene, goal) = (subject.seen_as(request)?, goal(request, begun, Duration::ZERO)?);
        let own = BuiltinPainter::open(request, scene, experts, goal, options.urgency)?;
        let painter = Painter::Own(Box::new(own));
        let session = Self { denoiser, ..Self::new(request, options, painter, notes, begun) };
        let resume = session.options.resume;
        let journal = PictureJournal::of_request(request, &session.name()?, resume)?;
        Ok(Self { journal, ..session })
    }

    /// The scene, where our own engine has read it.
    pub(crate) fn subject(&self) -> Option<&LoadedScene> {
        match &self.painter {
            Painter::Own(own) => Some(&own.subject),
            Painter::Other(_) => None,
        }
    }

    /// Our own engine, where that paints.
    pub(crate) fn own_engine(&self) -> Option<&Arc<BuiltinEngine>> {
        match &self.painter {
            Painter::Own(own) => Some(&own.engine),
            Painter::Other(_) => None,
        }
    }

    /// The denoiser, where one was asked for.
    pub(crate) fn denoiser(&self) -> Option<&Denoiser> {
        self.denoiser.as_ref()
    }
}
