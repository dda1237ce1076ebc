//! Code compiled for each vector unit, run with the best one of the processor.
#![cfg_attr(target_arch = "x86_64", allow(unsafe_code))]

#[cfg(target_arch = "x86_64")]
use crate::traverse::avx2::Avx2;
use crate::traverse::lanes::Lanes;
use crate::traverse::portable::Portable;

/// A task to compile for each vector unit. Everything that must be compiled that way is `#[inline(always)]`, all the
/// way down from [`Task::run`]; other functions are compiled once for all units.
///
/// Results are bit-identical on all units: the compiler does not contract or reorder operations.
pub trait Task {
    /// The result of the task.
    type Output;

    /// Runs the task.
    fn run(self) -> Self::Output;
}

/// Runs a task with the best vector unit of this processor, and returns its output.
#[cfg(target_arch = "x86_64")]
#[inline]
pub fn run<T: Task>(task: T) -> T::Output {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    fn compiled<T: Task>(task: T) -> T::Output {
        task.run()
    }
    match Avx2::detect() {
        // SAFETY: an `Avx2` value proves that the processor has these features.
        Some(_) => unsafe { compiled(task) },
        None => task.run(),
    }
}

/// Runs a task with the best vector unit of this processor, and returns its output.
#[cfg(not(target_arch = "x86_64"))]
#[inline]
pub fn run<T: Task>(task: T) -> T::Output {
    task.run()
}

/// A [`Task`] that is written for eight lanes.
pub(crate) trait LaneTask {
    type Output;

    /// Runs the task; implementations are `inline(always)`.
    fn run<S: Lanes>(self, unit: S) -> Self::Output;
}

/// Runs a task with the best vector unit of this processor.
pub(crate) fn run_in_lanes<T: LaneTask>(task: T) -> T::Output {
    #[cfg(target_arch = "x86_64")]
    if let Some(unit) = Avx2::detect() {
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
        fn compiled<T: LaneTask>(task: T, unit: Avx2) -> T::Output {
            task.run(unit)
        }
        // SAFETY: an `Avx2` value proves that the processor has these features.
        return unsafe { compiled(task, unit) };
    }
    task.run(Portable)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Sum<'a>(&'a [f32]);

    impl Task for Sum<'_> {
        type Output = f32;

        #[inline(always)]
        fn run(self) -> f32 {
            self.0.iter().fold(0.0, |sum, x| sum.mul_add(0.9, x * 1.1))
        }
    }

    #[test]
    fn every_unit_gives_the_same_bits() {
        let numbers: Vec<f32> = (0..100).map(|i| (i as f32).sqrt()).collect();
        assert_eq!(run(Sum(&numbers)).to_bits(), Sum(&numbers).run().to_bits());
    }
}
