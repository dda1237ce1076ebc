//! The partition of a frame into zones by the importance map, in three levels, each refining the last.
//!
//! Source: MAGarRO, section 3.3: recursive division by minimum size and maximum complexity; joining of neighbors of
//! similar complexity; balancing, "to obtain tasks that all require roughly the same rendering time".

mod balance;
mod cut;
mod index;
mod join;
mod ratio;
mod settings;

use bottega_image::{Rect, Sides};

use self::cut::{cut_x, cut_y};
pub(crate) use self::index::{ZoneIndex, nearest_multiple};
pub use self::settings::{Balance, Level, PartitionSettings, UnknownLevel, ZoneLimits};
use crate::{ImportanceMap, ZoneId};

/// A frame cut into zones: rectangles that cover each of its pixels exactly once, ordered by upper left corner, row
/// before column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Partition {
    frame: Rect,
    zones: Vec<Rect>,
}

impl Partition {
    /// Cuts `frame` into zones by the costs in `map`; deterministic in the arguments. An empty frame has no zones.
    ///
    /// # Panics
    /// If the frame reaches beyond the survey of `map`.
    pub fn new(map: &ImportanceMap, frame: Rect, settings: &PartitionSettings) -> Self {
        if frame.is_empty() {
            return Self { frame, zones: Vec::new() };
        }
        let mut zones = vec![frame];
        let complexity = map.complexity(&frame);
        let complexity_max = settings.complexity_max(complexity);
        let side_min = settings.limits.side_min.max(1);
        // Level 1: divide by minimum size and maximum complexity
        if settings.level >= Level::Divided {
            zones = divide(map, frame, side_min, complexity_max);
        }
        // Level 2: join similar neighbors
        if settings.level >= Level::Joined {
            zones = join::join(map, zones, settings.limits.similarity, complexity_max * settings.joined_max);
        }
        // Level 3: balance the expected times, or the complexity/size ratios
        if settings.level >= Level::Balanced {
            let count = settings.zone_count.max(1);
            zones = match settings.limits.balance {
                Balance::Time => balance::balance(map, frame, &zones, side_min, complexity / f64::from(count)),
                Balance::Ratio => ratio::even_out(map, frame, &zones, side_min, count),
            };
        }
        Self::of_zones(frame, zones)
    }

    /// Returns the partition with all inner edges moved to multiples of `side` pixels of the picture. Zones that
    /// become empty are dropped; their pixels go to neighbors.
    #[must_use]
    pub fn along_grid(self, side: u32) -> Self {
        // Equal coordinates move to the same place, so zones neither overlap nor leave holes.
        let moved = |at: u32, low: u32, high: u32| {
            if at == low || at == high { at } else { nearest_multiple(at, side).clamp(low, high) }
        };
        let Rect { x0, y0, x1, y1 } = self.frame;
        let zones = self.zones.iter().map(|zone| Rect {
            x0: moved(zone.x0, x0, x1),
            y0: moved(zone.y0, y0, y1),
            x1: moved(zone.x1, x0, x1),
            y1: moved(zone.y1, y0, y1),
        });
        Self::of_zones(self.frame, zones.filter(|zone| !zone.is_empty()).collect())
    }

    /// Makes a partition of given zones. Check rectangles of unknown origin with [`Partition::covers`] first.
    ///
    /// # Panics
    /// If the zones do not cover the frame exactly once.
    pub fn of_zones(frame: Rect, mut zones: Vec<Rect>) -> Self {
        zones.sort_unstable_by_key(|zone| (zone.y0, zone.x0));
        assert!(Self::covers(frame, &zones), "zones do not cover {frame} exactly once");
        Self { frame, zones }
    }

    /// Returns true if rectangles cover each pixel of a frame exactly once and nothing else.
    pub fn covers(frame: Rect, zones: &[Rect]) -> bool {
        let area: u64 = zones.iter().map(Rect::area).sum();
        if area != frame.area() || zones.iter().any(|zone| zone.is_empty() || !frame.encloses(zone)) {
            return false;
        }
        // The areas add up, so they cover the frame if no two overlap.
        let index = ZoneIndex::new(frame, zones);
        zones.iter().enumerate().all(|(i, zone)| index.touching(zone).all(|j| j == i))
    }

