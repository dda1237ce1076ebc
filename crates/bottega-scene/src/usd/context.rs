//! The scene under construction, and what a prim has from its ancestors.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::DAffine3;
use openusd::usd::Prim;

use super::binding::Bindings;
use super::material::Materials;
use super::source::StageSource;
use crate::model::Scene;

/// State that a prim inherits from its ancestors.
#[derive(Clone)]
pub(super) struct InheritedState {
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
pub(super) struct VisitedPrim<'p> {
    pub(super) prim: &'p Prim,
    pub(super) world_from_prim: DAffine3,
    /// State for its children.
    pub(super) inherited: InheritedState,
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
    pub(super) world_from_stage: DAffine3,
    /// Number of prims that were visited.
    pub(super) prims: usize,
}
