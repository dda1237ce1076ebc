//! AOVs: values of a pixel beside its color.

/// An arbitrary output variable: a value of a pixel beside its color.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Aov {
    /// Reflectance of the first non-specular surface, linear RGB.
    Albedo,
    /// Shading normal of the first surface, world space, x y z.
    Normal,
    /// Distance from the camera to the first surface, in scene units; 0 where nothing is hit.
    Depth,
    /// Number of samples of the pixel.
    SampleCount,
    /// Cost of the pixel: traversal steps and shading, in the units of the renderer's cost model.
    Cost,
}

impl Aov {
    /// All AOVs, in their order within a pixel.
    pub const ALL: [Self; 5] = [Self::Albedo, Self::Normal, Self::Depth, Self::SampleCount, Self::Cost];

    /// Returns the name in the command line, JSON and EXR layers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::SampleCount => "samples",
            Self::Cost => "cost",
        }
    }

    /// Returns the number of floats in a pixel. The sample count is always kept and needs none of its own.
    pub fn channel_count(self) -> usize {
        match self {
            Self::SampleCount => 0,
            Self::Cost => 1,
            other => other.channels().len(),
        }
    }

    /// Returns the names of the AOV's channels within its layer; empty for a single channel.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo => &["R", "G", "B"],
            Self::Normal => &["X", "Y", "Z"],
            Self::Depth => &["Z"],
            Self::SampleCount | Self::Cost => &[],
        }
    }

    /// Returns the full names of its channels in a file.
    pub fn full_names(self) -> Vec<String> {
        match self.channels() {
            [] => vec![self.name().to_owned()],
            channels => channels.iter().map(|channel| format!("{}.{channel}", self.name())).collect(),
        }
    }
}

/// A set of AOVs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AovSet(u8);

impl AovSet {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Returns this set with `aov` added.
    #[must_use]
    pub fn with(self, aov: Aov) -> Self {
        Self(self.0 | 1 << aov as u8)
    }

    /// Returns true if `aov` is in the set.
    pub fn contains(self, aov: Aov) -> bool {
        self.0 & (1 << aov as u8) != 0
    }

    /// Returns one bit per AOV, the first of [`Aov::ALL`] lowest: for stored tiles.
    pub fn bits(self) -> u8 {
        self.0
    }

    /// Returns the set of these [`bits`](Self::bits); `None` if an unknown bit is set.
    pub fn from_bits(bits: u8) -> Option<Self> {
        (bits >> Aov::ALL.len() == 0).then_some(Self(bits))
    }

    /// Iterates over the members of the set, in the order of [`Aov::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Aov> {
        Aov::ALL.into_iter().filter(move |&aov| self.contains(aov))
    }
}

impl FromIterator<Aov> for AovSet {
    fn from_iter<I: IntoIterator<Item = Aov>>(aovs: I) -> Self {
        aovs.into_iter().fold(Self::NONE, Self::with)
    }
}