    /// Returns the frame that the zones cover.
    pub fn frame(&self) -> Rect {
        self.frame
    }

    /// Returns the zones, indexed by [`ZoneId`].
    pub fn zones(&self) -> &[Rect] {
        &self.zones
    }

    /// Returns the zones with their ids.
    pub fn iter(&self) -> impl Iterator<Item = (ZoneId, Rect)> {
        self.zones.iter().enumerate().map(|(i, &rect)| (ZoneId::of_index(i), rect))
    }

    /// Returns the greatest complexity per pixel of a zone over the least: 1 if all zones have the same complexity/size
    /// ratio, or there are none.
    ///
    /// # Panics
    /// If the frame reaches beyond the survey of `map`.
    pub fn ratio_spread(&self, map: &ImportanceMap) -> f64 {
        let ratios = || self.zones.iter().map(|zone| map.complexity_density(zone));
        let (least, greatest) = (ratios().fold(f64::INFINITY, f64::min), ratios().fold(0.0, f64::max));
        if self.zones.is_empty() { 1.0 } else { greatest / least }
    }

    /// Returns the expected time of the longest zone over the mean: 1 is perfect balance. At level 3 at most 1.1,
    /// unless the longest zone is too small to cut or its costs are concentrated in too few pixels. 1 without zones.
    ///
    /// # Panics
    /// If the frame reaches beyond the survey of `map`.
    pub fn imbalance(&self, map: &ImportanceMap) -> f64 {
        let longest = self.zones.iter().map(|zone| map.complexity(zone)).fold(0.0, f64::max);
        if self.zones.is_empty() { 1.0 } else { longest * self.zones.len() as f64 / map.complexity(&self.frame) }
    }

    /// Returns the [`NeighborDifference`] of each zone, in the order of their ids.
    ///
    /// # Panics
    /// If the frame reaches beyond the survey of `map`.
    pub fn neighbor_differences(&self, map: &ImportanceMap) -> Vec<NeighborDifference> {
        let density: Vec<f64> = self.zones.iter().map(|zone| map.complexity_density(zone)).collect();
        let index = ZoneIndex::new(self.frame, &self.zones);
        let difference = |(i, zone): (usize, &Rect)| {
            // Per side: the differences weighted by edge length, and the total length.
            let mut sides = Sides::all((0.0, 0.0));
            for j in index.touching(&zone.grown(1, &self.frame)).filter(|&j| j != i) {
                if let Some(((sum, length), edge)) = shared_edge(zone, &self.zones[j], &mut sides) {
                    *sum += f64::from(edge) * (density[i] - density[j]).abs();
                    *length += f64::from(edge);
                }
            }
            let mean = |(sum, length): (f64, f64)| if length > 0.0 { sum / length } else { 0.0 };
            let all = sides.into_array().into_iter().fold((0.0, 0.0), |all, side| (all.0 + side.0, all.1 + side.1));
            NeighborDifference { mean: mean(all), sides: sides.map(mean) }
        };
        self.zones.iter().enumerate().map(difference).collect()
    }
}

/// The paper's Neighbor Difference: the absolute difference in cost per pixel between a zone and the zones that share
/// an edge with it, averaged by the length of the edges. In average pixels per pixel; 0 without neighbors.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NeighborDifference {
    /// The average over all edges of the zone.
    pub mean: f64,
    /// The average over the edges of each side.
    pub sides: Sides<f64>,
}

impl NeighborDifference {
    /// Returns a difference that is the same on all sides.
    pub fn all(difference: f64) -> Self {
        Self { mean: difference, sides: Sides::all(difference) }
    }
}

