//! Level 2 of the partition: neighbors of similar complexity are joined.

use std::collections::BTreeMap;

use bottega_image::Rect;

use crate::ImportanceMap;

/// Joins neighbors whose union is a rectangle, whose costs per pixel differ by at most `similarity` of the greater one,
/// and whose joint complexity is at most `complexity_max`, until no such pair is left.
pub(super) fn join(map: &ImportanceMap, zones: Vec<Rect>, similarity: f64, complexity_max: f64) -> Vec<Rect> {
    let mut zones: BTreeMap<(u32, u32), Rect> = zones.into_iter().map(|zone| ((zone.y0, zone.x0), zone)).collect();
    loop {
        let count = zones.len();
        let corners: Vec<(u32, u32)> = zones.keys().copied().collect();
        for corner in corners {
            // Skip a zone that was joined to an earlier one
            let Some(&zone) = zones.get(&corner) else { continue };
            // Find the neighbors right and below whose union with it is a rectangle
            let right = zones.get(&(zone.y0, zone.x1)).filter(|other| other.y1 == zone.y1).copied();
            let below = zones.get(&(zone.y1, zone.x0)).filter(|other| other.x1 == zone.x1).copied();
            let alike = |other: &Rect| {
                let (a, b) = (map.complexity_density(&zone), map.complexity_density(other));
                (a - b).abs() <= similarity * a.max(b)
                    && map.complexity(&zone) + map.complexity(other) <= complexity_max
            };
            // Choose the more similar of those that are similar enough; of equal ones, the right
            let partner = [right, below].into_iter().flatten().filter(alike).min_by(|a, b| {
                let difference = |other: &Rect| (map.complexity_density(other) - map.complexity_density(&zone)).abs();
                difference(a).total_cmp(&difference(b))
            });
            // Join them
            if let Some(other) = partner {
                zones.remove(&(other.y0, other.x0));
                zones.insert(corner, Rect { x1: other.x1, y1: other.y1, ..zone });
            }
        }
        // Stop when a pass joins nothing
        if zones.len() == count {
            return zones.into_values().collect();
        }
    }
}
