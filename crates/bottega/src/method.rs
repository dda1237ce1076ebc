//! The integrator of a picture: the requested one, or else one that finds the same light as the integrator of the scene file.

use bottega_render::PhotonSettings;
use bottega_scene::{IntegratorHint, PhotonHints, Scene, TransportPaths};

use crate::{
    loaded_scene::LoadedScene,
    request::{IntegratorChoice, Request, WordChoice},
    settings::{agent_photons, photon_settings},
};

/// The integrator with its settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// The integrator: path tracing, photon mapping or lighting agents.
    pub integrator: IntegratorChoice,
    /// Settings of photons; `None` for path tracing.
    pub photons: Option<PhotonSettings>,
    /// A note for the user if the integrator of the scene file is replaced.
    pub note: Option<String>,
}

impl Method {
    /// Chooses the method of a request for a scene.
    ///
    /// - `bounces`: maximum number of bounces of light.
    pub fn of(request: &Request, subject: &LoadedScene, bounces: u32) -> Self {
        let hint = subject.hints.integrator.as_ref();
        // Choose the integrator: the requested one, or the counterpart of the scene file's
        let (integrator, hints, reason) = match (request.integrator.method, hint) {
            (Some(requested), hint) => {
                let hints = hint.and_then(photon_hints).filter(|_| requested == IntegratorChoice::Photon);
                // The file does not make a requested integrator progressive; its settings of photons count if the request is
                // progressive.
                (requested, hints.filter(|_| request.photons.progressive), None)
            }
            (None, None) => (IntegratorChoice::Path, None, None),
            (None, Some(hint)) => chosen(hint, subject),
        };
        // Collect its settings
        let photons = photon_settings(&request.photons, bounces, hints);
        let photons = match integrator {
            IntegratorChoice::Path => None,
            IntegratorChoice::Photon => Some(photons),
            IntegratorChoice::Ala => Some(agent_photons(&request.lighting_agents, photons)),
        };
        // Explain the replacement of the scene file's integrator
        let name = name(integrator, photons.as_ref());
        let note = hint.filter(|hint| is_replaced(hint)).map(|hint| {
            let at = if hint.place.is_empty() { String::new() } else { format!("{}: ", hint.place) };
            let why = match (reason, request.integrator.method) {
                (_, Some(_)) => ", as requested",
                (Some(reason), None) => reason,
                (None, None) => "",
            };
            format!("{at}the integrator `{}` is replaced by {name}{why}", hint.name)
        });
        Self { integrator, photons, note }
    }

    /// Returns the word of the integrator: `path`, `photon` or `ala`.
    pub fn word(&self) -> &'static str {
        self.integrator.word()
    }

    /// Returns the readable name of the method, with the options that select it.
    pub fn name(&self) -> &'static str {
        name(self.integrator, self.photons.as_ref())
    }
}

fn name(integrator: IntegratorChoice, photons: Option<&PhotonSettings>) -> &'static str {
    match (integrator, photons) {
        (IntegratorChoice::Path, _) => "path tracing (--integrator path)",
        (IntegratorChoice::Photon, Some(photons)) if photons.progressive => {
            "progressive photons (--integrator photon --progressive)"
        }
        (IntegratorChoice::Photon, _) => "photon mapping (--integrator photon)",
        (IntegratorChoice::Ala, _) => "lighting agents (--integrator ala)",
    }
}

/// Returns the integrator that replaces one of a scene file, its photon hints, and the reason if another one is expected.
fn chosen(
    hint: &IntegratorHint,
    subject: &LoadedScene,
) -> (IntegratorChoice, Option<PhotonHints>, Option<&'static str>) {
    const MEDIA: &str = ", since photons do not go through media; caustics may lack light";
    const MOTION: &str = ", since photons know no time; caustics may lack light";
    let has_media = subject.prepared.has_media();
    match hint.follows {
        TransportPaths::Photons(_) | TransportPaths::BothEnds if subject.prepared.moves() => {
            (IntegratorChoice::Path, None, Some(MOTION))
        }
        TransportPaths::Photons(_) | TransportPaths::BothEnds if has_media => {
            (IntegratorChoice::Path, None, Some(MEDIA))
        }
        TransportPaths::Photons(hints) => (IntegratorChoice::Photon, Some(hints), None),
        TransportPaths::BothEnds if hides_light(subject.scene()) => {
            let reason = ", which also finds what small lights send over mirrors and through glass";
            (IntegratorChoice::Photon, Some(PhotonHints::default()), Some(reason))
        }
        TransportPaths::BothEnds | TransportPaths::Paths { .. } => (IntegratorChoice::Path, None, None),
    }
}

fn photon_hints(hint: &IntegratorHint) -> Option<PhotonHints> {
    if let TransportPaths::Photons(hints) = hint.follows { Some(hints) } else { None }
}

fn is_replaced(hint: &IntegratorHint) -> bool {
    hint.follows != TransportPaths::Paths { is_ours: true }
}

/// Returns true if there is light that camera paths cannot find: that of point lights over mirrors and through glass.
fn hides_light(scene: &Scene) -> bool {
    !scene.lights.is_empty() && scene.materials.iter().any(|material| material.surface.has_mirror())
}
