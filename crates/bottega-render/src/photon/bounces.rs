//! Light at a point by number of bounces, so that a path takes only as much of it as its depth allows.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::{
    bytes::{ByteForm, Reader, Writer},
    map::{Nearest, PhotonMap},
    record::{Photon, of_shared_exponent, shared_exponent},
};

/// Number of bounce counts that are distinguished; the last one stands for all above.
pub(crate) const BOUNCES_KEPT: usize = 32;

/// Light by number of bounces.
pub(crate) type ByBounces = [Spectrum; BOUNCES_KEPT];

/// Shares of the light at a point by number of bounces, for each of red, green and blue.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BounceShares {
    parts: ByBounces,
    count: usize,
}

impl Default for BounceShares {
    fn default() -> Self {
        Self { parts: [Spectrum::ZERO; BOUNCES_KEPT], count: 0 }
    }
}

impl BounceShares {
    /// Adds light with this number of bounces.
    #[inline(always)]
    pub(crate) fn add(&mut self, bounces: usize, light: Spectrum) {
        self.parts[bounces] += light;
        self.count = self.count.max(bounces + 1);
    }

    /// Multiplies the shares of all numbers of bounces.
    pub(crate) fn scale(&mut self, by: Spectrum) {
        self.parts[..self.count].iter_mut().for_each(|part| *part *= by);
    }

    /// Returns the shares of 0, 1, 2 … bounces.
    pub(crate) fn as_slice(&self) -> &[Spectrum] {
        &self.parts[..self.count]
    }
}

/// Returns the index of a number of bounces in [`ByBounces`].
#[inline(always)]
pub(crate) fn kept(bounces: u32) -> usize {
    (bounces as usize).min(BOUNCES_KEPT - 1)
}

/// Bits of a label that hold the length of the list.
const COUNT_BITS: u32 = 6;
/// Greatest number of entries in all lists of a map. Light of further places is not divided by bounces.
const NUMBERS_MAX: usize = 1 << (u32::BITS - COUNT_BITS);

/// Points on surfaces with the irradiance there, estimated from photons and kept apart by numbers of bounces.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IrradiancePlaces {
    /// Points, with the irradiance by all light as power; the label holds start and length of the list.
    places: Vec<Photon>,
    /// Irradiance by light with at most 0, 1, 2 … bounces, as shared-exponent colors; the total is left out.
    lists: Vec<u32>,
}

/// Points with precomputed irradiance in a tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct IrradianceMap {
    map: PhotonMap,
    lists: Vec<u32>,
}

impl IrradiancePlaces {
    /// Returns the number of points.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Returns `true` if there are no points.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Adds a point.
    ///
    /// - `irradiance`: by number of bounces.
    pub(crate) fn push(&mut self, place: Photon, irradiance: &ByBounces) {
        let count = irradiance.iter().rposition(|part| *part != Spectrum::ZERO).map_or(0, |last| last + 1);
        let has_room = self.lists.len() + count < NUMBERS_MAX;
        let label = if has_room { (self.lists.len() as u32) << COUNT_BITS | count as u32 } else { 0 };
        let mut sum = Spectrum::ZERO;
        for (part, i) in irradiance[..count].iter().zip(1..) {
            sum += *part;
            if i < count && has_room {
                self.lists.push(shared_exponent(sum));
            }
        }
        self.places.push(place.with_power(sum).with_label(label));
    }

    /// Appends the points that follow.
    pub(crate) fn append(&mut self, later: Self) {
        let first = self.lists.len();
        if first + later.lists.len() < NUMBERS_MAX {
            let moved = |place: &Photon| place.with_label(place.mark().label() + ((first as u32) << COUNT_BITS));
            self.places.extend(later.places.iter().map(moved));
            self.lists.extend(later.lists);
        } else {
            self.places.extend(later.places.iter().map(|place| place.with_label(0)));
        }
    }
}

impl ByteForm for IrradiancePlaces {
    fn write(&self, to: &mut Writer) {
        to.photons(&self.places);
        to.numbers(&self.lists);
    }

    fn read(from: &mut Reader<'_>) -> Option<Self> {
        let (places, lists) = (from.photons()?, from.numbers()?);
        let is_sound = places.iter().all(|place| has_list(place.mark().label(), &lists));
        is_sound.then_some(Self { places, lists })
    }
}

