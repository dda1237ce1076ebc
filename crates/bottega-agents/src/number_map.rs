//! A map for keys that are mostly 0, 1, 2, …

use std::collections::BTreeMap;

/// Maximum number of slots of the dense part per entry, plus a few.
const SLOTS_EACH: usize = 2;
const SLOTS_MORE: usize = 64;

/// A map for integer keys that are mostly 0, 1, 2, …: these are looked up by index in a vector of at most two slots per
/// entry plus 64, or as many as were reserved. Larger keys are kept in a tree, so that one of them does not enlarge the
/// vector.
#[derive(Clone, Debug, PartialEq)]
pub struct NumberMap<V> {
    dense: Vec<Option<V>>,
    /// Entries beyond the dense part.
    sparse: BTreeMap<u64, V>,
    len: usize,
}

impl<V> Default for NumberMap<V> {
    fn default() -> Self {
        Self { dense: Vec::new(), sparse: BTreeMap::new(), len: 0 }
    }
}

impl<V> NumberMap<V> {
    /// Makes an empty map with room for the keys 0, 1, … `count` − 1, which may be inserted in any order.
    pub fn with_room_for(count: usize) -> Self {
        Self { dense: std::iter::repeat_with(|| None).take(count).collect(), ..Self::default() }
    }

    /// Returns the number of entries.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Returns true if there are no entries.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the value of a number; `None`: it has none.
    pub fn get(&self, number: impl Into<u64>) -> Option<&V> {
        let number = number.into();
        match self.slot(number) {
            Some(slot) => self.dense[slot].as_ref(),
            None if self.sparse.is_empty() => None,
            None => self.sparse.get(&number),
        }
    }

    /// Returns the value of a number, mutable; `None`: it has none.
    pub fn get_mut(&mut self, number: impl Into<u64>) -> Option<&mut V> {
        let number = number.into();
        match self.slot(number) {
            Some(slot) => self.dense[slot].as_mut(),
            None if self.sparse.is_empty() => None,
            None => self.sparse.get_mut(&number),
        }
    }

    /// Returns true if a number has a value.
    pub fn contains(&self, number: impl Into<u64>) -> bool {
        self.get(number).is_some()
    }

    /// Sets the value of a number. Returns the old one; `None`: there was none.
    pub fn insert(&mut self, number: impl Into<u64>, value: V) -> Option<V> {
        let number = number.into();
        if self.slot(number).is_none() && number < (SLOTS_EACH * self.len + SLOTS_MORE) as u64 {
            self.grow(number as usize + 1);
        }
        let before = match self.slot(number) {
            Some(slot) => self.dense[slot].replace(value),
            None => self.sparse.insert(number, value),
        };
        self.len += usize::from(before.is_none());
        before
    }

    /// Removes the value of a number, and returns it; `None`: there was none.
    pub fn remove(&mut self, number: impl Into<u64>) -> Option<V> {
        let number = number.into();
        let before = match self.slot(number) {
            Some(slot) => self.dense[slot].take(),
            None => self.sparse.remove(&number),
        };
        self.len -= usize::from(before.is_some());
        before
    }

    /// Returns all entries in ascending order of their numbers.
    pub fn iter(&self) -> impl Iterator<Item = (u64, &V)> {
        let dense = self.dense.iter().enumerate().filter_map(|(slot, value)| Some((slot as u64, value.as_ref()?)));
        dense.chain(self.sparse.iter().map(|(&number, value)| (number, value)))
    }

    /// Returns all values in ascending order of their numbers.
    pub fn values(&self) -> impl Iterator<Item = &V> {
        self.iter().map(|(_, value)| value)
    }

    fn slot(&self, number: u64) -> Option<usize> {
        usize::try_from(number).ok().filter(|&slot| slot < self.dense.len())
    }

    fn grow(&mut self, slots: usize) {
        self.dense.resize_with(slots, || None);
        while let Some(first) = self.sparse.first_entry().filter(|first| *first.key() < slots as u64) {
            let (number, value) = first.remove_entry();
            self.dense[number as usize] = Some(value);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_number_far_away_costs_one_entry() {
        let mut map = NumberMap::default();
        map.insert(u64::MAX, 1);
        map.insert(1_u64 << 40, 2);
        assert!(map.dense.capacity() < 1000);
        (0..1000_u64).for_each(|number| _ = map.insert(number, 0));
        assert_eq!((map.sparse.len(), map.len()), (2, 1002));
    }

    proptest! {
        #[test]
        fn it_holds_what_a_tree_would(
            changes in prop::collection::vec((prop_oneof![0_u64..300, Just(u64::MAX)], any::<Option<u8>>()), 0..500),
            room in 0_usize..20,
        ) {
            let (mut map, mut tree) = (NumberMap::with_room_for(room), BTreeMap::new());
            for (number, value) in changes {
                match value {
                    Some(value) => prop_assert_eq!(map.insert(number, value), tree.insert(number, value)),
                    None => prop_assert_eq!(map.remove(number), tree.remove(&number)),
                }
                prop_assert_eq!(map.get(number), tree.get(&number));
                prop_assert_eq!(map.len(), tree.len());
            }
            prop_assert!(map.iter().eq(tree.iter().map(|(&number, value)| (number, value))));
        }
    }
}
