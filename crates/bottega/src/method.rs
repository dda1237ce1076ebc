//! Which of our integrators paints a picture: the one that the user asks for, else one that finds the light which the integrator
//! of the scene file finds.

use bottega_render::PhotonSettings;
use bottega_scene::{Follows, IntegratorHint, PhotonHints, Scene};

use crate::{
    cli::{IntegratorArg, RenderArgs},
    scene::Subject,
};

/// How a picture is painted.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Method {
    pub(crate) integrator: IntegratorArg,
    /// How photons are used, if the picture is one of photons or of lighting agents.
    pub(crate) photons: Option<PhotonSettings>,
    /// What the user should know, where the file's integrator is replaced.
    pub(crate) note: Option<String>,
}

impl Method {
    /// - `bounces`: surfaces that light may come to.
    pub(crate) fn of(args: &RenderArgs, subject: &Subject, bounces: u32) -> Self {
        let hint = subject.hints.integrator.as_ref();
        let (integrator, hints, reason) = match (args.integrator, hint) {
            (Some(asked), hint) => {
                let hints = hint.and_then(photon_hints).filter(|_| asked == IntegratorArg::Photon);
                // What the user asks for is not to be made progressive by the file; what the file says of photons counts.
                (asked, hints.filter(|_| args.photon_mapping.progressive), None)
            }
            (None, None) => (IntegratorArg::Path, None, None),
            (None, Some(hint)) => chosen(hint, subject),
        };
        let photons = args.photon_mapping.settings(bounces, hints);
        let photons = match integrator {
            IntegratorArg::Path => None,
            IntegratorArg::Photon => Some(photons),
            IntegratorArg::Ala => Some(args.lighting.settings(photons)),
        };
        let name = name(integrator, photons.as_ref());
        let note = hint.filter(|hint| is_replaced(hint)).map(|hint| {
            let at = if hint.place.is_empty() { String::new() } else { format!("{}: ", hint.place) };
            let why = match (reason, args.integrator) {
                (_, Some(_)) => " as it was asked for",
                (Some(reason), None) => reason,
                (None, None) => "",
            };
            format!("{at}the integrator `{}` is replaced by {name}{why}", hint.name)
        });
        Self { integrator, photons, note }
    }

    /// In words.
    pub(crate) fn name(&self) -> &'static str {
        name(self.integrator, self.photons.as_ref())
    }
}

fn name(integrator: IntegratorArg, photons: Option<&PhotonSettings>) -> &'static str {
    match (integrator, photons) {
        (IntegratorArg::Path, _) => "path tracing (--integrator path)",
        (IntegratorArg::Photon, Some(photons)) if photons.progressive => {
            "progressive photons (--integrator photon --progressive)"
        }
        (IntegratorArg::Photon, _) => "photon mapping (--integrator photon)",
        (IntegratorArg::Ala, _) => "lighting agents (--integrator ala)",
    }
}

/// The counterpart of an integrator, and why it is not another one.
fn chosen(hint: &IntegratorHint, subject: &Subject) -> (IntegratorArg, Option<PhotonHints>, Option<&'static str>) {
    const MEDIA: &str = ", since photons do not go through media; caustics may lack light";
    let has_media = subject.prepared.has_media();
    match hint.follows {
        Follows::Photons(_) | Follows::BothEnds if has_media => (IntegratorArg::Path, None, Some(MEDIA)),
        Follows::Photons(hints) => (IntegratorArg::Photon, Some(hints), None),
        Follows::BothEnds if hides_light(subject.scene()) => {
            let reason = ", which finds the light of small lamps over mirrors and through glass, too";
            (IntegratorArg::Photon, Some(PhotonHints::default()), Some(reason))
        }
        Follows::BothEnds | Follows::Paths { .. } => (IntegratorArg::Path, None, None),
    }
}

fn photon_hints(hint: &IntegratorHint) -> Option<PhotonHints> {
    if let Follows::Photons(hints) = hint.follows { Some(hints) } else { None }
}

fn is_replaced(hint: &IntegratorHint) -> bool {
    hint.follows != Follows::Paths { is_ours: true }
}

/// Whether there is light that paths from the camera cannot find: of lamps without extent, over mirrors and through glass.
fn hides_light(scene: &Scene) -> bool {
    !scene.lights.is_empty() && scene.materials.iter().any(|material| material.surface.has_mirror())
}