impl IrradianceMap {
    /// Builds the tree on the current thread pool.
    pub(crate) fn new(known: IrradiancePlaces) -> Self {
        Self { map: PhotonMap::new(known.places), lists: known.lists }
    }

    /// Returns the points; their power is the irradiance by all light.
    pub(crate) fn places(&self) -> &PhotonMap {
        &self.map
    }

    /// Returns the irradiance at a point by its number, by light with at most `bounces` bounces.
    #[inline(always)]
    pub(crate) fn irradiance(&self, number: u32, bounces: u32) -> Spectrum {
        let mark = self.map.mark(number);
        let (first, count) = (mark.label() >> COUNT_BITS, mark.label() & ((1 << COUNT_BITS) - 1));
        if kept(bounces) as u32 + 1 >= count {
            return mark.power();
        }
        of_shared_exponent(self.lists[first as usize + bounces as usize])
    }

    /// Returns the irradiance at a point by its number, by number of bounces.
    pub(crate) fn by_bounces(&self, number: u32) -> ByBounces {
        let mut below = Spectrum::ZERO;
        std::array::from_fn(|bounces| {
            let sum = self.irradiance(number, bounces as u32);
            (sum - std::mem::replace(&mut below, sum)).max(Spectrum::ZERO)
        })
    }

    /// Finds the nearest points; see [`PhotonMap::nearest`].
    #[inline(always)]
    pub(crate) fn nearest(&self, p: Vec3, radius_squared: f32, found: &mut Nearest) {
        self.map.nearest(p, radius_squared, found);
    }

    /// Returns the memory, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.map.memory_bytes() + size_of_val(&*self.lists)
    }

    /// Writes the points with their lists.
    pub(crate) fn write(&self, to: &mut Writer) {
        to.map(&self.map);
        to.numbers(&self.lists);
    }

    /// Reads points with their lists; `None`: not valid.
    pub(crate) fn read(from: &mut Reader<'_>) -> Option<Self> {
        let (map, lists) = (from.map()?, from.numbers()?);
        let is_sound = map.iter().all(|place| has_list(place.mark().label(), &lists));
        is_sound.then_some(Self { map, lists })
    }
}

/// Returns `true` if the list of a label exists.
fn has_list(label: u32, lists: &[u32]) -> bool {
    let (first, count) = (label >> COUNT_BITS, label & ((1 << COUNT_BITS) - 1));
    count as usize <= BOUNCES_KEPT && first as usize + (count as usize).saturating_sub(1) <= lists.len()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn irradiance_is_kept_apart_by_bounces() {
        let light = |parts: &[(usize, f32)]| {
            let mut all = [Spectrum::ZERO; BOUNCES_KEPT];
            parts.iter().for_each(|&(bounces, value)| all[bounces] = Spectrum::splat(value));
            all
        };
        let at = |x: f32| Photon::new(Vec3::X * x, Vec3::Y, Vec3::Y, Spectrum::ZERO);
        let mut known = IrradiancePlaces::default();
        known.push(at(0.0), &light(&[]));
        known.push(at(1.0), &light(&[(0, 1.0), (2, 2.0)]));
        let mut later = IrradiancePlaces::default();
        later.push(at(2.0), &light(&[(1, 0.5), (BOUNCES_KEPT - 1, 0.25)]));
        known.append(later);
        let mut to = Writer::default();
        known.write(&mut to);
        assert_eq!(IrradiancePlaces::read(&mut Reader(&to.0)).as_ref(), Some(&known));
        let map = IrradianceMap::new(known);
        let irradiance = |x: f32, bounces: u32| {
            let number = map.places().nearest_where(Vec3::X * x, 0.1, |_| true).unwrap();
            map.irradiance(number, bounces).x
        };
        assert_eq!([0, 9].map(|bounces| irradiance(0.0, bounces)), [0.0, 0.0]);
        assert_eq!([0, 1, 2, 90].map(|bounces| irradiance(1.0, bounces)), [1.0, 1.0, 3.0, 3.0]);
        assert_eq!([0, 1, 30, 31, u32::MAX].map(|bounces| irradiance(2.0, bounces)), [0.0, 0.5, 0.5, 0.75, 0.75]);
        let number = map.places().nearest_where(Vec3::X * 2.0, 0.1, |_| true).unwrap();
        let parts = map.by_bounces(number);
        assert_eq!((parts[0].x, parts[1].x, parts[2].x, parts[31].x), (0.0, 0.5, 0.0, 0.25));
    }
}
