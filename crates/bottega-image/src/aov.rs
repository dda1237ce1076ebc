//! AOVs: values of a pixel beside its color.

use crate::matte;

/// An arbitrary output variable: a value of a pixel beside its color.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Aov {
    /// Reflectance of the first non-specular surface, linear RGB.
    Albedo,
    /// Shading normal of the first surface, world space, x y z; 0 where the first event is scattering in a medium.
    Normal,
    /// Distance from the camera to the first surface, or to the first scattering in a medium, in scene units; 0: neither.
    Depth,
    /// Number of samples of the pixel.
    SampleCount,
    /// Cost of the pixel: traversal steps and shading, in the units of the renderer's cost model.
    Cost,
    /// Position of the first surface, or of the first scattering in a medium, world space, x y z.
    Position,
    /// Geometric normal of the first surface, on the side of the camera, world space, x y z.
    GeometricNormal,
    /// First set of texture coordinates of the first surface, u v.
    Uv,
    /// Light that scattered once at most, linear RGB.
    Direct,
    /// Light that scattered more than once, linear RGB.
    Indirect,
    /// Standard error of the mean luminance; its square is the variance of the mean.
    Error,
    /// Motion vectors of the first surface, in pixels to the right and up: from where it is to where it is when the
    /// shutter is closed (forward) and when it opens (backward).
    Motion,
    /// Light on shadow catchers with all objects, R G B, and the share of the pixel that shows them. In a
    /// [finished](crate::Film::finished) film, the share of the light that the other objects leave to them.
    ShadowCatcher,
    /// Light on shadow catchers without the other objects, linear RGB.
    CatcherLight,
    /// Ranks of the objects that cover the pixel: a Cryptomatte.
    CryptoObject,
    /// Ranks of the materials that cover the pixel: a Cryptomatte.
    CryptoMaterial,
    /// Ranks of the assets that cover the pixel: a Cryptomatte.
    CryptoAsset,
}

impl Aov {
    /// All AOVs, in their order within a pixel.
    pub const ALL: [Self; 17] = [
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::SampleCount,
        Self::Cost,
        Self::Position,
        Self::GeometricNormal,
        Self::Uv,
        Self::Direct,
        Self::Indirect,
        Self::Error,
        Self::Motion,
        Self::ShadowCatcher,
        Self::CatcherLight,
        Self::CryptoObject,
        Self::CryptoMaterial,
        Self::CryptoAsset,
    ];
    /// The layers of pictures with shadow catchers, and of no others.
    pub const CATCHERS: [Self; 2] = [Self::ShadowCatcher, Self::CatcherLight];
    /// The Cryptomattes, which lie last within a pixel.
    pub const MATTES: [Self; 3] = [Self::CryptoObject, Self::CryptoMaterial, Self::CryptoAsset];

    /// Returns the name in the command line and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Albedo => "albedo",
            Self::Normal => "normal",
            Self::Depth => "depth",
            Self::SampleCount => "samples",
            Self::Cost => "cost",
            Self::Position => "position",
            Self::GeometricNormal => "geometric-normal",
            Self::Uv => "uv",
            Self::Direct => "direct",
            Self::Indirect => "indirect",
            Self::Error => "error",
            Self::Motion => "motion",
            Self::ShadowCatcher => "shadow-catcher",
            Self::CatcherLight => "catcher-light",
            Self::CryptoObject => "crypto-object",
            Self::CryptoMaterial => "crypto-material",
            Self::CryptoAsset => "crypto-asset",
        }
    }

    /// Returns the name of the layer in an EXR file, by the custom of compositing programs.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Position => "P",
            Self::GeometricNormal => "geometric_normal",
            Self::ShadowCatcher => "shadow_catcher",
            Self::CatcherLight => "catcher_light",
            Self::CryptoObject => "CryptoObject",
            Self::CryptoMaterial => "CryptoMaterial",
            Self::CryptoAsset => "CryptoAsset",
            other => other.name(),
        }
    }

    /// Returns true for a Cryptomatte.
    pub fn is_matte(self) -> bool {
        Self::MATTES.contains(&self)
    }

    /// Returns the number of floats that the AOV adds to a pixel. It is 0 for the sample count and the error, which are
    /// always kept.
    pub fn channel_count(self) -> usize {
        match self {
            Self::SampleCount | Self::Error => 0,
            Self::Cost => 1,
            matte if matte.is_matte() => matte::FLOATS,
            other => other.channels().len(),
        }
    }

    /// Returns the names of the AOV's channels within its layer; empty for a single channel and for a Cryptomatte. Motion
    /// vectors have Nuke's full names, without a layer before them.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Self::ShadowCatcher => &["R", "G", "B", "A"],
            Self::Albedo | Self::Direct | Self::Indirect | Self::CatcherLight => &["R", "G", "B"],
            Self::Normal | Self::Position | Self::GeometricNormal => &["X", "Y", "Z"],
            Self::Depth => &["Z"],
            Self::Uv => &["U", "V"],
            Self::Motion => &["forward.u", "forward.v", "backward.u", "backward.v"],
            Self::SampleCount | Self::Cost | Self::Error => &[],
            Self::CryptoObject | Self::CryptoMaterial | Self::CryptoAsset => &[],
        }
    }

    /// Returns the full names of its channels in a file, in their order within a pixel.
    pub fn full_names(self) -> Vec<String> {
        let layer = self.file_name();
        match self.channels() {
            // Cryptomatte 1.2: two ranks of identity and coverage in each layer of four channels
            [] if self.is_matte() => (0..matte::RANKS_WRITTEN / 2)
                .flat_map(|pair| ["R", "G", "B", "A"].map(|channel| format!("{layer}{pair:02}.{channel}")))
                .collect(),
            [] => vec![layer.to_owned()],
            channels if self == Self::Motion => channels.iter().map(|&channel| channel.to_owned()).collect(),
            channels => channels.iter().map(|channel| format!("{layer}.{channel}")).collect(),
        }
    }
}

/// A set of AOVs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct AovSet(u32);

impl AovSet {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Returns this set with `aov` added.
    #[must_use]
    pub fn with(self, aov: Aov) -> Self {
        Self(self.0 | 1 << aov as u32)
    }

    /// Returns true if `aov` is in the set.
    pub fn contains(self, aov: Aov) -> bool {
        self.0 & (1 << aov as u32) != 0
    }

    /// Returns one bit per AOV, the first of [`Aov::ALL`] lowest: for stored tiles.
    pub fn bits(self) -> u32 {
        self.0
    }

    /// Returns the set of these [`bits`](Self::bits); `None` if an unknown bit is set.
    pub fn from_bits(bits: u32) -> Option<Self> {
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
