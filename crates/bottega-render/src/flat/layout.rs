//! The records of a scene and of a picture of it, and the codes in them.

use glam::{Mat3, Vec2, Vec3, Vec4};

use crate::record;

/// Stands for a place where nothing is.
pub const NONE: u32 = u32::MAX;

/// Places of a [`FlatScene`](crate::flat::FlatScene) that say where everything else is.
pub mod header {
    /// Records of instances, [`InstanceRecord`](super::InstanceRecord).
    pub const INSTANCES: usize = 0;
    /// Records of spheres, [`SphereRecord`](super::SphereRecord).
    pub const SPHERES: usize = 1;
    /// Records of the lights of the tree, [`LIGHT_WORDS`](super::LIGHT_WORDS) each, by their numbers in it.
    pub const LIGHTS: usize = 2;
    /// How many these are.
    pub const LIGHT_COUNT: usize = 3;
    /// Nodes of the tree, [`TreeNodeRecord`](super::TreeNodeRecord).
    pub const TREE: usize = 4;
    /// Intensity of all lights of the tree together (f32).
    pub const TREE_INTENSITY: usize = 5;
    /// Records of triangles that shine, [`ShiningRecord`](super::ShiningRecord).
    pub const SHINING: usize = 6;
    /// Parallel lights, [`ParallelRecord`](super::ParallelRecord).
    pub const PARALLEL: usize = 7;
    /// How many these are.
    pub const PARALLEL_COUNT: usize = 8;
    /// The [`EnvironmentRecord`](super::EnvironmentRecord); [`NONE`](super::NONE): there is none.
    pub const ENVIRONMENT: usize = 9;
    /// Whether light sampling finds light from infinitely far away.
    pub const HAS_FAR: usize = 10;
    /// Words of the header.
    pub const COUNT: usize = 16;
}

/// Numbers that stand for the variants of enums.
pub mod code {
    /// A light's record: of a surface.
    pub const LIGHT_SURFACE: u32 = 0;
    /// Of a sphere.
    pub const LIGHT_SPHERE: u32 = 1;
    /// Of a point.
    pub const LIGHT_POINT: u32 = 2;
    /// Of a spotlight.
    pub const LIGHT_SPOT: u32 = 3;
    /// Of a point with a picture of its intensity by direction.
    pub const LIGHT_GONIOMETRIC: u32 = 4;
    /// Of a projector.
    pub const LIGHT_PROJECTOR: u32 = 5;
    /// Gives no light.
    pub const LIGHT_DARK: u32 = 6;

    /// A spotlight falls off by the square of the ramp between its cosines.
    pub const SPOT_SQUARED_COSINE: u32 = 0;
    /// By a smooth step of it.
    pub const SPOT_SMOOTH_COSINE: u32 = 1;
    /// Linearly in the angle.
    pub const SPOT_LINEAR_ANGLE: u32 = 2;

    /// The shape of a panel: a triangle. Else a rectangle: its corner in the lowest bits, the opposite one above, and then a bit.
    pub const PANEL_TRIANGLE: u32 = 0;
    /// Bits of a corner.
    pub const PANEL_CORNER_MASK: u32 = 3;
    /// Where the bits of the opposite corner begin.
    pub const PANEL_OPPOSITE_SHIFT: u32 = 2;
    /// The bit of a rectangle.
    pub const PANEL_RECTANGLE: u32 = 16;

    /// An environment whose directions are not sampled.
    pub const DENSITY_NONE: u32 = 0;
    /// One that is sampled uniformly.
    pub const DENSITY_UNIFORM: u32 = 1;
    /// By densities that go linearly from centre to centre.
    pub const DENSITY_BILINEAR: u32 = 2;
    /// By cells of equal density.
    pub const DENSITY_CELLS: u32 = 3;

    /// A camera of perspective projection.
    pub const CAMERA_PERSPECTIVE: u32 = 0;
    /// Of parallel rays.
    pub const CAMERA_PARALLEL: u32 = 1;
    /// Of all directions, by latitude and longitude.
    pub const CAMERA_EQUIRECTANGULAR: u32 = 2;
    /// Of all directions, by equal areas.
    pub const CAMERA_EQUAL_AREA: u32 = 3;
}

