//! The frames of an animation, and the names of their pictures.

mod list;
mod name;

pub use self::list::{Frames, FramesError};
pub(crate) use self::name::{FrameName, NameError};

/// Returns advice for a file name without a valid place for the number of a frame.
pub(crate) fn frame_name_help(error: &NameError) -> &'static str {
    match error {
        NameError::SeveralPlaces { .. } => "leave one place for it: film.####.exr or film.%04d.exr",
        NameError::NoPlace { .. } => "a place for the number is written #### or %04d; a percent sign is written %%",
        NameError::NotUnicode => "give the output a name in Unicode",
    }
}
