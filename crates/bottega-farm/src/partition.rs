//! From the importance map to zones, in three levels, each working on the result of the one before.
//!
//! Source: MAGarRO, section 3.3: recursive division by minimum size and maximum complexity; joining of neighbours of
//! similar complexity; balancing, "to obtain tasks that all require roughly the same rendering time".

mod balance;
mod cut;
mod join;

use std::str::FromStr;

use bottega_image::{Rect, Sides};

use self::cut::{cut_x, cut_y};
use crate::{ImportanceMap, ZoneId};

/// How far the partition is carried.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Level {
    /// No partition: the whole frame is one zone.
    Whole,
    /// Recursive division by minimum size and maximum complexity (the paper's first level).
    Divided,
    /// Neighbouring zones of similar complexity joined (the second level).
    Joined,
    /// All zones of nearly the same expected time (the third level).
    #[default]
    Balanced,
}

impl Level {
    /// All levels, from 0 to 3.
    pub const ALL: [Self; 4] = [Self::Whole, Self::Divided, Self::Joined, Self::Balanced];
}

impl FromStr for Level {
    type Err = UnknownLevel;

    fn from_str(text: &str) -> Result<Self, UnknownLevel> {
        match text {
            "0" => Ok(Self::Whole),
            "1" => Ok(Self::Divided),
            "2" => Ok(Self::Joined),
            "3" => Ok(Self::Balanced),
            _ => Err(UnknownLevel { found: text.to_owned() }),
        }
    }
}

/// No such level of partition.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown partition level `{found}`: use 0, 1, 2 or 3")]
pub struct UnknownLevel {
    /// What was asked for.
    pub found: String,
}

/// What the Analyst aims at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartitionSettings {
    /// How far to go.
    pub level: Level,
    /// The least width and height of a zone, in pixels. Only a frame that is itself smaller has smaller zones.
    pub side_min: u32,
    /// How many zones are wanted. The maximum complexity of a zone (first level) and the expected time that all
    /// should have (third level) are the frame's complexity divided by it.
    pub zone_count: u32,
    /// So many zones are wanted at least, however dear they are: one for each agent.
    pub zones_least: u32,
    /// Level 2 joins zones whose costs a pixel differ by at most this share of the greater one.
    pub similarity: f64,
    /// Level 2 joins nothing to more than this multiple of the maximum complexity. (The paper names no bound; without
    /// one an even scene becomes one zone.)
    pub joined_max: f64,
}

impl PartitionSettings {
    /// Enough zones for so many agents that none waits at the end for another, but none so small that its messages
    /// cost more than its pixels.
    pub fn for_agents(level: Level, agents: usize, frame: Rect) -> Self {
        const ZONES_PER_AGENT: u64 = 8;
        const ZONES_MIN: u64 = 16;
        const ZONES_MAX: u64 = 1 << 16;
        const PIXELS_PER_ZONE_MIN: u64 = 1024;
        let wanted = (agents as u64).saturating_mul(ZONES_PER_AGENT).clamp(ZONES_MIN, ZONES_MAX);
        let affordable = (frame.area() / PIXELS_PER_ZONE_MIN).max(1);
        let zone_count = wanted.min(affordable) as u32;
        let zones_least = (agents.max(1) as u64).min(zone_count.into()) as u32;
        Self { level, side_min: 8, zone_count, zones_least, similarity: 0.15, joined_max: 2.0 }
    }
}

/// A frame cut into zones: rectangles that cover each of its pixels exactly once, ordered by upper left corner, row
/// before column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Partition {
    frame: Rect,
    zones: Vec<Rect>,
}

impl Partition {
    /// Cuts `frame`. The result depends on nothing but the arguments. An empty frame has no zones.
    pub fn new(map: &ImportanceMap, frame: Rect, settings: &PartitionSettings) -> Self {
        if frame.is_empty() {
            return Self { frame, zones: Vec::new() };
        }
        let mut zones = vec![frame];
        let time_wanted = map.complexity(&frame) / f64::from(settings.zone_count.max(1));
        let side_min = settings.side_min.max(1);
        if settings.level >= Level::Divided {
            zones = divide(map, frame, side_min, time_wanted);
        }
        if settings.level >= Level::Joined {
            zones = join::join(map, zones, settings.similarity, time_wanted * settings.joined_max);
        }
        if settings.level >= Level::Balanced {
            zones = balance::balance(map, frame, &zones, side_min, time_wanted);
        }
        Self::of_zones(frame, zones)
    }

