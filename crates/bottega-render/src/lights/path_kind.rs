//! Kinds of paths, by their number of bounces and by what found the light at their end.

/// Number of bounces from which paths count as one kind.
const BOUNCES_MAX: u32 = 7;
/// Number of [`LightFinder`]s.
const FINDERS: u32 = 3;
/// Number of kinds.
const KINDS: usize = (FINDERS * (BOUNCES_MAX + 1)) as usize;

/// The kind of ray or sample that found the light at the end of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LightFinder {
    /// A light sample with its shadow ray.
    Sample,
    /// A ray scattered by a rough surface or a medium, which hit the light.
    Scattering,
    /// A ray from the camera, or over a mirror or through clear glass, which hit the light. No light sample finds it.
    Mirror,
}

/// The kind of a path: its number of bounces, and the way in which it found its light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PathKind {
    /// Number of bounces of the light, 0 to 7; 7 also stands for more.
    pub bounces: u32,
    /// The kind of ray or sample that found the light.
    pub finder: LightFinder,
}

/// The end of a path, where a ray found light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PathEnd {
    /// Number of scattering events.
    pub(crate) depth: u32,
    /// `true`: the camera or a specular lobe chose the last direction.
    pub(crate) is_mirror: bool,
}

impl PathKind {
    /// All kinds, by bounces, then by finder.
    pub const ALL: [Self; KINDS] = {
        let mut all = [Self { bounces: 0, finder: LightFinder::Sample }; KINDS];
        let mut index = 0;
        while index < KINDS {
            let finder = [LightFinder::Sample, LightFinder::Scattering, LightFinder::Mirror][index % FINDERS as usize];
            all[index] = Self { bounces: index as u32 / FINDERS, finder };
            index += 1;
        }
        all
    };

    /// Returns `true` if the kind also stands for paths of more bounces.
    pub fn is_open(self) -> bool {
        self.bounces == BOUNCES_MAX
    }

    /// Returns the kind of light found by a light sample after some bounces.
    #[inline(always)]
    pub(crate) fn sampled(bounces: u32) -> Self {
        Self { bounces: bounces.min(BOUNCES_MAX), finder: LightFinder::Sample }
    }

    /// Returns the kind of light found by a ray.
    #[inline(always)]
    pub(crate) fn hit(end: PathEnd) -> Self {
        let finder = if end.is_mirror { LightFinder::Mirror } else { LightFinder::Scattering };
        Self { bounces: end.depth.min(BOUNCES_MAX), finder }
    }

    /// Returns the set of groups, one bit each, that contains this kind alone.
    #[inline(always)]
    pub(crate) fn bit(self) -> u32 {
        1 << (self.bounces * FINDERS + self.finder as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_kind_has_its_own_bit() {
        for (index, kind) in PathKind::ALL.into_iter().enumerate() {
            assert_eq!(kind.bit(), 1 << index, "{kind:?}");
        }
        assert_eq!(PathKind::sampled(99), PathKind { bounces: 7, finder: LightFinder::Sample });
        assert!(PathKind::hit(PathEnd { depth: 7, is_mirror: true }).is_open());
    }
}
