//! The portable vector unit: arrays. It is the reference for the others.

use super::lanes::{LaneJob, LaneRow, Lanes};
use super::stack::Stack;
use crate::tree::{Child, WIDTH};

/// Arrays of eight floats; `f32::mul_add` keeps the one rounding of the hardware's fused operation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable;

type F = [f32; WIDTH];

#[inline(always)]
fn zip(a: F, b: F, f: impl Fn(f32, f32) -> f32) -> F {
    std::array::from_fn(|i| f(a[i], b[i]))
}

#[inline(always)]
fn compare(a: F, b: F, f: impl Fn(f32, f32) -> bool) -> u32 {
    (0..WIDTH).fold(0, |bits, i| bits | u32::from(f(a[i], b[i])) << i)
}

const SIGN: u32 = 1 << 31;

#[inline(always)]
fn integer(a: f32) -> i32 {
    a.to_bits() as i32
}

impl Lanes for Portable {
    type F = F;
    type Mask = u32;

    #[inline(always)]
    fn splat(self, x: f32) -> F {
        [x; WIDTH]
    }
    #[inline(always)]
    fn splat_at(self, x: &f32) -> F {
        [*x; WIDTH]
    }
    #[inline(always)]
    fn load(self, x: &F) -> F {
        *x
    }
    #[inline(always)]
    fn load_row<const ROWS: usize>(self, rows: &[F; ROWS], row: LaneRow<ROWS>) -> F {
        rows[row.offset() / size_of::<F>()]
    }
    #[inline(always)]
    fn store(self, x: F) -> F {
        x
    }
    #[inline(always)]
    fn add(self, a: F, b: F) -> F {
        zip(a, b, |a, b| a + b)
    }
    #[inline(always)]
    fn sub(self, a: F, b: F) -> F {
        zip(a, b, |a, b| a - b)
    }
    #[inline(always)]
    fn mul(self, a: F, b: F) -> F {
        zip(a, b, |a, b| a * b)
    }
    #[inline(always)]
    fn div(self, a: F, b: F) -> F {
        zip(a, b, |a, b| a / b)
    }
    #[inline(always)]
    fn mul_add(self, a: F, b: F, c: F) -> F {
        std::array::from_fn(|i| a[i].mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn mul_sub(self, a: F, b: F, c: F) -> F {
        std::array::from_fn(|i| a[i].mul_add(b[i], -c[i]))
    }
    #[inline(always)]
    fn neg_mul_add(self, a: F, b: F, c: F) -> F {
        std::array::from_fn(|i| (-a[i]).mul_add(b[i], c[i]))
    }
    #[inline(always)]
    fn min(self, a: F, b: F) -> F {
        zip(a, b, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn swap_halves(self, a: F) -> F {
        std::array::from_fn(|i| a[i ^ 4])
    }
    #[inline(always)]
    fn lt(self, a: F, b: F) -> u32 {
        compare(a, b, |a, b| a < b)
    }
    #[inline(always)]
    fn le(self, a: F, b: F) -> u32 {
        compare(a, b, |a, b| a <= b)
    }
    #[inline(always)]
    fn and(self, a: u32, b: u32) -> u32 {
        a & b
    }
    #[inline(always)]
    fn max_bits(self, a: F, b: F) -> F {
        zip(a, b, |a, b| if integer(a) > integer(b) { a } else { b })
    }
    #[inline(always)]
    fn min_bits(self, a: F, b: F) -> F {
        zip(a, b, |a, b| if integer(a) < integer(b) { a } else { b })
    }
    #[inline(always)]
    fn gt_bits(self, a: F, b: F) -> u32 {
        compare(a, b, |a, b| integer(a) > integer(b))
    }
    #[inline(always)]
    fn sign(self, a: F) -> F {
        a.map(|a| f32::from_bits(a.to_bits() & SIGN))
    }
    #[inline(always)]
    fn turn(self, a: F, sign: F) -> F {
        zip(a, sign, |a, sign| f32::from_bits(a.to_bits() ^ sign.to_bits()))
    }
    #[inline(always)]
    fn prefetch<const LINES: usize>(self, _: *const u8) {}
    #[inline(always)]
    fn bits(self, a: u32) -> u32 {
        a
    }
    #[inline(always)]
    fn push_ordered(self, stack: &mut Stack<'_>, children: &[Child; WIDTH], near: F, miss: u32, order: u32) -> usize {
        let mut slots = (0..WIDTH).rev().map(|i| (order >> (3 * i) & 7) as usize).filter(|slot| miss >> slot & 1 == 0);
        let nearest = slots.next().unwrap_or_default();
        for slot in slots.rev() {
            stack.push(children[slot], near[slot]);
        }
        nearest
    }
    #[inline(always)]
    fn push_slots(self, stack: &mut Stack<'_>, children: &[Child; WIDTH], slots: u32, highest_last: usize) {
        for slot in (0..WIDTH).map(|i| if highest_last == 1 { i } else { WIDTH - 1 - i }) {
            if slots >> slot & 1 == 1 {
                stack.push(children[slot], 0.0);
            }
        }
    }
    #[inline(always)]
    fn apart<J: LaneJob>(self, job: J) -> J::Output {
        job.run()
    }
}