/// Returns the side of `a` at which the disjoint rectangle `b` touches it, and the length of the shared edge in
/// pixels.
fn shared_edge<'a, T>(a: &Rect, b: &Rect, sides: &'a mut Sides<T>) -> Option<(&'a mut T, u32)> {
    let overlap = |a0: u32, a1: u32, b0: u32, b1: u32| a1.min(b1).saturating_sub(a0.max(b0));
    let (high, wide) = (overlap(a.y0, a.y1, b.y0, b.y1), overlap(a.x0, a.x1, b.x0, b.x1));
    let side = match (high > 0, wide > 0) {
        (true, _) if b.x1 == a.x0 => &mut sides.left,
        (true, _) if b.x0 == a.x1 => &mut sides.right,
        (_, true) if b.y1 == a.y0 => &mut sides.top,
        (_, true) if b.y0 == a.y1 => &mut sides.bottom,
        _ => return None,
    };
    Some((side, high.max(wide)))
}

/// Runs level 1: halves the longer side of each zone that is too complex, while both halves are large enough.
fn divide(map: &ImportanceMap, frame: Rect, side_min: u32, complexity_max: f64) -> Vec<Rect> {
    let mut open = vec![frame];
    let mut zones = Vec::new();
    while let Some(zone) = open.pop() {
        let side = zone.width().max(zone.height());
        if side / 2 < side_min || map.complexity(&zone) <= complexity_max {
            zones.push(zone);
        } else if zone.width() >= zone.height() {
            open.extend(cut_x(zone, zone.x0 + side / 2));
        } else {
            open.extend(cut_y(zone, zone.y0 + side / 2));
        }
    }
    zones
}

#[cfg(test)]
mod tests {
    use bottega_engines::{Survey, SurveyPixel};
    use proptest::prelude::*;

    use super::*;
    use crate::ImportanceFunction;

    /// A scene of flat background with some bright blobs of cost.
    fn blobs(surveyed: Rect, frame: Rect, seed: u32) -> ImportanceMap {
        let (width, height) = (64, 48);
        let hash = |k: u32| (seed.wrapping_add(k).wrapping_mul(0x9e37_79b9) >> 12) as f32 / (1u32 << 20) as f32;
        let pixels = (0..width * height)
            .map(|i| {
                let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
                let near = |k: u32| {
                    let (dx, dy) = (x - hash(3 * k), y - hash(3 * k + 1));
                    40.0 * hash(3 * k + 2) / (1.0 + 60.0 * (dx * dx + dy * dy))
                };
                let steps = 4.0 + (0..4).map(near).sum::<f32>();
                SurveyPixel { steps, recursion_levels: steps.floor(), path_length: 1.0, ..SurveyPixel::default() }
            })
            .collect();
        let survey = Survey { width, height, pixels, zones_max: None };
        ImportanceMap::new(&survey, surveyed, frame, ImportanceFunction::Paper).unwrap()
    }

    fn settings(level: Level, side_min: u32, zone_count: u32) -> PartitionSettings {
        let limits = ZoneLimits { side_min, ..ZoneLimits::default() };
        PartitionSettings { level, zone_count, zones_least: 1, joined_max: 2.0, limits }
    }

    #[test]
    fn level_0_is_one_zone() {
        let frame = Rect::new(3, 4, 100, 90);
        let partition = Partition::new(&ImportanceMap::uniform(frame), frame, &settings(Level::Whole, 8, 64));
        assert_eq!(partition.zones(), [frame]);
    }

    #[test]
    fn level_1_divides_where_it_is_complex_and_nowhere_else() {
        let frame = Rect::of_size(256, 256);
        let map = blobs(frame, frame, 7);
        let partition = Partition::new(&map, frame, &settings(Level::Divided, 8, 32));
        let complexity_max = map.complexity(&frame) / 32.0;
        for zone in partition.zones() {
            let divisible = zone.width().max(zone.height()) / 2 >= 8;
            assert!(map.complexity(zone) <= complexity_max || !divisible);
        }
        let areas = partition.zones().iter().map(Rect::area);
        assert!(areas.clone().max() > areas.min(), "an uneven scene gives uneven zones");
    }

