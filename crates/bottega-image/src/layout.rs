//! The layout of a pixel: its values and their offsets.

use std::{ops::Range, sync::Arc};

use crate::aov::{Aov, AovSet};
use crate::layers::{Layer, Layers, LayersError};
use crate::matte;

/// The offsets of the values in a pixel of a [`Tile`](crate::Tile): radiance R G B, alpha, the sum of squared
/// luminances (for the variance), the sample count, the kept AOVs (Cryptomattes last), then the named layers: averaged ones,
/// then picked ones. Picked values are not sums; they are followed by the sample count of their pass.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    aovs: AovSet,
    /// Floats per pixel: at most some hundreds, so that tiles stay small.
    stride: u32,
    layers: Option<Arc<Layers>>,
}

impl Layout {
    /// Offset of radiance R, G, B within a pixel, in floats; the other offsets likewise.
    pub const COLOR: usize = 0;
    /// Offset of the sum of alpha.
    pub const ALPHA: usize = 3;
    /// Offset of the sum of squared luminances.
    pub const LUMINANCE_SQUARED: usize = 4;
    /// Offset of the number of samples, exact up to 2²⁴.
    pub const SAMPLE_COUNT: usize = 5;
    const FIXED: usize = 6;

    /// Returns the layout with these AOVs.
    pub fn new(aovs: AovSet) -> Self {
        let stride = Self::FIXED + aovs.iter().map(Aov::channel_count).sum::<usize>();
        Self { aovs, stride: stride as u32, layers: None }
    }

    /// Returns the layout with these AOVs and layers; the order of the layers does not matter.
    ///
    /// # Errors
    ///
    /// There are too many layers or channels, a name that a file cannot hold, a layer without channels, or two channels of
    /// the same name.
    pub fn with_layers(aovs: AovSet, layers: Vec<Layer>) -> Result<Self, LayersError> {
        let plain = Self::new(aovs);
        if layers.is_empty() {
            return Ok(plain);
        }
        let layers = Layers::new(layers, aovs)?;
        let stride = plain.stride() + layers.mean_channels + layers.picked_floats();
        Ok(Self { stride: stride as u32, layers: Some(Arc::new(layers)), ..plain })
    }

    /// Returns the kept AOVs.
    pub fn aovs(&self) -> AovSet {
        self.aovs
    }

    /// Returns the layers, in their order within a pixel.
    pub fn layers(&self) -> &[Layer] {
        self.layers.as_ref().map_or(&[], |layers| &layers.list)
    }

    /// Returns the offset of the first averaged layer.
    pub(crate) fn mean_layers_start(&self) -> usize {
        self.sums_end() - self.layers.as_ref().map_or(0, |layers| layers.mean_channels)
    }

    /// Iterates over the layers, each with the offset of its first float within a pixel.
    pub fn placed_layers(&self) -> impl Iterator<Item = (usize, &Layer)> {
        self.layers().iter().scan(self.mean_layers_start(), |next, layer| {
            let offset = *next;
            *next += layer.channels.len();
            Some((offset, layer))
        })
    }

    /// Returns name and offsets of the displayable parts of a film's pixel: `color`, `alpha`, `error` (the standard
    /// error of the mean luminance), `samples`, and the kept AOVs and layers.
    pub fn parts(&self) -> Vec<(&str, Range<usize>)> {
        let fixed = [
            ("color", Self::COLOR..Self::COLOR + 3),
            ("alpha", Self::ALPHA..Self::ALPHA + 1),
            (Aov::Error.name(), Self::LUMINANCE_SQUARED..Self::LUMINANCE_SQUARED + 1),
            (Aov::SampleCount.name(), Self::SAMPLE_COUNT..Self::SAMPLE_COUNT + 1),
        ];
        let aovs = self.aovs.iter().filter(|&aov| aov.channel_count() > 0);
        let aovs = aovs.filter_map(|aov| self.offset(aov).map(|at| (aov.name(), at..at + aov.channel_count())));
        let others = self.placed_layers().map(|(at, layer)| (layer.name.as_str(), at..at + layer.channels.len()));
        fixed.into_iter().chain(aovs).chain(others).collect()
    }

    /// Returns true if an AOV of the first surface is kept: see [`Tile::add_surface`](crate::Tile::add_surface).
    pub fn has_surfaces(&self) -> bool {
        [Aov::Position, Aov::GeometricNormal, Aov::Uv, Aov::Motion].into_iter().any(|aov| self.aovs.contains(aov))
            || self.has_mattes()
    }

    /// Returns true if a Cryptomatte is kept.
    pub fn has_mattes(&self) -> bool {
        !self.mattes().is_empty()
    }

    /// Returns the number of floats in a pixel.
    pub fn stride(&self) -> usize {
        self.stride as usize
    }

    /// Returns the offset of the first float that is not a sum; see [`Combine::Pick`](crate::Combine::Pick). It equals
    /// [`stride`](Self::stride) without picked layers.
    pub fn sums_end(&self) -> usize {
        self.stride() - self.layers.as_ref().map_or(0, |layers| layers.picked_floats())
    }

