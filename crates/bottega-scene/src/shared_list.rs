//! Lists whose elements are shared between copies of the list.

use std::ops::{Index, IndexMut};
use std::sync::Arc;

/// A list of large values. A copy of the list refers to the same values, so it takes no memory for them; a value that is
/// changed while other lists refer to it is copied first.
#[derive(Clone, Debug, PartialEq)]
pub struct SharedList<T>(Vec<Arc<T>>);

impl<T> SharedList<T> {
    /// Returns the number of elements.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns true if the list has no element.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns an element by its index; `None`: there is none.
    pub fn get(&self, index: usize) -> Option<&T> {
        self.0.get(index).map(AsRef::as_ref)
    }

    /// Returns the last element; `None`: the list is empty.
    pub fn last(&self) -> Option<&T> {
        self.0.last().map(AsRef::as_ref)
    }

    /// Returns the elements as shared pointers. Equal pointers mean the same value, also in different lists.
    pub fn shared(&self) -> &[Arc<T>] {
        &self.0
    }

    /// Appends an element.
    pub fn push(&mut self, element: T) {
        self.push_shared(Arc::new(element));
    }

    /// Appends an element that other lists may refer to, without a copy.
    pub fn push_shared(&mut self, element: Arc<T>) {
        self.0.push(element);
    }

    /// Replaces the element at `index`. Other lists that refer to the previous one keep it.
    ///
    /// # Panics
    ///
    /// If there is no such element.
    pub fn set_shared(&mut self, index: usize, element: Arc<T>) {
        self.0[index] = element;
    }

    /// Drops all elements from index `len` on; does nothing if the list is shorter.
    pub fn truncate(&mut self, len: usize) {
        self.0.truncate(len);
    }

    /// Removes the last element and returns it; `None`: the list is empty.
    pub fn pop(&mut self) -> Option<Arc<T>> {
        self.0.pop()
    }

    /// Returns an iterator over the elements.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &T> + DoubleEndedIterator + Clone {
        self.0.iter().map(AsRef::as_ref)
    }
}

impl<T: Clone> SharedList<T> {
    /// Returns an iterator that changes the elements; it copies those that other lists refer to.
    pub fn iter_mut(&mut self) -> impl ExactSizeIterator<Item = &mut T> {
        self.0.iter_mut().map(Arc::make_mut)
    }
}

impl<T> Default for SharedList<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T> Index<usize> for SharedList<T> {
    type Output = T;

    fn index(&self, index: usize) -> &T {
        &self.0[index]
    }
}

impl<T: Clone> IndexMut<usize> for SharedList<T> {
    /// Returns an element to change it; copies it if other lists refer to it.
    fn index_mut(&mut self, index: usize) -> &mut T {
        Arc::make_mut(&mut self.0[index])
    }
}

impl<T> From<Vec<T>> for SharedList<T> {
    fn from(elements: Vec<T>) -> Self {
        elements.into_iter().collect()
    }
}

impl<T> FromIterator<T> for SharedList<T> {
    fn from_iter<I: IntoIterator<Item = T>>(elements: I) -> Self {
        Self(elements.into_iter().map(Arc::new).collect())
    }
}
