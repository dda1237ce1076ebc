//! Ranks of a pixel in a Cryptomatte: which things cover it, and how much.
//!
//! A pixel holds [`RANKS`] pairs of identity and coverage; an empty pair is two zeros. In a tile, coverages are sums of
//! sample weights, in the order in which the identities arrived. In a film, they are means in descending order.
//!
//! **What is dropped.** A tile keeps [`RANKS`] identities per pixel. If another one arrives, it takes the place of the
//! identity with the smallest sum if that is not above the weight of the new sample (of equal ones, that which arrived
//! last); else the sample is dropped. So identities are lost whose coverage is about one sample, and no coverage is
//! ever too large. The rule uses only the samples in the order of their indices, so any division of the work gives the
//! same bits. A file has the first [`RANKS_WRITTEN`] pairs of a film.
//!
//! Source: Friedman and Jones 2015, *Fully Automatic ID Mattes with Support for Motion Blur and Transparency*; Psyop's
//! specification of Cryptomatte 1.2.

/// Pairs of identity and coverage that a pixel keeps.
const RANKS: usize = 8;
/// Pairs of identity and coverage in a file.
pub(crate) const RANKS_WRITTEN: usize = 6;
/// Floats of a pixel.
pub(crate) const FLOATS: usize = 2 * RANKS;

/// The weights with which two lists of ranks are blended.
#[derive(Clone, Copy)]
pub(crate) struct Blend {
    /// Weight of the film's own ranks; 0: it has none.
    pub(crate) weight: f32,
    /// Weight of the other ranks, above 0.
    pub(crate) other: f32,
}

/// Adds a sample to the ranks of a tile's pixel, `[FLOATS]`.
///
/// - `identity`: what the sample shows; 0: nothing.
pub(crate) fn add(ranks: &mut [f32], identity: f32, weight: f32) {
    if identity == 0.0 || weight == 0.0 {
        return;
    }
    let (pairs, _) = ranks.as_chunks_mut::<2>();
    // Add to the identity's own pair, or to the first empty one
    let own = pairs.iter_mut().find(|[known, _]| known.to_bits() == identity.to_bits() || *known == 0.0);
    if let Some(pair) = own {
        *pair = [identity, pair[1] + weight];
        return;
    }
    // Replace the smallest
    let smallest = pairs.iter_mut().rev().min_by(|a, b| a[1].total_cmp(&b[1]));
    if let Some(pair) = smallest.filter(|pair| pair[1] <= weight) {
        *pair = [identity, weight];
    }
}

/// Blends the ranks of a tile's pixel into those of a film's, both `[FLOATS]`.
///
/// - `count`: number of the tile's samples.
pub(crate) fn blend(film: &mut [f32], tile: &[f32], count: f32, Blend { weight, other }: Blend) {
    let new = means(tile, count);
    let (old, _) = film.as_chunks_mut::<2>();
    let is_equal = old.iter().flatten().zip(new.iter().flatten()).all(|(a, b)| a.to_bits() == b.to_bits());
    if weight == 0.0 {
        old.copy_from_slice(&new);
    } else if !is_equal {
        // Average the coverage of each identity, which is 0 where it has no rank
        let coverage = |pairs: &[[f32; 2]], [identity, _]: &[f32; 2]| {
            let found = pairs.iter().find(|[known, _]| known.to_bits() == identity.to_bits());
            found.map_or(0.0, |[_, coverage]| *coverage)
        };
        let mean = |pair: &[f32; 2]| {
            let (a, b) = (coverage(old, pair), coverage(&new, pair));
            let mean = if a.to_bits() == b.to_bits() { a } else { (a * weight + b * other) / (weight + other) };
            [pair[0], mean]
        };
        let only_new =
            new.iter().filter(|[identity, _]| old.iter().all(|[known, _]| known.to_bits() != identity.to_bits()));
        let mut all: Vec<[f32; 2]> = old.iter().chain(only_new).map(mean).collect();
        sort(&mut all);
        old.copy_from_slice(&all[..RANKS]);
    }
}

