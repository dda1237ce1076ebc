//! The light tree: choice of one light among many, by its estimated contribution at a point.
//!
//! A tree with up to four children per node. Sampling walks down from the root and chooses each child with a probability
//! proportional to an estimate of its light at the point.
//!
//! Source: Conty Estevez and Kulla 2018, *Importance Sampling of Many Lights with Adaptive Tree Splitting*, without the
//! splitting: each sample draws one light.

use std::f32::consts::{FRAC_PI_2, PI};

use bottega_kernels::{Aabb, math};
use glam::{Vec3, Vec4};

use super::{NO_LIGHT, Receiver, bounds::LightBounds};
use crate::bsdf::warp::ONE_MINUS_EPSILON;

/// Children per node: the lanes of a vector unit.
const WIDTH: usize = 4;
/// Number of buckets per axis in which splits are tried.
const BUCKETS: usize = 12;
/// Depth from which on nodes are halved by count, which bounds the depth for any input.
const BALANCED_DEPTH: usize = 48;
/// Smallest squared distance to a light, in squared scene units, which avoids division by 0.
pub const DISTANCE_SQUARED_MIN: f32 = 1e-20;

/// One value per child.
type Lanes = [f32; WIDTH];

/// A node: the [`LightBounds`] of each child, precomputed for sampling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightNode {
    /// Centre of the box.
    pub(crate) center: [Lanes; 3],
    /// Half-extents of the box.
    pub(crate) half: [Lanes; 3],
    /// Half-diagonal of the box.
    pub(crate) radius: Lanes,
    /// Axis of the cone of normals.
    pub(crate) axis: [Lanes; 3],
    /// Cosine and sine of the cone's half-angle.
    pub(crate) cos_spread: Lanes,
    pub(crate) sin_spread: Lanes,
    /// Cosine of the angle beyond the cone at which emission ends.
    pub(crate) cos_emission: Lanes,
    /// 1 if light is also emitted backwards, else −1.
    pub(crate) two_sided: Lanes,
    /// Share of the whole tree's intensity; 0 for a missing child.
    pub(crate) intensity: Lanes,
    /// Index of the child's node; [`NO_LIGHT`] for a leaf.
    pub(crate) child: [u32; WIDTH],
    /// End of each child's range of lights, which is the start of the next child's.
    pub(crate) end: [u32; WIDTH],
}

/// A tree over lights; lights are numbered in the order of its leaves.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightTree {
    /// The nodes, the root first; none for less than two lights.
    pub(crate) nodes: Vec<LightNode>,
    /// Number of lights.
    pub(crate) light_count: u32,
    /// Total intensity of all lights.
    pub(crate) intensity: f32,
}

/// An estimate of the light from each child of a node.
pub(super) trait Importance {
    /// Returns the estimates; 0 only if no light arrives.
    fn of(&self, children: &Children<'_>) -> Lanes;
}

/// The view of a node that an [`Importance`] gets.
pub(super) struct Children<'a>(&'a LightNode);

impl Importance for Receiver {
    #[inline(always)]
    fn of(&self, children: &Children<'_>) -> Lanes {
        let node = children.0;
        // For opaque surfaces, omit light from below the horizon
        if self.n == Vec3::ZERO { facing::<false>(node, self) } else { facing::<true>(node, self) }
    }
}

/// Returns cos max(0, a − b) for two angles in [0, π].
#[inline(always)]
fn cos_difference(cos_a: Vec4, sin_a: Vec4, cos_b: Vec4, sin_b: Vec4) -> Vec4 {
    Vec4::select(cos_a.cmpgt(cos_b), Vec4::ONE, cos_a * cos_b + sin_a * sin_b)
}

/// Returns sin max(0, a − b) for two angles in [0, π].
#[inline(always)]
fn sin_difference(cos_a: Vec4, sin_a: Vec4, cos_b: Vec4, sin_b: Vec4) -> Vec4 {
    Vec4::select(cos_a.cmpgt(cos_b), Vec4::ZERO, sin_a * cos_b - cos_a * sin_b)
}

