//! Materials, surfaces, covers and textures as words: see `crate::material`.

use bottega_render::bsdf::constants as bsdf;
use bottega_render::flat::{Portable, Record, place_of};
use bottega_render::record;
use bottega_scene::Channel;
use glam::{Vec2, Vec3};

use super::declare::{Layout, constants};

pub(super) const LAYOUTS: &[Layout] = &[
    Layout::of::<MaterialsRecord>("MATERIALS"),
    Layout::of::<MaterialRecord>("MATERIAL"),
    Layout::of::<Param>("PARAM"),
    Layout::of::<CoverBlock>("COVER_BLOCK"),
    Layout::of::<PlainHead>("SURFACE"),
    Layout::of::<ConductorHead>("CONDUCTOR"),
    Layout::of::<DielectricHead>("DIELECTRIC"),
    Layout::of::<PlasticHead>("PLASTIC"),
    Layout::of::<CoatedHead>("COATED"),
    Layout::of::<PrincipledHead>("PRINCIPLED"),
    Layout::of::<LayeredHead>("LAYERED"),
    Layout::of::<BlendHead>("BLEND"),
    Layout::counted::<DiffuseParams>("DIFFUSE_PARAM", Param::WORDS),
    Layout::counted::<TranslucentParams>("TRANSLUCENT_PARAM", Param::WORDS),
    Layout::counted::<ConductorParams>("CONDUCTOR_PARAM", Param::WORDS),
    Layout::counted::<DielectricParams>("DIELECTRIC_PARAM", Param::WORDS),
    Layout::counted::<PlasticParams>("PLASTIC_PARAM", Param::WORDS),
    Layout::counted::<CoatedParams>("COATED_PARAM", Param::WORDS),
    Layout::counted::<OverConductor>("COATED_PARAM", Param::WORDS),
    Layout::counted::<PrincipledParams>("PRINCIPLED_PARAM", Param::WORDS),
    Layout::counted::<LayeredParams>("LAYERED_PARAM", Param::WORDS),
    Layout::counted::<BlendParams>("BLEND_PARAM", Param::WORDS),
    Layout::of::<ImageRecord>("IMAGE"),
    Layout::of::<LevelRecord>("LEVEL"),
    Layout::of::<MapRecord>("MAP"),
];

constants! {
    /// Constants of materials and surfaces.
    SURFACES;
    /// Flags of a material.
    MATERIAL_HAS_OPACITY: u32 = 1;
    MATERIAL_NULL: u32 = 1 << 1;
    MATERIAL_UNLIT: u32 = 1 << 2;
    MATERIAL_SHINES: u32 = 1 << 3;
    MATERIAL_TRANSMITS: u32 = 1 << 4;
    MATERIAL_KEEPS_MEDIUM: u32 = 1 << 5;
    MATERIAL_NEEDS_TANGENTS: u32 = 1 << 6;
    MATERIAL_TEXTURED: u32 = 1 << 7;
    MATERIAL_EMITS_FRONT: u32 = 1 << 8;
    MATERIAL_EMITS_BACK: u32 = 1 << 9;
    MATERIAL_BLENDED: u32 = 1 << 10;
    MATERIAL_HAS_RELIEF: u32 = 1 << 11;
    MATERIAL_HAS_COAT: u32 = 1 << 12;
    MATERIAL_HAS_ANISOTROPY: u32 = 1 << 13;
    MATERIAL_LAYERED: u32 = 1 << 14;
    /// Flags of the alpha mode; neither: opaque.
    MATERIAL_MASKS: u32 = 1 << 15;
    MATERIAL_BLENDS_ALPHA: u32 = 1 << 16;

    /// Kinds of reliefs, in the lowest bits.
    RELIEF_NONE: u32 = 0;
    RELIEF_NORMALS: u32 = 1;
    RELIEF_HEIGHTS: u32 = 2;
    RELIEF_KIND_MASK: u32 = 3;
    /// Flags of Mitsuba's rule for reliefs, and its options.
    RELIEF_MITSUBA: u32 = 1 << 4;
    RELIEF_TURNS: u32 = 1 << 5;
    RELIEF_SHADOWS: u32 = 1 << 6;
    RELIEF_MIRRORED: u32 = 1 << 7;

    /// Kinds of surfaces, in the lowest byte of a record; above it the number of parameters.
    SURFACE_BLACK: u32 = 0;
    SURFACE_DIFFUSE: u32 = 1;
    SURFACE_TRANSLUCENT: u32 = 2;
    SURFACE_CONDUCTOR: u32 = 3;
    SURFACE_DIELECTRIC: u32 = 4;
    SURFACE_PLASTIC: u32 = 5;
    SURFACE_COATED: u32 = 6;
    SURFACE_PRINCIPLED: u32 = 7;
    SURFACE_LAYERED: u32 = 8;
    SURFACE_BLEND: u32 = 9;
    SURFACE_KIND_MASK: u32 = 0xff;
    SURFACE_COUNT_SHIFT: u32 = 8;
    /// Words of a surface's record before its parameters.
    SURFACE_PARAMS: u32 = 8;
    SURFACE_PARAMS_MAX: u32 = 16;
    /// The maximum depth of nested blends.
    BLEND_DEPTH_MAX: u32 = 64;
    /// The maximum number of records on the way through nested blends.
    SURFACE_DEPTH_MAX: u32 = BLEND_DEPTH_MAX + 1;
    /// The maximum number of events that are traced within a coat.
    COATED_EVENTS_MAX: u32 = bsdf::COATED_DEPTH_MAX;

    /// Flags of facets: distribution, shadowing and the scale of roughness.
    FACETS_BECKMANN: u32 = 1;
    FACETS_SEPARABLE: u32 = 2;
    FACETS_MASK: u32 = FACETS_BECKMANN | FACETS_SEPARABLE;
    FACETS_SCALE_SHIFT: u32 = 2;
    FACETS_ALPHA: u32 = 0;
    FACETS_SQUARE_ROOT: u32 = 1;
    FACETS_SQUARE: u32 = 2;
    FACETS_ALPHA_MAX: f32 = bsdf::ALPHA_MAX;

    /// Treatment of light that is reflected within a plastic: linear, nonlinear, or lost.
    PLASTIC_LINEAR: u32 = 0;
    PLASTIC_NONLINEAR: u32 = 1;
    PLASTIC_LOST: u32 = 2;

    /// Nodes of a cover's thickness per octave.
    COVER_STEPS_PER_OCTAVE: f32 = 8.0;
}

