//! Meshes that instances share, and what their placements need: mirrored copies, and a centre near the origin.

use std::collections::BTreeMap;

use glam::{Affine3A, DVec3};

use crate::model::{MeshBounds, Scene};
use crate::origin::{centered, rounding};

/// The scale that undoes the mirroring of a mesh.
pub(crate) const MIRROR: DVec3 = DVec3::new(-1.0, 1.0, 1.0);

/// The meshes of a scene that were placed.
#[derive(Debug)]
pub(crate) struct PlacedMeshes {
    /// `true`: the scene is far from the origin, and meshes may also be far from theirs.
    is_far: bool,
    /// Mirrored copies of meshes.
    mirrored: BTreeMap<u32, u32>,
    /// Former centres of the meshes that were moved to their origin.
    centers: BTreeMap<u32, DVec3>,
    bounds: MeshBounds,
}

impl PlacedMeshes {
    /// Makes an empty collection.
    ///
    /// - `origin`: offset that is subtracted from all world positions.
    pub(crate) fn new(origin: DVec3) -> Self {
        Self {
            is_far: origin != DVec3::ZERO,
            mirrored: BTreeMap::new(),
            centers: BTreeMap::new(),
            bounds: MeshBounds::default(),
        }
    }

    /// Returns the former centre of a mesh, if it was far from the origin of its own space and was moved there.
    ///
    /// - `warn`: called with the warning about a mesh that is moved now.
    pub(crate) fn center(&mut self, scene: &mut Scene, mesh: u32, warn: impl FnOnce(String)) -> DVec3 {
        if !self.is_far {
            return DVec3::ZERO;
        }
        if let Some(&known) = self.centers.get(&mesh) {
            return known;
        }
        let center = centered(&mut scene.meshes[mesh as usize]);
        if let Some(center) = center {
            warn(rounding(center));
        }
        let center = center.unwrap_or(DVec3::ZERO);
        self.centers.insert(mesh, center);
        center
    }

    /// Returns the mirrored copy of a mesh, made once.
    ///
    /// - `take`: called before it is made, with its memory in bytes.
    pub(crate) fn mirrored<E>(
        &mut self,
        scene: &mut Scene,
        mesh: u32,
        take: impl FnOnce(usize) -> Result<(), E>,
    ) -> Result<u32, E> {
        if let Some(&known) = self.mirrored.get(&mesh) {
            return Ok(known);
        }
        let original = &scene.meshes[mesh as usize];
        take(original.memory_bytes())?;
        let mirrored = scene.push_mesh(original.clone().mirrored());
        self.mirrored.insert(mesh, mirrored);
        Ok(mirrored)
    }

    /// Returns true if a mesh can be placed with this transformation; see
    /// [`is_placeable`](crate::model::is_placeable).
    pub(crate) fn is_placeable(&mut self, scene: &Scene, mesh: u32, world_from_object: &Affine3A) -> bool {
        self.bounds.is_placeable(scene, mesh, world_from_object)
    }
}