record! {
    /// An instance.
    pub struct InstanceRecord in 24 {
        /// The linear part of its transformation.
        pub world_from_object: Mat3,
        /// And where the origin goes.
        pub translation: Vec3,
        /// The transformation of normals.
        pub world_from_normal: Mat3,
        /// Place of its mesh.
        pub mesh: u32,
        /// Number of the first of its triangles among those that shine; [`NONE`](super::NONE): none shines.
        pub first_light: u32,
    }
}

record! {
    /// A mesh: places of its arrays, or [`NONE`](super::NONE) of those that nothing asks for.
    pub struct MeshRecord {
        /// Number of its material.
        pub material: u32,
        /// Three vertices a triangle.
        pub triangles: u32,
        /// Three numbers a vertex.
        pub positions: u32,
        /// Three numbers a vertex.
        pub normals: u32,
        /// Two numbers a vertex, of both sets.
        pub uvs: [u32; 2],
        /// Four numbers a vertex.
        pub colors: u32,
        /// Four numbers a vertex.
        pub tangents: u32,
    }
}

record! {
    /// A sphere.
    pub struct SphereRecord in 12 {
        /// World space.
        pub center: Vec3,
        /// Above 0.
        pub radius: f32,
        /// A unit quaternion.
        pub world_from_object: Vec4,
        /// Number of its material.
        pub material: u32,
        /// Number of its light; [`NONE`](super::NONE): light sampling never finds it.
        pub light: u32,
    }
}

/// Words of the record of any light of the tree.
pub const LIGHT_WORDS: u32 = 24;

record! {
    /// A surface that shines, or a part of it, as a light.
    pub struct SurfaceLightRecord in 24 {
        /// [`code::LIGHT_SURFACE`].
        pub kind: u32,
        /// Number of its instance.
        pub instance: u32,
        /// The first of its triangles.
        pub triangle: u32,
        /// Shape of the whole panel; see [`code::PANEL_TRIANGLE`].
        pub shape: u32,
        /// Corner of the panel.
        pub corner: Vec3,
        /// A side of the panel.
        pub x: Vec3,
        /// The other side.
        pub y: Vec3,
        /// Place of the part along both sides, and its size as a share of them, below 0 where it points the other way.
        pub part: Vec3,
        /// Number of its material.
        pub material: u32,
    }
}

record! {
    /// A sphere as a light.
    pub struct SphereLightRecord in 24 {
        /// [`code::LIGHT_SPHERE`].
        pub kind: u32,
        /// Number of the sphere.
        pub sphere: u32,
    }
}

record! {
    /// A light without extent; what more there is of its kind follows.
    pub struct PointLightRecord {
        /// One of the codes of lights.
        pub kind: u32,
        /// World space.
        pub position: Vec3,
        /// By channel.
        pub intensity: Vec3,
    }
}

record! {
    /// A spotlight.
    pub struct SpotLightRecord in 24 {
        /// What every light without extent has.
        pub point: PointLightRecord,
        /// Unit length.
        pub direction: Vec3,
        /// Within it there is full intensity.
        pub cos_inner: f32,
        /// Beyond it there is none.
        pub cos_outer: f32,
        /// Code of its fall-off.
        pub falloff: u32,
    }
}

record! {
    /// A light with a picture.
    pub struct PictureLightRecord in 24 {
        /// What every light without extent has.
        pub point: PointLightRecord,
        /// Turns directions.
        pub world_from_light: Mat3,
        /// Handle of its picture.
        pub picture: u32,
        /// Of a projector: half of its picture's height at distance 1.
        pub half_height: f32,
        /// Width over height of its picture.
        pub aspect: f32,
    }
}

record! {
    /// A triangle that shines.
    pub struct ShiningRecord {
        /// Place of the numbers of its parts.
        pub parts: u32,
        /// Shape of its panel; see [`code::PANEL_TRIANGLE`].
        pub shape: u32,
        /// Whether it is the second of a rectangle.
        pub is_second: bool,
        /// Parts a side.
        pub side: u32,
    }
}

record! {
    /// Parallel light.
    pub struct ParallelRecord {
        /// Direction towards it.
        pub to_light: Vec3,
        /// Of a surface that faces it.
        pub irradiance: Vec3,
        /// Its luminance.
        pub illuminance: f32,
    }
}