    #[test]
    fn level_2_joins_an_even_picture_up_to_the_bound() {
        let frame = Rect::of_size(256, 256);
        let map = ImportanceMap::uniform(frame);
        let divided = Partition::new(&map, frame, &settings(Level::Divided, 8, 64));
        let joined = Partition::new(&map, frame, &settings(Level::Joined, 8, 64));
        assert_eq!(divided.zones().len(), 64);
        assert_eq!(joined.zones().len(), 32);
        let unbounded = PartitionSettings { joined_max: f64::INFINITY, ..settings(Level::Joined, 8, 64) };
        assert_eq!(Partition::new(&map, frame, &unbounded).zones(), [frame]);
    }

    #[test]
    fn level_1_cuts_by_minimum_size_and_maximum_complexity() {
        let frame = Rect::of_size(256, 128);
        let map = ImportanceMap::uniform(frame);
        let zones = |side_min, complexity_max: f64| {
            let limits = ZoneLimits { side_min, complexity_max: Some(complexity_max), ..ZoneLimits::default() };
            let settings = PartitionSettings::for_agents(Level::Divided, 1, frame).within(None, limits);
            Partition::new(&map, frame, &settings).zones().len()
        };
        assert_eq!(zones(8, 1.0), 1);
        assert_eq!(zones(8, 0.5), 2);
        assert_eq!(zones(8, 1.0 / 32.0), 32);
        assert_eq!(zones(8, 0.03), 64);
        assert_eq!(zones(32, 0.001), 32);
        assert_eq!(zones(100, 0.001), 2);
        // The third level makes enough zones that none has to exceed it; a number of zones wins.
        let limits = ZoneLimits { complexity_max: Some(0.01), ..ZoneLimits::default() };
        let usual = PartitionSettings::for_agents(Level::Balanced, 1, frame);
        assert_eq!(usual.within(None, limits).zone_count, 100);
        assert_eq!(usual.within(Some(7), limits).zone_count, 7);
        assert_eq!(usual.within(None, ZoneLimits::default()), usual);
        assert_eq!(usual.within(None, limits).at_most(20).complexity_max(1.0), 0.05);
    }

    #[test]
    fn level_2_joins_more_the_less_similar_zones_must_be() {
        let frame = Rect::of_size(256, 256);
        let map = blobs(frame, frame, 7);
        let zones = |similarity| {
            let limits = ZoneLimits { similarity, ..ZoneLimits::default() };
            let settings = PartitionSettings { limits, ..settings(Level::Joined, 8, 64) };
            Partition::new(&map, frame, &settings).zones().len()
        };
        let counts = [0.0, 0.05, 0.15, 0.5, 1.0].map(zones);
        assert!(counts.is_sorted_by(|more, fewer| more >= fewer) && counts[0] > counts[4], "{counts:?}");
    }

    #[test]
    fn level_3_by_ratio_gives_every_zone_as_much_of_what_is_complex() {
        // Complex on the left: zones of one ratio are as wide as the picture.
        let frame = Rect::of_size(256, 256);
        let map = map_of(frame, |x, _| if x < 128 { 9.0 } else { 0.0 });
        let by = |balance, map: &ImportanceMap, count| {
            let limits = ZoneLimits { balance, ..ZoneLimits::default() };
            Partition::new(map, frame, &PartitionSettings { limits, ..settings(Level::Balanced, 8, count) })
        };
        let ratio = by(Balance::Ratio, &map, 4);
        assert_eq!(ratio.zones(), [0, 64, 128, 192].map(|y| Rect::new(0, y, 256, y + 64)));
        assert!((ratio.ratio_spread(&map) - 1.0).abs() < 1e-9, "{}", ratio.ratio_spread(&map));
        assert!(by(Balance::Time, &map, 4).ratio_spread(&map) > 2.0);
        // In nearly every scene it evens out the ratio, and nowhere the time.
        let is_evener = |seed: &u32| {
            let map = blobs(frame, frame, *seed);
            let [time, ratio] = [Balance::Time, Balance::Ratio].map(|balance| by(balance, &map, 16));
            ratio.ratio_spread(&map) < time.ratio_spread(&map) && time.imbalance(&map) <= ratio.imbalance(&map) + 1e-9
        };
        let eveners = (0..40).filter(is_evener).count();
        assert!(eveners >= 36, "{eveners}");
    }

