//! The triangles of a build in world space.

use crate::geometry::{BuildError, InstanceGeometry, MeshGeometry};
use crate::instance::Affine;
use glam::Affine3A;
use rayon::prelude::*;

use super::item::Item;

/// All triangles of some instances in world space, numbered from 0.
pub(super) struct BuildWorld<'a> {
    pub(super) meshes: &'a [MeshGeometry<'a>],
    pub(super) instances: &'a [InstanceGeometry],
    /// Number of the first triangle and instance, ascending in both.
    pub(super) starts: Vec<(u32, u32)>,
    /// World-from-object map of each entry of `starts`; `None` for the identity.
    pub(super) maps: Vec<Option<Affine>>,
    /// Number of triangles.
    pub(super) count: u32,
}

impl<'a> BuildWorld<'a> {
    /// Collects the triangles of the chosen instances. The error says that there are too many.
    pub(super) fn new(
        meshes: &'a [MeshGeometry<'a>],
        instances: &'a [InstanceGeometry],
        chosen: impl Iterator<Item = usize>,
    ) -> Result<Self, BuildError> {
        let (mut starts, mut count, limit) = (Vec::new(), 0usize, u32::MAX as usize - 1);
        for i in chosen {
            let triangles = meshes[instances[i].mesh as usize].triangles.len();
            if triangles != 0 {
                starts.push((count as u32, i as u32));
            }
            count = count.saturating_add(triangles);
            if count > limit {
                return Err(BuildError::TooMany { what: "triangles", count, limit });
            }
        }
        let map = |&(_, instance): &(u32, u32)| {
            let map = instances[instance as usize].world_from_object;
            (map != Affine3A::IDENTITY).then(|| Affine::new(&map))
        };
        let maps = starts.iter().map(map).collect();
        Ok(Self { meshes, instances, starts, maps, count: count as u32 })
    }

    /// Returns the index in `starts` that a triangle belongs to.
    pub(super) fn find(&self, id: u32) -> usize {
        self.starts.partition_point(|f| f.0 <= id) - 1
    }

    /// Returns the corners of a triangle in world space.
    pub(super) fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        let start = self.find(id);
        let (first, instance) = self.starts[start];
        let mesh = &self.meshes[self.instances[instance as usize].mesh as usize];
        let [a, b, c] = mesh.triangles[(id - first) as usize].map(|i| mesh.positions[i as usize].to_array());
        match &self.maps[start] {
            Some(map) => [map.point(a), map.point(b), map.point(c)],
            None => [a, b, c],
        }
    }

    /// Checks that no transform moved a triangle out of the range of floats.
    pub(super) fn check(&self, items: &[Item], parallel: bool) -> Result<(), BuildError> {
        let bad = |item: &&Item| !item.is_finite();
        let bad = if parallel { items.par_iter().find_first(bad) } else { items.iter().find(bad) };
        match bad {
            Some(bad) => Err(BuildError::TransformNotFinite { instance: self.starts[self.find(bad.id())].1 as usize }),
            None => Ok(()),
        }
    }
}
