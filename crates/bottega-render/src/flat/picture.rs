//! A flat picture: camera and filter.

use super::WordBuffer;
use crate::{
    camera::CameraRays,
    error::RenderError,
    filter::{Filter, FilterSampler},
    prepare::PreparedScene,
    sampler,
    settings::View,
};

/// Camera and filter of a picture as 32-bit words: a [`PictureRecord`](super::PictureRecord), then the quantiles of the
/// filter.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatPicture {
    /// The 32-bit words of the picture's tables, as the kernels read them.
    pub words: Vec<u32>,
}

impl FlatPicture {
    /// Writes a picture.
    ///
    /// # Errors
    /// The camera does not exist, or the picture has no pixels.
    pub fn new(prepared: &PreparedScene, view: View, filter: Filter) -> Result<Self, RenderError> {
        let camera = prepared.camera(view.camera).ok_or_else(|| prepared.no_camera(view.camera))?;
        if view.width == 0 || view.height == 0 {
            return Err(RenderError::EmptyPicture { width: view.width, height: view.height });
        }
        let mut words = WordBuffer::default();
        words.record(&CameraRays::new(&camera, view.width, view.height).record());
        FilterSampler::new(filter).write(&mut words);
        Ok(Self { words: words.into_inner().0 })
    }
}

/// Returns the table of the Sobol' sequence: the contribution of each value of each group of four bits of a bit-reversed
/// index to the four bit-reversed fractions of a point, `[8 groups × 16 values × 4]`. The contributions are combined by
/// XOR.
pub fn sobol_table() -> Vec<u32> {
    sampler::sobol_table().iter().flatten().flatten().copied().collect()
}
