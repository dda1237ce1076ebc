//! The second level: neighbours of similar complexity become one zone.

use std::collections::BTreeMap;

use bottega_image::Rect;

use crate::ImportanceMap;

/// Joins neighbours whose union is a rectangle, whose costs a pixel differ by at most `similarity` of the greater one
/// and whose joint complexity is at most `complexity_max`, until there are no more.
pub(super) fn join(map: &ImportanceMap, zones: Vec<Rect>, similarity: f64, complexity_max: f64) -> Vec<Rect> {
    let mut zones: BTreeMap<(u32, u32), Rect> = zones.into_iter().map(|zone| ((zone.y0, zone.x0), zone)).collect();
    loop {
        let count = zones.len();
        let corners: Vec<(u32, u32)> = zones.keys().copied().collect();
        for corner in corners {
            // A zone may have been joined to an earlier one, or have grown.
            let Some(&zone) = zones.get(&corner) else { continue };
            let right = zones.get(&(zone.y0, zone.x1)).filter(|other| other.y1 == zone.y1).copied();
            let below = zones.get(&(zone.y1, zone.x0)).filter(|other| other.x1 == zone.x1).copied();
            let alike = |other: &Rect| {
                let (a, b) = (map.complexity_density(&zone), map.complexity_density(other));
                (a - b).abs() <= similarity * a.max(b)
                    && map.complexity(&zone) + map.complexity(other) <= complexity_max
            };
            let partner = [right, below].into_iter().flatten().filter(alike).min_by(|a, b| {
                // The more similar one; to the right when both are equally so.
                let difference = |other: &Rect| (map.complexity_density(other) - map.complexity_density(&zone)).abs();
                difference(a).total_cmp(&difference(b))
            });
            if let Some(other) = partner {
                zones.remove(&(other.y0, other.x0));
                zones.insert(corner, Rect { x1: other.x1, y1: other.y1, ..zone });
            }
        }
        if zones.len() == count {
            return zones.into_values().collect();
        }
    }
}
