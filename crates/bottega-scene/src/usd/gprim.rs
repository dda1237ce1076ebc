//! Surfaces and their meshes.

use std::rc::Rc;

use glam::{DAffine3, Vec3};
use openusd::usd::Prim;

use super::context::{InheritedState, PrimMeshes, VisitedPrim, Walk};
use super::look::look_of;
use super::placement::{Thing, ThingPlacement};
use super::shape::{self, ShapeKind};
use super::{light, mesh};
use crate::error::SceneError;
use crate::material::{Material, Sides};
use crate::model::Mesh;

/// Adds a surface.
pub(super) fn add(
    walk: &mut Walk<'_, '_, '_>,
    visited: &VisitedPrim<'_>,
    kind: ShapeKind,
    placements: &mut Vec<ThingPlacement>,
) -> Result<(), SceneError> {
    let prim = visited.prim;
    let path: Rc<str> = prim.path().as_str().into();
    let glow = light::of_surface(walk, visited);
    let place =
        |thing: Thing, world_from_object: DAffine3| ThingPlacement { thing, world_from_object, path: path.clone() };
    if kind == ShapeKind::Sphere {
        let look = look_of(walk, visited, prim.path()).look;
        let radius = walk.source.number(prim, "radius", walk.time).unwrap_or(1.0);
        if !(radius > 0.0 && radius <= f64::from(f32::MAX)) {
            walk.source.warn(&path, format!("a sphere of the radius {radius} is left out"));
            return Ok(());
        }
        let material = match &glow {
            Some(glow) => glowing(walk, look.material, glow.radiance_of_sphere(radius, &visited.world_from_prim)),
            None => look.material,
        };
        placements.push(place(Thing::Sphere { radius, material }, visited.world_from_prim));
        return Ok(());
    }
    for &(mesh, mut material) in &*prim_meshes(walk, visited, kind)? {
        if let Some(glow) = &glow {
            let radiance = glow.radiance_of_mesh(&walk.scene.meshes[mesh as usize], &visited.world_from_prim);
            material = glowing(walk, material, radiance);
        }
        placements.push(place(Thing::Mesh { mesh, material }, visited.world_from_prim));
    }
    Ok(())
}

/// Returns a copy of a material that emits.
fn glowing(walk: &mut Walk<'_, '_, '_>, material: u32, radiance: Vec3) -> u32 {
    let base = walk.materials.get(material).clone();
    walk.materials.push(Material { emission: radiance.into(), emission_sides: Sides::Front, ..base })
}

/// Returns the meshes of a prim; those of an instance are the meshes of its prototype.
fn prim_meshes(
    walk: &mut Walk<'_, '_, '_>,
    visited: &VisitedPrim<'_>,
    kind: ShapeKind,
) -> Result<PrimMeshes, SceneError> {
    let source = walk.source;
    let prim = visited.prim;
    let shared = source.or_warn(prim.path().as_str(), prim.prim_in_prototype());
    let subsets = if kind == ShapeKind::Mesh { mesh::subsets(source, prim, walk.time) } else { Vec::new() };
    let mut looks = vec![look_of(walk, visited, prim.path())];
    for subset in &subsets {
        let inherited = visited.inherited.bindings.with(source, &subset.prim);
        let child = VisitedPrim {
            prim: visited.prim,
            world_from_prim: visited.world_from_prim,
            inherited: InheritedState { bindings: inherited, ..visited.inherited.clone() },
        };
        looks.push(look_of(walk, &child, subset.prim.path()));
    }
    let key = (
        shared.as_ref().unwrap_or(prim).path().as_str().to_owned(),
        looks.iter().map(|part| part.look.material).collect::<Vec<u32>>(),
    );
    if let Some(known) = walk.meshes.get(&key) {
        return Ok(known.clone());
    }
    let ancestors: &[Prim] = &visited.inherited.ancestors;
    let parts = match kind {
        ShapeKind::Mesh => mesh::read(source, prim, ancestors, walk.time, &subsets, &looks)?,
        other => shape::read(source, prim, other, walk.time).into_iter().map(|mesh| (0, mesh)).collect(),
    };
    let mut meshes = Vec::new();
    for (slot, mesh) in parts {
        source.take(prim.path().as_str(), mesh.memory_bytes())?;
        let material = looks[slot as usize].look.material;
        let name = prim.path().name().unwrap_or_default().to_owned();
        meshes.push((walk.scene.push_mesh(Mesh { name, material, ..mesh }), material));
    }
    let meshes: PrimMeshes = Rc::new(meshes);
    walk.meshes.insert(key, meshes.clone());
    Ok(meshes)
}
