//! Baking of texture trees that no single picture can represent.

use std::rc::Rc;

use glam::{Affine2, DVec3, Vec2, Vec4};

use super::context::Context;
use super::mapping::PlacedMapping;
use super::ramp::RampNode;
use super::texture_tree::{PictureNode, TextureNode, constant, only_ramp};
use crate::error::SceneError;
use crate::image::Image;
use crate::import::text_place::TextPlace;
use crate::texture::{ImageId, TextureMap, Wrap};
use crate::values::VALUE_MAX;

/// The longest side of a baked picture, in texels.
const SIDE_MAX: f32 = 4096.0;

/// Texels per cell of a checkerboard with textures.
const CELL_TEXELS: f32 = 64.0;

/// A picture to bake from a texture.
pub(super) struct BakedTexture {
    node: Rc<TextureNode>,
    is_scalar: bool,
    /// Final transformation of every colour.
    change: Option<fn(DVec3) -> DVec3>,
    at: TextPlace,
    layout: BakeLayout,
}

/// The area that a baked picture covers.
#[derive(Clone, Debug, PartialEq)]
enum BakeLayout {
    /// Two by two cells of a checkerboard of constants.
    Cells(PlacedMapping),
    /// The common area of all its pictures.
    Picture(PictureNode),
    /// A square of texture coordinates with that side.
    Square(f32),
    /// A row of texels over the range of a ramp, with their number.
    Ramp(RampNode, u32),
}

impl BakedTexture {
    /// Plans the picture of a texture tree.
    pub(super) fn new(
        node: Rc<TextureNode>,
        is_scalar: bool,
        change: Option<fn(DVec3) -> DVec3>,
        at: TextPlace,
    ) -> Self {
        let layout = match only_ramp(&node) {
            None => layout(&node),
            Some(ramp) => {
                let texels = ramp.texels(&|at| changed(ramp_value(&node, at), change));
                BakeLayout::Ramp(ramp, texels)
            }
        };
        Self { node, is_scalar, change, at, layout }
    }

    /// Returns the transformation from texture coordinates to the baked picture.
    pub(super) fn picture_from_uv(&self) -> Affine2 {
        match &self.layout {
            // Row 0 is the lower row of cells, as both count t upwards.
            BakeLayout::Cells(mapping) => {
                Affine2::from_cols_array(&[0.5, 0.0, 0.0, -0.5, 0.0, 0.5]) * mapping.picture_from_uv
            }
            BakeLayout::Picture(node) => node.mapping.picture_from_uv,
            BakeLayout::Square(edge) => Affine2::from_scale(Vec2::splat(1.0 / edge)),
            BakeLayout::Ramp(ramp, texels) => ramp.picture_from_uv(*texels),
        }
    }

    /// Returns the wrap mode of the baked picture.
    pub(super) fn wrap(&self) -> Wrap {
        match &self.layout {
            BakeLayout::Picture(node) => node.wrap,
            BakeLayout::Ramp(..) => Wrap::Clamp,
            BakeLayout::Cells(_) | BakeLayout::Square(_) => Wrap::Repeat,
        }
    }

    /// Returns true if the texels of the baked picture are interpolated.
    pub(super) fn is_smooth(&self) -> bool {
        match &self.layout {
            BakeLayout::Cells(_) => false,
            BakeLayout::Picture(node) => node.smooth,
            BakeLayout::Square(_) => true,
            BakeLayout::Ramp(ramp, _) => !ramp.is_step(),
        }
    }

    /// Returns true if the picture repeats with the period of the texture.
    pub(super) fn repeats(&self) -> bool {
        if let BakeLayout::Square(edge) = self.layout { repeats_within(&self.node, edge) } else { true }
    }

