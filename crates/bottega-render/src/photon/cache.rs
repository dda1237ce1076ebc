//! Indirect irradiance at a few places, and between them by how it changes.
//!
//! Ward, Rubinstein and Clear 1988, *A Ray Tracing Solution for Diffuse Interreflection*; Ward and Heckbert 1992, *Irradiance
//! Gradients*; Křivánek et al. 2006, *Making Radiance and Irradiance Caching Practical* (neighbour clamping).

mod surroundings;

use std::{f32::consts::PI, sync::Arc};

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    around::{Around, CELLS},
    bytes::{Reader, Writer},
    record::Photon,
};
use crate::{luminance, sampling::orthonormal_basis};
use surroundings::Speakers;
pub(crate) use surroundings::Surroundings;

/// Rings of directions, from the normal to the horizon, and directions in each.
pub(super) const RINGS: usize = 10;
pub(super) const SECTORS: usize = 32;
/// Rays by which the irradiance at one place is found.
pub(crate) const RAYS: u32 = (RINGS * SECTORS) as u32;
/// Standard errors by which records may differ beyond the error that is borne.
const NOISE: f32 = 2.0;
/// Levels of the tree below its root.
const LEVELS_MAX: u32 = 20;

/// What is known at one place.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    p: Vec3,
    n: Vec3,
    irradiance: Spectrum,
    /// How it changes as the surface turns and as the place moves: one vector for each of red, green and blue.
    turning: [Vec3; 3],
    moving: [Vec3; 3],
    /// Distance to other surfaces, on the harmonic mean.
    radius: f32,
    /// Variance of the luminance of the irradiance, by how much rays next to each other differ.
    variance: f32,
    /// Where the light comes from; on surfaces that do not send it to all sides alike.
    around: Option<Arc<Around>>,
}

/// What records say of a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Estimate {
    pub(crate) irradiance: Spectrum,
    /// Expected relative error: by how noisy they are, and by how much they differ.
    pub(crate) error: f32,
    /// How many say so, as far as they count alike.
    pub(crate) count: f32,
}

/// What a ray found.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Look {
    pub(crate) radiance: Spectrum,
    /// Infinite where it met nothing.
    pub(crate) distance: f32,
}

/// Records, found by place.
#[derive(Clone, Debug)]
pub(crate) struct IrradianceCache {
    records: Vec<Record>,
    /// Each with eight children, which follow one another; 0: none.
    nodes: Vec<Node>,
    low: Vec3,
    side: f32,
    /// Greatest error, as a share (Ward's a).
    tolerance: f32,
    /// Sum of the luminances of all records.
    brightness: f32,
    /// Places in all nodes that records are put to, and records that know directions.
    listed: usize,
    directed: usize,
}

#[derive(Clone, Debug, Default)]
struct Node {
    first_child: u32,
    records: Vec<u32>,
}

/// The direction of ray `index` of [`RAYS`]: by the cosine, stratified. `u`: where in its cell.
pub(crate) fn direction(n: Vec3, index: u32, u: [f32; 2]) -> Vec3 {
    let (ring, sector) = (index as usize / SECTORS, index as usize % SECTORS);
    let sine_squared = (ring as f32 + u[0]) / RINGS as f32;
    let (sin, cos) = math::sin_cos_of_turns((sector as f32 + u[1]) / SECTORS as f32);
    let (s, t) = orthonormal_basis(n);
    let sine = sine_squared.sqrt();
    (s * (sine * cos) + t * (sine * sin) + n * (1.0 - sine_squared).max(0.0).sqrt()).normalize()
}

