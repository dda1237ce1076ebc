//! The irradiance cache: indirect irradiance at sparse points, interpolated by gradients.
//!
//! Ward, Rubinstein and Clear 1988, *A Ray Tracing Solution for Diffuse Interreflection*; Ward and Heckbert 1992, *Irradiance
//! Gradients*; Křivánek et al. 2006, *Making Radiance and Irradiance Caching Practical* (neighbour clamping).

mod noise;
mod record;
mod surroundings;

use bottega_scene::Spectrum;
use glam::Vec3;

pub(crate) use super::around::GatherSample;
use super::{
    bounces::BounceShares,
    bytes::{Reader, Writer},
    record::Photon,
};
use crate::color::luminance;
use record::{EFFORT_MAX, RecordRegion};
pub(crate) use record::{IrradianceRecord, Measurement, RAYS, direction};
use surroundings::StrongestRecords;
pub(crate) use surroundings::Surroundings;

/// Number of standard errors by which records may differ in addition to the tolerated error.
const NOISE: f32 = 2.0;
/// Greatest side of the nodes that hold a record, relative to its radius. In smaller nodes lookups test fewer records
/// that are too far away, but each record is stored in more nodes.
const SIDE_MAX: f32 = 2.0;
/// Greatest depth of the octree.
const LEVELS_MAX: u32 = 20;

/// An interpolated irradiance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate {
    /// Irradiance at the point.
    pub(crate) irradiance: Spectrum,
    /// Expected relative error, by the noise of the records and by their differences.
    pub(crate) error: f32,
    /// Effective number of records, (Σw)² ∕ Σw² of their weights.
    pub(crate) count: f32,
    /// Sum of the squared nearness of the records: 1 for a single one at the point, falling to 0 where it ends.
    pub(crate) presence: f32,
}

/// Irradiance records in an octree.
#[derive(Clone, Debug)]
pub(crate) struct IrradianceCache {
    records: Vec<IrradianceRecord>,
    /// Nodes; the eight children of a node follow one another; 0: no children.
    nodes: Vec<CacheNode>,
    /// Least corner of the root's cube.
    low: Vec3,
    side: f32,
    /// Greatest error, as a share (Ward's a).
    tolerance: f32,
    /// Sum of the luminance of the irradiance of all records.
    brightness: f32,
    /// Number of entries of records in all nodes, and memory of the records' lists, in bytes.
    listed: usize,
    list_bytes: usize,
}

/// A node of the octree; inner nodes hold records, too.
#[derive(Clone, Debug, Default)]
struct CacheNode {
    first_child: u32,
    records: Vec<u32>,
}

impl IrradianceCache {
    /// Creates an empty cache.
    ///
    /// - `low`, `side`: a cube around the scene.
    pub(crate) fn new(low: Vec3, side: f32, tolerance: f32) -> Self {
        Self {
            records: Vec::new(),
            nodes: vec![CacheNode::default()],
            low,
            side,
            tolerance,
            brightness: 0.0,
            listed: 0,
            list_bytes: 0,
        }
    }

    #[cfg(test)]
    fn len(&self) -> usize {
        self.records.len()
    }