    #[test]
    fn level_3_keeps_expected_times_within_a_tenth() {
        for seed in 0..40 {
            let frame = Rect::of_size(640, 480);
            let map = blobs(frame, frame, seed);
            for zone_count in [5, 16, 64, 100] {
                let partition = Partition::new(&map, frame, &settings(Level::Balanced, 4, zone_count));
                let wanted = map.complexity(&frame) / f64::from(zone_count);
                for zone in partition.zones() {
                    let off = map.complexity(zone) / wanted - 1.0;
                    assert!(off.abs() <= 0.1, "seed {seed}, {zone_count} zones: {zone} is {off:+.3} off");
                }
            }
        }
    }

    /// A map of as many cells as pixels, by recursion levels.
    fn map_of(frame: Rect, levels: impl Fn(u32, u32) -> f32) -> ImportanceMap {
        let pixel = |(x, y)| SurveyPixel { recursion_levels: levels(x, y), ..SurveyPixel::default() };
        let survey = Survey {
            width: frame.width(),
            height: frame.height(),
            pixels: frame.pixels().map(pixel).collect(),
            zones_max: None,
        };
        ImportanceMap::new(&survey, frame, frame, ImportanceFunction::Paper).unwrap()
    }

    #[test]
    fn one_hot_pixel_makes_one_zone_too_long_and_no_other() {
        let frame = Rect::of_size(256, 256);
        // As much as an eighth of all else: of 64 zones seven would have to share one pixel.
        let map = map_of(frame, |x, y| if (x, y) == (77, 200) { 8191.0 } else { 0.0 });
        let partition = Partition::new(&map, frame, &settings(Level::Balanced, 8, 64));
        let wanted = map.complexity(&frame) / 64.0;
        let (hot, others): (Vec<&Rect>, Vec<&Rect>) = partition.zones().iter().partition(|zone| zone.contains(77, 200));
        assert!(hot[0].width() < 16 && hot[0].height() < 16, "it is cut as small as may be: {}", hot[0]);
        let over = map.complexity(hot[0]) / wanted;
        assert!((7.0..7.3).contains(&over), "{over} times the time wanted, of which the pixel alone takes 7.1");
        let longest = others.iter().map(|zone| map.complexity(zone) / wanted).fold(0.0, f64::max);
        assert!(longest <= 1.1, "{longest}");
        assert!((partition.imbalance(&map) - over * partition.zones().len() as f64 / 64.0).abs() < 1e-9);
    }

    #[test]
    fn a_frame_one_pixel_wide_is_balanced_along_its_length() {
        let (upright, lying) = (Rect::of_size(1, 4000), Rect::of_size(4000, 1));
        for frame in [upright, lying] {
            let map = map_of(frame, |x, y| ((x + y) / 500) as f32);
            let partition = Partition::new(&map, frame, &settings(Level::Balanced, 8, 40));
            let wanted = map.complexity(&frame) / 40.0;
            for zone in partition.zones() {
                let off = map.complexity(zone) / wanted - 1.0;
                assert!(off.abs() <= 0.1, "{zone}: {off:+.3}");
            }
        }
    }

    #[test]
    fn where_the_minimum_size_binds_zones_are_as_small_as_it_allows() {
        let frame = Rect::of_size(64, 64);
        let map = map_of(frame, |x, _| if x < 32 { 0.0 } else { 8.0 });
        let partition = Partition::new(&map, frame, &settings(Level::Balanced, 16, 256));
        // At most 16 fit. None of those that take more than a tenth over the mean could be cut again; of 16 equal squares the
        // costly ones would take 1.8 times the mean.
        let mean = map.complexity(&frame) / partition.zones().len() as f64;
        let is_long = |zone: &&Rect| map.complexity(zone) > 1.1 * mean;
        assert!(partition.zones().iter().filter(is_long).all(|zone| zone.width() < 32 && zone.height() < 32));
        assert!((1.1..=1.8).contains(&partition.imbalance(&map)), "{}", partition.imbalance(&map));
    }