    /// Returns the offsets of the Cryptomattes, [`crate::matte::FLOATS`] each: not sums of their own.
    pub(crate) fn mattes(&self) -> Range<usize> {
        let end = Self::FIXED + self.aovs.iter().map(Aov::channel_count).sum::<usize>();
        let count = Aov::MATTES.into_iter().filter(|&aov| self.aovs.contains(aov)).count();
        end - count * matte::FLOATS..end
    }

    /// Returns the offset of the first float of `aov` within a pixel; `None` if it is not kept.
    pub fn offset(&self, aov: Aov) -> Option<usize> {
        match aov {
            Aov::SampleCount => return Some(Self::SAMPLE_COUNT),
            Aov::Error => return Some(Self::LUMINANCE_SQUARED),
            _ => {}
        }
        self.aovs.contains(aov).then(|| {
            Self::FIXED + self.aovs.iter().take_while(|&other| other != aov).map(Aov::channel_count).sum::<usize>()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layers::{CHANNELS_MAX, Combine, LAYERS_MAX};

    fn layer(name: &str, channels: &str, combine: Combine) -> Layer {
        Layer { name: name.to_owned(), channels: channels.chars().map(String::from).collect(), combine }
    }

    #[test]
    fn layers_that_are_averaged_lie_before_those_that_are_picked() {
        let aovs = AovSet::NONE.with(Aov::Normal);
        let layers = vec![
            layer("depth", "Z", Combine::Pick),
            layer("uv", "UV", Combine::Mean),
            layer("beauty", "RGB", Combine::Mean),
        ];
        let layout = Layout::with_layers(aovs, layers).unwrap();
        let placed: Vec<(usize, &str)> =
            layout.placed_layers().map(|(offset, layer)| (offset, layer.name.as_str())).collect();
        assert_eq!(placed, [(9, "beauty"), (12, "uv"), (14, "depth")]);
        assert_eq!((layout.stride(), layout.sums_end()), (16, 14));
        assert_eq!(Layout::with_layers(aovs, Vec::new()).unwrap(), Layout::new(aovs));
    }

    #[test]
    fn the_parts_of_a_pixel_are_named_and_lie_side_by_side() {
        let aovs = [Aov::Normal, Aov::SampleCount, Aov::Cost, Aov::Error, Aov::CryptoAsset].into_iter().collect();
        let layout = Layout::with_layers(aovs, vec![layer("uv", "UV", Combine::Mean)]).unwrap();
        let parts = layout.parts();
        let names: Vec<&str> = parts.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["color", "alpha", "error", "samples", "normal", "cost", "crypto-asset", "uv"]);
        assert_eq!(layout.mattes(), parts[6].1);
        assert!(parts.windows(2).all(|pair| pair[0].1.end == pair[1].1.start), "{parts:?}");
        assert_eq!(parts.last().unwrap().1.end, layout.stride());
    }

    #[test]
    fn layers_that_no_file_holds_are_refused() {
        let refused = |layers| Layout::with_layers(AovSet::NONE.with(Aov::Depth), layers).unwrap_err();
        let many = |count| (0..count).map(|i| layer(&i.to_string(), "X", Combine::Mean)).collect::<Vec<_>>();
        assert!(Layout::with_layers(AovSet::NONE, many(LAYERS_MAX)).is_ok());
        assert!(matches!(refused(many(LAYERS_MAX + 1)), LayersError::Count { what: "layers", .. }));
        let wide = layer("wide", &"x".repeat(CHANNELS_MAX + 1), Combine::Mean);
        assert!(matches!(refused(vec![wide]), LayersError::Count { what: "channels", .. }));
        for (name, channels) in [("", "X"), ("a", ""), ("a\0b", "X"), ("a\n", "X"), (&"n".repeat(254), "X")] {
            assert!(
                matches!(refused(vec![layer(name, channels, Combine::Mean)]), LayersError::Name { .. }),
                "{name:?}"
            );
        }
        for layers in [vec![layer("a", "XX", Combine::Mean)], vec![layer("depth", "Z", Combine::Pick)]] {
            assert!(matches!(refused(layers), LayersError::Twice { .. }));
        }
    }

    #[test]
    fn a_layer_that_is_like_an_aov_is_known_as_such() {
        assert_eq!(layer("normal", "XYZ", Combine::Mean).as_aov(), Some(Aov::Normal));
        assert_eq!(layer("depth", "Z", Combine::Mean).as_aov(), Some(Aov::Depth));
        for other in [
            layer("depth", "Z", Combine::Pick),
            layer("normal", "RGB", Combine::Mean),
            layer("cost", "", Combine::Mean),
            layer("samples", "Y", Combine::Mean),
        ] {
            assert_eq!(other.as_aov(), None, "{other:?}");
        }
    }
}