record! {
    /// A node of the tree of lights: numbers of all four children each.
    pub struct TreeNodeRecord {
        /// Middles of the boxes.
        pub center_x: [f32; 4],
        /// Middles of the boxes.
        pub center_y: [f32; 4],
        /// Middles of the boxes.
        pub center_z: [f32; 4],
        /// Half of the sizes of the boxes.
        pub half_x: [f32; 4],
        /// Half of the sizes of the boxes.
        pub half_y: [f32; 4],
        /// Half of the sizes of the boxes.
        pub half_z: [f32; 4],
        /// Axes of the cones of normals.
        pub axis_x: [f32; 4],
        /// Axes of the cones of normals.
        pub axis_y: [f32; 4],
        /// Axes of the cones of normals.
        pub axis_z: [f32; 4],
        /// Of the balls around the boxes.
        pub radius: [f32; 4],
        /// Of the half angles of these cones.
        pub cos_spread: [f32; 4],
        /// Of the half angles of these cones.
        pub sin_spread: [f32; 4],
        /// Of the angle beyond the cone at which emission ends.
        pub cos_emission: [f32; 4],
        /// Above 0: both sides shine.
        pub two_sided: [f32; 4],
        /// Shares of the whole.
        pub intensity: [f32; 4],
        /// Numbers of the nodes, [`NONE`](super::NONE) of lights.
        pub child: [u32; 4],
        /// Numbers of the first light after each.
        pub end: [u32; 4],
    }
}

record! {
    /// Light from infinitely far away, all around.
    pub struct EnvironmentRecord {
        /// Code of its table.
        pub kind: u32,
        /// Whether its picture is one of equal areas.
        pub is_equal_area: bool,
        /// By which everything is multiplied.
        pub factor: Vec3,
        /// Turns directions.
        pub world_from_environment: Mat3,
        /// Of its luminance over all directions.
        pub integral: f32,
        /// Handle of its picture; [`NONE`](super::NONE): it has none.
        pub picture: u32,
        /// Of the table.
        pub table: TableRecord,
        /// What leads from latitudes to places on the picture: a factor.
        pub rows_scale: f32,
        /// And what is added.
        pub rows_offset: f32,
    }
}

record! {
    /// A table of densities: its size, and places of its arrays.
    pub struct TableRecord {
        /// Of the table.
        pub columns: u32,
        /// Of the table.
        pub rows: u32,
        /// Densities at centres; of cells [`NONE`](super::NONE).
        pub values: u32,
        /// Cumulative sums along each row.
        pub sums: u32,
        /// Cumulative sums of the rows.
        pub marginal: u32,
    }
}

impl TableRecord {
    /// Stands for no table.
    pub(crate) const NONE: Self = Self { columns: NONE, rows: NONE, values: NONE, sums: NONE, marginal: NONE };
}

record! {
    /// A camera and the size of its picture.
    pub struct CameraRecord {
        /// The linear part of its transformation.
        pub world_from_camera: Mat3,
        /// And where it is.
        pub position: Vec3,
        /// Half of the picture's extent along x and y.
        pub half_extent: Vec2,
        /// Of the lens.
        pub shift: Vec2,
        /// Two over the size in pixels.
        pub double_pixel: Vec2,
        /// Code of its projection.
        pub kind: u32,
        /// 0: a pinhole.
        pub lens_radius: f32,
        /// Distance in focus.
        pub focus: f32,
        /// Width of a pixel's cone.
        pub cone_width: f32,
        /// Its growth.
        pub cone_spread: f32,
        /// Distance of the near plane.
        pub near: f32,
        /// Of the far plane.
        pub far: f32,
    }
}

record! {
    /// A filter.
    pub struct FilterRecord {
        /// In pixels.
        pub radius: f32,
        /// Place of its quantiles, from the beginning of the picture; [`NONE`](super::NONE): it is uniform.
        pub quantiles: u32,
        /// Of its samples.
        pub factor: f32,
        /// Where it turns negative.
        pub sign_change: f32,
    }
}

record! {
    /// The head of a picture.
    pub struct PictureRecord {
        /// Camera.
        pub camera: CameraRecord,
        /// Filter; its quantiles follow.
        pub filter: FilterRecord,
    }
}
