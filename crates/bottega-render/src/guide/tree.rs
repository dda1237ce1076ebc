//! Regions of surfaces: one binary tree over space for each of six ways that a surface may face.

use glam::Vec3;

use super::directions::{Directions, Pyramid, cell_of, solid_angle};

/// Records from which one region learns.
const RECORDS_PER_REGION: usize = 1200;
/// Shares of the guide that a region may choose between.
const SHARES: [f32; 6] = [0.0, 0.2, 0.35, 0.5, 0.65, 0.8];
/// By what factor the mean square must fall for the guide to be worth its time.
const GAIN_MIN: f32 = 1.05;

/// A vertex of a path where it could have gone elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Record {
    pub(super) p: Vec3,
    /// See [`face_of`].
    pub(super) face: u8,
    /// Whether the path went on from here to the vertex of the next record.
    pub(super) has_next: bool,
    /// Radiance found to leave towards where the path came from.
    pub(super) leaving: f32,
    /// See [`cell_of`]; meaningless where the path ended.
    pub(super) cell: u16,
    /// What a unit of radiance from the direction taken counts for here: f cos over the density, by channel means.
    pub(super) weight: f32,
    /// What was found in that direction before the next vertex, times that.
    pub(super) emitted: f32,
    /// Density with which the direction was drawn, and in BSDF sampling alone.
    pub(super) pdf: f32,
    pub(super) bsdf_pdf: f32,
    /// What a density over the square is to be divided by for one per solid angle; 0 where the path ended.
    pub(super) cube: f32,
}

/// Which of the six axes a normal is nearest to.
#[inline]
pub(super) fn face_of(normal: Vec3) -> usize {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis + usize::from(normal[axis] < 0.0)
}

const UNGUIDED: u32 = u32::MAX;

#[derive(Clone, Copy, Debug)]
enum Node {
    /// Before and after a plane; the second child follows the first.
    Split { axis: u8, plane: f32, first: u32 },
    /// [`UNGUIDED`] where the BSDF is as good a guide.
    Region(u32),
}

/// The directions of one region.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// With which probability the guide is followed, not the BSDF.
    share: f32,
    directions: Directions,
}

impl Region {
    /// With which probability the guide is to be followed.
    #[inline]
    pub(crate) fn share(&self) -> f32 {
        self.share
    }

    /// Density per solid angle with which a direction in world space is drawn by the guide.
    #[inline]
    pub(crate) fn pdf(&self, w: Vec3) -> f32 {
        self.directions.pdf(w)
    }

    /// Draws a direction, with its density.
    #[inline]
    pub(crate) fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        self.directions.sample(u)
    }

    /// `None` where the BSDF is as good a guide.
    fn new(learnt: &Learnt, samples: &[Sample]) -> Option<Self> {
        // What one half has learnt is tried on the other.
        let mut squares = [0.0_f64; SHARES.len()];
        for odd in [false, true] {
            let Some(learnt) = directions(&learnt.halves[usize::from(odd)]) else { continue };
            for sample in half(samples, !odd) {
                let guided = learnt.weight(usize::from(sample.cell)) / sample.cube;
                for (square, share) in squares.iter_mut().zip(SHARES) {
                    let pdf = sample.bsdf_pdf + share * (guided - sample.bsdf_pdf);
                    *square += f64::from(sample.square / pdf.max(1e-20));
                }
            }
        }
        let (best, least) = squares.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1))?;
        if squares[0] < least * f64::from(GAIN_MIN) {
            return None;
        }
        Some(Self { share: SHARES[best], directions: directions(&learnt.whole)? })
    }
}

/// A direction taken at some point of a region, and what it was worth.
#[derive(Clone, Copy)]
struct Sample {
    cell: u16,
    /// Estimate of the mean square, per solid angle.
    square: f32,
    bsdf_pdf: f32,
    cube: f32,
}

/// Every other sample.
fn half(samples: &[Sample], odd: bool) -> impl Iterator<Item = &Sample> {
    samples.iter().skip(usize::from(odd)).step_by(2)
}

/// What is known of a region from all samples, and from each half of them.
struct Learnt {
    whole: Pyramid,
    halves: [Pyramid; 2],
}

impl Learnt {
    fn nothing() -> Self {
        Self { whole: Pyramid::uniform(), halves: [Pyramid::uniform(), Pyramid::uniform()] }
    }

    fn within(&self, samples: &[Sample]) -> Self {
        let halves =
            [false, true].map(|odd| Pyramid::learnt(&self.halves[usize::from(odd)], weights(half(samples, odd))));
        Self { whole: Pyramid::learnt(&self.whole, weights(samples.iter())), halves }
    }
}

/// What a [`Pyramid`] is made of.
fn weights<'a>(samples: impl Iterator<Item = &'a Sample>) -> impl Iterator<Item = (usize, f32)> {
    samples.map(|sample| (usize::from(sample.cell), sample.square))
}

/// The density that serves best where mean squares are as in `learnt`.
fn directions(learnt: &Pyramid) -> Option<Directions> {
    Directions::new(&std::array::from_fn(|cell| (learnt.cell(cell) * solid_angle(cell)).sqrt()))
}

