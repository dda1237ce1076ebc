//! The walk through the prims of a stage, from the root down.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::DAffine3;
use openusd::sdf::{Path, Specifier};
use openusd::usd::Prim;

use super::binding::Bindings;
use super::context::{InheritedState, VisitedPrim, Walk};
use super::material::Materials;
use super::placement::{Thing, ThingPlacement};
use super::shape::ShapeKind;
use super::source::StageSource;
use super::{camera, curves, gprim, instancer, light, place, xform};
use crate::error::SceneError;
use crate::model::{Scene, Sphere};
use crate::motion::{Shutter, SphereKey};

/// Most levels of prims.
const DEPTH_MAX: usize = 512;

/// Most prims that are visited.
const PRIMS_MAX: usize = 20_000_000;

/// Reads the stage at a time: meshes, instances, spheres, lights, the environment and cameras. Materials are added to
/// `materials`.
pub(super) fn scene<'s, 'a>(
    source: &'s StageSource<'a>,
    time: f64,
    world_from_stage: DAffine3,
    materials: &mut Materials<'s, 'a>,
) -> Result<Scene, SceneError> {
    let mut walk =
        Walk { source, time, scene: Scene::default(), materials, meshes: BTreeMap::new(), world_from_stage, prims: 0 };
    let inherited = InheritedState {
        world_from_parent: world_from_stage,
        is_visible: true,
        purpose: String::new(),
        bindings: Bindings::default(),
        ancestors: Rc::default(),
        depth: 0,
    };
    let mut placements = Vec::new();
    let roots = source.or_warn("", source.stage.root_prims());
    for name in roots {
        let Ok(path) = Path::abs_root().append_path(name.as_str()) else { continue };
        visit(&mut walk, &source.stage.prim(path), &inherited, &mut placements)?;
    }
    let Walk { mut scene, materials, .. } = walk;
    place::place_all(source, &placements, &mut scene, materials)?;
    Ok(scene)
}

/// Visits a prim and its descendants. What they place is added to `placements`.
fn visit(
    walk: &mut Walk<'_, '_, '_>,
    prim: &Prim,
    inherited: &InheritedState,
    placements: &mut Vec<ThingPlacement>,
) -> Result<(), SceneError> {
    let source = walk.source;
    let path = prim.path().as_str();
    walk.prims += 1;
    if walk.prims > PRIMS_MAX || inherited.depth > DEPTH_MAX {
        return Err(SceneError::Limit {
            path: source.request.path.into(),
            place: path.into(),
            problem: format!("there are more than {PRIMS_MAX} prims, or more than {DEPTH_MAX} levels of them"),
            remedy: "divide the stage",
        });
    }
    let specifier = source.or_warn(path, prim.specifier());
    let is_active = source.or_warn(path, prim.is_active().map(Some));
    if specifier != Some(Specifier::Def) || is_active == Some(false) {
        return Ok(());
    }
    let kind = source.type_of(prim);
    if matches!(kind.as_str(), "Material" | "Shader" | "NodeGraph" | "GeomSubset" | "RenderSettings") {
        return Ok(());
    }
    let visited = place(walk, prim, inherited);
    let InheritedState { is_visible, .. } = visited.inherited;
    let is_drawn = is_visible && matches!(visited.inherited.purpose.as_str(), "" | "default" | "render");
    if kind == "Camera" {
        camera::add(walk, &visited);
    }
    if is_drawn {
        match kind.as_str() {
            "PointInstancer" => return instancer::add(walk, &visited, placements, visit),
            "BasisCurves" => curves::add(walk, &visited, placements)?,
            "Points" => curves::add_points(walk, &visited, placements)?,
            "HermiteCurves" | "NurbsCurves" | "NurbsPatch" | "TetMesh" | "Volume" => {
                source.unsupported(path, format!("a `{kind}` is not supported and is left out"));
            }
            other => match ShapeKind::of(other) {
                Some(kind) => gprim::add(walk, &visited, kind, placements)?,
                None => {
                    if let Some(spec) = light::read(walk, &visited, other) {
                        placements.push(ThingPlacement {
                            thing: Thing::Light(Rc::new(spec)),
                            world_from_object: visited.world_from_prim,
                            path: path.into(),
                        });
                    }
                }
            },
        }
    } else if kind == "PointInstancer" {
        return Ok(());
    }
    visit_children(walk, &visited, placements)
}

fn visit_children(
    walk: &mut Walk<'_, '_, '_>,
    visited: &VisitedPrim<'_>,
    placements: &mut Vec<ThingPlacement>,
) -> Result<(), SceneError> {
    let children = walk.source.or_warn(visited.prim.path().as_str(), visited.prim.children());
    children.iter().try_for_each(|child| visit(walk, child, &visited.inherited, placements))
}

/// Computes the place of a prim, and what its children inherit.
fn place<'p>(walk: &Walk<'_, '_, '_>, prim: &'p Prim, inherited: &InheritedState) -> VisitedPrim<'p> {
    let source = walk.source;
    let local = xform::read(source, prim, walk.time);
    let parent = if local.resets { walk.world_from_stage } else { inherited.world_from_parent };
    let world_from_prim = parent * local.parent_from_prim;
    let is_visible = inherited.is_visible && source.text(prim, "visibility", walk.time).as_deref() != Some("invisible");
    let purpose = source.text(prim, "purpose", walk.time).unwrap_or_else(|| inherited.purpose.clone());
    let mut ancestors = inherited.ancestors.clone();
    let names = source.or_warn(prim.path().as_str(), prim.property_names());
    if names.iter().any(|name| name.as_str().starts_with("primvars:")) {
        Rc::make_mut(&mut ancestors).push(prim.clone());
    }
    let inherited = InheritedState {
        world_from_parent: world_from_prim,
        is_visible,
        purpose,
        bindings: inherited.bindings.with(source, prim),
        ancestors,
        depth: inherited.depth + 1,
    };
    VisitedPrim { prim, world_from_prim, inherited }
}

/// Gives spheres the keys of later times. Where spheres appear or vanish, all stand still.
///
/// - `times`, `later`: the later times, and the spheres then.
pub(super) fn add_sphere_keys(spheres: &mut [Sphere], shutter: Option<Shutter>, times: &[f64], later: &[Vec<Sphere>]) {
    let Some(shutter) = shutter else { return };
    if later.iter().any(|list| list.len() != spheres.len()) {
        return;
    }
    for (index, sphere) in spheres.iter_mut().enumerate() {
        let key = |time: f64, sphere: &Sphere| SphereKey {
            time,
            center: sphere.center,
            radius: sphere.radius,
            world_from_object: sphere.world_from_object,
        };
        let first = key(shutter.open, sphere);
        let keys = times.iter().zip(later).map(|(&time, list)| key(time, &list[index]));
        let keys: Vec<SphereKey> = std::iter::once(first).chain(keys).collect();
        let is_still = keys.iter().all(|key| SphereKey { time: first.time, ..*key } == first);
        sphere.motion = if is_still { Vec::new() } else { keys };
    }
}
