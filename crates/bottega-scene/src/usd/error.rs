//! Errors of the USD library as errors of the scene.

use std::any::Any;
use std::path::Path;

use crate::error::SceneError;
use crate::text::shortened;

/// Returns the error for a panic of the thread that composes the stage.
pub(super) fn panicked(path: &Path, panic: &(dyn Any + Send)) -> SceneError {
    let message = panic.downcast_ref::<&str>().copied().or_else(|| panic.downcast_ref::<String>().map(String::as_str));
    let problem = format!("the USD library failed: {}", shortened(message.unwrap_or("unknown fault")));
    SceneError::Damaged { path: path.into(), problem }
}

/// Returns an error of the library with its causes, as one line.
pub(super) fn chain(error: &(dyn std::error::Error + 'static)) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    shortened(&text.replace('\n', " ")).into_owned()
}