#[inline(always)]
fn sqrt(v: Vec4) -> Vec4 {
    Vec4::from_array(v.to_array().map(f32::sqrt))
}

/// Returns √(1 − x²).
#[inline(always)]
fn co(x: Vec4) -> Vec4 {
    sqrt((Vec4::ONE - x * x).max(Vec4::ZERO))
}

/// Returns intensity over squared distance with bounds of both cosines (ibid., §4.2 and eq. 3), without branches, for all
/// children at once.
#[inline(always)]
fn facing<const ONE_SIDED: bool>(node: &LightNode, receiver: &Receiver) -> Lanes {
    let (p, n) = (receiver.p, receiver.n);
    let lanes = Vec4::from_array;
    // Squared distance to the centres of the boxes
    let (x, y, z) = (lanes(node.center[0]) - p.x, lanes(node.center[1]) - p.y, lanes(node.center[2]) - p.z);
    let squared = (x * x + y * y + z * z).max(Vec4::splat(DISTANCE_SQUARED_MIN));
    let inverse = Vec4::ONE / sqrt(squared);
    let radius = lanes(node.radius);
    // Angle of the box's bounding sphere; everything from within
    let is_inside = (radius * radius).cmpge(squared);
    let sin_box = radius * inverse;
    let cos_box = co(sin_box);
    // Bound the emission angle: least angle between the cone, widened by the box, and the point
    let [axis_x, axis_y, axis_z] = node.axis.map(lanes);
    let cos_axis = -(x * axis_x + y * axis_y + z * axis_z) * inverse;
    let cos_axis = Vec4::select(lanes(node.two_sided).cmpgt(Vec4::ZERO), cos_axis.abs(), cos_axis);
    let sin_axis = co(cos_axis);
    let (cos_spread, sin_spread) = (lanes(node.cos_spread), lanes(node.sin_spread));
    let cos_beyond = cos_difference(cos_axis, sin_axis, cos_spread, sin_spread);
    let sin_beyond = sin_difference(cos_axis, sin_axis, cos_spread, sin_spread);
    let cos_least = cos_difference(cos_beyond, sin_beyond, cos_box, sin_box);
    let cos_least = Vec4::select(is_inside, Vec4::ONE, cos_least);
    let seen = lanes(node.intensity) * cos_least / squared.max(radius * radius);
    let seen = Vec4::select(cos_least.cmpgt(lanes(node.cos_emission)), seen, Vec4::ZERO);
    if !ONE_SIDED {
        return seen.to_array();
    }
    // Bound the cosine at the receiver
    let above = x * n.x + y * n.y + z * n.z;
    let [half_x, half_y, half_z] = node.half.map(lanes);
    let reach = half_x * n.x.abs() + half_y * n.y.abs() + half_z * n.z.abs();
    let cos_receiver = above * inverse;
    let cos_receiver = cos_difference(cos_receiver, co(cos_receiver), cos_box, sin_box).max(Vec4::ZERO);
    let seen = seen * Vec4::select(is_inside, Vec4::ONE, cos_receiver);
    Vec4::select((above + reach).cmpgt(Vec4::ZERO), seen, Vec4::ZERO).to_array()
}

/// A segment of a ray along which a medium may scatter.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Segment {
    /// Start in world space.
    pub(crate) origin: Vec3,
    /// Direction, unit length.
    pub(crate) direction: Vec3,
    /// Length; may be infinite.
    pub(crate) length: f32,
}

impl Importance for Segment {
    /// Returns the integral of intensity over squared distance along the segment, as if all light came from the centre
    /// and in all directions.
    #[inline(always)]
    fn of(&self, children: &Children<'_>) -> Lanes {
        let node = children.0;
        std::array::from_fn(|i| {
            let center = Vec3::new(node.center[0][i], node.center[1][i], node.center[2][i]);
            let radius_squared = (node.radius[i] * node.radius[i]).max(DISTANCE_SQUARED_MIN);
            let arc = Arc::new(self, center, radius_squared);
            node.intensity[i] * arc.angle() / arc.distance
        })
    }
}