impl Record {
    /// From what rays found in the directions of [`direction`].
    ///
    /// - `reach`: least and greatest radius within which it may count.
    pub(crate) fn new(p: Vec3, n: Vec3, looks: &[Look], reach: [f32; 2]) -> Self {
        let look = |ring: usize, sector: usize| &looks[ring * SECTORS + sector % SECTORS];
        let cell = PI / looks.len() as f32;
        let irradiance = looks.iter().map(|look| look.radiance).sum::<Spectrum>() * cell;
        let inverse: f32 = looks.iter().map(|look| 1.0 / look.distance.max(1e-9)).sum::<f32>() / looks.len() as f32;
        let radius = if inverse > 0.0 { 1.0 / inverse } else { f32::INFINITY };
        let (s, t) = orthonormal_basis(n);
        let around = |turns: f32| {
            let (sin, cos) = math::sin_cos_of_turns(turns);
            s * cos + t * sin
        };
        let (mut turning, mut moving) = ([Vec3::ZERO; 3], [Vec3::ZERO; 3]);
        let add = |to: &mut [Vec3; 3], along: Vec3, by: Spectrum| {
            for channel in 0..3 {
                to[channel] += along * by[channel];
            }
        };
        let sine = |edge: usize| (edge as f32 / RINGS as f32).sqrt();
        for sector in 0..SECTORS {
            let middle = (sector as f32 + 0.5) / SECTORS as f32;
            let (towards, across) = (around(middle), around(middle + 0.25));
            let edge_across = around(sector as f32 / SECTORS as f32 + 0.25);
            for ring in 0..RINGS {
                let here = look(ring, sector);
                // Ward and Heckbert 1992, eq. 1; the sign is that of a turn from n to where the light is.
                let middle_squared = (ring as f32 + 0.5) / RINGS as f32;
                let tangent = (middle_squared / (1.0 - middle_squared)).sqrt();
                add(&mut turning, across, here.radiance * (tangent * cell));
                // Ibid., eq. 2: across the borders of cells between rings, and between sectors.
                if ring > 0 {
                    let below = look(ring - 1, sector);
                    let sine = sine(ring);
                    let cos_squared = 1.0 - sine * sine;
                    let near = here.distance.min(below.distance).max(reach[0]);
                    let by = 2.0 * PI / SECTORS as f32 * sine * cos_squared / near;
                    add(&mut moving, towards, (here.radiance - below.radiance) * by);
                }
                let before = look(ring, sector + SECTORS - 1);
                let near = here.distance.min(before.distance).max(reach[0]);
                let by = (sine(ring + 1) - sine(ring)) / near;
                add(&mut moving, edge_across, (here.radiance - before.radiance) * by);
            }
        }
        let difference = |i: usize| luminance(looks[i].radiance) - luminance(look(i / SECTORS, i + 1).radiance);
        let variance = (0..looks.len()).map(|i| 0.5 * difference(i) * difference(i)).sum::<f32>() * cell * cell;
        Self {
            p,
            n,
            irradiance,
            turning,
            moving,
            radius: radius.clamp(reach[0], reach[1].max(reach[0])),
            variance,
            around: None,
        }
    }

    /// The same with where the light comes from.
    pub(crate) fn with_directions(self, looks: &[Look]) -> Self {
        Self { around: Some(Arc::new(Around::new(looks))), ..self }
    }

    /// How much it counts at another place; nothing where it is too far off, or before that place.
    fn weight(&self, p: Vec3, n: Vec3, tolerance: f32) -> f32 {
        match self.nearness(p, n, tolerance) {
            0.0 => 0.0,
            nearness => 1.0 / (tolerance * (1.0 - nearness)).max(1e-6) - 1.0 / tolerance,
        }
    }

    /// 1 where it was measured, 0 where it counts nothing.
    fn nearness(&self, p: Vec3, n: Vec3, tolerance: f32) -> f32 {
        let cosine = n.dot(self.n);
        let error = (p - self.p).length() / self.radius + (1.0 - cosine).max(0.0).sqrt();
        let is_before = (p - self.p).dot(n + self.n) < -0.1 * self.radius;
        if is_before { 0.0 } else { (1.0 - error / tolerance).max(0.0) }
    }

