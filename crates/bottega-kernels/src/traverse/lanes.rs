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
    /// The same of a number in memory: where it is wanted in lanes only, nothing else should read it.
    fn splat_at(self, x: &f32) -> Self::F;
    /// Three numbers, each over all lanes.
    #[inline(always)]
    fn splat3(self, [x, y, z]: &[f32; 3]) -> [Self::F; 3] {
        [self.splat_at(x), self.splat_at(y), self.splat_at(z)]
    }
    fn load(self, x: &[f32; WIDTH]) -> Self::F;
    /// One of the rows of a node or block.
    fn load_row<const ROWS: usize>(self, rows: &[[f32; WIDTH]; ROWS], row: LaneRow<ROWS>) -> Self::F;
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
    /// The last four lanes, then the first four.
    fn swap_halves(self, a: Self::F) -> Self::F;
    /// a < b; false for NaN.
    fn lt(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// a ≤ b; false for NaN.
    fn le(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// The larger by the order of the bits as signed integers, which for numbers that are not negative is theirs; a
    /// negative one loses to any other. Four cycles faster than the comparison of floats.
    fn max_bits(self, a: Self::F, b: Self::F) -> Self::F;
    /// The smaller by the order of the bits as signed integers: one that is negative where an operand is.
    fn min_bits(self, a: Self::F, b: Self::F) -> Self::F;
    /// a > b by the order of the bits as signed integers.
    fn gt_bits(self, a: Self::F, b: Self::F) -> Self::Mask;
    /// The sign bit of `a`, all others 0.
    fn sign(self, a: Self::F) -> Self::F;
    /// `a` with its sign turned where `sign`, of [`Lanes::sign`], is set.
    fn turn(self, a: Self::F, sign: Self::F) -> Self::F;
    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Asks for memory that will be needed soon, so many cache lines of it; does nothing else.
    fn prefetch<const LINES: usize>(self, memory: *const u8);
    /// One bit a lane, lane 0 lowest.
    fn bits(self, a: Self::Mask) -> u32;
    /// Pushes those children for which `miss` is *not* set in the sequence of `order` (three bits a slot), but for the
    /// last, whose slot is returned. There must be at least one.
    fn push_ordered(
        self,
        stack: &mut Stack<'_>,
        children: &[Child; WIDTH],
        near: Self::F,
        miss: Self::Mask,
        order: u32,
    ) -> usize;
    /// Pushes the children in `slots` (a bit each, at most seven), without where they are entered: the lowest slot last where
    /// `highest_last` is 0, the highest where it is 1.
    fn push_slots(self, stack: &mut Stack<'_>, children: &[Child; WIDTH], slots: u32, highest_last: usize);
    /// Runs a job out of line, so that what it needs of registers and stack is no burden on the caller.
    fn apart<J: LaneJob>(self, job: J) -> J::Output;
}

/// The number of one of `ROWS` rows of eight floats: held as an offset in bytes, and never too large.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LaneRow<const ROWS: usize>(usize);

impl<const ROWS: usize> LaneRow<ROWS> {
    /// Row `index`, or the last where there are not so many.
    #[inline(always)]
    pub(crate) fn new(index: usize) -> Self {
        Self(index.min(ROWS - 1) * size_of::<[f32; WIDTH]>())
    }

    /// Bytes before the row; the row ends within `ROWS`.
    #[inline(always)]
    pub(crate) fn offset(self) -> usize {
        self.0
    }
}

/// Something to be run by [`Lanes::apart`]. No closure: only functions can be forced inline, and what is not inlined into the
/// traversal is compiled without the vector unit.
pub(crate) trait LaneJob {
    type Output;
    /// To be marked `inline(always)`.
    fn run(self) -> Self::Output;
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
