//! Shapes, the tree over them, rays, and the answers to rays.

use std::mem::offset_of;

use bottega_kernels::Hit;
use bottega_render::flat::{Portable as _, Record as _, place_of};
use bottega_render::record;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::declare::{Layout, buffer_struct, constants};

/// The number of children of a node.
pub(crate) const WIDTH: usize = 8;

constants! {
    /// Constants of shapes and rays.
    CONSTANTS;
    /// Threads per workgroup.
    GROUP_SIZE: u32 = 64;
    /// A distance that stands for infinity.
    FAR: f32 = 3e38;
    /// The bit of an instance number that marks a sphere.
    HIT_SPHERE: u32 = Hit::SPHERE;
    /// The instance of an answer without a hit.
    HIT_NOTHING: u32 = Hit::NONE.instance;
    /// Conservative bound of the rounding of a slab test: 1 + 2 γ₃ (Ize, "Robust BVH Ray Traversal", 2013).
    SLAB_SLACK: f32 = 1.0000008;
    /// Tolerance of the edge tests, relative to the sum of the three: no ray may slip between two triangles that share an edge.
    EDGE_SLACK: f32 = 0.0000019;
    /// Size of a node in vectors of four words.
    NODE_VECTORS: u32 = size_of::<Node>() as u32 / 16;
    /// The lowest bit of each of four bytes.
    NODE_EACH: u32 = 0x0101_0101;
    /// Width of the field of a child's kind that holds its place, or the offset of its first shape from the node's.
    NODE_PLACE_WIDTH: u32 = 5;
    /// The mask of the field of [`NODE_PLACE_WIDTH`] bits in four children.
    NODE_PLACE_BITS: u32 = ((1 << NODE_PLACE_WIDTH) - 1) * NODE_EACH;
    /// The mask of the bits of shapes in four children: one bit per shape, after a shift by [`NODE_PLACE_WIDTH`].
    NODE_SHAPE_BITS: u32 = ((1 << LEAF_MAX) - 1) * NODE_EACH;
    /// Offset of the places of inner children: they use the upper eight of 32 bits.
    NODE_INNER: u32 = 24;
    /// The lower 24 bits, which stand for shapes.
    NODE_GROUP_SHAPES: u32 = (1 << NODE_INNER) - 1;
    /// A group with the root alone.
    NODE_GROUP_ROOT: u32 = 1 << 31;
    /// The upper one of the two bits of [`NODE_INNER`]; no leaf has both.
    NODE_INNER_SHIFT: u32 = 4;
    /// The mask of the bit [`NODE_INNER_SHIFT`] in four children.
    NODE_INNER_BITS: u32 = NODE_EACH << NODE_INNER_SHIFT;
    /// The maximum number of shapes per leaf; a leaf has one bit per shape.
    LEAF_MAX: u32 = 3;
}

pub(super) const LAYOUTS: &[Layout] = &[Layout::of::<AnswerRecord>("ANSWER")];

record! {
    /// The closest hit of a ray.
    pub(crate) struct AnswerRecord {
        pub(crate) t: f32,
        pub(crate) u: f32,
        pub(crate) v: f32,
        pub(crate) instance: u32,
        pub(crate) primitive: u32,
    }
}

impl AnswerRecord {
    /// Decodes the words that the shader wrote.
    pub(crate) fn of(words: &[u32; Self::WORDS as usize]) -> Self {
        let float = |place: u32| f32::from_bits(words[place as usize]);
        Self {
            t: float(const { place_of(Self::FIELDS, "t") }),
            u: float(const { place_of(Self::FIELDS, "u") }),
            v: float(const { place_of(Self::FIELDS, "v") }),
            instance: words[const { place_of(Self::FIELDS, "instance") as usize }],
            primitive: words[const { place_of(Self::FIELDS, "primitive") as usize }],
        }
    }
}

