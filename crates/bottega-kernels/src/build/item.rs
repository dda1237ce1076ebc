//! The items of a tree: boxes with numbers, eight lanes each.

use crate::Aabb;
use crate::traverse::lanes::Lanes;
use glam::Vec3;

/// A box by its least coordinates and, turned over, its greatest: what is smaller is wider, in all lanes alike. The fourth of each half
/// is free.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct ItemSpan(pub(super) [f32; 8]);

impl ItemSpan {
    pub(super) const EMPTY: Self = Self([f32::INFINITY; 8]);

    /// Around both.
    #[inline(always)]
    pub(super) fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane].min(other.0[lane])))
    }

    pub(super) fn lower(&self, axis: usize) -> f32 {
        self.0[axis]
    }

    pub(super) fn upper(&self, axis: usize) -> f32 {
        -self.0[axis + 4]
    }

    pub(super) fn bounds(&self) -> Aabb {
        let [a, b, c, _, d, e, f, _] = self.0;
        Aabb { min: Vec3::new(a, b, c), max: -Vec3::new(d, e, f) }
    }
}

/// Half the surface of a [`ItemSpan`].
#[inline(always)]
pub(super) fn half_area<S: Lanes>(s: S, span: S::F) -> f32 {
    // Sides turned over, as factors of products of two.
    let [x, y, z, ..] = s.store(s.add(span, s.swap_halves(span)));
    x * y + y * z + z * x
}

/// A primitive while the tree is built: its box, and its number in the bits of the free lane (see [`NUMBER`]).
#[derive(Clone, Copy, Debug)]
pub(super) struct Item(pub(super) ItemSpan);

/// Turned over in a number that lies in the fourth lane, which takes part in all that is computed: makes it a float between 1 and 2.
/// By itself a small number would be a denormal float, and each product with one would take a hundred times as long.
const NUMBER: u32 = 1f32.to_bits();

impl Item {
    pub(super) fn new(bounds: &Aabb, id: u32) -> Self {
        let (low, high) = (bounds.min, -bounds.max);
        Self(ItemSpan([low.x, low.y, low.z, f32::from_bits(id ^ NUMBER), high.x, high.y, high.z, 0.0]))
    }

    pub(super) fn id(&self) -> u32 {
        self.0.0[3].to_bits() ^ NUMBER
    }

    pub(super) fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    /// Whether it is a box around nothing.
    pub(super) fn is_empty(&self) -> bool {
        self.0.lower(0) > self.0.upper(0)
    }

    pub(super) fn is_finite(&self) -> bool {
        let bounds = self.bounds();
        bounds.min.is_finite() && bounds.max.is_finite()
    }

    /// Twice its center on an axis.
    #[inline(always)]
    pub(super) fn center(&self, axis: usize) -> f32 {
        self.0.0[axis] - self.0.0[axis + 4]
    }

    /// Twice its center, as a [`ItemSpan`] of no extent.
    #[inline(always)]
    pub(super) fn centers<S: Lanes>(&self, s: S) -> S::F {
        let span = s.load(&self.0.0);
        s.sub(span, s.swap_halves(span))
    }
}
