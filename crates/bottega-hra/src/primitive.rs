//! Primitives, sets of primitives, and ids of data.

use std::fmt;

/// The self-contained, non-recursive, time-bounded computations of work units.
///
/// The allocator knows a primitive only by name: its cost on each resource is learned, and what it computes is the
/// renderer's business.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Primitive {
    /// Closest hits of a batch of rays. Low level.
    Intersect,
    /// Visibility tests of a batch of rays: true if a ray hits anything. Low level.
    Occluded,
    /// The nearest photons of each point of a batch. Low level.
    PhotonGather,
    /// Shading of a wave of paths at their rays' hits. High level.
    Shade,
    /// Samples of a block of pixels. High level.
    PixelBlock,
    /// Tracing of a batch of photons. High level.
    PhotonBatch,
    /// Irradiance at a batch of points, as sensors measure it. High level.
    SensorBatch,
}

impl Primitive {
    /// The number of primitives.
    pub const COUNT: usize = 7;

    /// All primitives, in the order of [`Primitive::index`].
    pub const ALL: [Self; Self::COUNT] = [
        Self::Intersect,
        Self::Occluded,
        Self::PhotonGather,
        Self::Shade,
        Self::PixelBlock,
        Self::PhotonBatch,
        Self::SensorBatch,
    ];

    /// Returns the index in [`Primitive::ALL`], for tables with an entry per primitive.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// Returns the name, such as `photon gather`: for messages, and as key in the JSON of a
    /// [`CostBook`](crate::CostBook).
    pub const fn name(self) -> &'static str {
        match self {
            Self::Intersect => "intersect",
            Self::Occluded => "occluded",
            Self::PhotonGather => "photon gather",
            Self::Shade => "shade",
            Self::PixelBlock => "pixel block",
            Self::PhotonBatch => "photon batch",
            Self::SensorBatch => "sensor batch",
        }
    }
}

impl fmt::Display for Primitive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A set of primitives: the capabilities of a resource.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PrimitiveSet(u8);

impl PrimitiveSet {
    /// The empty set.
    pub const NONE: Self = Self(0);
    /// The set of all primitives.
    pub const ALL: Self = Self((1 << Primitive::COUNT) - 1);

    /// Returns the set with `primitive` added.
    #[must_use]
    pub const fn with(self, primitive: Primitive) -> Self {
        Self(self.0 | 1 << primitive.index())
    }

    /// Returns true if `primitive` is in the set.
    pub const fn contains(self, primitive: Primitive) -> bool {
        self.0 & 1 << primitive.index() != 0
    }

    /// Returns true if the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Returns the members, in the order of [`Primitive::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Primitive> {
        Primitive::ALL.into_iter().filter(move |&primitive| self.contains(primitive))
    }
}

impl FromIterator<Primitive> for PrimitiveSet {
    fn from_iter<I: IntoIterator<Item = Primitive>>(primitives: I) -> Self {
        primitives.into_iter().fold(Self::NONE, Self::with)
    }
}

impl<const N: usize> From<[Primitive; N]> for PrimitiveSet {
    fn from(primitives: [Primitive; N]) -> Self {
        primitives.into_iter().collect()
    }
}

/// The id of read-only data (a scene, a photon map) that may be resident in a resource's memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct DataId(pub u64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_holds_what_was_put_in_and_nothing_else() {
        let set = PrimitiveSet::from([Primitive::Occluded, Primitive::PhotonBatch]);
        let members: Vec<_> = set.iter().collect();
        assert_eq!(members, [Primitive::Occluded, Primitive::PhotonBatch]);
        assert_eq!(PrimitiveSet::ALL.iter().count(), Primitive::COUNT);
        assert!(PrimitiveSet::NONE.is_empty() && !set.is_empty());
    }

    #[test]
    fn the_index_of_a_primitive_is_its_place_in_all() {
        for (index, primitive) in Primitive::ALL.into_iter().enumerate() {
            assert_eq!(primitive.index(), index);
        }
    }
}
