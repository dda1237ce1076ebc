//! Eight numbers at once: what the traversal needs of a vector unit.

use super::stack::Stack;
use crate::tree::{Child, WIDTH};

/// A vector unit of eight `f32` lanes. Every implementation gives the same bits: `mul_add` is fused (one rounding), and
/// `min`/`max` return the *second* operand when the comparison is false or unordered, so NaN in the first is dropped.
///
/// A value of the type is the proof that the processor has the unit.
pub(crate) trait Lanes: Copy {
    type F: Copy;
    type Mask: Copy;
    fn splat(self, x: f32) -> Self::F;
    fn load(self, x: &[f32; WIDTH]) -> Self::F;
    fn store(self, x: Self::F) -> [f32; WIDTH];
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// a · b + c
    fn mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// a · b − c
    fn mul_sub(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// c − a · b
    fn neg_mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// a where a < b, else b.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// a where a > b, else b.
    fn max(self, a: Self::F, b: Self::F) -> Self::F;
    /// a < b; false for NaN.
    fn lt(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// a ≤ b; false for NaN.
    fn le(self, a: Self::F, b: Self::F) -> Self::Mask;
    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// b and not a.
    fn and_not(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// One bit a lane, lane 0 lowest.
    fn bits(self, a: Self::Mask) -> u32;
    /// Pushes those children whose bit is set in `mask`, in the sequence of `order` (three bits a slot).
    fn push_ordered(
        self,
        stack: &mut Stack<'_>,
        children: &[Child; WIDTH],
        near: Self::F,
        mask: Self::Mask,
        order: u32,
    );
}
