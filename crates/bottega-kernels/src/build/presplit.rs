//! Splitting of triangles whose boxes are mostly empty, before the first stage, so that several tight boxes refer to
//! them.
//!
//! A long thin triangle at an angle fills little of its box, so most rays through the box miss it. Splitting the
//! box along its longest side (and the triangle with it) gives boxes of less total area. As in Karras and Aila 2013,
//! "Fast Parallel Construction of High-Quality Bounding Volume Hierarchies", section 4, split planes are taken from one
//! grid over the scene where possible, so that neighbors are split alike. Unlike there, the splits that save most area
//! come first, in a few rounds that threads may share, and none that saves less than a quarter of an average triangle's
//! area; evenly tessellated meshes stay unsplit.
//!
//! The measure is the area without the box's largest face. An axis-aligned wall is all largest face: a ray into its box
//! ends there, and everything in the wall is tested at once. Splitting it only puts it into many leaves (measured: a
//! fifth more steps in a room of such walls).

use super::item::Item;
use crate::Aabb;
use glam::Vec3;
use rayon::prelude::*;
use std::cmp::Ordering;
use std::ops::Range;

/// Least saving of a split, as a share of an average triangle box's area.
const WORTHWHILE: f32 = 0.25;

/// Once this fraction of the budget is left, all of it is spent in one round.
const REST: usize = 16;

/// A possible split, and the area that it saves.
#[derive(Clone, Copy)]
struct Cut {
    saved: f32,
    /// Index of the item.
    index: u32,
}

impl Cut {
    /// Orders by decreasing saving.
    fn order(&self, other: &Self) -> Ordering {
        other.saved.total_cmp(&self.saved).then(self.index.cmp(&other.index))
    }
}

/// Splits items where it pays.
///
/// - `budget`: maximal number of items to add.
/// - `parallel`: use the threads of the current pool; the result does not depend on it.
/// - `corners`: corners of a triangle.
pub(super) fn presplit(
    items: &mut Vec<Item>,
    budget: usize,
    parallel: bool,
    corners: impl Fn(u32) -> [[f32; 3]; 3] + Sync,
) {
    let (scene, total) = survey(items, parallel);
    let least = WORTHWHILE * (total / items.len().max(1) as f64) as f32;
    // `whole`: the item is an unsplit triangle, which allows a quick bound before clipping.
    let consider = |items: &[Item], index: u32, whole: bool| {
        let item = &items[index as usize];
        let bounds = item.bounds();
        let most = thickness(&bounds);
        if most <= least || !least.is_finite() {
            return None;
        }
        let corners = corners(item.id());
        if whole && most - shadows(&corners) <= least {
            return None;
        }
        let halves = cut(&bounds, &scene)?;
        let halves = clipped(&bounds, &halves, &parallelogram(&corners));
        let saved = most - thickness(&halves[0]) - thickness(&halves[1]);
        (saved > least).then_some(Cut { saved, index })
    };
    let parts = |items: &[Item], made: &Cut| {
        let item = &items[made.index as usize];
        let bounds = item.bounds();
        let halves = cut(&bounds, &scene)?;
        Some(clipped(&bounds, &halves, &corners(item.id())).map(|half| Item::new(&half, item.id())))
    };
    let mut left = budget.min((u32::MAX as usize).saturating_sub(items.len()));
    // Find the first candidates
    let mut cuts = collect(0..items.len() as u32, parallel, |index| consider(items, index, true));
    while left > 0 && !cuts.is_empty() {
        // Keep no more candidates than the budget allows.
        keep_first(&mut cuts, left, parallel);
        // Make the best half, so that their parts compete with the other candidates in the next round.
        let count = if left > budget / REST { left.div_ceil(2) } else { left };
        let rest = keep_first(&mut cuts, count, parallel);
        left -= cuts.len();
        let halves = collect(0..cuts.len() as u32, parallel, |made| parts(items, &cuts[made as usize]));
        let first = items.len() as u32;
        items.reserve_exact(halves.len());
        for (made, [half, other]) in cuts.iter().zip(halves) {
            items[made.index as usize] = half;
            items.push(other);
        }
        if left == 0 {
            break;
        }
        // Consider splitting the new parts
        let fresh = collect(0..2 * cuts.len() as u32, parallel, |half| {
            let made = half / 2;
            consider(items, if half % 2 == 0 { cuts[made as usize].index } else { first + made }, false)
        });
        cuts = rest;
        cuts.extend(fresh);
    }
}

