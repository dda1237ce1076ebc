//! Cutting a rectangle in two.

use bottega_image::Rect;

/// Returns the parts left and right of `x`.
pub(super) fn cut_x(zone: Rect, x: u32) -> [Rect; 2] {
    [Rect { x1: x, ..zone }, Rect { x0: x, ..zone }]
}

/// Returns the parts above and below `y`.
pub(super) fn cut_y(zone: Rect, y: u32) -> [Rect; 2] {
    [Rect { y1: y, ..zone }, Rect { y0: y, ..zone }]
}
