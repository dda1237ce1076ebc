//! Layers that other engines make beside the color: named, with channels of their own.

use crate::aov::{Aov, AovSet};

/// Layers of one picture at most.
pub const LAYERS_MAX: usize = 128;
/// Channels of all layers of one picture at most.
pub const CHANNELS_MAX: usize = 512;
/// The longest name of a channel with its layer, in bytes: what OpenEXR allows.
pub const CHANNEL_NAME_BYTES_MAX: usize = 255;

/// How what several passes, and zones that overlap, say of a pixel becomes one value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Combine {
    /// Their mean, weighted as that of the color is.
    Mean,
    /// What one of them says: of passes the one of most samples, of zones the one that weighs most there. For numbers of
    /// things, codes, and whatever else an engine takes from one sample: a mean of such would say nothing.
    Pick,
}

/// A layer: its name and its channels, as in `depth.Z`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// Names of its channels, in the order in which they lie in a pixel.
    pub channels: Vec<String>,
    /// What becomes of several values.
    pub combine: Combine,
}

impl Layer {
    /// The channels' names with that of the layer.
    pub fn full_names(&self) -> impl Iterator<Item = String> {
        self.channels.iter().map(|channel| format!("{}.{channel}", self.name))
    }

    /// The AOV that has the same name, channels and way to combine.
    pub fn as_aov(&self) -> Option<Aov> {
        let alike = |aov: &Aov| {
            aov.name() == self.name && !aov.channels().is_empty() && self.channels.iter().eq(aov.channels().iter())
        };
        Aov::ALL.into_iter().find(alike).filter(|_| self.combine == Combine::Mean)
    }
}

/// Layers that no picture can have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LayersError {
    /// Too many.
    #[error("there are {found} {what}, and at most {most} are taken")]
    Count {
        /// Of what.
        what: &'static str,
        /// How many.
        found: usize,
        /// How many are taken.
        most: usize,
    },
    /// A name that no file holds.
    #[error("{name:?} is no name for a channel: 1 to {CHANNEL_NAME_BYTES_MAX} bytes without control characters are")]
    Name {
        /// The name.
        name: String,
    },
    /// Two channels of one name.
    #[error("there are two channels `{name}`")]
    Twice {
        /// The name.
        name: String,
    },
}

/// The layers of a picture: those that are averaged lie first in a pixel, then those that are picked.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Layers {
    pub(crate) list: Box<[Layer]>,
    pub(crate) mean_channels: usize,
    pub(crate) pick_channels: usize,
}

impl Layers {
    /// Layers beside `aovs`, with whose channels theirs must not be confused.
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

    /// Floats that picked layers take in a pixel: their channels, and the samples of the pass that they are of.
    pub(crate) fn picked_floats(&self) -> usize {
        if self.pick_channels > 0 { self.pick_channels + 1 } else { 0 }
    }
}