/// Collects the results of `find` that are not `None`, in the order of the numbers.
fn collect<T: Send>(numbers: Range<u32>, parallel: bool, find: impl Fn(u32) -> Option<T> + Sync) -> Vec<T> {
    if parallel {
        numbers.into_par_iter().with_min_len(1024).filter_map(&find).collect()
    } else {
        numbers.filter_map(&find).collect()
    }
}

/// Keeps the best `count` cuts, in the order of the items, and returns the rest.
fn keep_first(cuts: &mut Vec<Cut>, count: usize, parallel: bool) -> Vec<Cut> {
    if count >= cuts.len() {
        return Vec::new();
    }
    cuts.select_nth_unstable_by(count, Cut::order);
    let rest = cuts.split_off(count);
    // Sort by item for locality, and because the order after selection is unspecified.
    if parallel {
        cuts.par_sort_unstable_by_key(|cut| cut.index);
    } else {
        cuts.sort_unstable_by_key(|cut| cut.index);
    }
    rest
}

/// Returns the box around all items and the sum of their half areas, summed in fixed pieces and so independent of
/// threads.
fn survey(items: &[Item], parallel: bool) -> (Aabb, f64) {
    let piece = |items: &[Item]| {
        items.iter().fold((Aabb::EMPTY, 0.0), |(all, sum), item| {
            let bounds = item.bounds();
            (all.union(&bounds), sum + f64::from(bounds.half_area()))
        })
    };
    const PIECE: usize = 1 << 16;
    let pieces: Vec<(Aabb, f64)> =
        if parallel { items.par_chunks(PIECE).map(piece).collect() } else { items.chunks(PIECE).map(piece).collect() };
    pieces.iter().fold((Aabb::EMPTY, 0.0), |(all, sum), piece| (all.union(&piece.0), sum + piece.1))
}

/// Returns half the surface area without the largest face: 0 for a flat box.
fn thickness(bounds: &Aabb) -> f32 {
    let d = bounds.max - bounds.min;
    let faces = [d.x * d.y, d.y * d.z, d.z * d.x];
    faces[0] + faces[1] + faces[2] - faces[0].max(faces[1]).max(faces[2])
}

/// Returns the limit of [`thickness`] when the triangle's [`parallelogram`] is split into ever more boxes: its
/// projected areas along the axes, without the largest.
fn shadows(corners: &[[f32; 3]; 3]) -> f32 {
    let [a, b, c] = corners.map(Vec3::from);
    let shadows = (b - a).cross(c - a).abs();
    shadows.element_sum() - shadows.max_element()
}

/// Returns the triangle and its mirror image at the longest side. Most triangles are halves of such a shape, and as
/// both halves share a leaf, cutting away the other half saves nothing.
fn parallelogram(corners: &[[f32; 3]; 3]) -> [[f32; 3]; 4] {
    let length = |i: usize| -> f32 { (0..3).map(|k| (corners[(i + 1) % 3][k] - corners[i][k]).powi(2)).sum() };
    let longest =
        if length(0) >= length(1) && length(0) >= length(2) { 0 } else { 1 + usize::from(length(2) > length(1)) };
    let [a, b, c] = std::array::from_fn(|i| corners[(longest + i) % 3]);
    [a, std::array::from_fn(|k| a[k] + b[k] - c[k]), b, c]
}

/// Returns the two halves of a box; `None` if it cannot be split.
fn cut(bounds: &Aabb, scene: &Aabb) -> Option<[Aabb; 2]> {
    let size = bounds.max - bounds.min;
    let axis = if size.x >= size.y && size.x >= size.z { 0 } else { 1 + usize::from(size.z > size.y) };
    let plane = grid_plane(bounds.min[axis], bounds.max[axis], scene.min[axis], scene.max[axis]);
    if !(bounds.min[axis] < plane && plane < bounds.max[axis]) {
        return None;
    }
    let (mut low, mut high) = (*bounds, *bounds);
    low.max[axis] = plane;
    high.min[axis] = plane;
    Some([low, high])
}