/// A segment as seen from a point: equiangular sampling of distances along it.
///
/// Source: Kulla and Fajardo 2012, *Importance Sampling Techniques for Path Tracing in Participating Media*, §4.1.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arc {
    /// Distance along the ray to the point nearest to the light.
    nearest: f32,
    /// Distance of the nearest point from the light.
    distance: f32,
    /// Angle of the segment's start seen from the light, in radians; `end`: of its end.
    start: f32,
    end: f32,
}

impl Arc {
    /// Creates the view of a segment from `place`.
    ///
    /// - `blur_squared`: added to the squared distance, for a light with extent.
    pub(crate) fn new(segment: &Segment, place: Vec3, blur_squared: f32) -> Self {
        let to_place = place - segment.origin;
        let nearest = to_place.dot(segment.direction);
        let offset = to_place - segment.direction * nearest;
        // On the axis the angle vanishes: keep a thousandth of the distance
        let least = 1e-6 * to_place.length_squared();
        let distance = (offset.length_squared() + blur_squared).max(least).max(DISTANCE_SQUARED_MIN).sqrt();
        let angle = |along: f32| math::atan2(along - nearest, distance);
        let end = if segment.length.is_finite() { angle(segment.length) } else { FRAC_PI_2 };
        Self { nearest, distance, start: angle(0.0), end }
    }

    fn angle(&self) -> f32 {
        (self.end - self.start).max(0.0)
    }

    /// Draws a distance along the segment.
    pub(crate) fn sample(&self, u: f32) -> f32 {
        (self.nearest + self.distance * math::tan(self.start + u * self.angle())).max(0.0)
    }

    /// Returns the density of a distance, per unit of length; 0 if the segment has no angular extent.
    pub(crate) fn pdf(&self, along: f32) -> f32 {
        let from_nearest = along - self.nearest;
        let angle = self.angle();
        if angle > 0.0 {
            self.distance / (angle * (self.distance * self.distance + from_nearest * from_nearest))
        } else {
            0.0
        }
    }
}

impl LightTree {
    /// Builds a tree over lights, all of positive intensity; returns it with the order of the lights in its leaves.
    pub(super) fn new(lights: &[LightBounds]) -> (Self, Vec<u32>) {
        let mut leaves: Vec<(LightBounds, u32)> = lights.iter().copied().zip(0..).collect();
        if leaves.is_empty() {
            return Default::default();
        }
        let mut binary = Vec::with_capacity(2 * leaves.len());
        split(&mut leaves, 0, &mut binary);
        let intensity = binary[0].bounds.intensity;
        let mut nodes = Vec::with_capacity(leaves.len().div_ceil(2));
        let mut first_light = 0;
        collapse(&binary, 0, intensity, &mut first_light, &mut nodes);
        let order = leaves.iter().map(|&(_, light)| light).collect();
        (Self { nodes, light_count: leaves.len() as u32, intensity }, order)
    }

