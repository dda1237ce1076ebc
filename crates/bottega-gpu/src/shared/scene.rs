//! A scene and a view of it, as `bottega_render::flat` writes them.

use bottega_render::flat::{
    self, CameraRecord, EnvironmentRecord, FilterRecord, InstanceRecord, MeshRecord, ParallelRecord,
    PictureLightRecord, PictureRecord, PointLightRecord, ShiningRecord, SphereLightRecord, SphereRecord,
    SpotLightRecord, SurfaceLightRecord, TableRecord, TreeNodeRecord, code, constants as flat_constants, header,
};

use super::declare::{Layout, constants};

pub(super) const LAYOUTS: &[Layout] = &[
    Layout::of::<InstanceRecord>("INSTANCE"),
    Layout::of::<MeshRecord>("MESH"),
    Layout::of::<SphereRecord>("SPHERE"),
    Layout::of::<SurfaceLightRecord>("SURFACE_LIGHT"),
    Layout::of::<SphereLightRecord>("SPHERE_LIGHT"),
    Layout::of::<PointLightRecord>("POINT_LIGHT"),
    Layout::of::<SpotLightRecord>("SPOT_LIGHT"),
    Layout::of::<PictureLightRecord>("PICTURE_LIGHT"),
    Layout::of::<ShiningRecord>("SHINING"),
    Layout::of::<ParallelRecord>("PARALLEL"),
    Layout::of::<TreeNodeRecord>("TREE_NODE"),
    Layout::of::<EnvironmentRecord>("ENVIRONMENT"),
    Layout::of::<TableRecord>("DENSITY"),
    Layout::of::<CameraRecord>("CAMERA"),
    Layout::of::<FilterRecord>("FILTER"),
    Layout::of::<PictureRecord>("PICTURE"),
];

constants! {
    /// Codes in records.
    CODES;
    LIGHT_SURFACE: u32 = code::LIGHT_SURFACE;
    LIGHT_SPHERE: u32 = code::LIGHT_SPHERE;
    LIGHT_POINT: u32 = code::LIGHT_POINT;
    LIGHT_SPOT: u32 = code::LIGHT_SPOT;
    LIGHT_GONIOMETRIC: u32 = code::LIGHT_GONIOMETRIC;
    LIGHT_PROJECTOR: u32 = code::LIGHT_PROJECTOR;
    SPOT_SQUARED_COSINE: u32 = code::SPOT_SQUARED_COSINE;
    SPOT_SMOOTH_COSINE: u32 = code::SPOT_SMOOTH_COSINE;
    PANEL_TRIANGLE: u32 = code::PANEL_TRIANGLE;
    PANEL_CORNER_MASK: u32 = code::PANEL_CORNER_MASK;
    PANEL_OPPOSITE_SHIFT: u32 = code::PANEL_OPPOSITE_SHIFT;
    DENSITY_NONE: u32 = code::DENSITY_NONE;
    DENSITY_UNIFORM: u32 = code::DENSITY_UNIFORM;
    DENSITY_BILINEAR: u32 = code::DENSITY_BILINEAR;
    CAMERA_PARALLEL: u32 = code::CAMERA_PARALLEL;
    CAMERA_EQUIRECTANGULAR: u32 = code::CAMERA_EQUIRECTANGULAR;
    CAMERA_EQUAL_AREA: u32 = code::CAMERA_EQUAL_AREA;
}

constants! {
    /// Places of the header, and constants of light transport.
    CONSTANTS;
    /// An index that stands for none.
    NONE: u32 = flat::NONE;
    HEADER_INSTANCES: u32 = header::INSTANCES as u32;
    HEADER_SPHERES: u32 = header::SPHERES as u32;
    HEADER_LIGHTS: u32 = header::LIGHTS as u32;
    HEADER_LIGHT_COUNT: u32 = header::LIGHT_COUNT as u32;
    HEADER_TREE: u32 = header::TREE as u32;
    HEADER_TREE_INTENSITY: u32 = header::TREE_INTENSITY as u32;
    HEADER_SHINING: u32 = header::SHINING as u32;
    HEADER_PARALLEL: u32 = header::PARALLEL as u32;
    HEADER_PARALLEL_COUNT: u32 = header::PARALLEL_COUNT as u32;
    HEADER_ENVIRONMENT: u32 = header::ENVIRONMENT as u32;
    HEADER_HAS_FAR: u32 = header::HAS_FAR as u32;
    LIGHT_WORDS: u32 = flat::LIGHT_WORDS;
    FILTER_INTERVALS: u32 = flat_constants::FILTER_INTERVALS as u32;
    /// Minimum probability of sampling the environment and distant lights, and minimum probability of not doing so.
    SHARE_MIN: f32 = flat_constants::SHARE_MIN;
    /// A light seen under a larger solid angle than this, in sr, is sampled by solid angle.
    SOLID_ANGLE_MIN: f32 = flat_constants::SOLID_ANGLE_MIN;
    DISTANCE_SQUARED_MIN: f32 = flat_constants::DISTANCE_SQUARED_MIN;
    /// Offset of a new ray from the surface, relative to the magnitude of the numbers that its origin was computed from.
    CLEARANCE: f32 = flat_constants::CLEARANCE;
    EXTENT_CLEARANCE: f32 = flat_constants::EXTENT_CLEARANCE;
    /// Minimum cosine between wo and the shading normal.
    COSINE_MIN: f32 = flat_constants::COSINE_MIN;
    ROULETTE_SURVIVAL_MAX: f32 = flat_constants::ROULETTE_SURVIVAL_MAX;
    /// Gap between a shadow ray's end and its target, relative to its length.
    SHADOW_MARGIN: f32 = flat_constants::SHADOW_MARGIN;
    /// Growth of the cone after a scattering that spreads over one steradian.
    SCATTERED_SPREAD: f32 = flat_constants::SCATTERED_SPREAD;
    /// Separates the random numbers that choose between blended surfaces from those that decide on opacity.
    BLEND: [u32; 2] = [flat_constants::BLEND as u32, (flat_constants::BLEND >> 32) as u32];
    /// The position of the depth in the upper word of the keys of both.
    DEPTH_SHIFT: u32 = flat_constants::DEPTH_SHIFT - 32;
    /// The bit by which shadow rays get other opacity numbers than paths.
    ASKS_AS_SHADOW: u32 = flat_constants::ASKS_AS_SHADOW;
}
