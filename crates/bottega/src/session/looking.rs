//! Another view of a session's scene, without loading it again.

use std::{sync::Arc, time::Instant};

use bottega_denoise::Denoiser;
use bottega_engines::BuiltinEngine;
use bottega_scene::Loaded;

use super::{
    Session,
    painter::{OpenedPicture, Painter},
};
use crate::{
    agent_rules::AgentRules,
    builtin::BuiltinPainter,
    error::Error,
    journal::PictureJournal,
    loaded_scene::LoadedScene,
    plan::PicturePart,
    request::{Request, ViewOptions},
};

impl Session {
    /// Returns the session with another view: another camera, or another pose. Nothing is read or prepared again; the picture is
    /// bit-identical to that of a session opened with this view.
    ///
    /// # Errors
    /// The view is invalid, the scene has no such camera, the output or its journal cannot be written, or the session uses an
    /// external engine, which cannot change the view.
    pub fn look(self, view: &ViewOptions) -> Result<Self, Error> {
        let request = Request { view: view.clone(), ..self.request.clone() };
        self.seen(&request)
    }

    /// Changes the view like [`Self::look`], for a request that differs in its view and in the size of the picture.
    ///
    /// # Errors
    /// Those of [`Self::look`], or the size is not allowed.
    pub(crate) fn seen(self, request: &Request) -> Result<Self, Error> {
        let begun = Instant::now();
        let Self { options, painter, denoiser, .. } = self;
        Self::check(request, &options)?;
        let Painter::Own(own) = painter else {
            return Err(Error::usage("other engines render the view of the scene file", "leave out the engine"));
        };
        let BuiltinPainter { subject, .. } = *own;
        let rules = AgentRules::of(request)?;
        let notes = rules.notes.clone();
        let part = PicturePart::Whole { begun, urgency: options.urgency };
        let opened = Painter::of_scene(request, subject.seen_as(request)?, rules, &part)?;
        let journal = PictureJournal::of_request(request, opened.name.as_deref(), options.resume)?;
        // The warnings about the scene have been reported
        let opened = OpenedPicture { notes, ..opened };
        Ok(Self { denoiser, journal, ..Self::new(request, options, opened, begun) })
    }

    /// Returns the session with another state of the scene, and the view and size of a request. Only changed parts are prepared
    /// again; the picture is bit-identical to that of a new session.
    ///
    /// # Errors
    /// The request or its rules cannot be used, the scene has no camera or not the requested one or cannot be prepared, or the
    /// session uses an external engine.
    pub fn edited(self, request: &Request, scene: impl Into<Loaded>) -> Result<Self, Error> {
        let begun = Instant::now();
        let Self { options, painter, denoiser, .. } = self;
        Self::check(request, &options)?;
        let Painter::Own(own) = painter else {
            return Err(Error::usage("other engines render the view of the scene file", "leave out the engine"));
        };
        // Give up the engine first: an acceleration structure without other references can be refitted.
        let BuiltinPainter { subject, engine, .. } = *own;
        drop(engine);
        let subject = subject.edited(scene, request)?;
        let rules = AgentRules::of(request)?;
        let notes = rules.notes.clone();
        let part = PicturePart::Whole { begun, urgency: options.urgency };
        let opened = OpenedPicture { notes, ..Painter::of_scene(request, subject, rules, &part)? };
        Ok(Self { denoiser, ..Self::new(request, options, opened, begun) })
    }

    /// Returns the loaded scene; `None` with an external engine.
    pub(crate) fn subject(&self) -> Option<&LoadedScene> {
        match &self.painter {
            Painter::Own(own) => Some(&own.subject),
            Painter::Other(_) => None,
        }
    }

    /// Returns the built-in engine; `None` with an external engine.
    pub(crate) fn own_engine(&self) -> Option<&Arc<BuiltinEngine>> {
        match &self.painter {
            Painter::Own(own) => Some(&own.engine),
            Painter::Other(_) => None,
        }
    }

    /// Returns the denoiser; `None`: the request does not ask for one.
    pub(crate) fn denoiser(&self) -> Option<&Denoiser> {
        self.denoiser.as_ref()
    }
}
