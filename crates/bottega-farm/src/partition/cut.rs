//! Cutting a rectangle in two.

use bottega_image::Rect;

/// The parts left and right of `x`.
pub(super) fn cut_x(zone: Rect, x: u32) -> [Rect; 2] {
    [Rect { x1: x, ..zone }, Rect { x0: x, ..zone }]
}

/// The parts above and below `y`.
pub(super) fn cut_y(zone: Rect, y: u32) -> [Rect; 2] {
    [Rect { y1: y, ..zone }, Rect { y0: y, ..zone }]
}
