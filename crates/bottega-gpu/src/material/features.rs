//! The shader features that a scene's surfaces use. Unused features are not compiled and take no registers.

use std::fmt::Write as _;

/// A set of features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Features(u32);

/// The names of the shaders' constants, by bit.
const NAMES: [&str; 11] = [
    "HAS_TEXTURES",
    "HAS_BECKMANN",
    "HAS_CONDUCTOR",
    "HAS_DIELECTRIC",
    "HAS_PLASTIC",
    "HAS_STACK",
    "HAS_PRINCIPLED",
    "HAS_LAYERED",
    "HAS_FILM",
    "HAS_COAT",
    "HAS_SHEEN",
];

impl Features {
    pub(crate) const TEXTURES: Self = Self(1 << 0);
    pub(super) const BECKMANN: Self = Self(1 << 1);
    pub(super) const CONDUCTOR: Self = Self(1 << 2);
    pub(super) const DIELECTRIC: Self = Self(1 << 3);
    pub(super) const PLASTIC: Self = Self(1 << 4);
    pub(super) const STACK: Self = Self(1 << 5);
    pub(super) const PRINCIPLED: Self = Self(1 << 6);
    pub(super) const LAYERED: Self = Self(1 << 7);
    pub(super) const FILM: Self = Self(1 << 8);
    pub(super) const COAT: Self = Self(1 << 9);
    pub(super) const SHEEN: Self = Self(1 << 10);
    /// The set of all features.
    #[cfg(test)]
    pub(crate) const ALL: Self = Self((1 << NAMES.len()) - 1);

    pub(crate) fn with(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// Returns the union with `others` if the condition holds.
    pub(crate) fn with_if(self, condition: bool, others: Self) -> Self {
        if condition { self.with(others) } else { self }
    }

    /// Returns true if any of `others` is in the set.
    pub(super) fn has_some_of(self, others: Self) -> bool {
        self.0 & others.0 != 0
    }

    /// Returns the names of the constants whose features are absent.
    pub(super) fn missing(self) -> impl Iterator<Item = &'static str> {
        NAMES.iter().enumerate().filter(move |(bit, _)| self.0 >> bit & 1 == 0).map(|(_, name)| *name)
    }

    /// Returns the features as constant declarations of WGSL.
    pub(super) fn constants(self) -> String {
        NAMES.iter().enumerate().fold(String::new(), |mut all, (bit, name)| {
            let _ = writeln!(all, "const {name}: bool = {};", self.0 >> bit & 1 == 1);
            all
        })
    }
}