    pub(super) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes)
    }

    /// Estimates the unoccluded illuminance by all lights; 0 only if no light arrives.
    #[inline(always)]
    pub(super) fn total(&self, receiver: &impl Importance) -> f32 {
        self.nodes.first().map_or(0.0, |root| receiver.of(&Children(root)).iter().sum::<f32>() * self.intensity)
    }

    /// Samples a light by a number in [0, 1); returns it with its probability. `None`: no light for this number.
    #[inline(always)]
    pub(super) fn sample(&self, receiver: &impl Importance, u: f32) -> Option<(u32, f32)> {
        if self.light_count <= 1 {
            // A single light needs no choice
            return (self.light_count == 1).then_some((0, 1.0));
        }
        self.descend(receiver, &self.nodes[0], 0, u)
    }

    /// Samples a light below a node by a number in [0, 1); for [`NO_LIGHT`] returns `first`, the part's only light.
    /// `None`: no light for this number.
    #[inline(always)]
    pub(super) fn sample_below(&self, receiver: &impl Importance, node: u32, first: u32, u: f32) -> Option<u32> {
        if node == NO_LIGHT {
            return Some(first);
        }
        Some(self.descend(receiver, self.nodes.get(node as usize)?, first, u)?.0)
    }

    /// Samples a light below a node whose first light is `first_light`; returns it with its probability there.
    #[inline(always)]
    fn descend<'a>(
        &'a self,
        receiver: &impl Importance,
        mut node: &'a LightNode,
        mut first_light: u32,
        mut u: f32,
    ) -> Option<(u32, f32)> {
        let mut pmf = 1.0;
        loop {
            let importance = receiver.of(&Children(node));
            let total: f32 = importance.iter().sum();
            if !(total > 0.0 && total.is_finite()) {
                return None;
            }
            // Choose a child by its importance
            let mut rest = u * total;
            let mut chosen = WIDTH;
            for (i, &part) in importance.iter().enumerate() {
                if part > 0.0 {
                    // Rounding may leave a remainder beyond the last child, which then takes it
                    let is_last = importance[i + 1..].iter().all(|&later| later <= 0.0);
                    if rest < part || is_last {
                        chosen = i;
                        break;
                    }
                    rest -= part;
                }
            }
            // Reuse the random number
            let part = importance[chosen];
            pmf *= part / total;
            u = (rest / part).min(ONE_MINUS_EPSILON);
            if node.child[chosen] == NO_LIGHT {
                let light = if chosen == 0 { first_light } else { node.end[chosen - 1] };
                return Some((light, pmf));
            }
            if chosen > 0 {
                first_light = node.end[chosen - 1];
            }
            node = &self.nodes[node.child[chosen] as usize];
        }
    }

    /// Returns the probability with which [`Self::sample`] chooses a light.
    #[inline(always)]
    pub(super) fn pmf(&self, receiver: &impl Importance, light: u32) -> f32 {
        if self.light_count <= 1 {
            return 1.0;
        }
        let mut pmf = 1.0;
        let mut node = &self.nodes[0];
        loop {
            let importance = receiver.of(&Children(node));
            let chosen = node.end.iter().position(|&end| light < end).unwrap_or(WIDTH - 1);
            let part = importance[chosen];
            if part <= 0.0 {
                return 0.0;
            }
            let total: f32 = importance.iter().sum();
            if !total.is_finite() {
                return 0.0;
            }
            pmf *= part / total;
            if node.child[chosen] == NO_LIGHT {
                return pmf;
            }
            node = &self.nodes[node.child[chosen] as usize];
        }
    }

    /// Returns the probability with which [`Self::sample`] chooses a light, and that of choosing it from node `top`, an
    /// ancestor; 1 for the latter if `top` is [`NO_LIGHT`].
    #[inline(always)]
    pub(super) fn pmfs(&self, receiver: &impl Importance, light: u32, top: u32) -> (f32, f32) {
        if self.light_count <= 1 {
            return (1.0, 1.0);
        }
        let (mut whole, mut below) = (1.0, 1.0);
        let mut number = 0;
        loop {
            if number == top {
                below = 1.0;
            }
            let node = &self.nodes[number as usize];
            let importance = receiver.of(&Children(node));
            let chosen = node.end.iter().position(|&end| light < end).unwrap_or(WIDTH - 1);
            let total: f32 = importance.iter().sum();
            if importance[chosen] <= 0.0 || !total.is_finite() {
                return (0.0, 0.0);
            }
            let part = importance[chosen] / total;
            whole *= part;
            below *= part;
            number = node.child[chosen];
            if number == NO_LIGHT {
                return (whole, if top == NO_LIGHT { 1.0 } else { below });
            }
        }
    }

    /// Returns the root as (node, first light, end of its lights); the node is [`NO_LIGHT`] for a single light. `None`:
    /// the tree has no lights.
    pub(super) fn root(&self) -> Option<(u32, u32, u32)> {
        let node = if self.light_count > 1 { 0 } else { NO_LIGHT };
        (self.light_count > 0).then_some((node, 0, self.light_count))
    }

    /// Returns the same for each child of a node, whose first light is `first`.
    pub(super) fn children(&self, node: u32, first: u32) -> impl Iterator<Item = (u32, u32, u32)> + '_ {
        let node = &self.nodes[node as usize];
        let firsts = std::iter::once(first).chain(node.end);
        let all = firsts.zip(node.end).zip(node.child).map(|((first, end), child)| (child, first, end));
        all.filter(|&(_, first, end)| first < end)
    }
}

