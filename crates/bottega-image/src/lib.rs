//! Pictures: rectangles of pixels, running sums, the film, image files, tone mapping and error metrics.
//!
//! This crate knows nothing of rendering: numbers come in, pictures go out. The decision that shaped it: a pixel is
//! a *left fold over its samples in the order of their indices*, kept as running sums in a [`Tile`]. However the
//! samples of a pixel are cut into passes, and whoever computes them, the sums have the same bits.

mod layout;
mod rect;
mod tile;

pub use layout::{Aov, AovSet, Layout};
pub use rect::Rect;
pub use tile::{SampleValues, Tile};
