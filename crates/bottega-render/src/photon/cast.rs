//! Parallel construction of a picture's photon maps and agents by the allocator.

use std::sync::Arc;

use bottega_hra::HraClient;

use super::{
    bounces::IrradianceMap,
    irradiance::irradiance_count,
    maps::{PhotonMaps, joined, photon_counts},
    trace::TracedPhotons,
    units::{IrradianceWork, PhotonWork},
};
use crate::{
    ala::cast_agents,
    error::RenderError,
    integrator::{LEARNING_STAGES, PathIntegrator, PhotonIntegrator, choose_techniques, learn_together},
    parts::parts,
    prepare::PreparedScene,
    prepass::Prepass,
    settings::{PathSettings, PhotonSettings, View},
    sharing::{Executors, LaterStages, Sharing},
    technique::{TechniqueJudge, TriedPhotons},
    work::{RenderOutput, RenderWork},
};

/// Greatest number of stages in which machines share the casting of a picture's photons.
const STAGES_MAX: u32 = 16;
/// Photons per unit of work: some milliseconds.
const PHOTONS: u32 = 8192;
/// Points per unit of work.
const POINTS: u32 = 4096;

/// Builds the photon maps of a picture, and casts its agents, unless they exist. Photons and irradiance are computed as
/// units of work, on all devices and, with `others`, on other machines. A progressive picture builds the maps of each
/// pass when a sample needs them. Does nothing for pictures without photons.
///
/// - `prepass`: belongs to `scene`, and receives the maps.
/// - `client`: runs the units of work; must not be used otherwise meanwhile.
/// - `others`: machines that render the same picture, which must call this, too.
///
/// # Errors
/// [`RenderError::PhotonsInMedia`], [`RenderError::EmptyPicture`], the allocator could not do the work, or the picture
/// was abandoned before its end.
pub fn cast_photons(
    scene: &Arc<PreparedScene>,
    prepass: &Arc<Prepass>,
    view: &View,
    settings: &PathSettings,
    client: &HraClient<RenderWork>,
    others: Option<&dyn Sharing>,
) -> Result<(), RenderError> {
    let Some(photons) = settings.photons else { return Ok(()) };
    let executors = Executors::new(client, others);
    let integrator = PhotonIntegrator::new(scene, prepass, view, settings, photons)?;
    if photons.progressive {
        return Ok(());
    }
    let passes = prepass.passes(scene, view, photons, settings.seed, 1);
    if !passes.is_made() {
        passes.put(maps(scene, prepass, view, photons, settings.seed, &executors)?);
    }
    if photons.agents.is_some() && !passes.has_agents() {
        passes.put_agents(cast_agents(scene, prepass, view, photons, settings.seed, &passes, &executors)?);
    }
    integrator.cast(0..1);
    Ok(())
}

/// Prepares a picture that tries photons: learns the guide of its paths, casts the photons, and chooses the technique of
/// each zone. Does nothing more than learning if the picture has too few samples for photons.
///
/// - `prepass`, `client`, `others`: as for [`cast_photons`].
/// - `judge`: the rules with the digest [`PathSettings::technique_rules`].
///
/// # Errors
/// The same as [`cast_photons`].
pub fn prepare_techniques(
    scene: &Arc<PreparedScene>,
    prepass: &Arc<Prepass>,
    view: &View,
    settings: &PathSettings,
    judge: &dyn TechniqueJudge,
    (client, others): (&HraClient<RenderWork>, Option<&dyn Sharing>),
) -> Result<(), RenderError> {
    match others {
        Some(others) => learn_together(scene, prepass, view, settings, others)?,
        None => drop(PathIntegrator::new(scene, prepass, view, settings)?),
    }
    let Some(tried) = TriedPhotons::of(view, settings) else { return Ok(()) };
    let cast = |photons: PhotonSettings, before: u32| {
        let with_photons = PathSettings { photons: Some(photons), tries_photons: false, ..*settings };
        let later = others.map(|others| LaterStages { others, before });
        let others = later.as_ref().map(|later| later as &dyn Sharing);
        cast_photons(scene, prepass, view, &with_photons, client, others)
    };
    // Cast the few photons of the trial, unless paths cannot judge them
    if !scene.hides_light() {
        cast(tried.trial, LEARNING_STAGES)?;
    }
    // Cast all photons if some zones need them
    if choose_techniques(scene, prepass, view, settings, (tried.trial, judge))?.only() != Some(false) {
        cast(tried.zones, LEARNING_STAGES + STAGES_MAX)?;
    }
    Ok(())
}

/// Builds the maps of one pass.
fn maps(
    scene: &Arc<PreparedScene>,
    prepass: &Arc<Prepass>,
    view: &View,
    photons: PhotonSettings,
    seed: u64,
    executors: &Executors<'_>,
) -> Result<PhotonMaps, RenderError> {
    let plan = prepass.photon_plan(scene, view);
    let trace = |count: u32, only_caustics: bool| {
        let work = |indices| {
            let (scene, prepass, view) = (Arc::clone(scene), Arc::clone(prepass), view.clone());
            PhotonWork { scene, prepass, settings: photons, view, only_caustics, seed, indices }
        };
        let works = parts(count, PHOTONS).map(work).map(|work| RenderWork::Photons(Box::new(work))).collect();
        let found =
            executors.run(works, |output| if let RenderOutput::Photons(part) = output { Some(part) } else { None })?;
        Ok::<_, RenderError>(found.into_iter().fold(TracedPhotons::default(), |mut all, part| {
            all.append(part);
            all
        }))
    };
    let [count, sent] = photon_counts(scene, &plan, &photons);
    let (traced, caustics) = (trace(count, false)?, trace(sent, true)?.caustic);
    let (mut maps, all) = scene.on_threads(|| PhotonMaps::begun(*plan.extent(), &photons, 0, traced, caustics));
    if let Some(all) = all.map(Arc::new) {
        let works = parts(irradiance_count(&all), POINTS).map(|points| {
            let (scene, all) = (Arc::clone(scene), Arc::clone(&all));
            RenderWork::Irradiance(IrradianceWork { scene, all, estimator: maps.estimator, points })
        });
        let answer = |output| if let RenderOutput::Irradiance(part) = output { Some(part) } else { None };
        let known = executors.run(works.collect(), answer)?;
        maps.irradiance = scene.on_threads(|| IrradianceMap::new(joined(known)));
    }
    Ok(maps)
}
