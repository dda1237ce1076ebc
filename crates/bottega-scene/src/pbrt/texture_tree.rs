//! A texture as a tree of pictures, constants and what joins them.

use std::rc::Rc;

use glam::DVec3;

use super::mapping::Laid;
use crate::{ImageId, Wrap};

/// A texture.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Node {
    Constant(DVec3),
    Picture(PictureNode),
    /// The product of both.
    Scale(Rc<Node>, Rc<Node>),
    /// From the first to the second by the third.
    Mix(Rc<Node>, Rc<Node>, Rc<Node>),
    /// The first where both coordinates are even, or both odd.
    Checkerboard(Laid, Rc<Node>, Rc<Node>),
    /// The values at (0, 0), (0, 1), (1, 0) and (1, 1).
    Bilinear(Laid, [DVec3; 4]),
}

/// A picture laid on a surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PictureNode {
    /// As [`Pictures`] counts.
    pub(super) picture: ImageId,
    /// Whether it stands for a number: pbrt takes alpha, or else the mean of the colours.
    pub(super) is_scalar: bool,
    pub(super) laid: Laid,
    pub(super) wrap: Wrap,
    pub(super) smooth: bool,
    pub(super) scale: f64,
    pub(super) invert: bool,
    /// Exponent by which the codes of the file become linear, where that is not sRGB.
    pub(super) gamma: Option<f64>,
}

/// The value of a tree that is the same everywhere.
pub(super) fn constant(node: &Node) -> Option<DVec3> {
    match node {
        Node::Constant(value) => Some(*value),
        Node::Picture(_) => None,
        Node::Scale(a, b) => Some(constant(a)? * constant(b)?),
        Node::Mix(a, b, amount) => {
            let (a, b, amount) = (constant(a)?, constant(b)?, constant(amount)?);
            Some(a + (b - a) * amount)
        }
        Node::Checkerboard(_, a, b) => constant(a).filter(|value| constant(b) == Some(*value)),
        Node::Bilinear(_, [first, rest @ ..]) => rest.iter().all(|value| value == first).then_some(*first),
    }
}

/// How many parts a tree has, seen as a tree.
pub(super) fn parts(node: &Node) -> usize {
    match node {
        Node::Constant(_) | Node::Picture(_) | Node::Bilinear(..) => 1,
        Node::Scale(a, b) | Node::Checkerboard(_, a, b) => parts(a) + parts(b) + 1,
        Node::Mix(a, b, amount) => parts(a) + parts(b) + parts(amount) + 1,
    }
}