/// What has been learnt about a view of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Guide {
    /// The six trees begin with the first six nodes.
    nodes: Vec<Node>,
    regions: Vec<Region>,
}

impl Guide {
    /// The region of a point on a surface whose normal, on the side from which it is seen, is `normal`. `None`: follow the
    /// BSDF.
    #[inline]
    pub(crate) fn at(&self, p: Vec3, normal: Vec3) -> Option<&Region> {
        let mut at = face_of(normal);
        loop {
            match *self.nodes.get(at)? {
                Node::Split { axis, plane, first } => {
                    at = first as usize + usize::from(p[usize::from(axis)] >= plane);
                }
                Node::Region(region) => return self.regions.get(region as usize),
            }
        }
    }

    /// Bytes held.
    pub(crate) fn memory_bytes(&self) -> usize {
        size_of_val(&*self.nodes) + size_of_val(&*self.regions)
    }

    pub(crate) fn describe(&self) -> String {
        let shares: f32 = self.regions.iter().map(|r| r.share).sum::<f32>() / self.regions.len().max(1) as f32;
        format!("{} nodes {} regions, share {shares}", self.nodes.len(), self.regions.len())
    }

    /// Learns from the vertices of paths, in the order of the paths.
    pub(super) fn learn(records: &[Record]) -> Self {
        let mut guide = Self { nodes: vec![Node::Region(UNGUIDED); 6], regions: Vec::new() };
        let of_face = |face| -> Vec<u32> {
            (0..records.len() as u32).filter(|&index| usize::from(records[index as usize].face) == face).collect()
        };
        // What leaves a vertex is known from one path, and badly; what leaves its region, from many.
        let mut leaving = vec![0.0; records.len()];
        for face in 0..6 {
            guide.split(face, records, of_face(face), &mut leaving);
        }
        let samples: Vec<Option<Sample>> = records.iter().enumerate().map(|(index, record)| {
            let next = if record.has_next { 0.5 * (leaving[index + 1] + records[index + 1].leaving) } else { 0.0 };
            let found = record.emitted + record.weight * next;
            let square = found * found * record.pdf;
            (record.cube > 0.0 && square.is_finite()).then_some(Sample {
                cell: record.cell,
                square,
                bsdf_pdf: record.bsdf_pdf,
                cube: record.cube,
            })
        }).collect();
        for face in 0..6 {
            guide.fill(face, records, &samples, of_face(face), &Learnt::nothing());
        }
        guide
    }

    /// Cuts a region until each part has few vertices, and notes for each of them what leaves its part.
    fn split(&mut self, at: usize, records: &[Record], part: Vec<u32>, leaving: &mut [f32]) {
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for &index in &part {
            let p = records[index as usize].p;
            (low, high) = (low.min(p), high.max(p));
        }
        let extent = high - low;
        let axis = extent.max_position();
        if part.len() > RECORDS_PER_REGION && extent[axis] > 0.0 {
            let mut places: Vec<f32> = part.iter().map(|&index| records[index as usize].p[axis]).collect();
            let middle = places.len() / 2;
            let (_, &mut plane, _) = places.select_nth_unstable_by(middle, f32::total_cmp);
            let (before, after) = halves(records, part, axis, plane);
            if !before.is_empty() {
                let first = self.nodes.len();
                self.nodes[at] = Node::Split { axis: axis as u8, plane, first: first as u32 };
                self.nodes.extend([Node::Region(UNGUIDED); 2]);
                self.split(first, records, before, leaving);
                self.split(first + 1, records, after, leaving);
                return;
            }
            return note(records, &after, leaving);
        }
        note(records, &part, leaving);
    }

    /// Makes the regions.
    fn fill(&mut self, at: usize, records: &[Record], samples: &[Option<Sample>], part: Vec<u32>, around: &Learnt) {
        let seen: Vec<Sample> = part.iter().filter_map(|&index| samples[index as usize]).collect();
        let here = around.within(&seen);
        match self.nodes[at] {
            Node::Split { axis, plane, first } => {
                let (before, after) = halves(records, part, usize::from(axis), plane);
                self.fill(first as usize, records, samples, before, &here);
                self.fill(first as usize + 1, records, samples, after, &here);
            }
            Node::Region(_) => {
                if let Some(region) = Region::new(&here, &seen) {
                    self.nodes[at] = Node::Region(self.regions.len() as u32);
                    self.regions.push(region);
                }
            }
        }
    }
}

fn halves(records: &[Record], part: Vec<u32>, axis: usize, plane: f32) -> (Vec<u32>, Vec<u32>) {
    part.into_iter().partition(|&index| records[index as usize].p[axis] < plane)
}

/// Gives all vertices of a region the root of the mean square of what leaves it.
fn note(records: &[Record], part: &[u32], leaving: &mut [f32]) {
    let sum: f64 = part.iter().map(|&index| f64::from(records[index as usize].leaving)).sum();
    let root = (sum / part.len().max(1) as f64) as f32;
    for &index in part {
        leaving[index as usize] = root;
    }
}

/// The cell of a direction, and what turns densities over the square into ones per solid angle.
pub(super) fn place_of(w: Vec3) -> (u16, f32) {
    let sum = w.x.abs() + w.y.abs() + w.z.abs();
    (cell_of(w) as u16, sum * sum * sum)
}
