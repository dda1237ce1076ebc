//! Text metadata of a picture file.

use std::collections::BTreeMap;

/// Text stored with a picture: scene digest, settings, seed, times, software. Text attributes in EXR, text chunks in
/// PNG. Ordered by key, so equal metadata gives equal bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Metadata(BTreeMap<String, String>);

impl Metadata {
    /// Maximal length of a key, in bytes: PNG's limit.
    pub const MAX_KEY_BYTES: usize = 79;

    /// Returns metadata with one entry, `software`: the name and version of this software.
    pub fn new() -> Self {
        let mut metadata = Self::default();
        metadata.set("software", concat!("Bottega ", env!("CARGO_PKG_VERSION")));
        metadata
    }

    /// Sets a value, replacing an earlier one. NUL bytes of `value` become spaces, as no format can hold them.
    ///
    /// # Panics
    ///
    /// Unless `key` is 1 to [`MAX_KEY_BYTES`](Self::MAX_KEY_BYTES) printable ASCII characters without spaces.
    pub fn set(&mut self, key: &str, value: impl Into<String>) {
        assert!(Self::is_key(key), "metadata key `{key}`");
        self.0.insert(key.to_owned(), value.into().replace('\0', " "));
    }

    /// Returns the value of `key`; `None`: there is none.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.0.get(key).map(String::as_str)
    }

    /// Iterates over all keys and values, sorted by key.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(key, value)| (key.as_str(), value.as_str()))
    }

    /// Sets a value read from a file; ignores a key that [`set`](Self::set) does not accept.
    pub(crate) fn set_read(&mut self, key: &str, value: String) {
        if Self::is_key(key) {
            self.0.insert(key.to_owned(), value);
        }
    }

    fn is_key(key: &str) -> bool {
        (1..=Self::MAX_KEY_BYTES).contains(&key.len()) && key.bytes().all(|b| b.is_ascii_graphic())
    }
}
