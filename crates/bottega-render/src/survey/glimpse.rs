//! A glimpse of a picture: its colors from one or two paths per pixel, for navigation in a scene.

use std::sync::Arc;

use bottega_hra::{HraClient, UnitError, WorkUnit};
use bottega_image::{Picture, Rect};

use super::{SurveyPixel, probe_settings, take_in};
use crate::{
    error::RenderError,
    prepare::PreparedScene,
    settings::View,
    work::{ProbeWork, RenderOutput, RenderWork},
};

/// Side of a block, in pixels: at most some milliseconds, as a glimpse can be canceled only between blocks.
const BLOCK_SIDE: u32 = 8;

/// The depth and the sample count of a glimpse.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GlimpseOptions {
    /// Greatest number of bounces of the final picture.
    pub max_depth: u32,
    /// Number of paths per pixel; 0 counts as 1.
    pub samples: u32,
}

/// Renders a glimpse of the picture `view`, which should be small. Returns its colours, linear RGB; `None` if it was
/// canceled.
///
/// - `client`: does all work, and must not be used otherwise meanwhile.
/// - `is_ended`: called after each block; `true` cancels.
///
/// The result depends only on the scene, the view and the options.
///
/// # Errors
/// The allocator does not do the work. A view without pixels is no error: its picture is empty.
pub fn glimpse(
    scene: &Arc<PreparedScene>,
    view: &View,
    options: GlimpseOptions,
    client: &HraClient<RenderWork>,
    is_ended: &dyn Fn() -> bool,
) -> Result<Option<Picture>, RenderError> {
    let settings = Arc::new(probe_settings(options.max_depth));
    let whole = Rect::of_size(view.width, view.height);
    let blocks: Vec<Rect> = whole.blocks(BLOCK_SIDE).collect();
    let unit = |(&rect, ticket)| {
        let (scene, settings) = (Arc::clone(scene), Arc::clone(&settings));
        let work = ProbeWork { scene, view: view.clone(), settings, rect, sample_count: options.samples };
        WorkUnit::new(RenderWork::Probe(work), ticket)
    };
    client.submit_group(blocks.iter().zip(0..).map(unit).collect())?;
    let mut pixels = vec![SurveyPixel::default(); whole.area() as usize];
    let (mut failure, mut is_over) = (None, false);
    // Take all answers even after a failure: none may be left for the client's next user
    while let Some(completed) = client.take() {
        match completed.output {
            Ok(RenderOutput::Probe(seen)) => take_in(&mut pixels, whole, blocks[completed.ticket as usize], &seen),
            Ok(RenderOutput::Refused(error)) => failure = Some(RenderError::Refused(error)),
            Ok(_) => failure = Some(RenderError::Unanswered),
            Err(UnitError::Expired) => is_over = true,
            Err(error) => failure = Some(error.into()),
        }
        if !is_over && (failure.is_some() || is_ended()) {
            is_over = true;
            client.cancel_pending();
        }
    }
    if let Some(error) = failure {
        return Err(error);
    }
    let picture =
        || Picture { width: view.width, height: view.height, data: pixels.iter().map(|pixel| pixel.color).collect() };
    Ok((!is_over).then(picture))
}