    /// What it says of another place.
    fn at(&self, p: Vec3, n: Vec3) -> Spectrum {
        let (turned, moved) = (self.n.cross(n), p - self.p);
        let change = |channel: usize| self.turning[channel].dot(turned) + self.moving[channel].dot(moved);
        (self.irradiance + Vec3::new(change(0), change(1), change(2))).max(Vec3::ZERO)
    }
}

impl IrradianceCache {
    /// Without records.
    ///
    /// - `low`, `side`: a cube around the scene.
    pub(crate) fn new(low: Vec3, side: f32, tolerance: f32) -> Self {
        Self {
            records: Vec::new(),
            nodes: vec![Node::default()],
            low,
            side,
            tolerance,
            brightness: 0.0,
            listed: 0,
            directed: 0,
        }
    }

    #[cfg(test)]
    fn len(&self) -> usize {
        self.records.len()
    }

    pub(crate) fn memory_bytes(&self) -> usize {
        let lists = self.listed * size_of::<u32>() + self.directed * size_of::<Around>();
        size_of_val(&*self.records) + size_of_val(&*self.nodes) + lists
    }

    /// The irradiance at a place; `None`: no record is near enough.
    pub(crate) fn at(&self, p: Vec3, n: Vec3) -> Option<Spectrum> {
        let (mut sum, mut weights) = (Spectrum::ZERO, 0.0);
        self.visit(p, |record| {
            let weight = record.weight(p, n, self.tolerance);
            if weight > 0.0 {
                sum += record.at(p, n) * weight;
                weights += weight;
            }
        });
        (weights > 0.0).then(|| sum / weights)
    }

    /// The irradiance at a place, and how far those who say so differ; `None`: no record is near enough.
    #[inline(always)]
    pub(crate) fn estimate(&self, p: Vec3, n: Vec3) -> Option<Estimate> {
        self.estimate_by(p, n, |_, _| true)
    }

    /// The same by those alone who know where light comes from, and what they know of it.
    #[inline(always)]
    pub(crate) fn surroundings(&self, p: Vec3, n: Vec3) -> Option<(Estimate, Surroundings<'_>)> {
        let mut speakers = Speakers::default();
        let estimate = self.estimate_by(p, n, |record, weight| {
            if record.around.is_some() {
                speakers.hear(record, weight);
            }
            record.around.is_some()
        })?;
        Some((estimate, speakers.told(estimate.irradiance)))
    }

    /// By those whom `is_asked`, given each record and how much it counts.
    #[inline(always)]
    fn estimate_by<'a>(
        &'a self,
        p: Vec3,
        n: Vec3,
        mut is_asked: impl FnMut(&'a Record, f32) -> bool,
    ) -> Option<Estimate> {
        let (mut sum, mut weights, mut squares) = (Spectrum::ZERO, 0.0, 0.0);
        let (mut weights_squared, mut noise) = (0.0, 0.0);
        self.visit(p, |record| {
            // Smoother than Ward's, whose weight has a peak at every record.
            let weight = record.nearness(p, n, self.tolerance);
            let weight = weight * weight;
            if weight > 0.0 && is_asked(record, weight) {
                let value = record.at(p, n);
                sum += value * weight;
                squares += luminance(value) * luminance(value) * weight;
                weights += weight;
                weights_squared += weight * weight;
                noise += record.variance * weight * weight;
            }
        });
        if weights <= 0.0 {
            return None;
        }
        let irradiance = sum / weights;
        let mean = luminance(irradiance);
        let spread = (squares / weights - mean * mean).max(0.0) * weights_squared / (weights * weights);
        let variance = spread.max(noise / (weights * weights));
        let error = if variance > 0.0 { variance.sqrt() / mean.max(self.faint()) } else { 0.0 };
        Some(Estimate { irradiance, error, count: weights * weights / weights_squared })
    }

