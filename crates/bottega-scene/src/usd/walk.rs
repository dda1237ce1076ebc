//! The walk through the prims of a stage, from the root down.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::DAffine3;
use openusd::sdf::{Path, Specifier};
use openusd::usd::Prim;

use super::binding::Bindings;
use super::gprim::GprimKind;
use super::material::Materials;
use super::placement::{self, Placement, Thing};
use super::source::StageSource;
use super::{camera, curves, instancer, light, xform};
use crate::error::SceneError;
use crate::model::{Scene, Sphere};
use crate::motion::{Shutter, SphereKey};

/// Most levels of prims.
const DEPTH_MAX: usize = 512;

/// Most prims that are visited.
const PRIMS_MAX: usize = 20_000_000;

/// What a prim has from its ancestors.
#[derive(Clone)]
pub(super) struct Inherited {
    /// The space of the prim's parent to world space.
    pub(super) world_from_parent: DAffine3,
    pub(super) is_visible: bool,
    /// The purpose that an ancestor has; empty: none has one.
    pub(super) purpose: String,
    pub(super) bindings: Bindings,
    /// The prim's ancestors that have primvars, nearest last.
    pub(super) ancestors: Rc<Vec<Prim>>,
    pub(super) depth: usize,
}

/// A prim on the walk, with its place.
pub(super) struct Visited<'p> {
    pub(super) prim: &'p Prim,
    pub(super) world_from_prim: DAffine3,
    /// What its children inherit.
    pub(super) inherited: Inherited,
}

/// A mesh of a prim, by the index in the scene, and the material of each.
pub(super) type PrimMeshes = Rc<Vec<(u32, u32)>>;

/// The walk, and the scene that it makes.
pub(super) struct Walk<'w, 's, 'a> {
    pub(super) source: &'s StageSource<'a>,
    pub(super) time: f64,
    pub(super) scene: Scene,
    pub(super) materials: &'w mut Materials<'s, 'a>,
    /// Meshes by the path of the prim that has them, and the materials that they were made for.
    pub(super) meshes: BTreeMap<(String, Vec<u32>), PrimMeshes>,
    world_from_stage: DAffine3,
    prims: usize,
}

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
    let inherited = Inherited {
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
        walk.visit(&source.stage.prim(path), &inherited, &mut placements)?;
    }
    let Walk { mut scene, materials, .. } = walk;
    placement::place_all(source, &placements, &mut scene, materials)?;
    Ok(scene)
}

impl Walk<'_, '_, '_> {
    /// Visits a prim and its descendants. What they place is added to `placements`.
    pub(super) fn visit(
        &mut self,
        prim: &Prim,
        inherited: &Inherited,
        placements: &mut Vec<Placement>,
    ) -> Result<(), SceneError> {
        let source = self.source;
        let path = prim.path().as_str();
        self.prims += 1;
        if self.prims > PRIMS_MAX || inherited.depth > DEPTH_MAX {
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
        let visited = self.place(prim, inherited);
        let Inherited { is_visible, .. } = visited.inherited;
        let is_drawn = is_visible && matches!(visited.inherited.purpose.as_str(), "" | "default" | "render");
        if kind == "Camera" {
            camera::add(self, &visited);
        }
        if is_drawn {
            match kind.as_str() {
                "PointInstancer" => return instancer::add(self, &visited, placements),
                "BasisCurves" => curves::add(self, &visited, placements)?,
                "Points" => curves::add_points(self, &visited, placements)?,
                "HermiteCurves" | "NurbsCurves" | "NurbsPatch" | "TetMesh" | "Volume" => {
                    source.unsupported(path, format!("a `{kind}` is not supported and is left out"));
                }
                other => match GprimKind::of(other) {
                    Some(kind) => self.add_gprim(&visited, kind, placements)?,
                    None => {
                        if let Some(spec) = light::read(self, &visited, other) {
                            placements.push(Placement {
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
        self.visit_children(&visited, placements)
    }

    fn visit_children(&mut self, visited: &Visited<'_>, placements: &mut Vec<Placement>) -> Result<(), SceneError> {
        let children = self.source.or_warn(visited.prim.path().as_str(), visited.prim.children());
        children.iter().try_for_each(|child| self.visit(child, &visited.inherited, placements))
    }

    /// Computes the place of a prim, and what its children inherit.
    fn place<'p>(&self, prim: &'p Prim, inherited: &Inherited) -> Visited<'p> {
        let source = self.source;
        let local = xform::read(source, prim, self.time);
        let parent = if local.resets { self.world_from_stage } else { inherited.world_from_parent };
        let world_from_prim = parent * local.parent_from_prim;
        let is_visible =
            inherited.is_visible && source.text(prim, "visibility", self.time).as_deref() != Some("invisible");
        let purpose = source.text(prim, "purpose", self.time).unwrap_or_else(|| inherited.purpose.clone());
        let mut ancestors = inherited.ancestors.clone();
        let names = source.or_warn(prim.path().as_str(), prim.property_names());
        if names.iter().any(|name| name.as_str().starts_with("primvars:")) {
            Rc::make_mut(&mut ancestors).push(prim.clone());
        }
        let inherited = Inherited {
            world_from_parent: world_from_prim,
            is_visible,
            purpose,
            bindings: inherited.bindings.with(source, prim),
            ancestors,
            depth: inherited.depth + 1,
        };
        Visited { prim, world_from_prim, inherited }
    }
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
