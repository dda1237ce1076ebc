//! Mutated files, on which the readers must not fail.
//!
//! Deterministic: mutation i of a file is a function of i. `BOTTEGA_FUZZ` multiplies the number of mutations.

use std::panic::{AssertUnwindSafe, catch_unwind};

use bottega_kernels::SplitMix64;

/// A change of a file: its place and its kind.
pub(crate) struct Random(SplitMix64);

impl Random {
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        (self.0.bits() % limit.max(1) as u64) as usize
    }

    pub(crate) fn byte(&mut self) -> u8 {
        self.0.bits() as u8
    }
}

/// Loads mutations of a file. A mutation that panics is kept as a file.
///
/// - `count`: number of mutations, before `BOTTEGA_FUZZ` multiplies it.
/// - `load`: returns true if the mutation is still a scene.
///
/// Returns the share of mutations that are still scenes.
pub(crate) fn survive(
    name: &str,
    count: u64,
    mutated: impl Fn(&mut Random) -> Vec<u8>,
    load: impl Fn(&[u8]) -> bool,
) -> f64 {
    let factor = std::env::var("BOTTEGA_FUZZ").ok().and_then(|text| text.parse().ok()).unwrap_or(1);
    let count = count * factor;
    let mut good = 0;
    for index in 0..count {
        let bytes = mutated(&mut Random(SplitMix64::new(index)));
        match catch_unwind(AssertUnwindSafe(|| load(&bytes))) {
            Ok(is_scene) => good += u64::from(is_scene),
            Err(_) => {
                let kept = std::env::temp_dir().join(format!("bottega-fuzz-{index}-{}", name.replace('/', "-")));
                std::fs::write(&kept, &bytes).unwrap();
                panic!("mutation {index} of {name} panics; it is kept as {}", kept.display());
            }
        }
    }
    eprintln!("{name}: {good} of {count} mutations were still scenes");
    good as f64 / count as f64
}

/// Applies a random change to the bytes of any file.
pub(crate) fn damage(file: &mut Vec<u8>, at: usize, random: &mut Random) {
    match random.below(5) {
        0 => file[at] = random.byte(),
        1 => file[at] ^= 1 << random.below(8),
        2 => file.truncate(at),
        3 => drop(file.remove(at)),
        // A piece is repeated somewhere else.
        _ => {
            let end = (at + random.below(64)).min(file.len());
            let piece = file[at..end].to_vec();
            let to = random.below(file.len());
            file.splice(to..to, piece);
        }
    }
}