    /// Returns the memory, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let lists = self.listed * size_of::<u32>() + self.list_bytes;
        size_of_val(&*self.records) + size_of_val(&*self.nodes) + lists
    }

    /// Returns the irradiance at a point by light with at most `bounces` bounces; `None`: no record is near enough.
    pub(crate) fn at(&self, p: Vec3, n: Vec3, bounces: u32) -> Option<Spectrum> {
        let (mut sum, mut weights) = (Spectrum::ZERO, 0.0);
        self.visit(p, |record| {
            let weight = record.weight(p, n, self.tolerance);
            if weight > 0.0 {
                sum += record.at(p, n) * record.share(bounces) * weight;
                weights += weight;
            }
        });
        (weights > 0.0).then(|| sum / weights)
    }

    /// Returns the irradiance at a point by light with at most `bounces` bounces, with its expected error; `None`: no
    /// record is near enough.
    #[inline(always)]
    pub(crate) fn estimate(&self, p: Vec3, n: Vec3, bounces: u32) -> Option<Estimate> {
        self.estimate_by(p, n, bounces, |_, _| true)
    }

    /// Returns how the irradiance at a point by light with at most `bounces` bounces divides by number of bounces.
    pub(crate) fn shares(&self, p: Vec3, n: Vec3, bounces: u32) -> BounceShares {
        let mut shares = BounceShares::default();
        let mut all = Spectrum::ZERO;
        self.visit(p, |record| {
            let nearness = record.nearness(p, n, self.tolerance);
            let weight = nearness * nearness * record.effort as f32;
            if weight > 0.0 {
                let light = record.at(p, n) * weight;
                all += light * record.share(bounces);
                record.parts(bounces, |number, part| shares.add(number, light * part));
            }
        });
        shares.scale(all.max(Spectrum::splat(f32::MIN_POSITIVE)).recip());
        shares
    }

    /// Returns the same as [`Self::estimate`], and the light by direction, from records that have directions. `None`:
    /// no such record is near enough.
    #[inline(always)]
    pub(crate) fn surroundings(&self, p: Vec3, n: Vec3, bounces: u32) -> Option<(Estimate, Surroundings<'_>)> {
        let mut strongest = StrongestRecords::default();
        let estimate = self.estimate_by(p, n, bounces, |record, weight| {
            if record.around.is_some() {
                strongest.insert(record, weight);
            }
            record.around.is_some()
        })?;
        Some((estimate, strongest.finish(estimate.irradiance)))
    }

    /// Interpolates between the records for which `counts` returns `true`, given each record and its weight.
    #[inline(always)]
    fn estimate_by<'a>(
        &'a self,
        p: Vec3,
        n: Vec3,
        bounces: u32,
        mut counts: impl FnMut(&'a IrradianceRecord, f32) -> bool,
    ) -> Option<Estimate> {
        let (mut sum, mut weights, mut squares) = (Spectrum::ZERO, 0.0, 0.0);
        let (mut weights_squared, mut noise, mut presence) = (0.0, 0.0, 0.0);
        self.visit(p, |record| {
            // Smoother than Ward's weight, which peaks at every record
            let nearness = record.nearness(p, n, self.tolerance);
            let weight = nearness * nearness * record.effort as f32;
            if weight > 0.0 && counts(record, weight) {
                let value = record.at(p, n) * record.share(bounces);
                sum += value * weight;
                squares += luminance(value) * luminance(value) * weight;
                weights += weight;
                weights_squared += weight * weight;
                noise += record.noise * weight * weight;
                presence += nearness * nearness;
            }
        });
        if weights <= 0.0 {
            return None;
        }
        // Combine the noise of the records with the spread between them
        let irradiance = sum / weights;
        let mean = luminance(irradiance);
        let count = weights * weights / weights_squared;
        let spread = (squares / weights - mean * mean).max(0.0) / count;
        let spread = if spread > 0.0 { spread.sqrt() / mean.max(self.faint()) } else { 0.0 };
        let error = spread.max(noise.sqrt() / weights);
        Some(Estimate { irradiance, error, count, presence })
    }

    /// Returns an irradiance relative to which differences are invisible.
    fn faint(&self) -> f32 {
        const FAINT: f32 = 0.05;
        FAINT * self.brightness / self.records.len().max(1) as f32
    }

    /// Adds a record. If it and others contradict each other beyond noise, both shrink until they do not reach each
    /// other.
    ///
    /// - `error`: greatest relative difference that is tolerated.
    pub(crate) fn add_within(&mut self, mut record: IrradianceRecord, error: f32) {
        let mut near = Vec::new();
        self.visit_numbers(record.p, |number| near.push(number));
        let faint = self.faint();
        for &number in &near {
            let other = &self.records[number as usize];
            if other.weight(record.p, record.n, self.tolerance) <= 0.0 {
                continue;
            }
            let (here, said) = (luminance(record.irradiance), luminance(other.at(record.p, record.n)));
            // Differences within noise are not significant
            let most = here.max(said).max(faint);
            let noise = NOISE * (record.noise + other.noise).sqrt() * most;
            if (here - said).abs() > noise + 2.0 * error * most {
                let distance = (other.p - record.p).length() / self.tolerance;
                record.radius = record.radius.min(distance);
                let other = &mut self.records[number as usize];
                other.radius = other.radius.min(distance);
            }
        }
        self.add(record);
    }

    /// Returns the records with light as photons: their positions, normals and irradiance.
    pub(crate) fn as_photons(&self) -> impl Iterator<Item = Photon> + '_ {
        let lit = self.records.iter().filter(|record| record.irradiance != Spectrum::ZERO);
        lit.map(|record| Photon::new(record.p, record.n, record.n, record.irradiance))
    }

    /// Adds a record. No radius is greater than that of a neighbour plus the distance to it (neighbour clamping): a
    /// point close to an object is close to it a little farther on, too. Records on the other side of a wall do not
    /// clamp.
    pub(crate) fn add(&mut self, mut record: IrradianceRecord) {
        let mut near = Vec::new();
        self.visit_numbers(record.p, |number| near.push(number));
        for &number in &near {
            let other = &mut self.records[number as usize];
            if other.n.dot(record.n) < -0.5 {
                continue;
            }
            let distance = (other.p - record.p).length();
            record.radius = record.radius.min(other.radius + distance);
            other.radius = other.radius.min(record.radius + distance);
        }
        self.put(record);
    }

    /// Returns a read-only copy with smaller node lists: each record only where its final radius reaches, near its own
    /// surface.
    pub(crate) fn settled(&self) -> Self {
        let mut settled = Self::new(self.low, self.side, self.tolerance);
        self.records.iter().for_each(|record| settled.settle(record.clone()));
        settled
    }

    /// Writes the root's cube and the records.
    pub(crate) fn write(&self, to: &mut Writer) {
        to.vector(self.low);
        to.value(self.side);
        to.number(self.records.len() as u32);
        self.records.iter().for_each(|record| record.write(to));
    }

    /// Reads a cache in the form that [`Self::settled`] returns; `None`: not valid.
    pub(crate) fn read(tolerance: f32, from: &mut Reader<'_>) -> Option<Self> {
        let (low, side) = (from.vector()?, from.value()?);
        let count = from.count(IrradianceRecord::BYTES_MIN)?;
        let mut cache = Self::new(low, side.max(0.0), tolerance);
        for _ in 0..count {
            cache.settle(IrradianceRecord::read(from)?);
        }
        Some(cache)
    }

    /// Inserts a record wherever it or a later neighbour may look for it.
    fn put(&mut self, record: IrradianceRecord) {
        let reach = record.reach_around(self.tolerance);
        self.hold(record, &reach);
    }

    /// Inserts a record only where it counts.
    fn settle(&mut self, record: IrradianceRecord) {
        let reach = record.reach(self.tolerance);
        self.hold(record, &reach);
    }

    /// Inserts a record into the nodes that meet `reach`.
    fn hold(&mut self, record: IrradianceRecord, reach: &RecordRegion) {
        let number = self.records.len() as u32;
        self.brightness += luminance(record.irradiance);
        self.list_bytes += record.list_bytes();
        self.records.push(record);
        self.insert(0, self.low, self.side, 0, (number, reach));
    }

    /// Inserts the index of a record into all nodes of about its size that it reaches.
    fn insert(&mut self, node: usize, low: Vec3, side: f32, level: u32, record: (u32, &RecordRegion)) {
        let (number, reach) = record;
        if !reach.meets(low, side) {
            return;
        }
        if level == LEVELS_MAX || side < SIDE_MAX * reach.radius {
            self.nodes[node].records.push(number);
            self.listed += 1;
            return;
        }
        if self.nodes[node].first_child == 0 {
            self.nodes[node].first_child = self.nodes.len() as u32;
            self.nodes.extend(std::iter::repeat_n(CacheNode::default(), 8));
        }
        let first = self.nodes[node].first_child as usize;
        let half = 0.5 * side;
        for child in 0..8 {
            let offset = Vec3::new((child & 1) as f32, (child >> 1 & 1) as f32, (child >> 2) as f32) * half;
            self.insert(first + child, low + offset, half, level + 1, record);
        }
    }

    /// Calls `look` with every record that may count at a point.
    fn visit<'a>(&'a self, p: Vec3, mut look: impl FnMut(&'a IrradianceRecord)) {
        self.visit_numbers(p, |number| look(&self.records[number as usize]));
    }

    /// Calls `look` with the records of all nodes from the root to the leaf that contains a point.
    fn visit_numbers(&self, p: Vec3, mut look: impl FnMut(u32)) {
        let (mut node, mut low, mut half) = (0, self.low, 0.5 * self.side);
        loop {
            self.nodes[node].records.iter().for_each(|&number| look(number));
            let first = self.nodes[node].first_child as usize;
            if first == 0 {
                return;
            }
            let above = (p - low).cmpge(Vec3::splat(half));
            low += Vec3::select(above, Vec3::splat(half), Vec3::ZERO);
            node = first + above.bitmask() as usize;
            half *= 0.5;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{super::bounces::BOUNCES_KEPT, *};

    /// Irradiance at a place by as many rays as a record has, of a scene that is known in all directions.
    fn record(p: Vec3, n: Vec3, scene: &impl Fn(Vec3, Vec3) -> GatherSample) -> IrradianceRecord {
        let looks = (0..RAYS).map(|i| scene(p, direction(n, i, [0.5, 0.5]))).collect();
        IrradianceRecord::new(p, n, &Measurement::new(looks, 1), [1e-3, 10.0])
    }

    /// A wide plane above that grows brighter to one side.
    fn ceiling(p: Vec3, w: Vec3) -> GatherSample {
        if w.y <= 1e-3 {
            return GatherSample { radiance: Vec3::ZERO, distance: f32::INFINITY };
        }
        let distance = (2.0 - p.y) / w.y;
        let hit = p + w * distance;
        GatherSample { radiance: Vec3::new(1.0, (0.5 * hit.x).tanh() + 1.5, 2.0), distance }
    }

    #[test]
    fn directions_are_drawn_by_the_cosine() {
        let n = Vec3::new(0.6, 0.0, 0.8);
        let mean: Vec3 = (0..RAYS).map(|i| direction(n, i, [0.5, 0.5])).sum::<Vec3>() / RAYS as f32;
        assert!((mean - n * (2.0 / 3.0)).length() < 2e-3, "{mean}");
    }

    #[test]
    fn gradients_tell_how_irradiance_changes() {
        let n = Vec3::Y;
        let here = record(Vec3::ZERO, n, &ceiling);
        for step in [Vec3::X * 0.1, Vec3::X * -0.1, Vec3::Z * 0.1] {
            let there = record(step, n, &ceiling).irradiance;
            let error = (here.at(step, n) - there).abs().max_element();
            let without = (here.irradiance - there).abs().max_element();
            assert!(error < 0.02 + 0.35 * without, "moved by {step}: {error} {without}");
        }
        for turn in [0.1_f32, -0.1] {
            let turned = Vec3::new(turn.sin(), turn.cos(), 0.0);
            // Rays below the horizon find the same as those just above: nothing.
            let there = record(Vec3::ZERO, turned, &ceiling).irradiance;
            let error = (here.at(Vec3::ZERO, turned) - there).abs().y;
            let without = (here.irradiance - there).abs().y;
            assert!(error < 0.03 + 0.5 * without, "turned by {turn}: {error} {without}");
        }
    }

    #[test]
    fn a_cache_answers_near_its_records_alone() {
        let mut cache = IrradianceCache::new(Vec3::splat(-4.0), 8.0, 0.2);
        let at = |cache: &IrradianceCache, p: Vec3, n: Vec3| cache.at(p, n, u32::MAX);
        assert!(at(&cache, Vec3::ZERO, Vec3::Y).is_none());
        cache.add(record(Vec3::ZERO, Vec3::Y, &ceiling));
        assert_eq!(cache.len(), 1);
        assert!(at(&cache, Vec3::ZERO, Vec3::Y).is_some() && at(&cache, Vec3::X * 0.2, Vec3::Y).is_some());
        assert!(at(&cache, Vec3::X * 3.0, Vec3::Y).is_none() && at(&cache, Vec3::ZERO, Vec3::X).is_none());
    }

    #[test]
    fn presence_fades_to_nothing_where_a_record_ends() {
        let even = |_: Vec3, _: Vec3| GatherSample { radiance: Vec3::ONE, distance: 5.0 };
        let mut cache = IrradianceCache::new(Vec3::splat(-10.0), 20.0, 0.3);
        cache.add(record(Vec3::ZERO, Vec3::Y, &even));
        let presence = |x: f32| cache.estimate(Vec3::X * x, Vec3::Y, u32::MAX).map(|estimate| estimate.presence);
        let end = (1..10_000).map(|i| 1e-3 * i as f32).find(|&x| presence(x).is_none()).expect("it has an end");
        let [here, half, there] = [0.0, 0.5 * end, end - 1e-3].map(|x| presence(x).expect("it is near enough"));
        assert!(here > 0.99 && half > 0.2 && half < 0.3 && there < 1e-3, "{here} {half} {there}");
    }

    #[test]
    fn no_record_counts_on_the_other_side_of_a_wall() {
        let dark = |_: Vec3, _: Vec3| GatherSample { radiance: Vec3::ZERO, distance: 5.0 };
        let mut cache = IrradianceCache::new(Vec3::splat(-10.0), 20.0, 0.3);
        // Inside a wall 0.4 wide, at its far side.
        cache.add(record(Vec3::ZERO, Vec3::Y, &dark));
        assert!(cache.estimate(Vec3::X * 0.4, Vec3::Y, u32::MAX).is_some());
        assert!(cache.estimate(Vec3::Y * 0.4, Vec3::Y, u32::MAX).is_none());
        // The outside stays known, however narrow the inside is.
        let narrow = |_: Vec3, _: Vec3| GatherSample { radiance: Vec3::ZERO, distance: 0.1 };
        cache.add(record(Vec3::X * 0.4, Vec3::NEG_Y, &narrow));
        assert!(cache.estimate(Vec3::X * 0.8, Vec3::Y, u32::MAX).is_some());
    }

    #[test]
    fn no_record_counts_in_another_room() {
        // A wall without thickness stands on the floor at x = 0.4; everything else is far away.
        let room = |p: Vec3, w: Vec3| {
            let distance = (0.4 - p.x) / w.x;
            let is_wall = w.x > 0.0 && (p + w * distance).y < 3.0;
            GatherSample { radiance: Vec3::ONE, distance: if is_wall { distance } else { 8.0 } }
        };
        let mut cache = IrradianceCache::new(Vec3::splat(-10.0), 20.0, 0.3);
        cache.add(record(Vec3::ZERO, Vec3::Y, &room));
        let is_known = |p: Vec3| cache.estimate(p, Vec3::Y, u32::MAX).is_some();
        for w in [Vec3::X, Vec3::new(0.8, 0.0, 0.6), Vec3::new(0.8, 0.0, -0.6)] {
            assert!(is_known(w * 0.3 / w.x) && !is_known(w * 0.45 / w.x), "{w}");
        }
        for w in [Vec3::NEG_X, Vec3::Z, Vec3::NEG_Z] {
            assert!(is_known(w * 0.45), "{w}");
        }
        // The byte form keeps the walls.
        let mut to = Writer::default();
        cache.write(&mut to);
        let read_back = IrradianceCache::read(0.3, &mut Reader(&to.0)).unwrap();
        assert!(read_back.estimate(Vec3::X * 0.45, Vec3::Y, u32::MAX).is_none());
        assert!(read_back.estimate(Vec3::X * 0.35, Vec3::Y, u32::MAX).is_some());
    }

    #[test]
    fn records_tell_light_apart_by_its_bounces() {
        let mut light = [Spectrum::ZERO; BOUNCES_KEPT];
        (light[2], light[4]) = (Vec3::new(3.0, 1.0, 0.0), Vec3::new(1.0, 1.0, 0.0));
        let known = record(Vec3::ZERO, Vec3::Y, &ceiling).with_bounces(&light);
        let mut to = Writer::default();
        known.write(&mut to);
        let known = IrradianceRecord::read(&mut Reader(&to.0)).unwrap();
        let mut cache = IrradianceCache::new(Vec3::splat(-4.0), 8.0, 0.2);
        cache.add(known);
        let all = cache.at(Vec3::ZERO, Vec3::Y, u32::MAX).unwrap();
        let share = |bounces: u32| (cache.at(Vec3::ZERO, Vec3::Y, bounces).unwrap() / all).x;
        let found = [0, 1, 2, 3, 4, 5].map(share);
        assert!(found.iter().zip([0.0, 0.0, 0.75, 0.75, 1.0, 1.0]).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}");
        let shares = cache.shares(Vec3::ZERO, Vec3::Y, u32::MAX);
        let shares = shares.as_slice();
        assert!((shares[2].x - 0.75).abs() < 1e-4 && (shares[4].x - 0.25).abs() < 1e-4 && shares[3].x.abs() < 1e-4);
        assert!((shares[2].y - 0.5).abs() < 1e-4 && shares.len() == 5, "{shares:?}");
        // With a limit, the shares below it sum to one.
        let shares = cache.shares(Vec3::ZERO, Vec3::Y, 3);
        let shares = shares.as_slice();
        assert!((shares[2].x - 1.0).abs() < 1e-4 && shares.len() <= 4, "{shares:?}");
    }

    #[test]
    fn settled_records_do_not_change() {
        let part = |i: u32, prime: u32| (i * prime % 401) as f32 / 401.0;
        let turned = |i: u32| Vec3::new(0.6 * part(i, 71) - 0.3, 1.0, 0.6 * part(i, 113) - 0.3).normalize();
        for tolerance in [0.3, 0.8, 1.0] {
            let mut cache = IrradianceCache::new(Vec3::splat(-4.0), 8.0, tolerance);
            for i in 0..60 {
                let p = Vec3::new(2.0 * part(i, 29) - 1.0, 0.2 * part(i, 7) - 0.1, 2.0 * part(i, 197) - 1.0);
                let radius = 0.2 + 2.0 * part(i, 31);
                cache.put(IrradianceRecord { radius, ..record(p, turned(i), &ceiling) });
            }
            let settled = cache.settled();
            assert!(settled.listed < cache.listed, "{} {}", settled.listed, cache.listed);
            let mut known = 0;
            for i in 0..4000 {
                let p = Vec3::new(2.4 * part(i, 23) - 1.2, 0.3 * part(i, 37) - 0.15, 2.4 * part(i, 41) - 1.2);
                let found = [&cache, &settled].map(|it| it.estimate(p, turned(i + 5), u32::MAX));
                let estimates = found.map(|it| it.map(|it| (it.irradiance, it.error, it.count, it.presence)));
                assert_eq!(estimates[0], estimates[1], "{p}");
                known += u32::from(estimates[0].is_some());
            }
            assert!(known > 20, "{known} places are known at {tolerance}");
        }
    }

    #[test]
    fn neighbours_clamp_one_another() {
        let mut cache = IrradianceCache::new(Vec3::splat(-4.0), 8.0, 0.5);
        let near = |p: Vec3, radius: f32| IrradianceRecord { radius, ..record(p, Vec3::Y, &ceiling) };
        cache.add(near(Vec3::ZERO, 2.0));
        cache.add(near(Vec3::X * 0.1, 0.05));
        assert!((cache.records[0].radius - 0.15).abs() < 1e-6, "{}", cache.records[0].radius);
    }
}
