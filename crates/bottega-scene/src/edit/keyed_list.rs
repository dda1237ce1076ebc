//! Values by key, in the order in which their keys were added.

use std::collections::{BTreeMap, HashMap};

use super::error::{EditError, EntryKind};

/// Values by key, in the order of a Python dictionary: a replaced value keeps its place, and a removed one that is added again
/// comes last.
#[derive(Clone, Debug)]
pub(super) struct KeyedList<T> {
    kind: EntryKind,
    numbers: HashMap<String, u64>,
    entries: BTreeMap<u64, (String, T)>,
    next: u64,
}

/// The treatment of a key that exists already, when an entry is put under it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PutMode {
    /// The key must be new.
    New,
    /// The key may exist: its value is replaced.
    AddOrReplace,
}

impl<T> KeyedList<T> {
    pub(super) fn new(kind: EntryKind) -> Self {
        Self { kind, numbers: HashMap::new(), entries: BTreeMap::new(), next: 0 }
    }

    /// Checks that a value can be put under a key.
    pub(super) fn check(&self, key: &str, mode: PutMode) -> Result<(), EditError> {
        if key.is_empty() {
            return Err(EditError::NoKey { kind: self.kind });
        }
        if mode == PutMode::New && self.numbers.contains_key(key) {
            return Err(EditError::Taken { kind: self.kind, key: key.to_owned() });
        }
        Ok(())
    }

    /// Adds or replaces a value.
    pub(super) fn put(&mut self, key: &str, value: T) {
        match self.numbers.get(key) {
            Some(number) => {
                self.entries.insert(*number, (key.to_owned(), value));
            }
            None => {
                self.numbers.insert(key.to_owned(), self.next);
                self.entries.insert(self.next, (key.to_owned(), value));
                self.next += 1;
            }
        }
    }

    /// Returns a value; `None`: there is none with this key.
    pub(super) fn find(&self, key: &str) -> Option<&T> {
        self.numbers.get(key).map(|number| &self.entries[number].1)
    }

    pub(super) fn get(&self, key: &str) -> Result<&T, EditError> {
        self.find(key).ok_or_else(|| self.unknown(key))
    }

    pub(super) fn get_mut(&mut self, key: &str) -> Result<&mut T, EditError> {
        match self.numbers.get(key).and_then(|number| self.entries.get_mut(number)) {
            Some((_, value)) => Ok(value),
            None => Err(EditError::Unknown { kind: self.kind, key: key.to_owned(), known: Vec::new() }),
        }
    }

    pub(super) fn remove(&mut self, key: &str) -> Result<T, EditError> {
        let number = self.numbers.remove(key).ok_or_else(|| self.unknown(key))?;
        self.entries.remove(&number).map(|(_, value)| value).ok_or_else(|| self.unknown(key))
    }

    /// Brings the values into the order of some keys; those without one of these keys follow, in their order.
    ///
    /// # Errors
    /// A key does not exist; nothing has changed then.
    pub(super) fn arrange(&mut self, keys: &[String]) -> Result<(), EditError> {
        if let Some(key) = keys.iter().find(|key| !self.numbers.contains_key(*key)) {
            return Err(self.unknown(key));
        }
        if self.keys().take(keys.len()).eq(keys.iter().map(|key| &**key)) {
            return Ok(());
        }
        let mut entries = std::mem::take(&mut self.entries);
        let first: Vec<_> = keys.iter().filter_map(|key| entries.remove(&self.numbers[key])).collect();
        for (number, (key, value)) in (0..).zip(first.into_iter().chain(entries.into_values())) {
            self.numbers.insert(key.clone(), number);
            self.entries.insert(number, (key, value));
            self.next = number + 1;
        }
        Ok(())
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, &T)> {
        self.entries.values().map(|(key, value)| (&**key, value))
    }

    pub(super) fn keys(&self) -> impl Iterator<Item = &str> {
        self.iter().map(|(key, _)| key)
    }

    pub(super) fn len(&self) -> usize {
        self.entries.len()
    }

    /// Returns a key that does not exist, made from a name.
    pub(super) fn fresh_key(&self, name: &str) -> String {
        let name = if name.is_empty() { self.kind.to_string() } else { name.to_owned() };
        let mut key = name.clone();
        // Begin at the number of entries, so that many equal names do not try all numbers.
        let mut number = self.entries.len().max(1);
        while self.numbers.contains_key(&key) {
            key = format!("{name}.{number}");
            number += 1;
        }
        key
    }

    fn unknown(&self, key: &str) -> EditError {
        EditError::Unknown { kind: self.kind, key: key.to_owned(), known: self.keys().map(str::to_owned).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_keep_the_order_of_a_python_dictionary() {
        let mut list = KeyedList::new(EntryKind::Light);
        for key in ["a", "b", "c"] {
            list.put(key, 0);
        }
        list.put("a", 1);
        assert_eq!(list.remove("b"), Ok(0));
        list.put("b", 2);
        assert_eq!(list.iter().collect::<Vec<_>>(), [("a", &1), ("c", &0), ("b", &2)]);
        list.arrange(&["b".into(), "a".into()]).unwrap();
        list.put("d", 3);
        assert_eq!(list.keys().collect::<Vec<_>>(), ["b", "a", "c", "d"]);
        assert!(matches!(list.arrange(&["a".into(), "x".into()]), Err(EditError::Unknown { .. })));
        list.arrange(&["a".into(), "c".into(), "b".into()]).unwrap();
        assert_eq!(list.remove("d"), Ok(3));
        assert!(list.check("a", PutMode::AddOrReplace).is_ok());
        assert!(matches!(list.check("a", PutMode::New), Err(EditError::Taken { .. })));
        assert_eq!(list.fresh_key("d"), "d");
        assert_eq!((list.fresh_key("a"), list.fresh_key("")), ("a.3".into(), "light".into()));
        let message = list.get("x").unwrap_err().to_string();
        assert_eq!(message, "there is no light `x`; the scene has `a`, `c`, `b`");
    }
}
