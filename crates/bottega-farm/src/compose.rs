//! Blending of neighboring zones with linear masks across interpolation bands.
//!
//! A zone is painted grown by its band. Where grown zones overlap, each has as weight the depth of the pixel in it,
//! divided by the sum of all depths. Across a straight edge between a zone of band *a* and one of band *b* that is the
//! paper's linear mask over *a + b* pixels (MAGarRO, section 3.5); at corners and T-junctions it is continuous.

use bottega_image::{Rect, Sides};

use crate::{Partition, partition::ZoneIndex};

/// A zone with its band.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BandedZone {
    /// The zone's own pixels, without the band.
    pub rect: Rect,
    /// The zone's pixels and its band, clipped to the frame.
    pub grown: Rect,
}

impl BandedZone {
    /// Makes the zone of `rect` with its bands, clipped to `frame`; all in pixels.
    pub fn new(rect: Rect, bands: Sides<u32>, frame: &Rect) -> Self {
        Self { rect, grown: rect.grown_by(bands, frame) }
    }

    /// Returns the distance of the pixel's center from the nearest edge of the grown zone, in pixels; 0 outside.
    /// Edges of the frame do not count, because nothing lies beyond them.
    fn depth(&self, x: u32, y: u32, frame: &Rect) -> f32 {
        /// Larger than any depth in a picture.
        const INSIDE: f32 = 1e9;
        if !self.grown.contains(x, y) {
            return 0.0;
        }
        let low = |edge: u32, limit: u32, at: u32| if edge == limit { INSIDE } else { (at - edge) as f32 + 0.5 };
        let high = |edge: u32, limit: u32, at: u32| if edge == limit { INSIDE } else { (edge - at) as f32 - 0.5 };
        low(self.grown.x0, frame.x0, x)
            .min(high(self.grown.x1, frame.x1, x))
            .min(low(self.grown.y0, frame.y0, y))
            .min(high(self.grown.y1, frame.y1, y))
    }
}

/// Returns the masks of all zones, in order of their ids.
///
/// - `bands`: one entry per zone, in order of ids: the widths of the bands beyond its edges, in pixels.
///
/// # Panics
/// If there are more or fewer entries than zones.
pub fn masks(partition: &Partition, bands: &[Sides<u32>]) -> Vec<Mask> {
    let (zones, frame) = (partition.zones(), partition.frame());
    assert_eq!(zones.len(), bands.len(), "one band for each zone");
    let band_max = bands.iter().flat_map(|bands| bands.into_array()).max().unwrap_or(0);
    if band_max == 0 {
        return zones.iter().map(|&rect| Mask::without_band(rect, frame)).collect();
    }
    let index = ZoneIndex::new(frame, zones);
    let banded = |i: usize| BandedZone::new(zones[i], bands[i], &frame);
    (0..zones.len())
        .map(|i| {
            let zone = banded(i);
            let near = index.touching(&zone.grown.grown(band_max, &frame)).map(banded).collect();
            Mask::new(frame, zone, near)
        })
        .collect()
}

/// The weights with which the pixels of one zone's tile enter the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    frame: Rect,
    zone: BandedZone,
    /// All zones that overlap it, including itself, in order of their ids, so that the sum is bit-identical for each of
    /// them. Empty: no other zone overlaps it.
    overlapping: Vec<BandedZone>,
}

impl Mask {
    /// Makes the mask of a zone without a band, where its neighbors have none either.
    ///
    /// - `rect`: the pixels of the zone.
    /// - `frame`: the pixels of the picture to paint.
    pub fn without_band(rect: Rect, frame: Rect) -> Self {
        Self { frame, zone: BandedZone::new(rect, Sides::all(0), &frame), overlapping: Vec::new() }
    }

    /// Makes the mask of a zone with a band.
    ///
    /// - `frame`: the pixels of the picture to paint; at its edges the mask does not fade.
    /// - `others`: all zones that may overlap `zone`, including itself, in order of their ids.
    pub fn new(frame: Rect, zone: BandedZone, mut others: Vec<BandedZone>) -> Self {
        others.retain(|other| other.grown.intersection(&zone.grown).is_some());
        if others.iter().all(|other| *other == zone) {
            others.clear();
        }
        Self { frame, zone, overlapping: others }
    }