/// Returns the plane of the coarsest power-of-two grid over the scene that lies in the middle half of an interval, or
/// else its middle.
fn grid_plane(low: f32, high: f32, scene_low: f32, scene_high: f32) -> f32 {
    const CELLS: f32 = 1_048_576.0;
    let (middle, quarter) = (low + (high - low) * 0.5, (high - low) * 0.25);
    let cell = |x: f32| ((x - scene_low) / (scene_high - scene_low) * CELLS) as u32;
    let (a, b) = (cell(middle - quarter), cell(middle + quarter));
    if a == b {
        return middle;
    }
    let bit = 31 - (a ^ b).leading_zeros();
    let plane = scene_low + (b >> bit << bit) as f32 / CELLS * (scene_high - scene_low);
    if middle - quarter <= plane && plane <= middle + quarter { plane } else { middle }
}

/// Returns conservative boxes around the parts of a convex polygon in both halves of `bounds`.
fn clipped(bounds: &Aabb, halves: &[Aabb; 2], corners: &[[f32; 3]]) -> [Aabb; 2] {
    let (mut polygon, mut other) = (Polygon::new(corners), Polygon::EMPTY);
    let (mut polygon, mut other) = (&mut polygon, &mut other);
    let (low, high) = polygon.extent();
    // Clip the polygon to the box
    for axis in 0..3 {
        for (sign, limit, beyond) in [
            (1.0, f64::from(bounds.min[axis]), low[axis] < f64::from(bounds.min[axis])),
            (-1.0, f64::from(bounds.max[axis]), high[axis] > f64::from(bounds.max[axis])),
        ] {
            if beyond {
                polygon.clip(axis, sign, limit, other);
                std::mem::swap(&mut polygon, &mut other);
            }
        }
    }
    // Divide it at the split plane
    let axis = if halves[0].max.x < bounds.max.x { 0 } else { 1 + usize::from(halves[0].max.z < bounds.max.z) };
    let parts = polygon.divided(axis, f64::from(halves[0].max[axis]));
    std::array::from_fn(|half| {
        let (low, high) = parts[half];
        let around = &halves[half];
        if low[0] > high[0] {
            return *around;
        }
        let limit = |x: f32, axis: usize| x.clamp(around.min[axis], around.max[axis]);
        Aabb {
            min: Vec3::from_array(std::array::from_fn(|axis| limit((low[axis] as f32).next_down(), axis))),
            max: Vec3::from_array(std::array::from_fn(|axis| limit((high[axis] as f32).next_up(), axis))),
        }
    })
}

/// Four corners, and two more for each of six planes, though an exactly convex polygon gains at most one.
const CORNERS: usize = 16;

/// Least and greatest coordinates of points.
type PointBounds = ([f64; 3], [f64; 3]);

const NOTHING: PointBounds = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);

#[inline(always)]
fn widen(span: &mut PointBounds, point: &[f64; 3]) {
    // Compiles to one instruction each; `min` and `max` also check for NaN.
    for (low, &x) in span.0.iter_mut().zip(point) {
        *low = if x < *low { x } else { *low };
    }
    for (high, &x) in span.1.iter_mut().zip(point) {
        *high = if x > *high { x } else { *high };
    }
}

/// A convex polygon.
struct Polygon {
    points: [[f64; 3]; CORNERS],
    count: usize,
}

impl Polygon {
    const EMPTY: Self = Self { points: [[0.0; 3]; CORNERS], count: 0 };

    fn new(corners: &[[f32; 3]]) -> Self {
        let mut polygon = Self::EMPTY;
        for corner in corners {
            polygon.push(corner.map(f64::from));
        }
        polygon
    }

    fn points(&self) -> &[[f64; 3]] {
        &self.points[..self.count]
    }

    fn extent(&self) -> PointBounds {
        let mut all = NOTHING;
        for point in self.points() {
            widen(&mut all, point);
        }
        all
    }

    #[inline(always)]
    fn push(&mut self, point: [f64; 3]) {
        if let Some(slot) = self.points.get_mut(self.count) {
            *slot = point;
            self.count += 1;
        }
    }

