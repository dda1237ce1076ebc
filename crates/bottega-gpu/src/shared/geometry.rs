//! Shapes, the tree over them, rays, and answers to rays.

use std::mem::offset_of;

use bottega_kernels::Hit;
use bottega_render::flat::{Portable as _, Record as _, place_of};
use bottega_render::record;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::declare::{Layout, buffer_struct, constants};

/// Children of a node.
pub(crate) const WIDTH: usize = 8;

constants! {
    /// Of shapes and rays.
    CONSTANTS;
    /// Threads in a group.
    GROUP_SIZE: u32 = 64;
    /// Stands for infinity.
    FAR: f32 = 3e38;
    /// The bit of an instance's number that tells of a sphere.
    HIT_SPHERE: u32 = Hit::SPHERE;
    /// The instance of a hit that is none.
    HIT_NOTHING: u32 = Hit::NONE.instance;
    /// Rounding of a slab test, conservatively: 1 + 2 γ₃ (Ize, "Robust BVH Ray Traversal", 2013).
    SLAB_SLACK: f32 = 1.0000008;
    /// Tolerance of the edge tests, relative to the sum of the three: rays through a shared edge must not slip between.
    EDGE_SLACK: f32 = 0.0000019;
    /// Vectors of four words of a node.
    NODE_VECTORS: u32 = size_of::<Node>() as u32 / 16;
    /// A bit for each of four children.
    NODE_EACH: u32 = 0x0101_0101;
    /// Bits of a child's kind that tell its place, or how far its first shape is from the node's.
    NODE_PLACE_WIDTH: u32 = 5;
    /// Those bits of four children.
    NODE_PLACE_BITS: u32 = ((1 << NODE_PLACE_WIDTH) - 1) * NODE_EACH;
    /// Bits of four children that stand for a shape each, above those of the place.
    NODE_SHAPE_BITS: u32 = ((1 << LEAF_MAX) - 1) * NODE_EACH;
    /// Added to the place of a child that is a node: these are counted in the upper eight of 32 bits.
    NODE_INNER: u32 = 24;
    /// The bits below, which stand for shapes.
    NODE_GROUP_SHAPES: u32 = (1 << NODE_INNER) - 1;
    /// The root alone.
    NODE_GROUP_ROOT: u32 = 1 << 31;
    /// The upper one of the two bits of [`NODE_INNER`], which no shape has both of.
    NODE_INNER_SHIFT: u32 = 4;
    /// That bit of four children.
    NODE_INNER_BITS: u32 = NODE_EACH << NODE_INNER_SHIFT;
    /// Shapes in a leaf at most: their number is kept in bits of which each stands for one.
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
    /// From the words that the shader wrote.
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
    /// A ray: all finite, nothing to be found where `t_min >= t_max`.
    struct Ray {
        origin: Vec3,
        t_min: f32,
        direction: Vec3,
        t_max: f32,
    }
}

buffer_struct! {
    /// What is told of a batch of rays.
    struct RayParams {
        ray_count: u32,
        padding_0: u32,
        padding_1: u32,
        padding_2: u32,
    }
}

/// A node of the tree; shaders read [`NODE_VECTORS`] vectors of four words.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(crate) struct Node {
    /// The lower corner.
    pub(crate) corner: [f32; 3],
    /// Biased exponents of the size of a step on each axis.
    pub(crate) exponents: [u8; 3],
    /// Which children are nodes, a bit each.
    pub(crate) inner: u8,
    /// The first child that is a node; they follow each other.
    pub(crate) children: u32,
    /// The first shape of the children that are leaves.
    pub(crate) shapes: u32,
    /// Of each child: 0 where there is none; a node: 1 << 5 | 24 + its place; a leaf: so many bits from bit 5 on as it has shapes,
    /// and in the lower five bits how far they are from `shapes`.
    pub(crate) kinds: [u8; WIDTH],
    /// Boxes by axis, in steps from the corner.
    pub(crate) low: [[u8; WIDTH]; 3],
    pub(crate) high: [[u8; WIDTH]; 3],
}

/// A struct of a node's parts for shaders, and the function that makes it of a node's vectors.
pub(super) fn node_source() -> String {
    // A word by the vector and the component that it is in.
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
