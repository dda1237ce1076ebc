//! Traversal of the tree by a ray, written once over [`lanes::Lanes`] and compiled for each vector unit.
//!
//! Robust mode has two parts. The *triangle* test is that of Woop, Benthin and Wald 2013, "Watertight Ray/Triangle
//! Intersection" (JCGT 2(1)): vertices are sheared into a space where the ray is the z axis; the sign of each edge
//! function then depends on edge and ray alone, and is the same for both triangles at the edge. Their fallback to
//! double precision is not needed for watertightness: rounding never flips a sign, it only makes zeros, and zero counts
//! as inside. The *box* test must never miss a box whose triangle is hit. A slab is one fused multiply-add of plane,
//! scale and shift. Instead of rounding each slab outward, `scale` and `shift` are made slightly too small for near
//! planes and slightly too large for far planes, once per ray: see [`setup`].
//!
//! The result does not depend on the order of visits: a box is skipped only if it is entered beyond the best hit, and a
//! hit never counts as closer than the entry of its leaf box (all boxes above are entered no later, as every operation
//! is monotone). So the lowest (t, instance, primitive) wins in any order.

pub(crate) mod lanes;
mod moving;
pub(crate) mod portable;
pub(crate) mod setup;
mod sphere;
pub(crate) mod stack;
mod triangle;

#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;

use crate::moving_tree::KeyPose;
use crate::tree::{Child, PlacedTree, SceneTrees, Sphere, TriangleBlock, WIDTH, WideNode};
use crate::{Hit, Ray};
use lanes::{LaneJob, Lanes};
use setup::PreparedRay;
use stack::{Stack, Storage};
use triangle::BlockHits;

/// A kind of ray query; the traversal is compiled for each.
pub(crate) trait Query {
    /// `true`: any hit ends the traversal.
    const ANY: bool;
    /// `true`: candidates must pass [`Query::accept`].
    const FILTERED: bool;
    /// `true`: the result depends neither on which hit it is nor on its position.
    const BLIND: bool = Self::ANY && !Self::FILTERED;
    fn accept(&self, _candidate: &Hit) -> bool {
        true
    }
    /// Counts a visit: called for each node and each leaf.
    #[inline(always)]
    fn visit(&mut self) {}
}

/// The query for the closest hit.
pub(crate) struct ClosestHit;
impl Query for ClosestHit {
    const ANY: bool = false;
    const FILTERED: bool = false;
}

/// The query for any hit.
pub(crate) struct AnyHit;
impl Query for AnyHit {
    const ANY: bool = true;
    const FILTERED: bool = false;
}

/// The query for the closest or any hit that a filter accepts.
pub(crate) struct FilteredHit<A, const ANY: bool>(pub(crate) A);
impl<A: Fn(&Hit) -> bool, const ANY: bool> Query for FilteredHit<A, ANY> {
    const ANY: bool = ANY;
    const FILTERED: bool = true;
    #[inline(always)]
    fn accept(&self, candidate: &Hit) -> bool {
        (self.0)(candidate)
    }
}

/// The query for the closest or any hit that counts visits.
pub(crate) struct CountedQuery<'a, const ANY: bool>(pub(crate) &'a mut u32);
impl<const ANY: bool> Query for CountedQuery<'_, ANY> {
    const ANY: bool = ANY;
    const FILTERED: bool = false;
    #[inline(always)]
    fn visit(&mut self) {
        *self.0 = self.0.saturating_add(1);
    }
}

/// The world space, in place of an instance index.
const WORLD: u32 = u32::MAX;

/// The best hit so far.
struct NearestHit {
    t: f32,
    /// [`WORLD`], or an instance with a tree of its own, or a sphere with its bit.
    space: u32,
    /// Triangle within that space; [`NOTHING`] if nothing was hit.
    id: u32,
    /// Lane of the hit in the arrays below.
    lane: usize,
    /// Barycentric coordinates times `det`, of the whole block; divided after traversal.
    u: [f32; WIDTH],
    v: [f32; WIDTH],
    det: [f32; WIDTH],
}

/// The triangle number of no hit.
const NOTHING: u32 = u32::MAX;

impl NearestHit {
    #[inline(always)]
    fn barycentric(&self) -> (f32, f32) {
        let lane = self.lane % WIDTH;
        (self.u[lane] / self.det[lane], self.v[lane] / self.det[lane])
    }
}