    /// Returns the sets of texture coordinates of its parts, in the order of the tree.
    pub(super) fn uv_sets(&self) -> Vec<u8> {
        fn gather(node: &TextureNode, sets: &mut Vec<u8>) {
            let mut add = |mapping: &PlacedMapping| {
                if !sets.contains(&mapping.uv_set) {
                    sets.push(mapping.uv_set);
                }
            };
            match node {
                TextureNode::Constant(_) => {}
                TextureNode::Picture(node) => add(&node.mapping),
                TextureNode::Scale(a, b) => [a, b].into_iter().for_each(|part| gather(part, sets)),
                TextureNode::Mix(a, b, amount) => [a, b, amount].into_iter().for_each(|part| gather(part, sets)),
                TextureNode::Checkerboard(mapping, a, b) => {
                    add(mapping);
                    [a, b].into_iter().for_each(|part| gather(part, sets));
                }
                TextureNode::Bilinear(mapping, _) => add(mapping),
                TextureNode::Ramp(ramp) => add(&ramp.mapping),
            }
        }
        let mut sets = Vec::new();
        gather(&self.node, &mut sets);
        sets
    }

    /// Bakes the picture.
    ///
    /// - `pictures`: pictures that the tree refers to.
    pub(super) fn image(&self, context: &Context<'_>, pictures: &[Image]) -> Result<Image, SceneError> {
        let (width, height) = match &self.layout {
            BakeLayout::Cells(_) => (2, 2),
            BakeLayout::Ramp(_, texels) => (*texels, 1),
            BakeLayout::Picture(_) | BakeLayout::Square(_) => {
                let edge = if let BakeLayout::Square(edge) = self.layout { Some(edge) } else { None };
                let size =
                    (size(&self.node, pictures, edge.is_some()) * edge.unwrap_or(1.0)).min(Vec2::splat(SIDE_MAX));
                (size.x.max(1.0) as u32, size.y.max(1.0) as u32)
            }
        };
        let bytes = width as usize * height as usize * size_of::<[f32; 3]>() * 4 / 3;
        context.resources.budget().take(context.path(self.at.file), &context.place(self.at), bytes)?;
        let texel = |index: u32| {
            let (x, y) = (index % width, index / width);
            let value = match &self.layout {
                BakeLayout::Cells(_) => match &*self.node {
                    TextureNode::Checkerboard(_, even, odd) => {
                        constant(if x == y { even } else { odd }).unwrap_or_default()
                    }
                    _ => DVec3::ZERO,
                },
                BakeLayout::Picture(_) => value(&self.node, texel_center(x, y, width, height), true, pictures),
                BakeLayout::Square(edge) => {
                    value(&self.node, texel_center(x, y, width, height) * *edge, false, pictures)
                }
                BakeLayout::Ramp(ramp, _) => ramp_value(&self.node, ramp.at_texel(x, width)),
            };
            let value = changed(value, self.change);
            let value = if self.is_scalar { DVec3::splat(value.element_sum() / 3.0) } else { value };
            value.as_vec3().to_array()
        };
        let texels: Vec<[f32; 3]> = (0..width * height).map(texel).collect();
        let name = format!("texture of {}", context.place(self.at));
        Ok(match &self.layout {
            // Noise is negative half of the time: it is kept between the bounds of its ramp
            BakeLayout::Ramp(..) => {
                let sound = |value: f32| if value.is_nan() { 0.0 } else { value.clamp(-VALUE_MAX, VALUE_MAX) };
                Image::from_numbers(name, width, height, texels.into_iter().map(|texel| texel.map(sound)).collect())
            }
            _ => Image::from_linear_rgb(name, width, height, texels),
        })
    }
}

fn changed(value: DVec3, change: Option<fn(DVec3) -> DVec3>) -> DVec3 {
    change.map_or(value, |change| change(value))
}

