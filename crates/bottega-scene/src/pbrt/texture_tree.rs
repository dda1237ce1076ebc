//! Texture trees of pictures, constants and operators.

use std::rc::Rc;

use glam::DVec3;

use super::mapping::PlacedMapping;
use super::ramp::RampNode;
use crate::texture::{ImageId, Wrap};

/// A node of a texture tree.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TextureNode {
    Constant(DVec3),
    Picture(PictureNode),
    /// The product of two textures.
    Scale(Rc<TextureNode>, Rc<TextureNode>),
    /// The interpolation from the first to the second by the third.
    Mix(Rc<TextureNode>, Rc<TextureNode>, Rc<TextureNode>),
    /// The first where the cell coordinates are both even or both odd, else the second.
    Checkerboard(PlacedMapping, Rc<TextureNode>, Rc<TextureNode>),
    /// The bilinear interpolation of values at (0, 0), (0, 1), (1, 0) and (1, 1).
    Bilinear(PlacedMapping, [DVec3; 4]),
    Ramp(RampNode),
}

/// A mapped picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PictureNode {
    /// Index in [`Pictures`].
    pub(super) picture: ImageId,
    /// `true`: the picture gives a number: alpha, or else the mean of the colours, as in pbrt.
    pub(super) is_scalar: bool,
    /// Mapping of the surface onto the picture.
    pub(super) mapping: PlacedMapping,
    pub(super) wrap: Wrap,
    /// `true`: interpolate between texels.
    pub(super) smooth: bool,
    /// Factor of the values, before `invert`.
    pub(super) scale: f64,
    /// `true`: 1 − value, at least 0.
    pub(super) invert: bool,
    /// Exponent that linearizes the file's codes, if they are not sRGB.
    pub(super) gamma: Option<f64>,
}

/// Returns the value of a constant tree; `None`: it is not constant.
pub(super) fn constant(node: &TextureNode) -> Option<DVec3> {
    match node {
        TextureNode::Constant(value) => Some(*value),
        TextureNode::Picture(_) | TextureNode::Ramp(_) => None,
        TextureNode::Scale(a, b) => Some(constant(a)? * constant(b)?),
        TextureNode::Mix(a, b, amount) => {
            let (a, b, amount) = (constant(a)?, constant(b)?, constant(amount)?);
            Some(a + (b - a) * amount)
        }
        TextureNode::Checkerboard(_, a, b) => constant(a).filter(|value| constant(b) == Some(*value)),
        TextureNode::Bilinear(_, [first, rest @ ..]) => rest.iter().all(|value| value == first).then_some(*first),
    }
}

/// Counts the nodes of a tree, shared ones repeatedly.
pub(super) fn parts(node: &TextureNode) -> usize {
    match node {
        TextureNode::Constant(_) | TextureNode::Picture(_) | TextureNode::Bilinear(..) | TextureNode::Ramp(_) => 1,
        TextureNode::Scale(a, b) | TextureNode::Checkerboard(_, a, b) => parts(a) + parts(b) + 1,
        TextureNode::Mix(a, b, amount) => parts(a) + parts(b) + parts(amount) + 1,
    }
}

/// Returns the ramp whose variable is the only one of a tree; `None`: there are others, or none.
pub(super) fn only_ramp(node: &TextureNode) -> Option<RampNode> {
    let mut leaves = Vec::new();
    add_leaves(node, &mut leaves);
    let ramps = leaves.iter().map(|leaf| if let TextureNode::Ramp(ramp) = leaf { Some(*ramp) } else { None });
    let ramps: Vec<RampNode> = ramps.collect::<Option<_>>()?;
    let first = *ramps.first()?;
    ramps.iter().all(|ramp| ramp.mapping == first.mapping).then_some(first)
}

/// Returns the same tree with the mean of each ramp; `None`: it has none.
pub(super) fn without_ramps(node: &Rc<TextureNode>) -> Option<Rc<TextureNode>> {
    let mut leaves = Vec::new();
    add_leaves(node, &mut leaves);
    leaves.iter().any(|leaf| matches!(leaf, TextureNode::Ramp(_))).then(|| flattened(node))
}

fn flattened(node: &Rc<TextureNode>) -> Rc<TextureNode> {
    match &**node {
        TextureNode::Constant(_) | TextureNode::Picture(_) | TextureNode::Bilinear(..) => node.clone(),
        TextureNode::Ramp(ramp) => Rc::new(TextureNode::Constant(DVec3::splat(ramp.mean))),
        TextureNode::Scale(a, b) => Rc::new(TextureNode::Scale(flattened(a), flattened(b))),
        TextureNode::Mix(a, b, amount) => Rc::new(TextureNode::Mix(flattened(a), flattened(b), flattened(amount))),
        TextureNode::Checkerboard(mapping, a, b) => {
            Rc::new(TextureNode::Checkerboard(*mapping, flattened(a), flattened(b)))
        }
    }
}

/// Appends the nodes of a tree that vary by themselves. A checkerboard is one.
fn add_leaves<'a>(node: &'a TextureNode, leaves: &mut Vec<&'a TextureNode>) {
    match node {
        TextureNode::Constant(_) => {}
        TextureNode::Picture(_) | TextureNode::Bilinear(..) | TextureNode::Ramp(_) => leaves.push(node),
        TextureNode::Scale(a, b) => [a, b].into_iter().for_each(|part| add_leaves(part, leaves)),
        TextureNode::Mix(a, b, amount) => [a, b, amount].into_iter().for_each(|part| add_leaves(part, leaves)),
        TextureNode::Checkerboard(_, a, b) => {
            leaves.push(node);
            [a, b].into_iter().for_each(|part| add_leaves(part, leaves));
        }
    }
}
