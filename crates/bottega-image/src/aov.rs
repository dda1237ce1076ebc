//! Values that a picture can carry beside its colour.

/// A value that a picture can carry beside its colour ("arbitrary output variable").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Aov {
    /// Reflectance of the first non-specular surface, linear RGB.
    Albedo,
    /// Shading normal of the first surface, world space, x y z.
    Normal,
    /// Distance from the camera to the first surface, in scene units; 0 where nothing is hit.
    Depth,
    /// Samples taken of the pixel.
    SampleCount,
    /// What the pixel cost: traversal steps and shading, in the units of the renderer's cost model.
    Cost,
}

impl Aov {
    /// All of them, in the order in which they lie in a pixel.
    pub const ALL: [Self; 5] = [Self::Albedo, Self::Normal, Self::Depth, Self::SampleCount, Self::Cost];

    /// The name in the command line, JSON and EXR layers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::SampleCount => "samples",
            Self::Cost => "cost",
        }
    }

    /// Floats that it takes in a pixel. The sample count is always kept and takes none of its own.
    pub fn channel_count(self) -> usize {
        match self {
            Self::SampleCount => 0,
            Self::Cost => 1,
            other => other.channels().len(),
        }
    }

    /// Names of its channels within its layer; none where it is a channel by itself.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::Albedo => &["R", "G", "B"],
            Self::Normal => &["X", "Y", "Z"],
            Self::Depth => &["Z"],
            Self::SampleCount | Self::Cost => &[],
        }
    }

    /// The names of its channels in a file.
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
    /// No AOV.
    pub const NONE: Self = Self(0);

    /// This set and `aov`.
    #[must_use]
    pub fn with(self, aov: Aov) -> Self {
        Self(self.0 | 1 << aov as u8)
    }

    /// Whether `aov` is in it.
    pub fn contains(self, aov: Aov) -> bool {
        self.0 & (1 << aov as u8) != 0
    }

    /// One bit an AOV, the first of [`Aov::ALL`] lowest: for stored tiles.
    pub fn bits(self) -> u8 {
        self.0
    }

    /// The set of these [`bits`](Self::bits); `None` when one of them means nothing.
    pub fn from_bits(bits: u8) -> Option<Self> {
        (bits >> Aov::ALL.len() == 0).then_some(Self(bits))
    }

    /// Its members, in the order of [`Aov::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Aov> {
        Aov::ALL.into_iter().filter(move |&aov| self.contains(aov))
    }
}

impl FromIterator<Aov> for AovSet {
    fn from_iter<I: IntoIterator<Item = Aov>>(aovs: I) -> Self {
        aovs.into_iter().fold(Self::NONE, Self::with)
    }
}