/// Evaluates a tree of ramps with one variable.
fn ramp_value(node: &TextureNode, at: f32) -> DVec3 {
    match node {
        TextureNode::Ramp(ramp) => ramp.value(at),
        TextureNode::Constant(value) => *value,
        TextureNode::Scale(a, b) => ramp_value(a, at) * ramp_value(b, at),
        TextureNode::Mix(a, b, amount) => {
            let (a, b) = (ramp_value(a, at), ramp_value(b, at));
            a + (b - a) * ramp_value(amount, at)
        }
        TextureNode::Picture(_) | TextureNode::Checkerboard(..) | TextureNode::Bilinear(..) => DVec3::ZERO,
    }
}

fn layout(node: &Rc<TextureNode>) -> BakeLayout {
    if let TextureNode::Checkerboard(mapping, even, odd) = &**node
        && constant(even).is_some()
        && constant(odd).is_some()
    {
        return BakeLayout::Cells(*mapping);
    }
    let mut leaves = Vec::new();
    if gather(node, &mut leaves)
        && let Some((first, rest)) = leaves.split_first()
        && rest.iter().all(|leaf| (leaf.mapping, leaf.wrap) == (first.mapping, first.wrap))
    {
        return BakeLayout::Picture((*first).clone());
    }
    // A checkerboard of unit cells has a period of two.
    BakeLayout::Square(if !repeats_within(node, 1.0) && repeats_within(node, 2.0) { 2.0 } else { 1.0 })
}

/// Returns true if a tree is periodic over a square with that side.
fn repeats_within(node: &TextureNode, edge: f32) -> bool {
    let whole = |mapping: &PlacedMapping, period: f32| {
        let scale = mapping.picture_from_uv.matrix2;
        [scale.x_axis.x, scale.y_axis.y].iter().all(|scale| (edge * scale / period).fract() == 0.0)
    };
    let all = |parts: &[&TextureNode]| parts.iter().all(|part| repeats_within(part, edge));
    match node {
        TextureNode::Constant(_) => true,
        TextureNode::Picture(node) => node.wrap == Wrap::Repeat && whole(&node.mapping, 1.0),
        TextureNode::Scale(a, b) => all(&[a, b]),
        TextureNode::Mix(a, b, amount) => all(&[a, b, amount]),
        TextureNode::Checkerboard(mapping, a, b) => whole(mapping, 2.0) && all(&[a, b]),
        // Values continue to grow beyond the unit square.
        TextureNode::Bilinear(..) | TextureNode::Ramp(_) => false,
    }
}

/// Collects the pictures of a tree. Returns true if nothing else in it varies.
fn gather<'a>(node: &'a TextureNode, leaves: &mut Vec<&'a PictureNode>) -> bool {
    match node {
        TextureNode::Constant(_) => true,
        TextureNode::Picture(leaf) => {
            leaves.push(leaf);
            true
        }
        TextureNode::Scale(a, b) => gather(a, leaves) && gather(b, leaves),
        TextureNode::Mix(a, b, amount) => gather(a, leaves) && gather(b, leaves) && gather(amount, leaves),
        TextureNode::Checkerboard(..) | TextureNode::Bilinear(..) | TextureNode::Ramp(_) => false,
    }
}

/// Returns the number of texels that resolve a tree: those of its pictures, or of the unit square if these may repeat.
fn size(node: &TextureNode, pictures: &[Image], of_square: bool) -> Vec2 {
    let scale = |mapping: &PlacedMapping| {
        let scale = mapping.picture_from_uv.matrix2;
        Vec2::new(scale.x_axis.x, scale.y_axis.y).abs()
    };
    match node {
        TextureNode::Constant(_) => Vec2::ONE,
        TextureNode::Picture(node) => {
            let (width, height) = pictures[node.picture.0 as usize].size();
            let size = Vec2::new(width as f32, height as f32);
            if of_square { (size * scale(&node.mapping)).ceil() } else { size }
        }
        TextureNode::Scale(a, b) => size(a, pictures, of_square).max(size(b, pictures, of_square)),
        TextureNode::Mix(a, b, amount) => {
            size(a, pictures, of_square).max(size(b, pictures, of_square)).max(size(amount, pictures, of_square))
        }
        TextureNode::Checkerboard(mapping, a, b) => {
            let cells = (scale(mapping) * CELL_TEXELS).ceil();
            cells.max(size(a, pictures, of_square)).max(size(b, pictures, of_square))
        }
        TextureNode::Bilinear(..) | TextureNode::Ramp(_) => Vec2::splat(CELL_TEXELS),
    }
}