/// Returns the mean coverages of a tile's pixel in descending order. Coverage below 0, where the filter is, is dropped;
/// what is left then sums to 1 at most.
fn means(tile: &[f32], count: f32) -> [[f32; 2]; RANKS] {
    /// Sum above which it is not the result of rounding.
    const MOST: f32 = 1.0 + 1e-5;
    let mut pairs = [[0.0; 2]; RANKS];
    for (pair, &[identity, sum]) in pairs.iter_mut().zip(tile.as_chunks::<2>().0) {
        if sum > 0.0 {
            *pair = [identity, sum / count];
        }
    }
    sort(&mut pairs);
    let total: f32 = pairs.iter().map(|[_, coverage]| coverage).sum();
    if total > MOST {
        pairs.iter_mut().for_each(|[_, coverage]| *coverage /= total);
    }
    pairs
}

/// Sorts by descending coverage, then by identity; empty pairs come last.
fn sort(pairs: &mut [[f32; 2]]) {
    pairs.sort_by(|a, b| b[1].total_cmp(&a[1]).then_with(|| a[0].to_bits().cmp(&b[0].to_bits())));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tile(samples: &[(f32, f32)]) -> [f32; FLOATS] {
        let mut ranks = [0.0; FLOATS];
        samples.iter().for_each(|&(identity, weight)| add(&mut ranks, identity, weight));
        ranks
    }

    fn film(tiles: &[(&[f32; FLOATS], f32, f32)]) -> [f32; FLOATS] {
        let (mut film, mut before) = ([0.0; FLOATS], 0.0);
        for &(tile, count, weight) in tiles {
            blend(&mut film, tile, count, Blend { weight: before, other: weight });
            before += weight;
        }
        film
    }

    #[test]
    fn coverage_is_the_share_of_the_samples_in_descending_order() {
        let ranks = film(&[(&tile(&[(5.0, 1.0), (7.0, 1.0), (0.0, 1.0), (7.0, 1.0)]), 4.0, 1.0)]);
        assert_eq!(ranks[..6], [7.0, 0.5, 5.0, 0.25, 0.0, 0.0]);
    }

    #[test]
    fn a_ninth_identity_replaces_only_one_that_a_single_sample_showed() {
        let mut samples: Vec<(f32, f32)> = (1..=8).map(|identity| (identity as f32, 1.0)).collect();
        samples.extend([(1.0, 1.0), (8.0, 1.0), (9.0, 1.0)]);
        let ranks = tile(&samples);
        assert_eq!(ranks[..2], [1.0, 2.0]);
        // The last of the smallest
        assert_eq!(ranks[12..], [9.0, 1.0, 8.0, 2.0]);
        samples.extend((1..=8).map(|identity| (identity as f32, 1.0)));
        samples.push((9.0, 1.0));
        let crowded = tile(&samples.iter().filter(|(identity, _)| *identity != 7.0).copied().collect::<Vec<_>>());
        assert!(crowded.as_chunks::<2>().0.contains(&[9.0, 2.0]), "{crowded:?}");
        assert!(crowded.iter().skip(1).step_by(2).sum::<f32>() <= samples.len() as f32);
    }

    #[test]
    fn the_tiles_of_two_zones_are_blended_to_the_same_bits_in_either_order() {
        let (a, b) = (tile(&[(1.0, 1.0), (2.0, 1.0), (2.0, 1.0)]), tile(&[(3.0, 1.0), (2.0, 1.0)]));
        let (one, other) = (film(&[(&a, 3.0, 0.3), (&b, 2.0, 0.7)]), film(&[(&b, 2.0, 0.7), (&a, 3.0, 0.3)]));
        assert_eq!(one.map(f32::to_bits), other.map(f32::to_bits));
        assert_eq!([one[0], one[2], one[4]], [2.0, 3.0, 1.0]);
        assert!((one[1] - (0.3 * 2.0 / 3.0 + 0.35)).abs() < 1e-6 && (one[3] - 0.35).abs() < 1e-6);
        assert_eq!(film(&[(&a, 3.0, 0.3), (&a, 3.0, 0.1), (&a, 3.0, 0.7)]), film(&[(&a, 3.0, 1.0)]));
    }

    #[test]
    fn where_the_filter_is_negative_coverage_stays_between_0_and_1() {
        let ranks = film(&[(&tile(&[(1.0, 1.5), (1.0, 1.5), (2.0, 1.0), (3.0, -0.5)]), 3.0, 1.0)]);
        assert_eq!(ranks[..6], [1.0, 0.75, 2.0, 0.25, 0.0, 0.0]);
    }
}
