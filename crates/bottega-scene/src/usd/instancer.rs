//! Point instancers: prototypes placed many times.

use std::collections::BTreeSet;

use glam::{DAffine3, DQuat, DVec3};
use openusd::sdf::Path;
use openusd::usd::Prim;

use super::context::{InheritedState, VisitedPrim, Walk};
use super::placement::{self, ThingPlacement};
use super::values;
use crate::error::SceneError;

/// Visits a prim and its descendants, and adds what they place.
pub(super) type Visit =
    fn(&mut Walk<'_, '_, '_>, &Prim, &InheritedState, &mut Vec<ThingPlacement>) -> Result<(), SceneError>;

/// Places the instances of a point instancer. Its prototypes are drawn nowhere else if they are below it.
pub(super) fn add(
    walk: &mut Walk<'_, '_, '_>,
    visited: &VisitedPrim<'_>,
    placements: &mut Vec<ThingPlacement>,
    visit: Visit,
) -> Result<(), SceneError> {
    let (source, prim, time) = (walk.source, visited.prim, walk.time);
    let path = prim.path().as_str();
    let prototypes = source.targets(prim, "prototypes");
    let indices = source.read(prim, "protoIndices", time, values::integers).unwrap_or_default();
    let positions = source.read(prim, "positions", time, values::vectors).unwrap_or_default();
    let orientations = match source.read(prim, "orientationsf", time, values::quaternions) {
        Some(list) if !list.is_empty() => list,
        _ => source.read(prim, "orientations", time, values::quaternions).unwrap_or_default(),
    };
    let scales = source.read(prim, "scales", time, values::vectors).unwrap_or_default();
    let ids = source.read(prim, "ids", time, values::long_integers).unwrap_or_default();
    let hidden = hidden(walk, visited);
    if prototypes.is_empty() || indices.is_empty() {
        return Ok(());
    }
    if positions.len() < indices.len() {
        source.warn(
            path,
            format!("has {} positions for {} instances; the rest is left out", positions.len(), indices.len()),
        );
    }
    for (name, count) in [("orientations", orientations.len()), ("scales", scales.len())] {
        if count != 0 && count < indices.len() {
            source.warn(path, format!("has {count} {name} for {} instances; they are left out", indices.len()));
        }
    }
    for name in ["velocities", "angularVelocities", "accelerations"] {
        if source.value(prim, name, time).is_some() {
            source.unsupported_once(path, "velocities of points are left out: instances move by their samples");
        }
    }
    let mut models: Vec<Option<Vec<ThingPlacement>>> = prototypes.iter().map(|_| None).collect();
    for (instance, (&index, position)) in indices.iter().zip(&positions).enumerate() {
        let id = ids.get(instance).copied().unwrap_or(instance as i64);
        if hidden.contains(&id) {
            continue;
        }
        let Some(number) = usize::try_from(index).ok().filter(|&number| number < prototypes.len()) else {
            source.warn(path, format!("refers to prototype {index}, and there are {}", prototypes.len()));
            continue;
        };
        if models[number].is_none() {
            models[number] = Some(model(walk, visited, &prototypes[number], visit)?);
        }
        let scale = if scales.len() < indices.len() { DVec3::ONE } else { scales[instance].as_dvec3() };
        let turn = if orientations.len() < indices.len() { DQuat::IDENTITY } else { orientations[instance] };
        let turn = if turn.length_squared() > 0.0 { turn.normalize() } else { DQuat::IDENTITY };
        let local = DAffine3::from_scale_rotation_translation(scale, turn, position.as_dvec3());
        if !local.is_finite() {
            source.warn(path, "the places of some instances are not finite; they are left out");
            continue;
        }
        let world = visited.world_from_prim * local;
        let model = models[number].as_deref().unwrap_or_default();
        placement::book(source, path, placements.len(), model.len())?;
        placements.extend(
            model
                .iter()
                .map(|part| ThingPlacement { world_from_object: world * part.world_from_object, ..part.clone() }),
        );
    }
    Ok(())
}

/// Returns what a prototype places, in the space of the instancer.
fn model(
    walk: &mut Walk<'_, '_, '_>,
    visited: &VisitedPrim<'_>,
    prototype: &Path,
    visit: Visit,
) -> Result<Vec<ThingPlacement>, SceneError> {
    let prim = walk.source.stage.prim(prototype.clone());
    let inherited = InheritedState { world_from_parent: DAffine3::IDENTITY, ..visited.inherited.clone() };
    let mut placements = Vec::new();
    visit(walk, &prim, &inherited, &mut placements)?;
    Ok(placements)
}

/// Returns the ids of instances that are not drawn.
fn hidden(walk: &Walk<'_, '_, '_>, visited: &VisitedPrim<'_>) -> BTreeSet<i64> {
    let source = walk.source;
    let invisible = source.read(visited.prim, "invisibleIds", walk.time, values::long_integers).unwrap_or_default();
    let inactive = source.stage.attribute(visited.prim.path().clone()).get_metadata("inactiveIds");
    let inactive = source.or_warn(visited.prim.path().as_str(), inactive);
    let inactive = inactive.and_then(|list| values::long_integers(&list)).unwrap_or_default();
    invisible.into_iter().chain(inactive).collect()
}
