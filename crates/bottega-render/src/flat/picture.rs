//! A picture of a scene: camera and filter.

use super::Words;
use crate::{
    PreparedScene, RenderError, View,
    camera::CameraRays,
    filter::{Filter, FilterSampler},
    sampler,
};

/// Camera and filter of a picture as words: the camera (world from camera, four columns of three; half of the picture's extent
/// along x and y; shift of the lens; two over the size in pixels; its kind (0 perspective, 1 parallel, 2 equirectangular, 3 of equal
/// areas); radius of the lens; distance in focus;
/// width and spread of a pixel's cone; distances of the near and the far plane), then the filter (radius, place of its quantiles or [`NONE`](super::NONE), the factor of
/// its samples, where it turns negative), then the quantiles.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatPicture {
    /// See there.
    pub words: Vec<u32>,
}

impl FlatPicture {
    /// Writes down a picture.
    ///
    /// # Errors
    /// There is no such camera, or no pixel.
    pub fn new(prepared: &PreparedScene, view: View, filter: Filter) -> Result<Self, RenderError> {
        let cameras = &prepared.scene().cameras;
        let camera =
            cameras.get(view.camera).ok_or(RenderError::NoCamera { index: view.camera, count: cameras.len() })?;
        if view.width == 0 || view.height == 0 {
            return Err(RenderError::EmptyPicture { width: view.width, height: view.height });
        }
        let mut words = Words::default();
        CameraRays::new(camera, view.width, view.height).write(&mut words);
        FilterSampler::new(filter).write(&mut words);
        Ok(Self { words: words.into_inner().0 })
    }
}

/// What each value of each group of four bits of a reversed index adds to the four reversed fractions of a point of the Sobol'
/// sequence: `[8 groups × 16 values × 4]`, to be joined by exclusive or.
pub fn sobol_table() -> Vec<u32> {
    sampler::sobol_table().iter().flatten().flatten().copied().collect()
}