    /// Irradiance of which nobody sees the difference, beside what there is on the mean.
    fn faint(&self) -> f32 {
        const FAINT: f32 = 0.05;
        FAINT * self.brightness / self.records.len().max(1) as f32
    }

    /// Adds a record; it and those that say otherwise of its place than it has found lose so much of their radius that they
    /// say nothing of each other.
    ///
    /// - `error`: greatest relative difference that is borne.
    pub(crate) fn add_within(&mut self, mut record: Record, error: f32) {
        let mut near = Vec::new();
        self.visit_numbers(record.p, |number| near.push(number));
        let faint = self.faint();
        for &number in &near {
            let other = &self.records[number as usize];
            if other.weight(record.p, record.n, self.tolerance) <= 0.0 {
                continue;
            }
            let (here, said) = (luminance(record.irradiance), luminance(other.at(record.p, record.n)));
            // Of noise alone nothing is learnt.
            let noise = NOISE * (record.variance + other.variance).sqrt();
            if (here - said).abs() > noise + 2.0 * error * here.max(said).max(faint) {
                let distance = (other.p - record.p).length() / self.tolerance;
                record.radius = record.radius.min(distance);
                let other = &mut self.records[number as usize];
                other.radius = other.radius.min(distance);
            }
        }
        self.add(record);
    }