/// Evaluates a tree.
///
/// - `at`: texture coordinates; with `on_picture`, coordinates of the pictures themselves.
fn value(node: &TextureNode, at: Vec2, on_picture: bool, pictures: &[Image]) -> DVec3 {
    let place = |mapping: &PlacedMapping| if on_picture { at } else { mapping.picture_from_uv.transform_point2(at) };
    match node {
        TextureNode::Constant(value) => *value,
        TextureNode::Picture(node) => picture_value(node, place(&node.mapping), pictures),
        TextureNode::Scale(a, b) => value(a, at, on_picture, pictures) * value(b, at, on_picture, pictures),
        TextureNode::Mix(a, b, amount) => {
            let (a, b) = (value(a, at, on_picture, pictures), value(b, at, on_picture, pictures));
            a + (b - a) * value(amount, at, on_picture, pictures)
        }
        TextureNode::Checkerboard(mapping, even, odd) => {
            let st = place(mapping);
            let parity = (st.x.floor() + (1.0 - st.y).floor()).rem_euclid(2.0);
            value(if parity == 0.0 { even } else { odd }, at, on_picture, pictures)
        }
        TextureNode::Bilinear(mapping, [v00, v01, v10, v11]) => {
            let st = place(mapping);
            let (s, t) = (f64::from(st.x), f64::from(1.0 - st.y));
            (*v00 * (1.0 - s) + *v10 * s) * (1.0 - t) + (*v01 * (1.0 - s) + *v11 * s) * t
        }
        TextureNode::Ramp(ramp) => DVec3::splat(ramp.mean),
    }
}

fn picture_value(node: &PictureNode, at: Vec2, pictures: &[Image]) -> DVec3 {
    let image = &pictures[node.picture.0 as usize];
    let map = TextureMap { wrap_u: node.wrap, wrap_v: node.wrap, smooth: node.smooth, ..TextureMap::new(ImageId(0)) };
    let texel = image.eval(&map, at, 0.0).as_dvec4();
    let mut value = texel.truncate();
    if let Some(gamma) = node.gamma {
        value = value.powf(gamma);
    }
    if node.is_scalar {
        value = DVec3::splat(if image.has_alpha() { texel.w } else { value.element_sum() / 3.0 });
    }
    value *= node.scale;
    if node.invert { (DVec3::ONE - value).max(DVec3::ZERO) } else { value }
}

/// Converts a picture to numbers as pbrt does: its alpha if it has one, else the mean of its colours.
pub(super) fn scalar_image(image: Image) -> Image {
    if image.is_gray() {
        return image;
    }
    let (width, height) = image.size();
    let texels = (0..width * height).map(|index| image.texel(index % width, index / width));
    if image.has_alpha() && !image.is_high_dynamic_range() {
        let alpha = texels.map(|texel| (texel.w * 255.0 + 0.5) as u8).collect();
        return Image::from_gray8(image.name.clone(), width, height, alpha, false);
    }
    let has_alpha = image.has_alpha();
    let number = |texel: Vec4| [if has_alpha { texel.w } else { texel.truncate().element_sum() / 3.0 }; 3];
    Image::from_linear_rgb(image.name.clone(), width, height, texels.map(number).collect())
}

/// Returns the texture coordinates of a texel's centre.
fn texel_center(x: u32, y: u32, width: u32, height: u32) -> Vec2 {
    Vec2::new((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32)
}
