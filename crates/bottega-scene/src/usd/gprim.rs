//! Surfaces: their kinds, looks and meshes.

use std::rc::Rc;

use glam::{DAffine3, Vec3};
use openusd::sdf::Path;
use openusd::usd::Prim;

use super::light;
use super::material::Look;
use super::placement::{Placement, Thing};
use super::primvar::{self, Interpolation};
use super::walk::{PrimMeshes, Visited, Walk};
use super::{mesh, shape};
use crate::error::SceneError;
use crate::material::{Material, Sides};
use crate::model::Mesh;

/// The kinds of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum GprimKind {
    Mesh,
    Sphere,
    Cube,
    Cylinder,
    Cone,
    Capsule,
    Plane,
}

impl GprimKind {
    /// Returns the kind of a type of prims; `None`: it is no surface.
    pub(super) fn of(type_name: &str) -> Option<Self> {
        Some(match type_name {
            "Mesh" => Self::Mesh,
            "Sphere" => Self::Sphere,
            "Cube" => Self::Cube,
            "Cylinder" | "Cylinder_1" => Self::Cylinder,
            "Cone" => Self::Cone,
            "Capsule" | "Capsule_1" => Self::Capsule,
            "Plane" => Self::Plane,
            _ => return None,
        })
    }
}

/// The look of a part of a surface, and the primvars that it takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PartLook {
    pub(super) look: Rc<Look>,
    /// Name of the primvar of vertex colours; `None`: there are none.
    pub(super) color: Option<String>,
    /// Name of the primvar of the colours' opacity.
    pub(super) opacity: Option<String>,
}

impl Walk<'_, '_, '_> {
    /// Returns the look of a prim: that of its material, or of its display colour.
    ///
    /// - `path`: the prim, or a subset of its faces.
    pub(super) fn look_of(&mut self, visited: &Visited<'_>, path: &Path) -> PartLook {
        let material = visited.inherited.bindings.material(path);
        if let Some(look) = material.and_then(|material| self.materials.bound(&material)) {
            let (color, opacity) = (look.color.clone(), look.opacity.clone());
            return PartLook { look, color, opacity };
        }
        // Without values of its own a surface has the fallback of the schema's display colour
        const USUAL: Vec3 = Vec3::splat(0.5);
        let (source, prim, ancestors) = (self.source, visited.prim, &visited.inherited.ancestors);
        let color = primvar::vectors(source, prim, ancestors, "displayColor", self.time);
        let opacity = primvar::numbers(source, prim, ancestors, "displayOpacity", self.time);
        let constant_color = match &color {
            Some(color) if color.interpolation == Interpolation::Constant => color.at(0).unwrap_or(USUAL),
            Some(_) => Vec3::ONE,
            None => USUAL,
        };
        let constant_opacity = match &opacity {
            Some(opacity) if opacity.interpolation == Interpolation::Constant => opacity.at(0).unwrap_or(1.0),
            _ => 1.0,
        };
        let varies =
            |interpolation: Option<Interpolation>| interpolation.is_some_and(|it| it != Interpolation::Constant);
        let (has_colors, has_opacities) =
            (varies(color.map(|it| it.interpolation)), varies(opacity.map(|it| it.interpolation)));
        // Opacities of points need a surface that is not opaque
        let alpha = if has_opacities { constant_opacity.min(1.0 - f32::EPSILON) } else { constant_opacity };
        let look = self.materials.plain(constant_color.extend(alpha).to_array());
        let named = |is_there: bool, name: &str| is_there.then(|| name.to_owned());
        PartLook { look, color: named(has_colors, "displayColor"), opacity: named(has_opacities, "displayOpacity") }
    }

    /// Adds a surface.
    pub(super) fn add_gprim(
        &mut self,
        visited: &Visited<'_>,
        kind: GprimKind,
        placements: &mut Vec<Placement>,
    ) -> Result<(), SceneError> {
        let prim = visited.prim;
        let path: Rc<str> = prim.path().as_str().into();
        let glow = light::of_surface(self, visited);
        let place =
            |thing: Thing, world_from_object: DAffine3| Placement { thing, world_from_object, path: path.clone() };
        if kind == GprimKind::Sphere {
            let look = self.look_of(visited, prim.path()).look;
            let radius = self.source.number(prim, "radius", self.time).unwrap_or(1.0);
            if !(radius > 0.0 && radius <= f64::from(f32::MAX)) {
                self.source.warn(&path, format!("a sphere of the radius {radius} is left out"));
                return Ok(());
            }
            let material = match &glow {
                Some(glow) => self.glowing(look.material, glow.radiance_of_sphere(radius, &visited.world_from_prim)),
                None => look.material,
            };
            placements.push(place(Thing::Sphere { radius, material }, visited.world_from_prim));
            return Ok(());
        }
        for &(mesh, mut material) in &*self.prim_meshes(visited, kind)? {
            if let Some(glow) = &glow {
                let radiance = glow.radiance_of_mesh(&self.scene.meshes[mesh as usize], &visited.world_from_prim);
                material = self.glowing(material, radiance);
            }
            placements.push(place(Thing::Mesh { mesh, material }, visited.world_from_prim));
        }
        Ok(())
    }

    /// Returns a copy of a material that emits.
    fn glowing(&mut self, material: u32, radiance: Vec3) -> u32 {
        let base = self.materials.get(material).clone();
        self.materials.push(Material { emission: radiance.into(), emission_sides: Sides::Front, ..base })
    }

    /// Returns the meshes of a prim; those of an instance are the meshes of its prototype.
    fn prim_meshes(&mut self, visited: &Visited<'_>, kind: GprimKind) -> Result<PrimMeshes, SceneError> {
        let source = self.source;
        let prim = visited.prim;
        let shared = source.or_warn(prim.path().as_str(), prim.prim_in_prototype());
        let subsets = if kind == GprimKind::Mesh { mesh::subsets(source, prim, self.time) } else { Vec::new() };
        let mut looks = vec![self.look_of(visited, prim.path())];
        for subset in &subsets {
            let inherited = visited.inherited.bindings.with(source, &subset.prim);
            let child = Visited {
                prim: visited.prim,
                world_from_prim: visited.world_from_prim,
                inherited: super::walk::Inherited { bindings: inherited, ..visited.inherited.clone() },
            };
            looks.push(self.look_of(&child, subset.prim.path()));
        }
        let key = (
            shared.as_ref().unwrap_or(prim).path().as_str().to_owned(),
            looks.iter().map(|part| part.look.material).collect::<Vec<u32>>(),
        );
        if let Some(known) = self.meshes.get(&key) {
            return Ok(known.clone());
        }
        let ancestors: &[Prim] = &visited.inherited.ancestors;
        let parts = match kind {
            GprimKind::Mesh => mesh::read(source, prim, ancestors, self.time, &subsets, &looks)?,
            other => shape::read(source, prim, other, self.time).into_iter().map(|mesh| (0, mesh)).collect(),
        };
        let mut meshes = Vec::new();
        for (slot, mesh) in parts {
            source.take(prim.path().as_str(), mesh.memory_bytes())?;
            let material = looks[slot as usize].look.material;
            let name = prim.path().name().unwrap_or_default().to_owned();
            meshes.push((self.scene.push_mesh(Mesh { name, material, ..mesh }), material));
        }
        let meshes: PrimMeshes = Rc::new(meshes);
        self.meshes.insert(key, meshes.clone());
        Ok(meshes)
    }
}
