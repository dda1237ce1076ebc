//! AVX2: the vector unit of x86-64 processors since 2013, with FMA and bit manipulation instructions.
#![allow(unsafe_code)]

use super::Query;
use super::lanes::{LaneJob, LaneRow, Lanes};
use super::stack::Stack;
use crate::tree::{Child, SceneTrees, WIDTH};
use crate::{Hit, Ray};
use std::arch::x86_64::*;

/// Proof that the processor has AVX2, FMA, BMI1 and 2, LZCNT and POPCNT; only [`Avx2::detect`] makes one.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// Detects the features of the processor.
    pub(crate) fn detect() -> Option<Self> {
        let vector = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
        let bits = is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2");
        let counts = is_x86_feature_detected!("lzcnt") && is_x86_feature_detected!("popcnt");
        (vector && bits && counts).then_some(Self(()))
    }
}

/// Runs [`super::run`], compiled for this unit.
#[inline(always)]
pub(crate) fn run<Q: Query, const ROBUST: bool>(
    unit: Avx2,
    tree: &SceneTrees,
    ray: &Ray,
    time: f32,
    query: &mut Q,
) -> Hit {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn compiled<Q: Query, const ROBUST: bool>(
        unit: Avx2,
        tree: &SceneTrees,
        ray: &Ray,
        time: f32,
        query: &mut Q,
    ) -> Hit {
        super::run::<_, Q, ROBUST>(unit, tree, ray, time, query)
    }
    // SAFETY: `unit` proves that the processor has these features.
    unsafe { compiled::<Q, ROBUST>(unit, tree, ray, time, query) }
}

/// The positions of the set bits of each eight-bit mask: lowest first, and highest first.
static COMPRESS: [[[u8; WIDTH]; 256]; 2] = {
    let mut table = [[[0; WIDTH]; 256]; 2];
    let mut mask = 0;
    while mask < 256 {
        let (mut bit, mut count) = (0, 0);
        let all = (mask as u32).count_ones() as usize;
        while bit < WIDTH {
            if mask >> bit & 1 == 1 {
                table[0][mask][count] = bit as u8;
                table[1][mask][all - 1 - count] = bit as u8;
                count += 1;
            }
            bit += 1;
        }
        mask += 1;
    }
    table
};

// SAFETY (of every block below without a comment of its own): `self` proves that the processor has the instructions;
// they touch registers only.
impl Lanes for Avx2 {
    type F = __m256;
    type Mask = __m256;

