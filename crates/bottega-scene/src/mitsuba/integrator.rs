//! Integrators of a Mitsuba scene: the technique and its depth.

use super::context::ImportContext;
use super::document::{Class, Object, ObjectId};
use crate::color::Spectrum;
use crate::hints::RenderHints;
use crate::import::text_place::{ImportResult, TextPlace};
use crate::integrator::{IntegratorHint, PhotonHints, TransportPaths};
use crate::model::Scene;
use crate::surface::Surface;

/// The effects of an integrator on the scene beyond light transport.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct IntegratorEffects {
    /// `true`: passing straight through a thin sheet is not a bounce, and lights are visible through it.
    sees_through_panes: bool,
    /// `true`: media are ignored.
    ignores_media: bool,
    /// `true`: the camera does not see emitters.
    hides_emitters: bool,
    /// Location of the integrator.
    at: TextPlace,
}

impl IntegratorEffects {
    /// Applies the effects to the finished scene.
    pub(super) fn apply(&self, context: &mut ImportContext<'_>, scene: &mut Scene) {
        let &Self { sees_through_panes, ignores_media, hides_emitters, at } = self;
        for camera in &mut scene.cameras {
            camera.hides_emitters = hides_emitters;
        }
        for material in &mut scene.materials {
            material.see_through = sees_through_panes && material.has_clear_sheet();
        }
        if !ignores_media {
            return;
        }
        if scene.leave_out_media() {
            context.note(at, "the integrator of the file does not support media: they are left out");
        }
        // Without media, their boundaries are bounces and hide lights.
        for material in scene.materials.iter_mut().filter(|material| material.surface == Surface::Null) {
            material.surface = Surface::clear_sheet(Spectrum::ONE.into());
        }
    }
}

/// Reads the integrator: which of ours replaces it, and the number of bounces. Returns its effects on the scene;
/// `None`: another one was read before, which counts.
pub(super) fn read_integrator(
    context: &mut ImportContext<'_>,
    hints: &mut RenderHints,
    id: ObjectId,
) -> ImportResult<Option<IntegratorEffects>> {
    let object = context.visit(id)?;
    if matches!(object.plugin.as_str(), "aov" | "moment" | "adaptive" | "irrcache" | "multichannel" | "stokes") {
        return read_inner_integrator(context, hints, object);
    }
    let depth = object.integer("max_depth")?.unwrap_or(-1);
    // Mitsuba counts the edges of a path: 1 is emission, 2 direct light.
    let mut bounces = u32::try_from(depth).map_or(u32::MAX, |depth| depth.saturating_sub(1));
    let hides_emitters = object.boolean("hide_emitters", false)?;
    let mut follows = TransportPaths::Paths { is_ours: true };
    let mut is_known = true;
    match object.plugin.as_str() {
        "path" | "volpath" | "volpathmis" | "volpath_simple" => {}
        "direct" => {
            bounces = 1;
            for name in ["emitter_samples", "bsdf_samples", "luminaire_samples"] {
                if object.integer(name)? == Some(0) {
                    context.warn(object.at, format!("light is found in every way, though `{name}` is 0"));
                }
            }
        }
        "prb" | "prb_basic" | "prb_projective" | "prbvolpath" => {
            follows = TransportPaths::Paths { is_ours: false };
            object.accept_all();
        }
        "direct_projective" => {
            (follows, bounces) = (TransportPaths::Paths { is_ours: false }, 1);
            object.accept_all();
        }
        "bdpt" | "mlt" | "pssmlt" | "erpt" | "ptracer" | "vpl" => {
            follows = TransportPaths::BothEnds;
            object.accept_all();
        }
        "photonmapper" | "ppm" | "sppm" => follows = TransportPaths::Photons(photon_hints(hints, object)?),
        _ => {
            let message = format!("the {} is not supported; paths are traced instead", object.describe());
            context.warn(object.at, message);
            object.accept_all();
            is_known = false;
        }
    }
    if hints.max_depth.is_some() {
        return Ok(None);
    }
    hints.max_depth = Some(bounces);
    let place = context.place(object.at);
    hints.integrator = is_known.then(|| IntegratorHint { name: object.plugin.clone(), place, follows });
    let follows_media = matches!(object.plugin.as_str(), "volpath" | "volpathmis" | "volpath_simple" | "prbvolpath");
    Ok(Some(IntegratorEffects {
        sees_through_panes: follows_media,
        ignores_media: is_known && !follows_media && !matches!(object.plugin.as_str(), "bdpt" | "photonmapper"),
        at: object.at,
        hides_emitters,
    }))
}

/// Reads the nested integrator of one that only processes its result.
fn read_inner_integrator(
    context: &mut ImportContext<'_>,
    hints: &mut RenderHints,
    object: &Object,
) -> ImportResult<Option<IntegratorEffects>> {
    object.accept_all();
    let inner = object.children.iter().find(|child| context.document.get(child.object).class == Class::Integrator);
    // `adaptive` only controls the sample count.
    if object.plugin != "adaptive" {
        let message = format!("the {} is not supported; only what it colours is painted", object.describe());
        context.warn(object.at, message);
    }
    inner.map_or(Ok(None), |child| read_integrator(context, hints, child.object))
}

/// Reads the parameters of Mitsuba 0.x's photon mappers.
fn photon_hints(hints: &mut RenderHints, object: &Object) -> ImportResult<PhotonHints> {
    let count = |name: &str| -> ImportResult<Option<u32>> {
        let number = object.integer(name)?;
        Ok(number.and_then(|number| u32::try_from(number).ok()).filter(|&number| number > 0))
    };
    let positive = |name: &str| -> ImportResult<Option<f32>> {
        let number = object.float(name)?.map(|number| number as f32);
        Ok(number.filter(|number| *number > 0.0 && number.is_finite()))
    };
    // Its passes are our samples.
    if let Some(passes) = count("max_passes")? {
        hints.samples = Some(passes.min(1 << 24));
    }
    Ok(PhotonHints {
        count: count("photon_count")?,
        radius: positive("initial_radius")?,
        radius_share: positive("global_lookup_radius")?,
        gather: count("lookup_size")?,
    })
}