    /// Where light was measured, and how much.
    pub(crate) fn as_photons(&self) -> impl Iterator<Item = Photon> + '_ {
        let lit = self.records.iter().filter(|record| record.irradiance != Spectrum::ZERO);
        lit.map(|record| Photon::new(record.p, record.n, record.n, record.irradiance))
    }

    /// Adds a record. No radius may be greater than that of a neighbour and the way to it: what is near to something is not
    /// far from it a little farther on.
    pub(crate) fn add(&mut self, mut record: Record) {
        let mut near = Vec::new();
        self.visit_numbers(record.p, |number| near.push(number));
        for &number in &near {
            let other = &mut self.records[number as usize];
            let distance = (other.p - record.p).length();
            record.radius = record.radius.min(other.radius + distance);
            other.radius = other.radius.min(record.radius + distance);
        }
        self.put(record);
    }

    /// The same, each record only where it reaches by the radius that is left of it.
    pub(crate) fn settled(&self) -> Self {
        let mut settled = Self::new(self.low, self.side, self.tolerance);
        self.records.iter().for_each(|record| settled.put(record.clone()));
        settled
    }

    /// Where the cube is, how many records there are, and what each of them knows.
    pub(crate) fn write(&self, to: &mut Writer) {
        to.vector(self.low);
        to.value(self.side);
        to.number(self.records.len() as u32);
        for Record { p, n, irradiance, turning, moving, radius, variance, around } in &self.records {
            [*p, *n, *irradiance].iter().chain(turning).chain(moving).for_each(|&vector| to.vector(vector));
            to.value(*radius);
            to.value(*variance);
            to.number(u32::from(around.is_some()));
            around.iter().flat_map(|around| around.to_numbers()).for_each(|number| to.number(number));
        }
    }

    /// One that is [settled](Self::settled).
    pub(crate) fn read(tolerance: f32, from: &mut Reader<'_>) -> Option<Self> {
        const RECORD_BYTES: usize = 4 * 29;
        let (low, side) = (from.vector()?, from.value()?);
        let count = from.count(RECORD_BYTES)?;
        let mut cache = Self::new(low, side.max(0.0), tolerance);
        for _ in 0..count {
            let mut vector = || from.vector();
            let [p, n, irradiance] = [vector()?, vector()?, vector()?];
            let turning = [vector()?, vector()?, vector()?];
            let moving = [vector()?, vector()?, vector()?];
            let (radius, variance) = (from.value()?, from.value()?);
            if radius < 0.0 || variance < 0.0 {
                return None;
            }
            let around = match from.number()? {
                0 => None,
                1 => {
                    let mut numbers = [0; CELLS];
                    for number in &mut numbers {
                        *number = from.number()?;
                    }
                    Some(Arc::new(Around::from_numbers(numbers)))
                }
                _ => return None,
            };
            cache.put(Record { p, n, irradiance, turning, moving, radius, variance, around });
        }
        Some(cache)
    }

    /// Puts a record where it reaches.
    fn put(&mut self, record: Record) {
        let number = self.records.len() as u32;
        self.brightness += luminance(record.irradiance);
        self.directed += usize::from(record.around.is_some());
        let (p, reach) = (record.p, self.tolerance * record.radius);
        self.records.push(record);
        self.insert(0, self.low, self.side, 0, number, p, reach);
    }

    /// Puts a record into all nodes that it reaches, of about its own size.
    fn insert(&mut self, node: usize, low: Vec3, side: f32, level: u32, number: u32, p: Vec3, reach: f32) {
        let high = low + side;
        if (p + reach).cmplt(low).any() || (p - reach).cmpgt(high).any() {
            return;
        }
        if level == LEVELS_MAX || side < 4.0 * reach {
            self.nodes[node].records.push(number);
            self.listed += 1;
            return;
        }
        if self.nodes[node].first_child == 0 {
            self.nodes[node].first_child = self.nodes.len() as u32;
            self.nodes.extend(std::iter::repeat_n(Node::default(), 8));
        }
        let first = self.nodes[node].first_child as usize;
        let half = 0.5 * side;
        for child in 0..8 {
            let offset = Vec3::new((child & 1) as f32, (child >> 1 & 1) as f32, (child >> 2) as f32) * half;
            self.insert(first + child, low + offset, half, level + 1, number, p, reach);
        }
    }

    fn visit<'a>(&'a self, p: Vec3, mut look: impl FnMut(&'a Record)) {
        self.visit_numbers(p, |number| look(&self.records[number as usize]));
    }

    /// Goes from the root to the smallest node that holds a place.
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
    use super::*;

    /// Irradiance at a place by as many rays as a record has, of a scene that is known in all directions.
    fn record(p: Vec3, n: Vec3, scene: &impl Fn(Vec3, Vec3) -> Look) -> Record {
        let looks: Vec<Look> = (0..RAYS).map(|i| scene(p, direction(n, i, [0.5, 0.5]))).collect();
        Record::new(p, n, &looks, [1e-3, 10.0])
    }

    /// A wide plane above that grows brighter to one side.
    fn ceiling(p: Vec3, w: Vec3) -> Look {
        if w.y <= 1e-3 {
            return Look { radiance: Vec3::ZERO, distance: f32::INFINITY };
        }
        let distance = (2.0 - p.y) / w.y;
        let hit = p + w * distance;
        Look { radiance: Vec3::new(1.0, (0.5 * hit.x).tanh() + 1.5, 2.0), distance }
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
        assert!(cache.at(Vec3::ZERO, Vec3::Y).is_none());
        cache.add(record(Vec3::ZERO, Vec3::Y, &ceiling));
        assert_eq!(cache.len(), 1);
        assert!(cache.at(Vec3::ZERO, Vec3::Y).is_some() && cache.at(Vec3::X * 0.2, Vec3::Y).is_some());
        assert!(cache.at(Vec3::X * 3.0, Vec3::Y).is_none() && cache.at(Vec3::ZERO, Vec3::X).is_none());
    }

    #[test]
    fn neighbours_clamp_one_another() {
        let mut cache = IrradianceCache::new(Vec3::splat(-4.0), 8.0, 0.5);
        let near = |p: Vec3, radius: f32| Record { radius, ..record(p, Vec3::Y, &ceiling) };
        cache.add(near(Vec3::ZERO, 2.0));
        cache.add(near(Vec3::X * 0.1, 0.05));
        assert!((cache.records[0].radius - 0.15).abs() < 1e-6, "{}", cache.records[0].radius);
    }
}
