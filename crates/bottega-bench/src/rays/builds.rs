//! The time to build trees, compared with Embree.

use std::time::Duration;

use bottega_kernels::BuildOptions;

use super::{
    embree::{Embree, EmbreeSetting},
    kernel::{BottegaKernel, RayKernel},
};
use crate::{error::Error, scenes::BenchScene};

/// The numbers of threads that build.
const THREADS: [usize; 2] = [1, 2];

/// Seconds to build a tree with this many threads: medians.
#[derive(Clone, Copy, Debug)]
pub(super) struct BuildTimes {
    pub(super) threads: usize,
    pub(super) ours: f64,
    /// Our build without reinsertion.
    pub(super) quick: f64,
    pub(super) embree_medium: f64,
    pub(super) embree_high: f64,
}

/// Builds all trees in turn, `count` times.
pub(super) fn build_times(scene: &BenchScene, embree: &Embree, count: u16) -> Result<Vec<BuildTimes>, Error> {
    let of = |threads: usize| {
        let ours = |optimize| -> Result<Duration, Error> {
            let options = BuildOptions { threads, optimize, ..BuildOptions::default() };
            Ok(BottegaKernel::build("ours", scene, &options)?.build_time())
        };
        let theirs = |setting| -> Result<Duration, Error> {
            Ok(embree.build(scene, setting, threads).map_err(Error::Embree)?.build_time())
        };
        let mut times: [Vec<Duration>; 4] = Default::default();
        for _ in 0..count {
            times[0].push(ours(true)?);
            times[1].push(ours(false)?);
            times[2].push(theirs(EmbreeSetting::Medium)?);
            times[3].push(theirs(EmbreeSetting::High)?);
        }
        let [ours, quick, embree_medium, embree_high] = times.map(median);
        Ok(BuildTimes { threads, ours, quick, embree_medium, embree_high })
    };
    THREADS.into_iter().map(of).collect()
}

fn median(mut times: Vec<Duration>) -> f64 {
    times.sort();
    times[times.len() / 2].as_secs_f64()
}
