//! The third level: zones that all take nearly the same time.

use bottega_image::Rect;

use super::cut::{cut_x, cut_y};
use crate::ImportanceMap;

/// How far the expected time a zone on either side of a cut may be from the one wanted, for the sake of an edge that
/// the level before found. Half of the ±10 % that are promised: the rest is for pixels, which cannot be cut.
const SNAP_TOLERANCE: f64 = 0.05;

/// Moves, splits and merges until each zone has nearly the complexity `time_wanted`, where the minimum size allows.
///
/// The frame is cut in proportion to the expected time of both sides, recursively. A cut falls on an edge between
/// zones of the level before where one lies near enough, so that zones stay even within; elsewhere the edge is
/// moved to where balance wants it. Between any two cuts no error is passed on: each aims at `time_wanted` anew.
pub(super) fn balance(map: &ImportanceMap, frame: Rect, zones: &[Rect], side_min: u32, time_wanted: f64) -> Vec<Rect> {
    let count = ((map.complexity(&frame) / time_wanted).round() as u64).clamp(1, u64::from(u32::MAX));
    let mut balanced = Vec::new();
    let mut open = vec![Region { rect: frame, count, within: zones.to_vec() }];
    let balancer = Balancer { map, side_min, time_wanted: map.complexity(&frame) / count as f64 };
    while let Some(region) = open.pop() {
        match balancer.cut(&region) {
            Some(parts) => open.extend(parts),
            None => balanced.push(region.rect),
        }
    }
    balanced
}

/// A part of the frame that is still to be cut into `count` zones.
struct Region {
    rect: Rect,
    count: u64,
    /// The zones of the level before that lie in it, whole or in part.
    within: Vec<Rect>,
}

struct Balancer<'a> {
    map: &'a ImportanceMap,
    side_min: u32,
    time_wanted: f64,
}

impl Balancer<'_> {
    /// Cuts a region in two; `None` when it is a zone.
    fn cut(&self, region: &Region) -> Option<[Region; 2]> {
        let Region { rect, count, .. } = *region;
        if count < 2 {
            return None;
        }
        let (wide, high) = (rect.width() / 2 >= self.side_min, rect.height() / 2 >= self.side_min);
        let along_x = match (wide, high) {
            (false, false) => return None,
            (wide, high) => wide && (!high || rect.width() >= rect.height()),
        };
        let (low, high) = if along_x { (rect.x0, rect.x1) } else { (rect.y0, rect.y1) };
        let (low, high) = (low + self.side_min, high - self.side_min);
        let halves = |at: u32| if along_x { cut_x(rect, at) } else { cut_y(rect, at) };
        let before = |at: u32| self.map.complexity(&halves(at)[0]);

        // The last place at which the first side has no more than its share, and the one after it.
        let share = self.map.complexity(&rect) * (count / 2) as f64 / count as f64;
        let (mut lower, mut upper) = (low, high);
        while lower < upper {
            let middle = lower + (upper - lower).div_ceil(2);
            if before(middle) <= share { lower = middle } else { upper = middle - 1 }
        }
        let next = (lower + 1).min(high);
        let exact = if before(next) - share < share - before(lower) { next } else { lower };
        let at = self.snapped(region, along_x, exact, low..=high);
        Some(self.parts(region, halves(at)))
    }

    /// The edge of the level before that is nearest to `exact` and keeps the balance; `exact` when there is none.
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

    /// Both sides, with as many zones as their complexity and size want.
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

    /// How many zones of minimum size find room.
    fn capacity(&self, rect: &Rect) -> u64 {
        let along = |side: u32| u64::from((side / self.side_min).max(1));
        along(rect.width()) * along(rect.height())
    }
}
