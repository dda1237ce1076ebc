//! Pictures: rectangles of pixels, running sums, the film, image files, tone mapping and error metrics.
//!
//! This crate knows nothing of rendering: numbers come in, pictures go out. The decision that shaped it: a pixel is a
//! *left fold over its samples in the order of their indices*, kept as running sums in a [`Tile`]. However the samples
//! of a pixel are cut into passes, and whoever computes them, the sums have the same bits.
//!
//! The way of a pixel: [`Tile`] (sums) → [`Film`] (weighted means) → [`write_exr`] or [`write_png`]; and back from any
//! file as a [`Picture`] by [`read_picture`]. How far two pictures are apart say [`rmse`], [`rel_mse`], [`flip`] and,
//! of noisy ones, [`rejected_share`]; whether the edges of zones show in one, [`seams`]; a [`Canvas`] is what a person looks at.

mod aov;
mod canvas;
mod color_map;
mod colorimetry;
mod error;
mod exr_read;
mod exr_write;
mod film;
mod layers;
mod layout;
mod likeness;
mod limits;
mod metadata;
mod metrics;
mod output;
mod parallel;
mod picture;
mod png_read;
mod png_write;
mod preview;
mod radiance_read;
mod read;
mod rect;
mod source;
mod tile;
mod tone;
mod whole;

pub use aov::{Aov, AovSet};
pub use canvas::Canvas;
pub use color_map::{ColorMap, false_color};
pub use colorimetry::{Chromaticities, Conversion, WhitePoint, adaptation};
pub use error::ImageError;
pub use exr_read::Planes;
pub use exr_write::{ExrCompression, ExrOptions, HalfOrFloat, write_exr, write_picture_exr};
pub use film::Film;
pub use layers::{CHANNEL_NAME_BYTES_MAX, CHANNELS_MAX, Combine, LAYERS_MAX, Layer, LayersError};
pub use layout::Layout;
pub use limits::{Packing, ReadLimits, check_announced};
pub use metadata::Metadata;
pub use metrics::{
    FlipError, FlipOptions, FlipView, Moments, Seams, USUAL_TRIM, firefly_count, flip, mae, mean_z_score,
    rejected_share, rejected_share_of_films, rel_mse, rel_mse_map, rel_mse_trimmed, rmse, seams,
};
pub use output::{OutputFormat, check_writable, write_whole};
pub use picture::{Picture, luminance};
pub use png_write::{PngBits, PngOptions, write_png, write_png_rgb8};
pub use preview::Preview;
pub use read::{read_channels, read_image, read_image_bytes, read_picture};
pub use rect::{Rect, Sides};
pub use source::ImageFile;
pub use tile::{SampleValues, Tile};
pub use tone::{Encoding, ToneMap, displayed, linear_from_srgb, srgb_from_linear};
pub use whole::{WholeHeader, WholePicture, is_float_picture, read_whole};
