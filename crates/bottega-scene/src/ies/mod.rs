//! Photometric profiles of lamps: files of IES LM-63.
//!
//! A profile gives the luminous intensity of a lamp for each direction. Lights use it as a picture by direction
//! ([`DirectionPicture`](crate::DirectionPicture)), so that a scene, its file and a farm need no further kind of data.
//!
//! Source: ANSI/IES LM-63-19, *Approved Method: IES Standard File Format for the Electronic Transfer of Photometric Data*.

mod picture;
mod planes;
mod profile;
mod read;
mod spherical;
mod words;

pub use self::picture::{IesInterpolation, IesPicture};
pub use self::profile::IesProfile;
