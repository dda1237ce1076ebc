//! Visibility by kind of ray.

use std::fmt;

use serde::{Deserialize, Serialize};

/// The kinds of ray for which a surface or light exists, as a set. The kind of a ray is that of the event that it leaves.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "u8", into = "u8")]
pub struct Visibility(u8);

impl Visibility {
    /// The empty set: visible to no ray.
    pub const NONE: Self = Self(0);
    /// Rays of the camera.
    pub const CAMERA: Self = Self(1);
    /// Rays that a diffuse lobe reflects.
    pub const DIFFUSE: Self = Self(2);
    /// Rays that a mirror or a glossy lobe reflects.
    pub const GLOSSY: Self = Self(4);
    /// Rays transmitted through a surface.
    pub const TRANSMISSION: Self = Self(8);
    /// Rays scattered within a medium.
    pub const VOLUME: Self = Self(16);
    /// Rays from a point towards a light that was sampled for it: a surface that is not there for them casts no shadow.
    pub const SHADOW: Self = Self(32);
    /// The set of all kinds: visible to all rays.
    pub const ALL: Self = Self(63);
    /// Rays after a scattering event, of all kinds.
    pub const BOUNCES: Self = Self(Self::DIFFUSE.0 | Self::GLOSSY.0 | Self::TRANSMISSION.0 | Self::VOLUME.0);

    /// Returns true if all kinds of `other` are in the set.
    #[inline(always)]
    pub const fn has(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Returns the kinds of ray that are in both sets.
    #[inline(always)]
    #[must_use]
    pub const fn within(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Returns this set without the kinds of `other`.
    #[must_use]
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Returns true if at least one kind of [`Self::BOUNCES`] is in the set.
    pub fn has_bounces(self) -> bool {
        self.within(Self::BOUNCES) != Self::NONE
    }

    /// Returns true if some kinds of [`Self::BOUNCES`] are in the set and others are not, so that paths must know the
    /// kind of their last event.
    pub fn tells_bounces_apart(self) -> bool {
        ![Self::NONE, Self::BOUNCES].contains(&self.within(Self::BOUNCES))
    }
}

impl Default for Visibility {
    fn default() -> Self {
        Self::ALL
    }
}

impl From<Visibility> for u8 {
    fn from(visibility: Visibility) -> Self {
        visibility.0
    }
}

impl TryFrom<u8> for Visibility {
    type Error = String;

    fn try_from(bits: u8) -> Result<Self, String> {
        let is_known = bits & !Self::ALL.0 == 0;
        is_known
            .then_some(Self(bits))
            .ok_or_else(|| format!("{bits} is not a set of kinds of ray: at most 63 is allowed"))
    }
}

impl fmt::Debug for Visibility {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Visibility({:#08b})", self.0)
    }
}
