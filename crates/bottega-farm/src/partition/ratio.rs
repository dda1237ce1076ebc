//! Level 3 of the partition, read literally: zones with nearly equal complexity/size ratios.

use std::collections::BTreeSet;

use bottega_image::Rect;

use super::cut::{cut_x, cut_y};
use crate::ImportanceMap;

/// Maximum aspect ratio of a zone, unless what it is cut from is slimmer.
const ASPECT_MAX: f64 = 4.0;
/// Minimum share of the cut side for the shorter part, so that zones do not differ much in size.
const PART_MIN: f64 = 1.0 / 3.0;

/// Cuts `frame` into `count` zones of nearly equal complexity per pixel, where the minimum size allows.
///
/// Cuts each region, recursively, where both sides are most similar in complexity per pixel; of equal cuts at an edge
/// of level 2, else nearest to the middle. The zone count is divided in proportion to the sizes.
pub(super) fn even_out(map: &ImportanceMap, frame: Rect, zones: &[Rect], side_min: u32, count: u32) -> Vec<Rect> {
    let mut even = Vec::new();
    let mut open = vec![(frame, count, zones.to_vec())];
    while let Some((rect, count, within)) = open.pop() {
        let cut = if count < 2 { None } else { best_cut(map, rect, side_min, &within) };
        let Some(parts) = cut else {
            even.push(rect);
            continue;
        };
        let share = parts[0].area() as f64 / rect.area() as f64;
        let first = ((f64::from(count) * share).round() as u32).clamp(1, count - 1);
        let lies_in = |part: &Rect| within.iter().filter(|zone| zone.intersection(part).is_some()).copied().collect();
        open.extend([(parts[0], first, lies_in(&parts[0])), (parts[1], count - first, lies_in(&parts[1]))]);
    }
    even
}

/// Returns the two parts of a region at its best cut; `None` if the minimum size allows none.
fn best_cut(map: &ImportanceMap, rect: Rect, side_min: u32, within: &[Rect]) -> Option<[Rect; 2]> {
    let places = |low: u32, high: u32| {
        let part = ((f64::from(high - low) * PART_MIN) as u32).max(side_min);
        // Empty if two parts do not fit.
        low + part..=high.saturating_sub(part)
    };
    let is_slim = |rect: &Rect| {
        let (short, long) = (rect.width().min(rect.height()), rect.width().max(rect.height()));
        f64::from(long) > ASPECT_MAX * f64::from(short)
    };
    // List all cuts across and along the region
    let columns: BTreeSet<u32> = within.iter().map(|zone| zone.x0).collect();
    let rows: BTreeSet<u32> = within.iter().map(|zone| zone.y0).collect();
    let across = places(rect.x0, rect.x1)
        .map(|x| (cut_x(rect, x), columns.contains(&x), x.abs_diff(rect.x0 + rect.width() / 2)));
    let along =
        places(rect.y0, rect.y1).map(|y| (cut_y(rect, y), rows.contains(&y), y.abs_diff(rect.y0 + rect.height() / 2)));
    // Choose by: no slim part, most similar parts, edge of level 2, nearest to the middle
    let difference = |[a, b]: &[Rect; 2]| (map.complexity_density(a) - map.complexity_density(b)).abs();
    across
        .chain(along)
        .map(|(parts, is_edge, off)| (parts.iter().any(is_slim), difference(&parts), !is_edge, off, parts))
        .min_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).then((a.2, a.3).cmp(&(b.2, b.3))))
        .map(|(.., parts)| parts)
}