    #[inline(always)]
    fn splat(self, x: f32) -> __m256 {
        unsafe { _mm256_set1_ps(x) }
    }
    #[inline(always)]
    fn splat_at(self, x: &f32) -> __m256 {
        // SAFETY: reads the four bytes of `x`.
        unsafe { _mm256_broadcast_ss(x) }
    }
    #[inline(always)]
    fn load(self, x: &[f32; WIDTH]) -> __m256 {
        // SAFETY: reads the 32 bytes of `x`; unaligned loads are allowed.
        unsafe { _mm256_loadu_ps(x.as_ptr()) }
    }
    #[inline(always)]
    fn load_row<const ROWS: usize>(self, rows: &[[f32; WIDTH]; ROWS], row: LaneRow<ROWS>) -> __m256 {
        // SAFETY: reads 32 bytes within `rows`, as every `LaneRow<ROWS>` guarantees.
        unsafe { _mm256_loadu_ps(rows.as_ptr().cast::<u8>().add(row.offset()).cast()) }
    }
    #[inline(always)]
    fn store(self, x: __m256) -> [f32; WIDTH] {
        let mut out = [0.0; WIDTH];
        // SAFETY: writes the 32 bytes of `out`; unaligned stores are allowed.
        unsafe { _mm256_storeu_ps(out.as_mut_ptr(), x) };
        out
    }
    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_add_ps(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_sub_ps(a, b) }
    }
    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_mul_ps(a, b) }
    }
    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_div_ps(a, b) }
    }
    #[inline(always)]
    fn mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        unsafe { _mm256_fmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn mul_sub(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        unsafe { _mm256_fmsub_ps(a, b, c) }
    }
    #[inline(always)]
    fn neg_mul_add(self, a: __m256, b: __m256, c: __m256) -> __m256 {
        unsafe { _mm256_fnmadd_ps(a, b, c) }
    }
    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_min_ps(a, b) }
    }
    #[inline(always)]
    fn swap_halves(self, a: __m256) -> __m256 {
        unsafe { _mm256_permute2f128_ps::<1>(a, a) }
    }
    #[inline(always)]
    fn lt(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(a, b) }
    }
    #[inline(always)]
    fn le(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(a, b) }
    }
    #[inline(always)]
    fn and(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_and_ps(a, b) }
    }
    #[inline(always)]
    fn max_bits(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_castsi256_ps(_mm256_max_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b))) }
    }
    #[inline(always)]
    fn min_bits(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_castsi256_ps(_mm256_min_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b))) }
    }
    #[inline(always)]
    fn gt_bits(self, a: __m256, b: __m256) -> __m256 {
        unsafe { _mm256_castsi256_ps(_mm256_cmpgt_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b))) }
    }
    #[inline(always)]
    fn sign(self, a: __m256) -> __m256 {
        unsafe { _mm256_and_ps(a, _mm256_set1_ps(-0.0)) }
    }
    #[inline(always)]
    fn turn(self, a: __m256, sign: __m256) -> __m256 {
        unsafe { _mm256_xor_ps(a, sign) }
    }
    #[inline(always)]
    fn prefetch<const LINES: usize>(self, memory: *const u8) {
        // SAFETY: prefetching reads nothing; any address is allowed.
        unsafe {
            for line in 0..LINES {
                _mm_prefetch::<_MM_HINT_T0>(memory.wrapping_add(64 * line).cast());
            }
        }
    }
    #[inline(always)]
    fn bits(self, a: __m256) -> u32 {
        unsafe { _mm256_movemask_ps(a) as u32 }
    }
    #[inline(always)]
    fn push_ordered(
        self,
        stack: &mut Stack<'_>,
        children: &[Child; WIDTH],
        near: __m256,
        miss: __m256,
        order: u32,
    ) -> usize {
        let (near_out, child_out) = stack.room();
        // SAFETY: `Child` is a transparent `u32`, so `children` is 32 readable bytes, and both outputs are 32 writable
        // bytes; a table row is the 8 bytes that `_mm_loadl_epi64` reads. `permutevar8x32` uses three bits of each
        // lane. All eight entries are written, at least the `count` that `grow` requires.
        unsafe {
            let shifts = _mm256_setr_epi32(0, 3, 6, 9, 12, 15, 18, 21);
            let slots = _mm256_srlv_epi32(_mm256_set1_epi32(order as i32), shifts);
            let hit = _mm256_movemask_ps(_mm256_permutevar8x32_ps(miss, slots)) as usize ^ 0xff;
            let row = _mm_loadl_epi64(COMPRESS[0][hit & 255].as_ptr().cast());
            let slots = _mm256_permutevar8x32_epi32(slots, _mm256_cvtepu8_epi32(row));
            let child = _mm256_permutevar8x32_epi32(_mm256_loadu_si256(children.as_ptr().cast()), slots);
            _mm256_storeu_ps(near_out.as_mut_ptr().cast(), _mm256_permutevar8x32_ps(near, slots));
            _mm256_storeu_si256(child_out.as_mut_ptr().cast(), child);
            stack.grow((hit.count_ones() as usize).wrapping_sub(1) & 7);
            // Compute the last slot without going through memory: its node is the critical path.
            (order >> (3 * (hit as u32 | 1).ilog2()) & 7) as usize
        }
    }
    #[inline(always)]
    fn push_slots(self, stack: &mut Stack<'_>, children: &[Child; WIDTH], slots: u32, highest_last: usize) {
        let (near_out, child_out) = stack.room();
        // SAFETY: as in `push_ordered`. Entries are unused, but must be initialized.
        unsafe {
            let row = _mm_loadl_epi64(COMPRESS[(highest_last ^ 1) & 1][slots as usize & 255].as_ptr().cast());
            let child = _mm256_loadu_si256(children.as_ptr().cast());
            let child = _mm256_permutevar8x32_epi32(child, _mm256_cvtepu8_epi32(row));
            _mm256_storeu_ps(near_out.as_mut_ptr().cast(), _mm256_setzero_ps());
            _mm256_storeu_si256(child_out.as_mut_ptr().cast(), child);
            stack.grow(slots.count_ones() as usize & 7);
        }
    }
    #[inline(always)]
    fn apart<J: LaneJob>(self, job: J) -> J::Output {
        #[inline(never)]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn compiled<J: LaneJob>(job: J) -> J::Output {
            job.run()
        }
        unsafe { compiled(job) }
    }
}
