//! The interface of a vector unit: eight numbers at once.

use super::stack::Stack;
use crate::tree::{Child, WIDTH};

/// A vector unit of eight `f32` lanes. All implementations are bit-identical: `mul_add` is fused (one rounding), and
/// `min`/`max` return the *second* operand if the comparison is false or unordered, so NaN in the first is dropped.
///
/// A value of the type proves that the processor has the unit.
pub(crate) trait Lanes: Copy {
    type F: Copy;
    type Mask: Copy;
    fn splat(self, x: f32) -> Self::F;
    /// Broadcasts a number in memory, preferably one that is not read as a scalar.
    fn splat_at(self, x: &f32) -> Self::F;
    /// Broadcasts three numbers.
    #[inline(always)]
    fn splat3(self, [x, y, z]: &[f32; 3]) -> [Self::F; 3] {
        [self.splat_at(x), self.splat_at(y), self.splat_at(z)]
    }
    fn load(self, x: &[f32; WIDTH]) -> Self::F;
    /// Loads a row of a node or block.
    fn load_row<const ROWS: usize>(self, rows: &[[f32; WIDTH]; ROWS], row: LaneRow<ROWS>) -> Self::F;
    fn store(self, x: Self::F) -> [f32; WIDTH];
    fn add(self, a: Self::F, b: Self::F) -> Self::F;
    fn sub(self, a: Self::F, b: Self::F) -> Self::F;
    fn mul(self, a: Self::F, b: Self::F) -> Self::F;
    fn div(self, a: Self::F, b: Self::F) -> Self::F;
    /// Computes a · b + c with one rounding.
    fn mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// Computes a · b − c with one rounding.
    fn mul_sub(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// Computes c − a · b with one rounding.
    fn neg_mul_add(self, a: Self::F, b: Self::F, c: Self::F) -> Self::F;
    /// Returns a where a < b, else b.
    fn min(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns the last four lanes, then the first four.
    fn swap_halves(self, a: Self::F) -> Self::F;
    /// Compares a < b; false for NaN.
    fn lt(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// Compares a ≤ b; false for NaN.
    fn le(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// Returns the larger by the bits as signed integers: the larger float if neither is negative; a negative one loses
    /// to a non-negative. Four cycles faster than comparing floats.
    fn max_bits(self, a: Self::F, b: Self::F) -> Self::F;
    /// Returns the smaller by the bits as signed integers: a negative one if there is one.
    fn min_bits(self, a: Self::F, b: Self::F) -> Self::F;
    /// Compares a > b by the bits as signed integers.
    fn gt_bits(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// Returns the sign bit of `a`, all others 0.
    fn sign(self, a: Self::F) -> Self::F;
    /// Flips the sign of `a` where `sign`, from [`Lanes::sign`], is set.
    fn turn(self, a: Self::F, sign: Self::F) -> Self::F;
    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Prefetches `LINES` cache lines.
    fn prefetch<const LINES: usize>(self, memory: *const u8);
    /// Returns a mask as one bit per lane, lane 0 lowest.
    fn bits(self, a: Self::Mask) -> u32;
    /// Pushes the children for which `miss` is *not* set, in the sequence of `order` (three bits per slot), except the
    /// last, whose slot is returned. There must be at least one.
    fn push_ordered(
        self,
        stack: &mut Stack<'_>,
        children: &[Child; WIDTH],
        near: Self::F,
        miss: Self::Mask,
        order: u32,
    ) -> usize;
    /// Pushes the children in `slots` (one bit each, at most seven), without their entries: the lowest slot last if
    /// `highest_last` is 0, the highest if it is 1.
    fn push_slots(self, stack: &mut Stack<'_>, children: &[Child; WIDTH], slots: u32, highest_last: usize);
    /// Runs a job out of line, so that its registers and stack do not burden the caller.
    fn apart<J: LaneJob>(self, job: J) -> J::Output;
}

/// The index of one of `ROWS` rows of eight floats: stored as a byte offset, always in range.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneRow<const ROWS: usize>(usize);

impl<const ROWS: usize> LaneRow<ROWS> {
    /// Returns row `index`, or the last if there are fewer.
    #[inline(always)]
    pub(crate) fn new(index: usize) -> Self {
        Self(index.min(ROWS - 1) * size_of::<[f32; WIDTH]>())
    }

    /// Returns the byte offset of the row, which ends within `ROWS`.
    #[inline(always)]
    pub(crate) fn offset(self) -> usize {
        self.0
    }
}

/// A job for [`Lanes::apart`]. Not a closure: only functions can be forced inline, and a function that is not inlined
/// into the traversal is compiled without the vector unit.
pub(crate) trait LaneJob {
    type Output;
    /// Runs the job; implementations are `inline(always)`.
    fn run(self) -> Self::Output;
}

/// Returns the cross product a × b.
#[inline(always)]
pub(crate) fn cross<S: Lanes>(s: S, a: &[S::F; 3], b: &[S::F; 3]) -> [S::F; 3] {
    [
        s.mul_sub(a[1], b[2], s.mul(a[2], b[1])),
        s.mul_sub(a[2], b[0], s.mul(a[0], b[2])),
        s.mul_sub(a[0], b[1], s.mul(a[1], b[0])),
    ]
}

/// Returns the dot product a · b.
#[inline(always)]
pub(crate) fn dot<S: Lanes>(s: S, a: &[S::F; 3], b: &[S::F; 3]) -> S::F {
    s.mul_add(a[0], b[0], s.mul_add(a[1], b[1], s.mul(a[2], b[2])))
}
