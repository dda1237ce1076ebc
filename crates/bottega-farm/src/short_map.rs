//! A map with very few entries.

use crate::ZoneId;

/// A map by zone, as a sorted list: for few entries it is faster than a tree, and it allocates only when it outgrows
/// its capacity.
#[derive(Clone, Debug)]
pub(crate) struct ShortMap<V>(Vec<(ZoneId, V)>);

impl<V> Default for ShortMap<V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<V> ShortMap<V> {
    fn place(&self, zone: ZoneId) -> Result<usize, usize> {
        self.0.binary_search_by_key(&zone, |(zone, _)| *zone)
    }

    pub(crate) fn len(&self) -> usize {
        self.0.len()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    pub(crate) fn get(&self, zone: ZoneId) -> Option<&V> {
        self.place(zone).ok().map(|place| &self.0[place].1)
    }

    pub(crate) fn insert(&mut self, zone: ZoneId, value: V) {
        match self.place(zone) {
            Ok(place) => self.0[place].1 = value,
            Err(place) => self.0.insert(place, (zone, value)),
        }
    }

    pub(crate) fn remove(&mut self, zone: ZoneId) -> Option<V> {
        self.place(zone).ok().map(|place| self.0.remove(place).1)
    }

    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }

    pub(crate) fn iter(&self) -> impl DoubleEndedIterator<Item = (ZoneId, &V)> {
        self.0.iter().map(|(zone, value)| (*zone, value))
    }

    pub(crate) fn iter_mut(&mut self) -> impl Iterator<Item = (ZoneId, &mut V)> {
        self.0.iter_mut().map(|(zone, value)| (*zone, value))
    }

    pub(crate) fn values(&self) -> impl Iterator<Item = &V> {
        self.0.iter().map(|(_, value)| value)
    }

    pub(crate) fn values_mut(&mut self) -> impl Iterator<Item = &mut V> {
        self.0.iter_mut().map(|(_, value)| value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_are_found_by_zone_and_iterated_in_order() {
        let mut map = ShortMap::default();
        [5, 1, 3, 1].into_iter().enumerate().for_each(|(value, zone)| map.insert(ZoneId(zone), value));
        assert_eq!(map.iter().map(|(zone, value)| (zone.0, *value)).collect::<Vec<_>>(), [(1, 3), (3, 2), (5, 0)]);
        assert_eq!((map.remove(ZoneId(3)), map.remove(ZoneId(3)), map.len()), (Some(2), None, 2));
        assert_eq!((map.get(ZoneId(5)), map.get(ZoneId(4))), (Some(&0), None));
        map.clear();
        assert!(map.is_empty());
    }
}
