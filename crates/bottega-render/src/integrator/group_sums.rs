//! The light of a path by groups: of lights, or of kinds of paths.

use std::slice::ChunksExactMut;

use bottega_scene::Spectrum;

use crate::lights::LightGroups;

/// The light of one path, by group.
pub(super) struct GroupSums<'a> {
    groups: &'a LightGroups,
    /// One sum per group.
    sums: &'a mut [Spectrum],
}

impl<'a> GroupSums<'a> {
    /// Returns the groups that light belongs to.
    #[inline(always)]
    pub(super) fn groups(&self) -> &'a LightGroups {
        self.groups
    }

    /// Adds light to all groups of a set.
    #[inline(always)]
    pub(super) fn add(&mut self, groups: u32, light: Spectrum) {
        for (group, sum) in self.sums.iter_mut().enumerate() {
            if groups & 1 << group != 0 {
                *sum += light;
            }
        }
    }

    /// Multiplies the light of a path that has ended; 0: the path is dropped.
    pub(super) fn scale(&mut self, factor: f32) {
        for sum in &mut *self.sums {
            *sum = if factor == 0.0 { Spectrum::ZERO } else { *sum * factor };
        }
    }
}

/// A place for the light of many paths, by group.
pub(crate) struct GroupBuffer<'a> {
    /// The groups of light.
    pub(crate) groups: &'a LightGroups,
    /// Receives the sums: those of each path's groups, path by path.
    pub(crate) sums: &'a mut Vec<Spectrum>,
}

impl<'a> GroupBuffer<'a> {
    /// Returns places for `count` paths, all zero.
    pub(super) fn of_paths(self, count: usize) -> GroupSumsOfPaths<'a> {
        let Self { groups, sums } = self;
        sums.clear();
        sums.resize(count * groups.count(), Spectrum::ZERO);
        GroupSumsOfPaths { groups, sums: sums.chunks_exact_mut(groups.count().max(1)) }
    }
}

/// The sums of paths that have not started.
pub(super) struct GroupSumsOfPaths<'a> {
    groups: &'a LightGroups,
    sums: ChunksExactMut<'a, Spectrum>,
}

impl<'a> Iterator for GroupSumsOfPaths<'a> {
    type Item = GroupSums<'a>;

    #[inline(always)]
    fn next(&mut self) -> Option<GroupSums<'a>> {
        self.sums.next().map(|sums| GroupSums { groups: self.groups, sums })
    }
}