/// A node of the binary tree: two children, or one light.
struct Binary {
    bounds: LightBounds,
    /// Index of the second child; the first one follows its parent. `None`: a light.
    second: Option<u32>,
}

/// Appends the binary tree over these lights, and sorts them into the order of its leaves.
fn split(leaves: &mut [(LightBounds, u32)], depth: usize, out: &mut Vec<Binary>) {
    let index = out.len();
    if let [(bounds, _)] = leaves {
        out.push(Binary { bounds: *bounds, second: None });
        return;
    }
    let bounds = around(leaves.iter().map(|(bounds, _)| bounds));
    out.push(Binary { bounds, second: Some(0) });
    let middle = partition(leaves, depth);
    let (first, second) = leaves.split_at_mut(middle);
    split(first, depth + 1, out);
    out[index].second = Some(out.len() as u32);
    split(second, depth + 1, out);
}

/// Returns the bounds of at least one light.
fn around<'a>(mut lights: impl Iterator<Item = &'a LightBounds>) -> LightBounds {
    let first = *lights.next().expect("a light");
    lights.fold(first, |all, bounds| all.union(bounds))
}

/// Partitions the lights into two children; returns the index where the second one starts.
fn partition(leaves: &mut [(LightBounds, u32)], depth: usize) -> usize {
    let centers = leaves.iter().fold(Aabb::EMPTY, |all, (bounds, _)| all.with(bounds.bounds.center()));
    let extent = centers.max - centers.min;
    // Find the split of least cost over all axes
    let mut best: Option<(f32, usize, usize)> = None;
    if depth < BALANCED_DEPTH {
        for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
            for (place, cost) in split_costs(leaves, &centers, axis) {
                // Penalize cuts along the short sides of a long box (ibid., K_r)
                let cost = cost * extent.max_element() / extent[axis];
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, place));
                }
            }
        }
    }
    // Without a split: halve by count along the longest axis
    let Some((_, axis, place)) = best else {
        let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap_or(0);
        let middle = leaves.len() / 2;
        leaves.select_nth_unstable_by(middle, |a, b| {
            let along = |bounds: &LightBounds| bounds.bounds.center()[axis];
            along(&a.0).total_cmp(&along(&b.0)).then(a.1.cmp(&b.1))
        });
        return middle;
    };
    // Partition stably, so that the order depends on the input alone
    let (first, second): (Vec<_>, Vec<_>) =
        leaves.iter().partition(|(bounds, _)| bucket(&centers, axis, bounds.bounds.center()) < place);
    let middle = first.len();
    leaves[..middle].copy_from_slice(&first);
    leaves[middle..].copy_from_slice(&second);
    middle
}

fn bucket(centers: &Aabb, axis: usize, center: Vec3) -> usize {
    let share = (center[axis] - centers.min[axis]) / (centers.max[axis] - centers.min[axis]);
    ((share * BUCKETS as f32) as usize).min(BUCKETS - 1)
}