    /// The same with all edges within the frame at multiples of `side` pixels of the picture. Zones that are too small for that
    /// become part of others.
    #[must_use]
    pub fn along_grid(self, side: u32) -> Self {
        // Each edge of a zone goes where the same edges of all others go, so nothing overlaps and no hole is left.
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

    /// A partition that was made before. Panics when the zones do not cover the frame exactly once: see
    /// [`Partition::covers`] for rectangles of unknown origin.
    pub fn of_zones(frame: Rect, mut zones: Vec<Rect>) -> Self {
        zones.sort_unstable_by_key(|zone| (zone.y0, zone.x0));
        assert!(Self::covers(frame, &zones), "zones do not cover {frame} exactly once");
        Self { frame, zones }
    }

    /// Whether rectangles cover each pixel of a frame exactly once and lie nowhere else.
    pub fn covers(frame: Rect, zones: &[Rect]) -> bool {
        let area: u64 = zones.iter().map(Rect::area).sum();
        if area != frame.area() || zones.iter().any(|zone| zone.is_empty() || !frame.encloses(zone)) {
            return false;
        }
        // The areas add up, so they cover it when no two overlap.
        let index = ZoneIndex::new(frame, zones);
        zones.iter().enumerate().all(|(i, zone)| index.touching(zone).all(|j| j == i))
    }

    /// What is covered.
    pub fn frame(&self) -> Rect {
        self.frame
    }

    /// The zones by [`ZoneId`].
    pub fn zones(&self) -> &[Rect] {
        &self.zones
    }

    /// The zones with their ids.
    pub fn iter(&self) -> impl Iterator<Item = (ZoneId, Rect)> {
        self.zones.iter().enumerate().map(|(i, &rect)| (ZoneId::of_index(i), rect))
    }

    /// The expected time of the longest zone over the mean of all: 1 is perfect balance. At the third level it is at most 1.1
    /// unless the longest zone is too small to be cut, or its costs lie in too few pixels. 1 of no zones.
    pub fn imbalance(&self, map: &ImportanceMap) -> f64 {
        let longest = self.zones.iter().map(|zone| map.complexity(zone)).fold(0.0, f64::max);
        if self.zones.is_empty() { 1.0 } else { longest * self.zones.len() as f64 / map.complexity(&self.frame) }
    }

    /// How each zone differs from its neighbours.
    pub fn neighbor_differences(&self, map: &ImportanceMap) -> Vec<NeighborDifference> {
        let density: Vec<f64> = self.zones.iter().map(|zone| map.complexity_density(zone)).collect();
        let index = ZoneIndex::new(self.frame, &self.zones);
        let difference = |(i, zone): (usize, &Rect)| {
            // Of each side: the sum of differences by length, and the length.
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

/// The paper's Neighbor Difference: how much the cost a pixel of a zone differs from that of the zones that share an edge
/// with it, weighted by the length of the edge. 0 where there are none.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NeighborDifference {
    /// Over all its edges.
    pub mean: f64,
    /// Over the edges of each side.
    pub sides: Sides<f64>,
}

impl NeighborDifference {
    /// The same on all sides.
    pub fn all(difference: f64) -> Self {
        Self { mean: difference, sides: Sides::all(difference) }
    }
}

/// On which side of `a` the rectangle `b`, disjoint from it, has an edge with it, and how long that is in pixels.
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

/// First level: halves the longer side while a zone is too complex and both halves are large enough.
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

/// Finds rectangles by place: a grid of about as many cells as there are rectangles.
pub(crate) struct ZoneIndex<'a> {
    frame: Rect,
    zones: &'a [Rect],
    side: u32,
    columns: u32,
    cells: Vec<Vec<u32>>,
}

impl<'a> ZoneIndex<'a> {
    /// - `zones`: all within `frame`, which is not empty unless they are none.
    pub(crate) fn new(frame: Rect, zones: &'a [Rect]) -> Self {
        let area_per_zone = frame.area() / (zones.len() as u64).max(1);
        let side = (area_per_zone.isqrt() as u32).max(1);
        let columns = frame.width().div_ceil(side);
        let rows = frame.height().div_ceil(side);
        let mut cells = vec![Vec::new(); columns as usize * rows as usize];
        let mut index = Self { frame, zones, side, columns, cells: Vec::new() };
        for (i, zone) in zones.iter().enumerate() {
            for cell in index.cells_of(zone) {
                cells[cell].push(i as u32);
            }
        }
        index.cells = cells;
        index
    }

    fn cells_of(&self, rect: &Rect) -> impl Iterator<Item = usize> + use<> {
        let (frame, side, columns) = (self.frame, self.side, self.columns);
        let rect = rect.intersection(&frame).unwrap_or_default();
        let columns_hit =
            if rect.is_empty() { 0..0 } else { (rect.x0 - frame.x0) / side..(rect.x1 - frame.x0).div_ceil(side) };
        let rows_hit =
            if rect.is_empty() { 0..0 } else { (rect.y0 - frame.y0) / side..(rect.y1 - frame.y0).div_ceil(side) };
        rows_hit.flat_map(move |row| {
            columns_hit.clone().map(move |column| row as usize * columns as usize + column as usize)
        })
    }

    /// Indices of all rectangles that share a pixel with `rect`, ascending.
    pub(crate) fn touching(&self, rect: &Rect) -> impl Iterator<Item = usize> + use<> {
        let mut found: Vec<usize> = self
            .cells_of(rect)
            .flat_map(|cell| self.cells[cell].iter().map(|&i| i as usize))
            .filter(|&i| self.zones[i].intersection(rect).is_some())
            .collect();
        found.sort_unstable();
        found.dedup();
        found.into_iter()
    }
}

/// The multiple of `grid` that is nearest to a place.
pub(crate) fn nearest_multiple(at: u32, grid: u32) -> u32 {
    at.saturating_add(grid / 2) / grid.max(1) * grid.max(1)
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
        PartitionSettings { level, side_min, zone_count, zones_least: 1, similarity: 0.15, joined_max: 2.0 }
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
            for level in Level::ALL {
                let settings = settings(level, side_min, zone_count);
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
