//! A texture as a tree of pictures, constants and what joins them.

use std::rc::Rc;

use glam::DVec3;

use super::mapping::PlacedMapping;
use crate::{ImageId, Wrap};

/// A texture.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TextureNode {
    Constant(DVec3),
    Picture(PictureNode),
    /// The product of both.
    Scale(Rc<TextureNode>, Rc<TextureNode>),
    /// From the first to the second by the third.
    Mix(Rc<TextureNode>, Rc<TextureNode>, Rc<TextureNode>),
    /// The first where both coordinates are even, or both odd.
    Checkerboard(PlacedMapping, Rc<TextureNode>, Rc<TextureNode>),
    /// The values at (0, 0), (0, 1), (1, 0) and (1, 1).
    Bilinear(PlacedMapping, [DVec3; 4]),
}

/// A picture laid on a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PictureNode {
    /// As [`Pictures`] counts.
    pub(super) picture: ImageId,
    /// Whether it stands for a number: pbrt takes alpha, or else the mean of the colours.
    pub(super) is_scalar: bool,
    pub(super) laid: PlacedMapping,
    pub(super) wrap: Wrap,
    pub(super) smooth: bool,
    pub(super) scale: f64,
    pub(super) invert: bool,
    /// Exponent by which the codes of the file become linear, where that is not sRGB.
    pub(super) gamma: Option<f64>,
}

/// The value of a tree that is the same everywhere.
pub(super) fn constant(node: &TextureNode) -> Option<DVec3> {
    match node {
        TextureNode::Constant(value) => Some(*value),
        TextureNode::Picture(_) => None,
        TextureNode::Scale(a, b) => Some(constant(a)? * constant(b)?),
        TextureNode::Mix(a, b, amount) => {
            let (a, b, amount) = (constant(a)?, constant(b)?, constant(amount)?);
            Some(a + (b - a) * amount)
        }
        TextureNode::Checkerboard(_, a, b) => constant(a).filter(|value| constant(b) == Some(*value)),
        TextureNode::Bilinear(_, [first, rest @ ..]) => rest.iter().all(|value| value == first).then_some(*first),
    }
}

/// How many parts a tree has, seen as a tree.
pub(super) fn parts(node: &TextureNode) -> usize {
    match node {
        TextureNode::Constant(_) | TextureNode::Picture(_) | TextureNode::Bilinear(..) => 1,
        TextureNode::Scale(a, b) | TextureNode::Checkerboard(_, a, b) => parts(a) + parts(b) + 1,
        TextureNode::Mix(a, b, amount) => parts(a) + parts(b) + parts(amount) + 1,
    }
}
