//! Pictures: rectangles of pixels, running sums, the film, image files, tone mapping and error metrics.
//!
//! This crate knows nothing of rendering: numbers come in, pictures go out. The decision that shaped it: a pixel is a
//! *left fold over its samples in the order of their indices*, kept as running sums in a [`Tile`]. However the samples
//! of a pixel are divided into passes, and on whichever machine they are computed, the sums are bit-identical.
//!
//! The path of a pixel: [`Tile`] (sums) → [`Film`] (weighted means) → [`write_exr`] or [`write_png`]; and back from any
//! file as a [`Picture`] by [`read_picture`]. [`rmse`], [`rel_mse`] and [`flip`] measure the difference of two
//! pictures, [`rejected_share`] that of noisy ones; [`seams`] detects visible edges of zones; a [`Canvas`] is a picture
//! for display.
//!
//! # Modules
//!
//! | contents | files |
//! |---|---|
//! | rectangles of pixels | `src/rect.rs` |
//! | sums of samples, their weighted means | `src/tile.rs`, `src/film.rs` |
//! | offsets of values in a pixel; named layers | `src/layout.rs`, `src/layers.rs` |
//! | Cryptomattes: ranks of a pixel; identities and manifests | `src/matte.rs`, `src/cryptomatte.rs` |
//! | writing of OpenEXR and PNG; the format by file name | `src/exr_write.rs`, `src/png_write.rs`, `src/output.rs` |
//! | reading of OpenEXR, Radiance and PNG, for scenes and for comparing | `src/read.rs`, `src/exr_read/`, `src/radiance_read.rs`, `src/png_read.rs`; whole files: `src/whole.rs` |
//! | limits on what a picture's header may announce | `src/limits.rs` |
//! | layers of a file, each as a picture | `src/file_layers.rs` |
//! | colours of other primaries | `src/colorimetry.rs` |
//! | text in picture files: scene digest, settings, software | `src/metadata.rs` |
//! | tone mapping, transfer functions | `src/tone.rs` |
//! | RMSE, relMSE, FLIP, tests of noisy pictures, seams | `src/metrics.rs`, `src/metrics/` |
//! | whether two noisy tiles show the same | `src/likeness.rs` |
//! | previews during rendering | `src/preview.rs` |
//! | escaping of foreign names for terminals | `src/printable.rs` |
//! | false colours, canvases and drawings | `src/color_map.rs`, `src/canvas.rs`, `src/svg.rs` |

mod aov;
mod canvas;
mod color_map;
mod colorimetry;
mod cryptomatte;
mod error;
mod exr_read;
mod exr_write;
mod file_layers;
mod film;
mod layers;
mod layout;
mod likeness;
mod limits;
mod matte;
mod metadata;
mod metrics;
mod output;
mod parallel;
mod picture;
mod png_read;
mod png_write;
mod preview;
mod printable;
mod radiance_read;
mod read;
mod rect;
mod source;
mod svg;
mod tile;
mod tone;
mod whole;

pub use aov::{Aov, AovSet};
pub use canvas::Canvas;
pub use color_map::{ColorMap, false_color};
pub use colorimetry::{Chromaticities, Conversion, WhitePoint, adaptation};
pub use cryptomatte::{identity, manifest, murmur3, set_matte};
pub use error::ImageError;
pub use exr_read::Planes;
pub use exr_write::{ExrColorSpace, ExrCompression, ExrOptions, HalfOrFloat, write_exr, write_picture_exr};
pub use file_layers::{FileLayer, LayerKind, LayerPicture, LayerPlanes};
pub use film::Film;
pub use layers::{CHANNEL_NAME_BYTES_MAX, CHANNELS_MAX, Combine, LAYERS_MAX, Layer, LayersError};
pub use layout::Layout;
pub use limits::{Packing, ReadLimits, check_announced};
pub use metadata::Metadata;
pub use metrics::{
    FlipError, FlipOptions, FlipView, Moments, Seams, USUAL_TRIM, firefly_count, flip, mae, mean_z_score,
    rejected_share, rejected_share_of_films, rel_mse, rel_mse_map, rel_mse_trimmed, rmse, seams, srgb_mse,
};
pub use output::{OutputFormat, check_writable, write_whole, write_whole_with};
pub use picture::{Picture, luminance};
pub use png_write::{PngBits, PngOptions, png_bytes, write_png, write_png_rgb8};
pub use preview::Preview;
pub use printable::{printable, printable_lines, printable_path};
pub use read::{read_channels, read_image, read_image_bytes, read_picture};
pub use rect::{Rect, Sides};
pub use source::ImageFile;
pub use svg::{Svg, svg_text};
pub use tile::{CaughtLight, SampleValues, SurfaceValues, Tile};
pub use tone::{Encoding, ToneMap, displayed, linear_from_srgb, srgb_from_linear};
pub use whole::{WholeHeader, WholePicture, is_float_picture, read_whole};
