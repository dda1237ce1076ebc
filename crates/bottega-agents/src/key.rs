//! Keys of entries in the store.

use std::{fmt, sync::Arc};

/// The key of an entry, such as `work/7/zone/12`. Watches select keys by prefix.
///
/// Stored as a folder, which many entries share, and a name in it. A numeric name needs no formatting, and the store
/// finds its entry by index.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key {
    /// The part up to and including the last `/`.
    pub(crate) folder: Arc<str>,
    pub(crate) name: EntryName,
}

/// The name of an entry in its folder: the part of the key after the last `/`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum EntryName {
    /// A number in its canonical form, without sign or leading zeros.
    Number(u64),
    /// Any other text.
    Text(Arc<str>),
}

impl Key {
    /// Makes the key of a number in a folder.
    ///
    /// # Panics
    /// Unless `folder` ends with `/`.
    pub fn numbered(folder: &Arc<str>, number: u64) -> Self {
        assert!(folder.ends_with('/'), "the name of a folder ends with a stroke");
        Self { folder: Arc::clone(folder), name: EntryName::Number(number) }
    }

    /// Makes the key of a name in a folder. A name that contains `/` gives a key in a folder below.
    ///
    /// # Panics
    /// Unless `folder` ends with `/`.
    pub fn named(folder: &Arc<str>, name: &Arc<str>) -> Self {
        assert!(folder.ends_with('/'), "the name of a folder ends with a stroke");
        if name.contains('/') {
            return Self::from(format!("{folder}{name}"));
        }
        let number = number(name).map(EntryName::Number);
        Self { folder: Arc::clone(folder), name: number.unwrap_or_else(|| EntryName::Text(Arc::clone(name))) }
    }

    /// Returns true if the key, as text, starts with `prefix`.
    pub fn starts_with(&self, prefix: &Self) -> bool {
        match &prefix.name {
            EntryName::Text(rest) if rest.is_empty() => self.folder.starts_with(&*prefix.folder),
            _ => self.to_string().starts_with(&prefix.to_string()),
        }
    }
}

/// Parses a number in canonical form.
fn number(text: &str) -> Option<u64> {
    let first = text.bytes().next()?;
    let is_canonical = first.is_ascii_digit() && (first != b'0' || text.len() == 1);
    if is_canonical { text.parse().ok() } else { None }
}

impl<T: AsRef<str>> From<T> for Key {
    fn from(name: T) -> Self {
        let name = name.as_ref();
        let (folder, name) = name.split_at(name.rfind('/').map_or(0, |stroke| stroke + 1));
        Self {
            folder: folder.into(),
            name: number(name).map_or_else(|| EntryName::Text(name.into()), EntryName::Number),
        }
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.name {
            EntryName::Number(number) => write!(f, "{}{number}", self.folder),
            EntryName::Text(name) => write!(f, "{}{name}", self.folder),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_the_text_that_it_was_made_of() {
        for text in
            ["", "/", "a", "work/7/zone/12", "work/7/zone/012", "7", "0", "00", "a/+3", "a/99999999999999999999"]
        {
            assert_eq!(Key::from(text).to_string(), text);
        }
        let folder: Arc<str> = "work/1/".into();
        for name in ["7", "007", "agent-7", "x/7", "x/y", ""] {
            assert_eq!(Key::named(&folder, &name.into()), Key::from(format!("work/1/{name}")), "{name}");
        }
        assert_eq!(Key::numbered(&folder, 7), Key::from("work/1/7"));
    }

    #[test]
    fn prefixes_go_by_text() {
        let key = Key::from("work/1/zone/12");
        for prefix in ["", "work/", "work/1/zone/", "work/1/zone/1", "work/1/zone/12", "wor"] {
            assert!(key.starts_with(&prefix.into()), "{prefix}");
        }
        for other in ["work/2/", "work/1/zone/2", "work/1/zone/123", "zone"] {
            assert!(!key.starts_with(&other.into()), "{other}");
        }
    }
}
