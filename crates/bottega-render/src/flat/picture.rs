//! A flat picture: camera and filter.

use bottega_scene::Panorama;
use glam::Mat3;

use super::{CameraRecord, FilterRecord, NONE, Portable as _, WordBuffer, code};
use crate::{
    camera::{CameraRays, ProjectionKind},
    error::RenderError,
    filter::{Filter, FilterSampler, FilterShape},
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
    /// Writes the camera and the filter of a picture as words. A camera that [devices do not
    /// support](crate::camera::is_camera_for_devices) is written as one of another kind.
    ///
    /// # Errors
    /// [`RenderError::EmptyPicture`].
    pub fn new(view: &View, filter: Filter) -> Result<Self, RenderError> {
        if view.width == 0 || view.height == 0 {
            return Err(RenderError::EmptyPicture { width: view.width, height: view.height });
        }
        let mut words = WordBuffer::default();
        words.record(&camera_record(&CameraRays::new(&view.camera, view.width, view.height)));
        write_filter(&FilterSampler::new(filter), &mut words);
        Ok(Self { words: words.into_inner().0 })
    }
}

fn camera_record(rays: &CameraRays) -> CameraRecord {
    // Devices decline lenses, stereo, openings that are not round, and motion: see `is_camera_for_devices`
    let CameraRays {
        world_from_camera,
        half_extent,
        lens_shift,
        double_pixel,
        kind,
        lenses: _,
        eyes: _,
        lens,
        focus_distance,
        cone,
        clip,
        motion: _,
    } = rays;
    CameraRecord {
        world_from_camera: Mat3::from(world_from_camera.matrix3),
        position: world_from_camera.translation.into(),
        half_extent: *half_extent,
        shift: *lens_shift,
        double_pixel: *double_pixel,
        kind: match kind {
            // Devices decline cubes, fisheyes and lenses, see `is_camera_for_devices`
            ProjectionKind::Perspective | ProjectionKind::Lenses | ProjectionKind::Fisheye(_) => {
                code::CAMERA_PERSPECTIVE
            }
            ProjectionKind::Parallel => code::CAMERA_PARALLEL,
            ProjectionKind::Panorama(Panorama::Equirectangular) => code::CAMERA_EQUIRECTANGULAR,
            ProjectionKind::Panorama(Panorama::EqualArea | Panorama::Cube) => code::CAMERA_EQUAL_AREA,
        },
        lens_radius: lens.radius(),
        focus: *focus_distance,
        cone_width: cone.width,
        cone_spread: cone.spread,
        near: clip.near,
        far: clip.far.min(f32::MAX),
    }
}

/// Writes the record of a filter, then its quantiles.
fn write_filter(filter: &FilterSampler, words: &mut WordBuffer) {
    let FilterSampler { radius, shape } = filter;
    let radius = *radius;
    let table = match shape {
        FilterShape::Uniform => {
            words.record(&FilterRecord { radius, quantiles: NONE, factor: 1.0, sign_change: f32::MAX });
            return;
        }
        FilterShape::Shared(table) => table,
        FilterShape::Own(table) => &**table,
    };
    let (factor, sign_change) = (table.excess, table.sign_change.min(f32::MAX));
    let quantiles = words.place() + FilterRecord::WORDS;
    words.record(&FilterRecord { radius, quantiles, factor, sign_change });
    words.numbers(&table.quantiles);
}

/// Returns the table of the Sobol' sequence: the contribution of each value of each group of four bits of a bit-reversed
/// index to the four bit-reversed fractions of a point, `[8 groups × 16 values × 4]`. The contributions are combined by
/// XOR.
pub fn sobol_table() -> Vec<u32> {
    sampler::sobol_table().iter().flatten().flatten().copied().collect()
}
