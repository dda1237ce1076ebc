//! The integrator of a picture: the requested one, or else one that finds the same light as the integrator of the scene file.

use bottega_render::PhotonSettings;
use bottega_scene::{IntegratorHint, PhotonHints, TransportPaths};

use crate::{
    loaded_scene::LoadedScene,
    request::{IntegratorChoice, OptimizationChoice, Request, WordChoice},
    settings::{agent_photons, photon_settings},
};

/// The integrator with its settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Method {
    /// The integrator: path tracing, photon mapping, lighting agents, or `auto`, which chooses paths or photons by zone.
    pub integrator: IntegratorChoice,
    /// Settings of photons; `None`: paths alone, also with `auto` if photons cannot render the picture.
    pub photons: Option<PhotonSettings>,
    /// A note for the user if the integrator of the scene file is replaced, or if `auto` uses paths alone; `None`: neither.
    pub note: Option<String>,
}

impl Method {
    /// Chooses the method of a request for a scene, and returns it.
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
        // Find out why `auto` cannot try photons
        let refused = if integrator == IntegratorChoice::Auto { photons_refused(request, subject) } else { None };
        // Collect its settings
        let photons = photon_settings(&request.photons, bounces, hints);
        let photons = match integrator {
            IntegratorChoice::Path => None,
            IntegratorChoice::Photon => Some(photons),
            IntegratorChoice::Ala => Some(agent_photons(&request.lighting_agents, photons)),
            IntegratorChoice::Auto => Some(photons).filter(|_| refused.is_none()),
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
        let note = note.or_else(|| refused.map(|why| format!("--integrator auto uses paths alone: {why}")));
        Self { integrator, photons, note }
    }

    /// Returns the word of the integrator: `path`, `photon`, `ala` or `auto`.
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
        (IntegratorChoice::Auto, None) => "path tracing (--integrator auto)",
        (IntegratorChoice::Auto, Some(_)) => "paths or photons by zone (--integrator auto)",
    }
}

/// Returns the reason why `auto` cannot try photons for a request; `None`: it can.
fn photons_refused(request: &Request, subject: &LoadedScene) -> Option<&'static str> {
    /// The layers that paths alone compute.
    const PATH_LAYERS: [&str; 3] = ["all", "direct", "indirect"];
    let has = |layers: &Vec<String>| layers.iter().any(|layer| PATH_LAYERS.contains(&&**layer));
    let reasons = [
        (
            request.work.optimization == OptimizationChoice::Off,
            "photons are slightly blurred, so they are tried only with --optimize vs, s, n, b or vb",
        ),
        (subject.prepared.has_media(), "photons do not go through media"),
        (subject.prepared.moves(), "photons know no time"),
        (!request.film.light_groups.is_empty(), "photons do not keep the light of groups apart"),
        (!request.film.shadow_catchers.is_empty(), "photons know no shadow catchers"),
        (request.film.layers.as_ref().is_some_and(has), "photons do not tell direct from indirect light"),
        (request.photons.progressive, "progressive photons cannot be mixed with paths"),
        (request.integrator.wavefront, "rays that are separate units have no photons"),
    ];
    reasons.into_iter().find(|(is_so, _)| *is_so).map(|(_, why)| why)
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
        TransportPaths::BothEnds if subject.prepared.hides_light() => {
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
