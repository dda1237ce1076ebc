//! The items of a tree: numbered boxes, eight lanes each.

use crate::Aabb;
use crate::traverse::lanes::Lanes;
use glam::Vec3;

/// A box as its minimum and its negated maximum: the smaller a lane, the larger the box. The fourth lane of each half
/// is free.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
pub(super) struct ItemSpan(pub(super) [f32; 8]);

impl ItemSpan {
    /// The empty box.
    pub(super) const EMPTY: Self = Self([f32::INFINITY; 8]);

    /// Returns the smallest box around both boxes.
    #[inline(always)]
    pub(super) fn union(&self, other: &Self) -> Self {
        Self(std::array::from_fn(|lane| self.0[lane].min(other.0[lane])))
    }

    /// Returns the minimum on an axis.
    pub(super) fn lower(&self, axis: usize) -> f32 {
        self.0[axis]
    }

    /// Returns the maximum on an axis.
    pub(super) fn upper(&self, axis: usize) -> f32 {
        -self.0[axis + 4]
    }

    /// Converts the span to a box.
    pub(super) fn bounds(&self) -> Aabb {
        let [a, b, c, _, d, e, f, _] = self.0;
        Aabb { min: Vec3::new(a, b, c), max: -Vec3::new(d, e, f) }
    }
}

/// Returns half the surface area of an [`ItemSpan`].
#[inline(always)]
pub(super) fn half_area<S: Lanes>(s: S, span: S::F) -> f32 {
    // The sides are negated, which cancels in the products of two.
    let [x, y, z, ..] = s.store(s.add(span, s.swap_halves(span)));
    x * y + y * z + z * x
}

/// A primitive during the build: its box, and its number in the bits of the free lane (see [`NUMBER`]).
#[derive(Clone, Copy, Debug)]
pub(super) struct Item(pub(super) ItemSpan);

/// XORed into the number in the fourth lane, which takes part in all computations: makes it a float between 1 and 2. A
/// small number by itself is a denormal float, and products with those are a hundred times slower.
const NUMBER: u32 = 1f32.to_bits();

impl Item {
    /// Makes an item of a box and its number.
    pub(super) fn new(bounds: &Aabb, id: u32) -> Self {
        let (low, high) = (bounds.min, -bounds.max);
        Self(ItemSpan([low.x, low.y, low.z, f32::from_bits(id ^ NUMBER), high.x, high.y, high.z, 0.0]))
    }

    /// Returns the number of the item.
    pub(super) fn id(&self) -> u32 {
        self.0.0[3].to_bits() ^ NUMBER
    }

    /// Returns the bounds of the item.
    pub(super) fn bounds(&self) -> Aabb {
        self.0.bounds()
    }

    /// Returns true if the item's box is empty.
    pub(super) fn is_empty(&self) -> bool {
        self.0.lower(0) > self.0.upper(0)
    }

    /// Returns true if the item's box is finite.
    pub(super) fn is_finite(&self) -> bool {
        let bounds = self.bounds();
        bounds.min.is_finite() && bounds.max.is_finite()
    }

    /// Returns twice the center of the box on an axis.
    #[inline(always)]
    pub(super) fn center(&self, axis: usize) -> f32 {
        self.0.0[axis] - self.0.0[axis + 4]
    }

    /// Returns twice the center of the box, as an [`ItemSpan`] without extent.
    #[inline(always)]
    pub(super) fn centers<S: Lanes>(&self, s: S) -> S::F {
        let span = s.load(&self.0.0);
        s.sub(span, s.swap_halves(span))
    }
}
