//! Level 3 of the partition: zones of nearly equal expected time.

use bottega_image::Rect;

use super::cut::{cut_x, cut_y};
use crate::ImportanceMap;

/// Allowed deviation of the mean expected time per zone on either side of a cut, to reuse an edge of level 2. Half of
/// the ±10 % that level 3 guarantees: the rest is for pixels, which cannot be cut.
const SNAP_TOLERANCE: f64 = 0.05;

/// Cuts `frame` into zones of nearly the complexity `time_wanted`, where the minimum size allows.
///
/// Cuts the frame in two, recursively, in proportion to the expected times of both sides. A cut reuses an edge of level
/// 2 where one is near enough, so that zones stay uniform inside; elsewhere it lies where balance requires. Errors do
/// not accumulate: each cut aims at `time_wanted` itself.
pub(super) fn balance(map: &ImportanceMap, frame: Rect, zones: &[Rect], side_min: u32, time_wanted: f64) -> Vec<Rect> {
    // Compute the number of zones
    let count = ((map.complexity(&frame) / time_wanted).round() as u64).clamp(1, u64::from(u32::MAX));
    let mut balanced = Vec::new();
    let mut open = vec![Region { rect: frame, count, within: zones.to_vec() }];
    let balancer = Balancer { map, side_min, time_wanted: map.complexity(&frame) / count as f64 };
    // Cut each region until it is a single zone
    while let Some(region) = open.pop() {
        match balancer.cut(&region) {
            Some(parts) => open.extend(parts),
            None => balanced.push(region.rect),
        }
    }
    balanced
}

/// A part of the frame to cut into `count` zones.
struct Region {
    rect: Rect,
    count: u64,
    /// The zones of level 2 that overlap it.
    within: Vec<Rect>,
}

/// The parameters of the balancing.
struct Balancer<'a> {
    map: &'a ImportanceMap,
    side_min: u32,
    time_wanted: f64,
}

impl Balancer<'_> {
    /// Cuts a region in two; `None` if it is a single zone or too small to cut.
    fn cut(&self, region: &Region) -> Option<[Region; 2]> {
        let Region { rect, count, .. } = *region;
        if count < 2 {
            return None;
        }
        // Cut across the longer side that is long enough
        let (wide, high) = (rect.width() / 2 >= self.side_min, rect.height() / 2 >= self.side_min);
        let along_x = match (wide, high) {
            (false, false) => return None,
            (wide, high) => wide && (!high || rect.width() >= rect.height()),
        };
        let (low, high) = if along_x { (rect.x0, rect.x1) } else { (rect.y0, rect.y1) };
        let (low, high) = (low + self.side_min, high - self.side_min);
        let halves = |at: u32| if along_x { cut_x(rect, at) } else { cut_y(rect, at) };
        let before = |at: u32| self.map.complexity(&halves(at)[0]);

        // Find by bisection the last place at which the first side has at most its share, then take the nearer of it
        // and the next
        let share = self.map.complexity(&rect) * (count / 2) as f64 / count as f64;
        let (mut lower, mut upper) = (low, high);
        while lower < upper {
            let middle = lower + (upper - lower).div_ceil(2);
            if before(middle) <= share { lower = middle } else { upper = middle - 1 }
        }
        let next = (lower + 1).min(high);
        let exact = if before(next) - share < share - before(lower) { next } else { lower };
        // Snap the cut to an edge of level 2, if that keeps the balance
        let at = self.snapped(region, along_x, exact, low..=high);
        Some(self.parts(region, halves(at)))
    }

    /// Returns the edge of level 2 nearest to `exact` that keeps the balance; `exact` if there is none.
    fn snapped(&self, region: &Region, along_x: bool, exact: u32, allowed: std::ops::RangeInclusive<u32>) -> u32 {
        let edges = region.within.iter().map(|zone| if along_x { zone.x0 } else { zone.y0 });
        let first_count = (region.count / 2) as f64;
        let second_count = region.count as f64 - first_count;
        let in_balance = |at: &u32| {
            let [first, second] = if along_x { cut_x(region.rect, *at) } else { cut_y(region.rect, *at) };
            let off = |rect: &Rect, count: f64| (self.map.complexity(rect) / count / self.time_wanted - 1.0).abs();
            off(&first, first_count) <= SNAP_TOLERANCE && off(&second, second_count) <= SNAP_TOLERANCE
        };
        edges
            .filter(|at| allowed.contains(at))
            .filter(in_balance)
            .min_by_key(|&at| (at.abs_diff(exact), at))
            .unwrap_or(exact)
    }

    /// Returns both sides as regions, with zone counts in proportion to their complexities, within their capacities.
    fn parts(&self, region: &Region, [first, second]: [Rect; 2]) -> [Region; 2] {
        let share = self.map.complexity(&first) / (self.map.complexity(&first) + self.map.complexity(&second));
        let first_count = ((region.count as f64 * share).round() as u64).clamp(1, region.count - 1);
        let part = |rect: Rect, count: u64| Region {
            rect,
            count: count.min(self.capacity(&rect)),
            within: region.within.iter().filter(|zone| zone.intersection(&rect).is_some()).copied().collect(),
        };
        [part(first, first_count), part(second, region.count - first_count)]
    }

    /// Returns the number of zones of minimum size that fit.
    fn capacity(&self, rect: &Rect) -> u64 {
        let along = |side: u32| u64::from((side / self.side_min).max(1));
        along(rect.width()) * along(rect.height())
    }
}