    #[test]
    fn neighbor_difference_is_high_at_the_rim_of_a_complex_zone() {
        let frame = Rect::of_size(90, 30);
        let mut survey = Survey { width: 3, height: 1, pixels: vec![SurveyPixel::default(); 3], zones_max: None };
        survey.pixels[2].recursion_levels = 8.0;
        let map = ImportanceMap::new(&survey, frame, frame, ImportanceFunction::Paper).unwrap();
        let third = |i: u32| Rect::new(30 * i, 0, 30 * i + 30, 30);
        let differences = Partition::of_zones(frame, vec![third(0), third(1), third(2)]).neighbor_differences(&map);
        assert_eq!(differences[0].mean, 0.0);
        assert!(differences[1].mean > 0.0 && differences[2].mean > differences[1].mean);
        assert_eq!((differences[1].sides.left, differences[1].sides.top), (0.0, 0.0));
        assert_eq!(differences[1].sides.right, differences[2].sides.left);
    }

    #[test]
    fn what_overlaps_or_leaves_a_hole_is_no_partition() {
        let frame = Rect::of_size(4, 2);
        assert!(Partition::covers(frame, &[Rect::new(0, 0, 2, 2), Rect::new(2, 0, 4, 2)]));
        assert!(!Partition::covers(frame, &[Rect::new(0, 0, 2, 2), Rect::new(1, 0, 3, 2)]));
        assert!(!Partition::covers(frame, &[Rect::new(0, 0, 2, 2)]));
        assert!(!Partition::covers(frame, &[Rect::new(0, 0, 2, 2), Rect::new(2, 0, 3, 4)]));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn zones_cover_the_frame_exactly_once(
            (width, height) in (1u32..300, 1u32..300),
            crop in [0.0f64..1.0, 0.0..1.0, 0.0..1.0, 0.0..1.0],
            (side_min, zone_count, seed) in (1u32..40, 1u32..80, 0u32..100),
        ) {
            let span = |a: f64, b: f64, size: u32| {
                let low = (a.min(b) * f64::from(size)) as u32;
                (low, ((a.max(b) * f64::from(size)) as u32).max(low + 1))
            };
            let (x0, x1) = span(crop[0], crop[1], width);
            let (y0, y1) = span(crop[2], crop[3], height);
            let frame = Rect::new(x0, y0, x1, y1);
            let map = blobs(Rect::of_size(width, height), frame, seed);
            let readings = Level::ALL.map(|level| (level, Balance::Time)).into_iter();
            for (level, balance) in readings.chain([(Level::Balanced, Balance::Ratio)]) {
                let mut settings = settings(level, side_min, zone_count);
                settings.limits.balance = balance;
                let partition = Partition::new(&map, frame, &settings);
                let mut hits = vec![0; frame.area() as usize];
                for zone in partition.zones() {
                    prop_assert!(zone.width() >= side_min.min(frame.width()));
                    prop_assert!(zone.height() >= side_min.min(frame.height()));
                    zone.pixels().for_each(|(x, y)| hits[frame.index(x, y)] += 1);
                }
                prop_assert!(hits.iter().all(|&hits| hits == 1));
                prop_assert_eq!(&Partition::new(&map, frame, &settings), &partition);
                // It panics where it does not cover the frame.
                for side in [1, 7, 32] {
                    let along = partition.clone().along_grid(side);
                    let is_on = |at: u32, low: u32, high: u32| at == low || at == high || at.is_multiple_of(side);
                    for zone in along.zones() {
                        prop_assert!([zone.x0, zone.x1].iter().all(|&x| is_on(x, frame.x0, frame.x1)));
                        prop_assert!([zone.y0, zone.y1].iter().all(|&y| is_on(y, frame.y0, frame.y1)));
                    }
                    prop_assert!(side > 1 || along == partition);
                }
            }
        }
    }
}
