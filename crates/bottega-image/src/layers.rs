//! Named layers with channels of their own: those of other engines, and of light groups.

use crate::aov::{Aov, AovSet};

/// Maximal number of layers of a picture.
pub const LAYERS_MAX: usize = 128;
/// Maximal number of channels of all layers of a picture.
pub const CHANNELS_MAX: usize = 512;
/// Maximal length of a channel's full name, in bytes: OpenEXR's limit.
pub const CHANNEL_NAME_BYTES_MAX: usize = 255;

/// The way to combine a layer's values from several passes or overlapping zones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Combine {
    /// Mean, weighted like the color.
    Mean,
    /// One of the values: of passes, that with the most samples; of zones, that with the greatest weight. For object
    /// ids, codes and other values of which a mean is meaningless.
    Pick,
}

/// A layer: its name and its channels, as in `depth.Z`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Name of the layer.
    pub name: String,
    /// Names of the layer's channels, in their order within a pixel.
    pub channels: Vec<String>,
    /// The way to combine the values of several passes or zones.
    pub combine: Combine,
}

impl Layer {
    /// Iterates over the full names of its channels.
    pub fn full_names(&self) -> impl Iterator<Item = String> {
        self.channels.iter().map(|channel| format!("{}.{channel}", self.name))
    }

    /// Returns the AOV that the layer stands for: one with the same name, channels and combination that means the same
    /// in all engines (albedo, normal or depth). `None`: there is no such AOV.
    pub fn as_aov(&self) -> Option<Aov> {
        let alike = |aov: &Aov| aov.name() == self.name && self.channels.iter().eq(aov.channels().iter());
        let shared = [Aov::Albedo, Aov::Normal, Aov::Depth];
        shared.into_iter().find(alike).filter(|_| self.combine == Combine::Mean)
    }
}

/// The reason why a picture cannot have these layers.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayersError {
    /// There are too many layers or channels.
    #[error("there are {found} {what}, and at most {most} are taken")]
    Count {
        /// "layers" or "channels".
        what: &'static str,
        /// Number of layers or channels.
        found: usize,
        /// Maximal number of them.
        most: usize,
    },
    /// A name cannot be stored in a file, or a layer has no channels.
    #[error("{name:?} is not a valid channel name: 1 to {CHANNEL_NAME_BYTES_MAX} bytes without control characters are")]
    Name {
        /// The invalid name, or the name of the layer without channels.
        name: String,
    },
    /// Two channels have the same name.
    #[error("there are two channels `{name}`")]
    Twice {
        /// The duplicate name.
        name: String,
    },
}

/// The layers of a picture: within a pixel, averaged ones come first, then picked ones.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Layers {
    pub(crate) list: Box<[Layer]>,
    /// Number of averaged channels.
    pub(crate) mean_channels: usize,
    /// Number of picked channels.
    pub(crate) pick_channels: usize,
}

impl Layers {
    /// Checks and sorts layers, whose channels must differ from those of `aovs`.
    ///
    /// # Errors
    /// There are too many layers or channels, a name that a file cannot hold, or two channels of the same name.
    pub(crate) fn new(mut list: Vec<Layer>, aovs: AovSet) -> Result<Self, LayersError> {
        let within = |what, found, most| {
            if found > most { Err(LayersError::Count { what, found, most }) } else { Ok(()) }
        };
        within("layers", list.len(), LAYERS_MAX)?;
        within("channels", list.iter().map(|layer| layer.channels.len()).sum(), CHANNELS_MAX)?;
        let is_name = |name: &str| !name.is_empty() && !name.chars().any(char::is_control);
        for layer in &list {
            let is_sound = |name: &String| name.len() <= CHANNEL_NAME_BYTES_MAX;
            let parts = std::iter::once(&layer.name).chain(&layer.channels);
            let bad = parts.clone().find(|part| !is_name(part)).cloned();
            let bad = bad.or_else(|| layer.full_names().find(|name| !is_sound(name)));
            let bad = bad.or_else(|| layer.channels.is_empty().then(|| layer.name.clone()));
            if let Some(name) = bad {
                return Err(LayersError::Name { name });
            }
        }
        list.sort_by(|a, b| (a.combine, &a.name).cmp(&(b.combine, &b.name)));
        let mut names: Vec<String> = list.iter().flat_map(Layer::full_names).collect();
        names.extend(aovs.iter().flat_map(Aov::full_names));
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(LayersError::Twice { name: pair[0].clone() });
        }
        let count = |combine| {
            list.iter().filter(|layer| layer.combine == combine).map(|layer| layer.channels.len()).sum::<usize>()
        };
        let (mean_channels, pick_channels) = (count(Combine::Mean), count(Combine::Pick));
        Ok(Self { list: list.into(), mean_channels, pick_channels })
    }

    /// Returns the number of floats of picked layers in a pixel: their channels, and the sample count of their pass.
    pub(crate) fn picked_floats(&self) -> usize {
        if self.pick_channels > 0 { self.pick_channels + 1 } else { 0 }
    }
}
