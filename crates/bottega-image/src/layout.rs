//! Which values a pixel holds, and where.

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
            Self::Albedo | Self::Normal => 3,
            Self::Depth | Self::Cost => 1,
            Self::SampleCount => 0,
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

/// Where each value lies in a pixel of a [`Tile`](crate::Tile): first radiance R G B, then alpha, then the sum of
/// squared luminances (for the variance), then the sample count, then the AOVs that are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    aovs: AovSet,
}

impl Layout {
    /// Offset of radiance R, G, B.
    pub const COLOR: usize = 0;
    /// Offset of the sum of alpha.
    pub const ALPHA: usize = 3;
    /// Offset of the sum of squared luminances.
    pub const LUMINANCE_SQUARED: usize = 4;
    /// Offset of the number of samples, exact up to 2²⁴.
    pub const SAMPLE_COUNT: usize = 5;
    const FIXED: usize = 6;

    /// The layout that keeps these AOVs.
    pub fn new(aovs: AovSet) -> Self {
        Self { aovs }
    }

    /// The AOVs kept.
    pub fn aovs(&self) -> AovSet {
        self.aovs
    }

    /// Floats in a pixel.
    pub fn stride(&self) -> usize {
        Self::FIXED + self.aovs.iter().map(Aov::channel_count).sum::<usize>()
    }

    /// Offset of the first float of `aov`; `None` when it is not kept.
    pub fn offset(&self, aov: Aov) -> Option<usize> {
        if aov == Aov::SampleCount {
            return Some(Self::SAMPLE_COUNT);
        }
        self.aovs.contains(aov).then(|| {
            Self::FIXED + self.aovs.iter().take_while(|&other| other != aov).map(Aov::channel_count).sum::<usize>()
        })
    }
}