    /// Clips to the part where `sign · (p − limit) >= 0` on an axis (Sutherland and Hodgman 1974).
    fn clip(&self, axis: usize, sign: f64, limit: f64, out: &mut Self) {
        out.count = 0;
        let Some(mut p) = self.points().last() else { return };
        let distance = |p: &[f64; 3]| sign * (p[axis] - limit);
        let mut dp = distance(p);
        for q in self.points() {
            let dq = distance(q);
            if (dp < 0.0) != (dq < 0.0) && dp != 0.0 && dq != 0.0 {
                out.push(crossing(p, q, dp / (dp - dq), axis, limit));
            }
            if dq >= 0.0 {
                out.push(*q);
            }
            (p, dp) = (q, dq);
        }
    }

    /// Returns the bounds of the parts on both sides of a plane perpendicular to an axis.
    fn divided(&self, axis: usize, plane: f64) -> [PointBounds; 2] {
        let mut parts = [NOTHING; 2];
        let Some(mut p) = self.points().last() else { return parts };
        for q in self.points() {
            let (dp, dq) = (p[axis] - plane, q[axis] - plane);
            if (dp < 0.0) != (dq < 0.0) && dp != 0.0 && dq != 0.0 {
                let x = crossing(p, q, dp / (dp - dq), axis, plane);
                parts.iter_mut().for_each(|part| widen(part, &x));
            }
            if dq <= 0.0 {
                widen(&mut parts[0], q);
            }
            if dq >= 0.0 {
                widen(&mut parts[1], q);
            }
            p = q;
        }
        parts
    }
}

/// Returns the intersection of an edge with a plane perpendicular to an axis.
#[inline(always)]
fn crossing(p: &[f64; 3], q: &[f64; 3], t: f64, axis: usize, plane: f64) -> [f64; 3] {
    let mut x = std::array::from_fn(|k| p[k] + (q[k] - p[k]) * t);
    x[axis] = plane;
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(corners: &[[f32; 3]; 3], id: u32) -> Item {
        Item::new(&corners.iter().fold(Aabb::EMPTY, |b, &p| b.with(Vec3::from(p))), id)
    }

    #[test]
    fn a_long_thin_triangle_is_cut_and_its_parts_still_cover_it() {
        let long = [[0.0, 0.0, 0.0], [8.0, 7.0, 9.0], [8.0, 7.1, 9.0]];
        let small = |i: u32| [[i as f32, 0.0, 0.0], [i as f32 + 0.1, 0.0, 0.0], [i as f32, 0.1, 0.1]];
        let corners = |id: u32| if id == 0 { long } else { small(id) };
        let mut items: Vec<Item> = (0..9).map(|id| item(&corners(id), id)).collect();
        presplit(&mut items, 100, false, corners);
        let parts: Vec<Aabb> = items.iter().filter(|item| item.id() == 0).map(Item::bounds).collect();
        assert!(parts.len() >= 4 && items.len() == parts.len() + 8, "{} parts of {}", parts.len(), items.len());
        for i in 0..1000 {
            let (s, t) = (i as f32 / 999.0, (i * 37 % 1000) as f32 / 999.0);
            let p = Vec3::from(long[1]).lerp(Vec3::from(long[2]), t) * s;
            let inside = |b: &Aabb| p.cmpge(b.min - 1e-5).all() && p.cmple(b.max + 1e-5).all();
            assert!(parts.iter().any(inside), "{p} is in no part");
        }
        let area: f32 = parts.iter().map(Aabb::half_area).sum();
        assert!(area < 0.5 * item(&long, 0).bounds().half_area());
    }

    #[test]
    fn an_even_mesh_is_left_alone_and_the_budget_is_kept() {
        let even = |id: u32| [[id as f32, 0.0, 0.0], [id as f32 + 1.0, 0.0, 1.0], [id as f32, 1.0, 0.0]];
        let mut items: Vec<Item> = (0..50).map(|id| item(&even(id), id)).collect();
        presplit(&mut items, 20, true, even);
        assert_eq!(items.len(), 50);
        let long = |id: u32| if id < 3 { [[0.0; 3], [9.0, 9.0, 9.0], [9.0, 9.1, 9.0]] } else { even(id) };
        let mut items: Vec<Item> = (0..50).map(|id| item(&long(id), id)).collect();
        presplit(&mut items, 5, true, long);
        assert_eq!(items.len(), 55);
    }
}