/// Returns instance and primitive in the caller's numbering.
#[inline(always)]
fn key(tree: &SceneTrees, space: u32, id: u32) -> (u32, u32) {
    if id == NOTHING {
        (u32::MAX, u32::MAX)
    } else if space == WORLD {
        tree.resolve(id)
    } else {
        (space, id)
    }
}

/// Returns true if the first of two hits at the same distance wins, given by space and number.
#[cold]
#[inline(never)]
fn key_is_lower(tree: &SceneTrees, (space, id): (u32, u32), (best_space, best_id): (u32, u32)) -> bool {
    key(tree, space, id) < key(tree, best_space, best_id)
}

/// The test of a sphere or instance leaf, run out of line.
struct OtherLeafJob<'a, S, Q, const ROBUST: bool> {
    traversal: &'a Traversal<'a, S, ROBUST>,
    leaf: Child,
    entry: f32,
    query: &'a mut Q,
    best: &'a mut NearestHit,
}

impl<S: Lanes, Q: Query, const ROBUST: bool> LaneJob for OtherLeafJob<'_, S, Q, ROBUST> {
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        let Self { traversal, leaf, entry, query, best } = self;
        if leaf.is_sphere() {
            traversal.sphere(leaf.index(), entry, query, best)
        } else {
            traversal.instance(&traversal.tree.placed[leaf.index()], entry, query, best)
        }
    }
}

/// The traversal of the trees of a mesh's keys, run out of line.
struct KeysJob<'a, S, Q, const ROBUST: bool> {
    traversal: &'a Traversal<'a, S, ROBUST>,
    root: Child,
    entry: f32,
    query: &'a mut Q,
    best: &'a mut NearestHit,
}

impl<S: Lanes, Q: Query, const ROBUST: bool> LaneJob for KeysJob<'_, S, Q, ROBUST> {
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        self.traversal.traverse::<Q, false, true>(self.root, self.entry, self.query, self.best)
    }
}

/// Traverses the whole scene. Returns [`Hit::NONE`] if nothing was hit; for [`Query::ANY`] only `is_some` is
/// meaningful.
#[inline(always)]
pub(crate) fn run<S: Lanes, Q: Query, const ROBUST: bool>(
    s: S,
    tree: &SceneTrees,
    ray: &Ray,
    time: f32,
    query: &mut Q,
) -> Hit {
    let t_min = if ray.t_min > 0.0 { ray.t_min } else { 0.0 };
    if ray.t_max.is_nan() || ray.t_max <= t_min {
        return Hit::NONE;
    }
    let [u, v, det] = [[0.0; WIDTH]; 3];
    let mut best = NearestHit { t: ray.t_max, space: WORLD, id: NOTHING, lane: 0, u, v, det };
    let traversal = Traversal::<S, ROBUST> { s, tree, ray, t_min, time, space: WORLD, pose: KeyPose::NONE };
    let found = traversal.traverse::<Q, true, false>(tree.root, t_min, query, &mut best);
    if !found {
        return Hit::NONE;
    }
    if Q::BLIND {
        return Hit { instance: 0, ..Hit::NONE };
    }
    let (instance, primitive) = key(tree, best.space, best.id);
    let (u, v) = best.barycentric();
    Hit { t: best.t, u, v, instance, primitive }
}

/// The constant state of traversing one tree.
#[derive(Clone, Copy)]
struct Traversal<'a, S, const ROBUST: bool> {
    s: S,
    tree: &'a SceneTrees,
    /// The ray in the tree's space.
    ray: &'a Ray,
    t_min: f32,
    /// Time of the ray.
    time: f32,
    /// [`WORLD`] or an instance.
    space: u32,
    /// The place of the time between the trees of a mesh whose vertices move.
    pose: KeyPose,
}