/// Returns the costs of the splits before each bucket but the first, where both sides have lights.
fn split_costs(leaves: &[(LightBounds, u32)], centers: &Aabb, axis: usize) -> Vec<(usize, f32)> {
    let mut buckets: [Option<LightBounds>; BUCKETS] = [None; BUCKETS];
    for (bounds, _) in leaves {
        let bucket = &mut buckets[bucket(centers, axis, bounds.bounds.center())];
        *bucket = Some(bucket.map_or(*bounds, |all| all.union(bounds)));
    }
    let join = |a: Option<LightBounds>, b: Option<LightBounds>| match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    };
    let mut above = [None; BUCKETS];
    for i in (1..BUCKETS).rev() {
        above[i] = join(buckets[i], above.get(i + 1).copied().flatten());
    }
    let mut below = None;
    let mut costs = Vec::with_capacity(BUCKETS);
    for i in 1..BUCKETS {
        below = join(below, buckets[i - 1]);
        if let (Some(below), Some(above)) = (&below, &above[i]) {
            costs.push((i, below.cost() + above.cost()));
        }
    }
    costs
}

/// Appends a wide node for the binary node `index` and everything below it; returns its index.
///
/// - `first_light`: number of the first light below the node; afterwards that of the first light after it.
fn collapse(binary: &[Binary], index: u32, intensity: f32, first_light: &mut u32, nodes: &mut Vec<LightNode>) -> u32 {
    let mut children = vec![index];
    // Open the child with the highest cost until the node is full
    while children.len() < WIDTH {
        let inner = (0..children.len()).filter(|&i| binary[children[i] as usize].second.is_some());
        let cost = |i: usize| binary[children[i] as usize].bounds.cost();
        let Some(widest) = inner.max_by(|&a, &b| cost(a).total_cmp(&cost(b)).then(b.cmp(&a))) else { break };
        let opened = children[widest];
        let second = binary[opened as usize].second.unwrap_or(opened);
        children.splice(widest..=widest, [opened + 1, second]);
    }
    let place = nodes.len();
    nodes.push(LightNode::EMPTY);
    for (lane, &child) in children.iter().enumerate() {
        let binary_child = &binary[child as usize];
        nodes[place].set(lane, &binary_child.bounds, intensity);
        if binary_child.second.is_some() {
            nodes[place].child[lane] = collapse(binary, child, intensity, first_light, nodes);
        } else {
            *first_light += 1;
        }
        nodes[place].end[lane] = *first_light;
    }
    for lane in children.len()..WIDTH {
        nodes[place].end[lane] = *first_light;
    }
    place as u32
}

impl LightNode {
    const EMPTY: Self = Self {
        center: [[0.0; WIDTH]; 3],
        half: [[0.0; WIDTH]; 3],
        radius: [0.0; WIDTH],
        axis: [[0.0; WIDTH]; 3],
        cos_spread: [0.0; WIDTH],
        sin_spread: [0.0; WIDTH],
        cos_emission: [0.0; WIDTH],
        two_sided: [-1.0; WIDTH],
        intensity: [0.0; WIDTH],
        child: [NO_LIGHT; WIDTH],
        end: [0; WIDTH],
    };

    fn set(&mut self, lane: usize, bounds: &LightBounds, total_intensity: f32) {
        // Margin for rounding errors
        const MARGIN: f32 = 1e-4;
        let center = bounds.bounds.center();
        let half = (bounds.bounds.max - center).max(center - bounds.bounds.min) * (1.0 + MARGIN);
        let (sin, cos) = math::sin_cos((bounds.cone.angle + MARGIN).min(PI));
        for axis in 0..3 {
            self.center[axis][lane] = center[axis];
            self.half[axis][lane] = half[axis];
            self.axis[axis][lane] = bounds.cone.axis[axis];
        }
        self.radius[lane] = half.length();
        self.cos_spread[lane] = cos;
        self.sin_spread[lane] = sin.max(0.0);
        self.cos_emission[lane] = math::cos((bounds.emission_angle + MARGIN).min(PI));
        self.two_sided[lane] = if bounds.two_sided { 1.0 } else { -1.0 };
        self.intensity[lane] = bounds.intensity / total_intensity;
    }
}