constants! {
    /// Constants of textures.
    TEXTURES;
    /// Formats of images, in the lowest byte; above it a bit for sRGB codes.
    TEXTURE_GRAY8: u32 = 0;
    TEXTURE_RGBA8: u32 = 1;
    TEXTURE_RGBA16: u32 = 2;
    TEXTURE_RGB32: u32 = 3;
    TEXTURE_RGBA32: u32 = 4;
    IMAGE_FORMAT_MASK: u32 = 0xff;
    IMAGE_SRGB_SHIFT: u32 = 8;
    /// The code of the value 1.
    TEXEL_8_MAX: f32 = u8::MAX as f32;
    TEXEL_16_MAX: f32 = u16::MAX as f32;
    /// Upper bound of the texels within a footprint, so that the square of their number stays finite.
    TEXELS_SQUARED_MAX: f32 = 1e37;

    /// Flags of a map: the second set of coordinates, interpolation, and from the shifts on the wrap modes.
    MAP_UV_SET: u32 = 1;
    MAP_SMOOTH: u32 = 2;
    MAP_WRAP_U_SHIFT: u32 = 2;
    MAP_WRAP_V_SHIFT: u32 = 4;
    MAP_WRAP_MASK: u32 = 3;
    TEXTURE_WRAP_REPEAT: u32 = 0;
    TEXTURE_WRAP_MIRROR: u32 = 1;
    TEXTURE_WRAP_CLAMP: u32 = 2;

    /// The lowest bits of a map's handle name a channel,
    CHANNEL_R: u32 = Channel::R as u32;
    CHANNEL_G: u32 = Channel::G as u32;
    CHANNEL_B: u32 = Channel::B as u32;
    CHANNEL_A: u32 = Channel::A as u32;
    /// or all colour channels.
    CHANNEL_RGB: u32 = 4;
    CHANNEL_MASK: u32 = MAP_ALIGNMENT - 1;
    /// The bits of a handle that hold the place of the map.
    TEXTURE_HANDLE: u32 = !CHANNEL_MASK;
    /// Maps lie at multiples of this many words.
    MAP_ALIGNMENT: u32 = 8;
}

record! {
    /// The header before the first material.
    pub(crate) struct MaterialsRecord in 8 {
        pub(crate) count: u32,
        /// The place of the albedo curves; 0: there are none.
        pub(crate) curves: u32,
    }
}