buffer_struct! {
    /// A triangle, or a sphere: center in `p0`, radius in `p1.x`, and [`HIT_SPHERE`] in `instance`.
    struct Shape {
        p0: Vec3,
        instance: u32,
        p1: Vec3,
        primitive: u32,
        p2: Vec3,
        padding: u32,
    }
}

buffer_struct! {
    /// A ray with finite numbers; it hits nothing if `t_min >= t_max`.
    struct Ray {
        origin: Vec3,
        t_min: f32,
        direction: Vec3,
        t_max: f32,
    }
}

buffer_struct! {
    /// The parameters of a batch of rays.
    struct RayParams {
        ray_count: u32,
        padding_0: u32,
        padding_1: u32,
        padding_2: u32,
    }
}

/// A node of the tree; shaders read it as [`NODE_VECTORS`] vectors of four words.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Node {
    /// The lower corner of the node's box.
    pub(crate) corner: [f32; 3],
    /// The biased exponents of the step size on each axis.
    pub(crate) exponents: [u8; 3],
    /// A bit per child: set if the child is an inner node.
    pub(crate) inner: u8,
    /// The index of the first inner child; the others follow it.
    pub(crate) children: u32,
    /// The index of the first shape of the leaf children.
    pub(crate) shapes: u32,
    /// A byte per child. No child: 0. Inner node: 1 << 5 | 24 + its place. Leaf: from bit 5 on one bit per shape, and in the
    /// lower five bits the offset of its first shape from `shapes`.
    pub(crate) kinds: [u8; WIDTH],
    /// The children's boxes by axis, in steps from the corner.
    pub(crate) low: [[u8; WIDTH]; 3],
    pub(crate) high: [[u8; WIDTH]; 3],
}

/// Returns WGSL: a struct of a node's parts, and the function that unpacks it from the node's vectors.
pub(super) fn node_source() -> String {
    // The vector and component that hold a byte.
    let word = |byte: usize| format!("{}.{}", ["a", "b", "c", "d", "e"][byte / 16], ["x", "y", "z", "w"][byte / 4 % 4]);
    let byte = |byte: usize| format!("({} >> {}u) & 0xffu", word(byte), 8 * (byte % 4));
    let two = |byte: usize| format!("vec2<u32>({}, {})", word(byte), word(byte + 4));
    let three = |byte: usize, of: &dyn Fn(usize) -> String, step: usize| {
        [0, 1, 2].map(|index| of(byte + step * index)).join(", ")
    };
    let mut parts = vec![
        (
            "corner",
            "vec3<f32>",
            format!("bitcast<vec3<f32>>(vec3<u32>({}))", three(offset_of!(Node, corner), &word, 4)),
        ),
        ("exponents", "vec3<u32>", format!("vec3<u32>({})", three(offset_of!(Node, exponents), &byte, 1))),
        ("inner", "u32", byte(offset_of!(Node, inner))),
        ("children", "u32", word(offset_of!(Node, children))),
        ("shapes", "u32", word(offset_of!(Node, shapes))),
        ("kinds", "vec2<u32>", two(offset_of!(Node, kinds))),
    ];
    for (names, first) in
        [(["low_x", "low_y", "low_z"], offset_of!(Node, low)), (["high_x", "high_y", "high_z"], offset_of!(Node, high))]
    {
        let axes = names.into_iter().zip((first..).step_by(WIDTH));
        parts.extend(axes.map(|(name, place)| (name, "vec2<u32>", two(place))));
    }
    let fields: String = parts.iter().map(|(name, type_name, _)| format!("    {name}: {type_name},\n")).collect();
    let values: Vec<_> = parts.iter().map(|(.., value)| format!("        {value},\n")).collect();
    let vectors = ["a", "b", "c", "d", "e"].map(|name| format!("{name}: vec4<u32>")).join(", ");
    format!(
        "struct Node {{\n{fields}}}\nfn node_of({vectors}) -> Node {{\n    return Node(\n{}    );\n}}\n",
        values.concat()
    )
}

const _: () = assert!(size_of::<Node>() == 5 * 16, "as many vectors as `node_of` takes");