impl<S: Lanes, const ROBUST: bool> Traversal<'_, S, ROBUST> {
    /// Traverses the tree below `root`, which the ray enters at `floor`. Returns true if `best` was improved.
    ///
    /// - `TOP`: the tree of the world, which has spheres and instances.
    /// - `KEYS`: trees of a mesh whose vertices move.
    #[inline(always)]
    fn traverse<Q: Query, const TOP: bool, const KEYS: bool>(
        &self,
        root: Child,
        floor: f32,
        query: &mut Q,
        best: &mut NearestHit,
    ) -> bool {
        let s = self.s;
        // Prepare the ray for the box and triangle tests
        let Some(prepared) = PreparedRay::<S, ROBUST>::new(s, self.ray, floor, self.t_min) else { return false };
        let mut storage = Storage::new();
        let mut stack = Stack::new(&mut storage);
        let mut found = false;
        let mut limit = s.splat(best.t);
        let (mut current, mut entry) = (root, floor);
        loop {
            if current.is_node() {
                query.visit();
                let node = if KEYS { self.key_node(current) } else { self.tree.node(current) };
                // Prefetch the children, needed once the boxes are tested.
                s.prefetch::<1>((&raw const node.children).cast());
                // Test the boxes of the children, and continue with the nearest
                let (near, miss) = if KEYS {
                    prepared.boxes(s, &self.planes_between_keys(current), limit)
                } else {
                    prepared.boxes(s, &node.planes, limit)
                };
                if let Some(next) = self.choose::<Q>(node, near, miss, prepared.octant, &mut stack) {
                    (current, entry) = next;
                    continue;
                }
            // Test a leaf
            } else {
                let improved = if !TOP || current.is_triangles() {
                    if current == Child::EMPTY {
                        break;
                    }
                    query.visit();
                    self.triangles::<Q, KEYS>(current, entry, &prepared, limit, query, best)
                } else if current == Child::EMPTY {
                    break;
                } else {
                    query.visit();
                    s.apart(OtherLeafJob { traversal: self, leaf: current, entry, query, best })
                };
                if improved {
                    found = true;
                    if Q::ANY {
                        return true;
                    }
                    limit = s.splat(best.t);
                }
            }
            // Pop the next subtree that is not beyond the best hit
            loop {
                (current, entry) = stack.pop();
                if Q::BLIND || entry <= best.t {
                    break;
                }
            }
        }
        found
    }

    /// Prefetches a node or block that is probably needed soon. A wrong guess (a sphere, an instance, or a subtree
    /// beyond a closer hit) costs little.
    #[inline(always)]
    fn fetch(&self, child: Child) {
        let lines = self.tree.arena.as_ptr();
        self.s.prefetch::<{ TriangleBlock::LINES }>(lines.wrapping_add(child.index()).cast());
    }

    /// Returns the child to visit next, with its entry, and pushes the others. `None`: the ray hits none.
    #[inline(always)]
    fn choose<Q: Query>(
        &self,
        node: &WideNode,
        near: S::F,
        miss: S::Mask,
        octant: usize,
        stack: &mut Stack<'_>,
    ) -> Option<(Child, f32)> {
        let s = self.s;
        let hits = s.bits(miss) ^ 0xff;
        if hits == 0 {
            return None;
        }
        let first = hits.trailing_zeros() as usize & 7;
        let others = hits & (hits - 1);
        if Q::BLIND {
            // Visit by slot number, which is roughly from near to far in one of the two directions.
            let backwards = (node.order[octant] as i32 >> 31) as usize;
            let last = hits.ilog2() as usize & 7;
            // Avoid a branch: the nearer one is unpredictable.
            let next = first ^ ((first ^ last) & backwards);
            if others != 0 {
                s.push_slots(stack, &node.children, hits ^ 1 << next, backwards & 1);
                self.fetch(stack.top());
            }
            return Some((node.children[next], 0.0));
        }
        let nears = s.store(near);
        if others == 0 {
            return Some((node.children[first], nears[first]));
        }
        if others & (others - 1) == 0 {
            let second = others.trailing_zeros() as usize & 7;
            // Avoid a branch: the nearer one of two is unpredictable.
            let turn = (first ^ second) & ((nears[second] < nears[first]) as usize).wrapping_neg();
            let (next, later) = ((first ^ turn) & 7, (second ^ turn) & 7);
            stack.push(node.children[later], nears[later]);
            self.fetch(node.children[later]);
            return Some((node.children[next], nears[next]));
        }
        let nearest = s.push_ordered(stack, &node.children, near, miss, node.order[octant]) & 7;
        self.fetch(stack.top());
        Some((node.children[nearest], nears[nearest]))
    }

    /// Tests a block of triangles. Returns true if `best` was improved.
    #[inline(always)]
    fn triangles<Q: Query, const KEYS: bool>(
        &self,
        leaf: Child,
        entry: f32,
        prepared: &PreparedRay<S, ROBUST>,
        limit: S::F,
        query: &mut Q,
        best: &mut NearestHit,
    ) -> bool {
        let s = self.s;
        let between;
        let block = if KEYS {
            between = self.block_between_keys(leaf);
            &between
        } else {
            self.tree.block(leaf)
        };
        // Test all triangles of the block
        let Some(BlockHits { t, u, v, det, mut bits }) = prepared.triangles(s, block, limit) else { return false };
        if Q::BLIND {
            return true;
        }
        let (ts, us, vs, dets) = (s.store(t), s.store(u), s.store(v), s.store(det));
        let mut found = false;
        while bits != 0 {
            let lane = bits.trailing_zeros() as usize % WIDTH;
            bits &= bits - 1;
            // Compare the hit of a lane with the best hit
            let (t, id) = (if ts[lane] > entry { ts[lane] } else { entry }, block.id[lane]);
            let closer =
                t < best.t || (t == best.t && key_is_lower(self.tree, (self.space, id), (best.space, best.id)));
            if !closer {
                continue;
            }
            // Apply the filter
            if Q::FILTERED {
                let (instance, primitive) = key(self.tree, self.space, id);
                let (u, v) = (us[lane] / dets[lane], vs[lane] / dets[lane]);
                if !query.accept(&Hit { t, u, v, instance, primitive }) {
                    continue;
                }
            }
            (best.t, best.space, best.id, best.lane) = (t, self.space, id, lane);
            found = true;
            if Q::ANY {
                break;
            }
        }
        if found {
            (best.u, best.v, best.det) = (us, vs, dets);
        }
        found
    }

    fn sphere<Q: Query>(&self, index: usize, entry: f32, query: &mut Q, best: &mut NearestHit) -> bool {
        let moved = self.tree.motion.sphere(index, self.time);
        let moved = moved.map(|sphere| Sphere { center: sphere.center.to_array(), radius: sphere.radius });
        let sphere = moved.as_ref().unwrap_or(&self.tree.spheres[index]);
        let space = Hit::SPHERE | index as u32;
        for t in sphere::roots(sphere, self.ray) {
            if t.is_nan() || t <= self.t_min {
                continue;
            }
            let t = t.max(entry);
            let closer = t < best.t || (t == best.t && key_is_lower(self.tree, (space, 0), (best.space, best.id)));
            if !closer {
                continue;
            }
            if Q::FILTERED && !query.accept(&Hit { t, u: 0.0, v: 0.0, instance: space, primitive: 0 }) {
                continue;
            }
            (best.t, best.space, best.id, best.lane) = (t, space, 0, 0);
            (best.u[0], best.v[0], best.det[0]) = (0.0, 0.0, 1.0);
            return true;
        }
        false
    }

    /// Traverses the tree of a mesh in its own space. `t` is the same there, as the direction is not normalized.
    #[inline(always)]
    fn instance<Q: Query>(&self, placed: &PlacedTree, entry: f32, query: &mut Q, best: &mut NearestHit) -> bool {
        let ([ox, oy, oz], [dx, dy, dz]) = (self.ray.origin.to_array(), self.ray.direction.to_array());
        let moved;
        let (mut m, mut keys) = (&placed.object_from_world, None);
        // Find the pose of a moving instance
        if placed.motion != PlacedTree::STILL {
            let motion = &self.tree.motion.placements[placed.motion as usize];
            let Some(map) = motion.object_from_world(m, self.ray, self.time) else { return false };
            moved = map;
            (m, keys) = (&moved, motion.keys.as_ref());
        }
        // Transform the ray to object space
        let origin = m.map(|r| r[0] * ox + r[1] * oy + r[2] * oz + r[3]);
        let direction = m.map(|r| r[0] * dx + r[1] * dy + r[2] * dz);
        let ray = Ray { origin: origin.into(), direction: direction.into(), ..*self.ray };
        let pose = keys.map_or(KeyPose::NONE, |keys| keys.at(self.time));
        let traversal = Traversal::<S, ROBUST> { ray: &ray, space: placed.instance, pose, ..*self };
        if keys.is_some() {
            self.s.apart(KeysJob { traversal: &traversal, root: placed.root, entry, query, best })
        } else {
            traversal.traverse::<Q, false, false>(placed.root, entry, query, best)
        }
    }
}