record! {
    /// A parameter of a surface.
    pub(crate) struct Param {
        /// A colour, or a number in all channels or in the first.
        pub(crate) factor: Vec3,
        /// The handle of a texture that is multiplied by; 0: none.
        pub(crate) texture: u32,
    }
}

record! {
    /// A material.
    pub(crate) struct MaterialRecord in 32 {
        pub(crate) flags: u32,
        /// The places of the surfaces that scatter on the front and the back; 0: nothing scatters.
        pub(crate) front: u32,
        pub(crate) back: u32,
        /// The minimum alpha at which a masked surface is present.
        pub(crate) cutoff: f32,
        pub(crate) opacity: Param,
        pub(crate) emission: Param,
        /// Absorption per unit of distance, outside and inside.
        pub(crate) exterior: Vec3,
        pub(crate) interior: Vec3,
        /// The relief's kind and rule.
        pub(crate) relief: u32,
        /// The handle of the relief's texture.
        pub(crate) relief_map: u32,
        /// The scale of the x and y of normals, or of heights.
        pub(crate) relief_scale: f32,
        /// The handle of the clear coat's normal map; 0: the coat has the smooth normal of the surface.
        pub(crate) coat_map: u32,
        pub(crate) coat_scale: f32,
        /// The handle of a texture with the directions of stretched highlights.
        pub(crate) anisotropy_map: u32,
        /// The cosine and sine of the angle by which those directions are rotated.
        pub(crate) anisotropy_turn: Vec2,
        /// The colour of an unlit surface.
        pub(crate) unlit_color: Param,
    }
}

record! {
    /// The head of a surface that has only parameters.
    pub(crate) struct PlainHead in 8 {
        /// The kind and the number of parameters.
        pub(crate) kind: u32,
    }
}

record! {
    pub(crate) struct ConductorHead in 8 {
        pub(crate) kind: u32,
        pub(crate) facets: u32,
    }
}

record! {
    pub(crate) struct DielectricHead in 8 {
        pub(crate) kind: u32,
        pub(crate) facets: u32,
        pub(crate) eta: f32,
        pub(crate) thin: bool,
    }
}

record! {
    pub(crate) struct PlasticHead in 8 {
        pub(crate) kind: u32,
        pub(crate) facets: u32,
        pub(crate) eta: f32,
        /// The treatment of light that is reflected within: one of `PLASTIC_…`.
        pub(crate) inner: u32,
        /// The place of the plastic's cover; 0: the boundary is smooth everywhere, or the base is shaded as if it were.
        pub(crate) cover: u32,
    }
}

record! {
    pub(crate) struct CoatedHead in 8 {
        pub(crate) kind: u32,
        pub(crate) facets: u32,
        pub(crate) eta: f32,
        pub(crate) max_depth: u32,
        /// The place of the cover of a coat that only absorbs; 0: it may scatter, or lies on metal.
        pub(crate) cover: u32,
        pub(crate) is_metal: bool,
        /// The flags of the metal's facets.
        pub(crate) base_facets: u32,
    }
}

record! {
    pub(crate) struct PrincipledHead in 8 {
        pub(crate) kind: u32,
        pub(crate) thin: bool,
        pub(crate) eta: f32,
    }
}

record! {
    pub(crate) struct LayeredHead in 8 {
        pub(crate) kind: u32,
        pub(crate) thin: bool,
        pub(crate) ior: f32,
        pub(crate) dispersion: f32,
        pub(crate) film_ior: f32,
        /// The range of the film's thickness, in nanometres.
        pub(crate) film_least: f32,
        pub(crate) film_most: f32,
    }
}

record! {
    pub(crate) struct BlendHead in 8 {
        pub(crate) kind: u32,
        /// The places of both surfaces.
        pub(crate) first: u32,
        pub(crate) second: u32,
    }
}

record! {
    pub(crate) struct DiffuseParams {
        pub(crate) reflectance: Param,
        pub(crate) roughness: Param,
    }
}

record! {
    pub(crate) struct TranslucentParams {
        pub(crate) reflectance: Param,
        pub(crate) transmittance: Param,
    }
}

record! {
    pub(crate) struct ConductorParams {
        pub(crate) eta: Param,
        pub(crate) k: Param,
        pub(crate) reflectance: Param,
        pub(crate) roughness_x: Param,
        pub(crate) roughness_y: Param,
    }
}

