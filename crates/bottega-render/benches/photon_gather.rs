//! The time to find the 50 nearest of a million photons, beside `kiddo`.
//!
//! `cargo bench -p bottega-render --bench photon_gather`
//!
//! Photons lie on the walls of a room, and lookups are near the walls. Both get the same lookups, one after the
//! other on one thread, the rounds in turn. `kiddo` uses its fastest lookup: unsorted, its memory kept.
#![allow(clippy::print_stdout)]

use std::{hint::black_box, num::NonZeroUsize, time::Instant};

use bottega_kernels::{
    SplitMix64,
    compiled::{self, Task},
};
use bottega_render::photon::{Nearest, Photon, PhotonMap};
use glam::Vec3;
use kiddo::{ImmutableKdTree, dist::SquaredEuclidean};

const PHOTONS: u32 = 1_000_000;
const QUERIES: u32 = 100_000;
const NEAREST: usize = 50;
const ROUNDS: usize = 5;

/// Numbers in [0, 1).
struct Numbers(SplitMix64);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0.unit_f32()
    }

    /// On a wall of the room.
    fn on_wall(&mut self) -> Vec3 {
        let side = (self.next() * 6.0) as usize;
        let mut p = [self.next(), self.next(), self.next()];
        p[side / 2] = (side % 2) as f32;
        p.into()
    }
}

/// Lookups to perform; the result is the sum of all distances.
struct OwnMap<'a> {
    map: &'a PhotonMap,
    questions: &'a [Vec3],
}

impl Task for OwnMap<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let mut found = Nearest::new(NEAREST);
        let mut sum = 0.0;
        for &p in self.questions {
            self.map.nearest(p, f32::INFINITY, &mut found);
            sum += found.iter().map(|(_, distance)| f64::from(distance)).sum::<f64>();
        }
        sum
    }
}

fn main() {
    let mut numbers = Numbers(SplitMix64::new(1));
    let photons: Vec<Photon> =
        (0..PHOTONS).map(|_| Photon::new(numbers.on_wall(), Vec3::Y, Vec3::Y, Vec3::ONE)).collect();
    let questions: Vec<Vec3> = (0..QUERIES).map(|_| numbers.on_wall()).collect();
    let places: Vec<[f32; 3]> = photons.iter().map(|photon| photon.p.to_array()).collect();
    let start = Instant::now();
    let map = PhotonMap::new(photons);
    println!("ours   built in {:.3} s, {} bytes", start.elapsed().as_secs_f64(), map.memory_bytes());
    let start = Instant::now();
    let tree: ImmutableKdTree<f32, 3> = ImmutableKdTree::new_from_slice(&places).expect("a tree");
    println!("kiddo  built in {:.3} s", start.elapsed().as_secs_f64());
    let count = NonZeroUsize::new(NEAREST).expect("not 0");
    let (mut ours, mut theirs) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let start = Instant::now();
        let sum = black_box(compiled::run(OwnMap { map: &map, questions: &questions }));
        ours.push(start.elapsed().as_secs_f64());
        let start = Instant::now();
        let mut expected = 0.0;
        for p in &questions {
            let found = tree.query(&p.to_array()).nearest_n::<SquaredEuclidean<f32>>(count).unsorted().execute();
            expected += found.iter().map(|it| f64::from(it.distance)).sum::<f64>();
        }
        theirs.push(start.elapsed().as_secs_f64());
        assert!((sum / black_box(expected) - 1.0).abs() < 1e-6, "both must find the same: {sum} {expected}");
    }
    let median = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2] / f64::from(QUERIES) * 1e9
    };
    let (ours, theirs) = (median(&mut ours), median(&mut theirs));
    println!("ours   {ours:.0} ns a question\nkiddo  {theirs:.0} ns a question\nratio  {:.2}", theirs / ours);
}