    /// Returns the weight of the pixel (x, y): 0 outside the grown zone, exactly 1 where no other zone overlaps. The
    /// weights of all zones at a pixel sum to 1.
    pub fn weight(&self, x: u32, y: u32) -> f32 {
        if self.overlapping.is_empty() {
            return if self.zone.grown.contains(x, y) { 1.0 } else { 0.0 };
        }
        let own = self.zone.depth(x, y, &self.frame);
        if own == 0.0 {
            return 0.0;
        }
        let sum: f32 = self.overlapping.iter().map(|zone| zone.depth(x, y, &self.frame)).sum();
        // Without another zone here `sum` equals `own`, and the quotient is exactly 1.
        own / sum
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{ImportanceMap, Level, PartitionSettings, ZoneLimits};

    #[test]
    fn across_a_straight_edge_the_mask_is_linear_over_both_bands() {
        let frame = Rect::of_size(40, 10);
        let partition = Partition::of_zones(frame, vec![Rect::new(0, 0, 20, 10), Rect::new(20, 0, 40, 10)]);
        let [left, right] = &masks(&partition, &[Sides::all(4), Sides::all(2)])[..] else { panic!("two zones") };
        for x in 0..40 {
            // The left one fades from 18 (2 pixels inside) to 24 (4 pixels outside).
            let expected = ((24.0 - (x as f32 + 0.5)) / 6.0).clamp(0.0, 1.0);
            assert!((left.weight(x, 5) - expected).abs() < 1e-6, "at {x}: {} {expected}", left.weight(x, 5));
            assert!((left.weight(x, 5) + right.weight(x, 5) - 1.0).abs() < 1e-6);
        }
        assert_eq!(left.weight(17, 5).to_bits(), 1.0f32.to_bits());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn weights_sum_to_one_everywhere_and_are_one_outside_bands(
            (width, height, count) in (1u32..60, 1u32..60, 1u32..12),
            (bands, crop_x) in (prop::collection::vec([0u32..9, 0..9, 0..9, 0..9], 64), 0u32..20),
        ) {
            let frame = Rect::new(crop_x, 3, crop_x + width, height + 3);
            let map = ImportanceMap::uniform(frame);
            let settings =
                PartitionSettings::for_agents(Level::Balanced, 1, frame).within(Some(count), ZoneLimits { side_min: 3, ..ZoneLimits::default() });
            let partition = Partition::new(&map, frame, &settings);
            let sides = |[left, top, right, bottom]: [u32; 4]| Sides { left, top, right, bottom };
            let bands: Vec<Sides<u32>> = bands.into_iter().take(partition.zones().len()).map(sides).collect();
            let masks = masks(&partition, &bands);
            for (x, y) in frame.pixels() {
                let sum: f32 = masks.iter().map(|mask| mask.weight(x, y)).sum();
                prop_assert!((sum - 1.0).abs() < 1e-5, "{} at {}, {}", sum, x, y);
                for ((_, zone), mask) in partition.iter().zip(&masks) {
                    let reached = partition
                        .iter()
                        .filter(|&(_, other)| other != zone)
                        .any(|(id, other)| other.grown_by(bands[id.index()], &frame).contains(x, y));
                    if zone.contains(x, y) && !reached {
                        prop_assert_eq!(mask.weight(x, y).to_bits(), 1.0f32.to_bits());
                    }
                }
            }
        }

        #[test]
        fn without_bands_every_pixel_has_weight_one_in_its_zone_alone(count in 1u32..20) {
            let frame = Rect::of_size(33, 21);
            let map = ImportanceMap::uniform(frame);
            let settings =
                PartitionSettings::for_agents(Level::Divided, 1, frame).within(Some(count), ZoneLimits { side_min: 2, ..ZoneLimits::default() });
            let partition = Partition::new(&map, frame, &settings);
            let bands = vec![Sides::all(0); partition.zones().len()];
            for ((_, zone), mask) in partition.iter().zip(masks(&partition, &bands)) {
                for (x, y) in frame.pixels() {
                    prop_assert_eq!(mask.weight(x, y), if zone.contains(x, y) { 1.0 } else { 0.0 });
                }
            }
        }
    }
}