record! {
    pub(crate) struct DielectricParams {
        pub(crate) reflectance: Param,
        pub(crate) transmittance: Param,
        pub(crate) roughness_x: Param,
        pub(crate) roughness_y: Param,
    }
}

record! {
    pub(crate) struct PlasticParams {
        pub(crate) diffuse: Param,
        pub(crate) specular: Param,
        pub(crate) roughness_x: Param,
        pub(crate) roughness_y: Param,
    }
}

record! {
    /// The parameters of a coat; those of its base follow.
    pub(crate) struct CoatedParams {
        pub(crate) albedo: Param,
        pub(crate) thickness: Param,
        pub(crate) g: Param,
        pub(crate) roughness_x: Param,
        pub(crate) roughness_y: Param,
    }
}

record! {
    pub(crate) struct OverDiffuse {
        pub(crate) coat: CoatedParams,
        pub(crate) base: Param,
    }
}

record! {
    pub(crate) struct OverConductor {
        pub(crate) coat: CoatedParams,
        pub(crate) base: ConductorParams,
    }
}

record! {
    pub(crate) struct PrincipledParams {
        pub(crate) base_color: Param,
        pub(crate) roughness: Param,
        pub(crate) anisotropic: Param,
        pub(crate) metallic: Param,
        pub(crate) spec_trans: Param,
        pub(crate) spec_tint: Param,
        pub(crate) sheen: Param,
        pub(crate) sheen_tint: Param,
        pub(crate) flatness: Param,
        pub(crate) clearcoat: Param,
        pub(crate) clearcoat_gloss: Param,
        pub(crate) diff_trans: Param,
    }
}

record! {
    pub(crate) struct LayeredParams {
        pub(crate) base_color: Param,
        pub(crate) specular_color: Param,
        pub(crate) through_color: Param,
        pub(crate) sheen_color: Param,
        pub(crate) metallic: Param,
        pub(crate) roughness: Param,
        pub(crate) specular: Param,
        pub(crate) transmission: Param,
        pub(crate) diffuse_transmission: Param,
        pub(crate) coat: Param,
        pub(crate) coat_roughness: Param,
        pub(crate) sheen_roughness: Param,
        pub(crate) film: Param,
        /// The film's thickness, from 0 (minimum) to 1 (maximum).
        pub(crate) film_thickness: Param,
        /// The strength of the anisotropy.
        pub(crate) anisotropy: Param,
    }
}

record! {
    pub(crate) struct BlendParams {
        pub(crate) weight: Param,
    }
}

const _: () = assert!(
    LayeredParams::WORDS <= SURFACE_PARAMS_MAX * Param::WORDS
        && PrincipledParams::WORDS <= SURFACE_PARAMS_MAX * Param::WORDS
        && OverConductor::WORDS <= SURFACE_PARAMS_MAX * Param::WORDS
        && PlainHead::WORDS == SURFACE_PARAMS
        && place_of(OverDiffuse::FIELDS, "base") == place_of(OverConductor::FIELDS, "base")
);

record! {
    /// The head of the curves of a cover; the curves follow, ordered by slot of thickness, then by node of α.
    pub(crate) struct CoverBlock {
        /// The first node of α, and the number of nodes.
        pub(crate) first_node: u32,
        pub(crate) node_count: u32,
        /// The first step of thickness, below 1.
        pub(crate) first_step: i32,
        /// The number of slots of thickness. If there is more than one, the first is for thickness 0.
        pub(crate) slot_count: u32,
    }
}

record! {
    /// The head of an image; its levels follow.
    pub(crate) struct ImageRecord {
        /// The format, and a bit for sRGB codes.
        pub(crate) format: u32,
        pub(crate) level_count: u32,
    }
}

record! {
    /// A mip level of an image.
    pub(crate) struct LevelRecord {
        /// The place of the level's texels.
        pub(crate) texels: u32,
        pub(crate) width: u32,
        pub(crate) height: u32,
    }
}

record! {
    /// The mapping of an image to a surface.
    pub(crate) struct MapRecord in 16 {
        /// The place of the image.
        pub(crate) image: u32,
        pub(crate) flags: u32,
        /// The columns of the linear part of the transformation of uv, and its translation.
        pub(crate) x_axis: Vec2,
        pub(crate) y_axis: Vec2,
        pub(crate) offset: Vec2,
        /// The square of the number of texels per unit of uv.
        pub(crate) texels_squared: f32,
    }
}
