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
    fn or(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Asks for memory that will be needed soon; does nothing else.
    fn prefetch(self, memory: *const u8);
    /// One bit a lane, lane 0 lowest.
    fn bits(self, a: Self::Mask) -> u32;
    /// Pushes those children whose bit is set in `mask` in the sequence of `order` (three bits a slot), but for the last,
    /// whose slot is returned. At least one bit must be set.
    fn push_ordered(
        self,
        stack: &mut Stack<'_>,
        children: &[Child; WIDTH],
        near: Self::F,
        mask: Self::Mask,
        order: u32,
    ) -> usize;
    /// Runs a job out of line, so that what it needs of registers and stack is no burden on the caller.
    fn apart<J: Job>(self, job: J) -> J::Output;
}

/// Something to be run by [`Lanes::apart`]; see [`splat3`] on why it is no closure.
pub(crate) trait Job {
    type Output;
    /// To be marked `inline(always)`.
    fn run(self) -> Self::Output;
}

/// Three numbers, each over all lanes. (A function and no closure in `map`: only functions can be forced inline, and what is
/// not inlined into the traversal is compiled without the vector unit.)
#[inline(always)]
pub(crate) fn splat3<S: Lanes>(s: S, [x, y, z]: [f32; 3]) -> [S::F; 3] {
    [s.splat(x), s.splat(y), s.splat(z)]
}

/// a × b
#[inline(always)]
pub(crate) fn cross<S: Lanes>(s: S, a: &[S::F; 3], b: &[S::F; 3]) -> [S::F; 3] {
    [
        s.mul_sub(a[1], b[2], s.mul(a[2], b[1])),
        s.mul_sub(a[2], b[0], s.mul(a[0], b[2])),
        s.mul_sub(a[0], b[1], s.mul(a[1], b[0])),
    ]
}

/// a · b
#[inline(always)]
pub(crate) fn dot<S: Lanes>(s: S, a: &[S::F; 3], b: &[S::F; 3]) -> S::F {
    s.mul_add(a[0], b[0], s.mul_add(a[1], b[1], s.mul(a[2], b[2])))
}
