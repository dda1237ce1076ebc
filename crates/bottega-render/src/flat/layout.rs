//! The records of a flat scene and a flat picture, with their codes.

use glam::{Mat3, Vec2, Vec3, Vec4};

use crate::record;

/// The word that stands for no reference.
pub const NONE: u32 = u32::MAX;

/// Offsets in the header of a [`FlatScene`](crate::flat::FlatScene), which holds the offsets of everything else.
pub mod header {
    /// Header word: offset of the array of instances, [`InstanceRecord`](super::InstanceRecord).
    pub const INSTANCES: usize = 0;
    /// Header word: offset of the array of spheres, [`SphereRecord`](super::SphereRecord).
    pub const SPHERES: usize = 1;
    /// Header word: offset of the array of the tree's lights by number, [`LIGHT_WORDS`](super::LIGHT_WORDS) each.
    pub const LIGHTS: usize = 2;
    /// Header word: number of the tree's lights.
    pub const LIGHT_COUNT: usize = 3;
    /// Header word: offset of the array of the tree's nodes, [`TreeNodeRecord`](super::TreeNodeRecord).
    pub const TREE: usize = 4;
    /// Header word: total intensity of the tree's lights (f32).
    pub const TREE_INTENSITY: usize = 5;
    /// Header word: offset of the array of emitting triangles, [`ShiningRecord`](super::ShiningRecord).
    pub const SHINING: usize = 6;
    /// Header word: offset of the array of parallel lights, [`ParallelRecord`](super::ParallelRecord).
    pub const PARALLEL: usize = 7;
    /// Header word: number of parallel lights.
    pub const PARALLEL_COUNT: usize = 8;
    /// Header word: offset of the [`EnvironmentRecord`](super::EnvironmentRecord); [`NONE`](super::NONE) without an
    /// environment.
    pub const ENVIRONMENT: usize = 9;
    /// Header word: 1 if light sampling includes lights at infinity, else 0.
    pub const HAS_FAR: usize = 10;
    /// Number of words of the header.
    pub const COUNT: usize = 16;
}

/// Codes of enum variants.
pub mod code {
    /// Kind of a light: emitting surface.
    pub const LIGHT_SURFACE: u32 = 0;
    /// Kind of a light: emitting sphere.
    pub const LIGHT_SPHERE: u32 = 1;
    /// Kind of a light: point light.
    pub const LIGHT_POINT: u32 = 2;
    /// Kind of a light: spotlight.
    pub const LIGHT_SPOT: u32 = 3;
    /// Kind of a light: point with a picture of its intensity by direction.
    pub const LIGHT_GONIOMETRIC: u32 = 4;
    /// Kind of a light: projector.
    pub const LIGHT_PROJECTOR: u32 = 5;
    /// Kind of a light: none, emits nothing.
    pub const LIGHT_DARK: u32 = 6;

    /// Fall-off of a spotlight: square of the ramp between its cosines.
    pub const SPOT_SQUARED_COSINE: u32 = 0;
    /// Fall-off of a spotlight: smooth step of the ramp between its cosines.
    pub const SPOT_SMOOTH_COSINE: u32 = 1;
    /// Fall-off of a spotlight: linear in the angle.
    pub const SPOT_LINEAR_ANGLE: u32 = 2;

    /// Shape of a panel: triangle. Otherwise a rectangle: its corner in the lowest bits, the opposite corner above, then
    /// the bit [`PANEL_RECTANGLE`].
    pub const PANEL_TRIANGLE: u32 = 0;
    /// Mask of the bits of a panel's corner.
    pub const PANEL_CORNER_MASK: u32 = 3;
    /// Shift of the bits of the opposite corner.
    pub const PANEL_OPPOSITE_SHIFT: u32 = 2;
    /// Bit of a panel that is a rectangle.
    pub const PANEL_RECTANGLE: u32 = 16;

    /// Sampling of the environment: none.
    pub const DENSITY_NONE: u32 = 0;
    /// Sampling of the environment: uniform.
    pub const DENSITY_UNIFORM: u32 = 1;
    /// Sampling of the environment: density bilinear between the centres of cells.
    pub const DENSITY_BILINEAR: u32 = 2;
    /// Sampling of the environment: density constant in each cell.
    pub const DENSITY_CELLS: u32 = 3;

    /// Projection of a camera: perspective.
    pub const CAMERA_PERSPECTIVE: u32 = 0;
    /// Projection of a camera: parallel rays.
    pub const CAMERA_PARALLEL: u32 = 1;
    /// Projection of a camera: all directions, by latitude and longitude.
    pub const CAMERA_EQUIRECTANGULAR: u32 = 2;
    /// Projection of a camera: all directions, by equal areas.
    pub const CAMERA_EQUAL_AREA: u32 = 3;
}

record! {
    /// An instance of a mesh.
    pub struct InstanceRecord in 24 {
        /// Linear part of the transformation from object to world space.
        pub world_from_object: Mat3,
        /// Translation of the transformation from object to world space.
        pub translation: Vec3,
        /// Transformation of normals from object to world space: the inverse transpose.
        pub world_from_normal: Mat3,
        /// Offset of the [`MeshRecord`].
        pub mesh: u32,
        /// Index of the first triangle among the emitting ones; [`NONE`](super::NONE) if the mesh does not emit.
        pub first_light: u32,
    }
}

record! {
    /// A mesh: offsets of its arrays; [`NONE`](super::NONE) for arrays that are missing or unused.
    pub struct MeshRecord {
        /// Index of the material of the mesh.
        pub material: u32,
        /// Offset of vertex indices, three per triangle.
        pub triangles: u32,
        /// Offset of positions, three numbers per vertex.
        pub positions: u32,
        /// Offset of normals, three numbers per vertex.
        pub normals: u32,
        /// Offsets of both sets of texture coordinates, two numbers per vertex.
        pub uvs: [u32; 2],
        /// Offset of vertex colours, four numbers per vertex.
        pub colors: u32,
        /// Offset of tangents, four numbers per vertex.
        pub tangents: u32,
    }
}

record! {
    /// A sphere of the scene.
    pub struct SphereRecord in 12 {
        /// Centre in world space.
        pub center: Vec3,
        /// Radius, above 0, in scene units.
        pub radius: f32,
        /// Rotation from object space to world space, as a unit quaternion.
        pub world_from_object: Vec4,
        /// Index of the sphere's material.
        pub material: u32,
        /// Number of the sphere's light; [`NONE`](super::NONE) if light sampling never finds it.
        pub light: u32,
    }
}

/// Number of words of the record of any light of the tree.
pub const LIGHT_WORDS: u32 = 24;

record! {
    /// An emitting panel, or a part of one, as a light.
    pub struct SurfaceLightRecord in 24 {
        /// Kind of the light: [`code::LIGHT_SURFACE`].
        pub kind: u32,
        /// Index of the panel's instance.
        pub instance: u32,
        /// Index of the panel's first triangle.
        pub triangle: u32,
        /// Shape of the panel, see [`code::PANEL_TRIANGLE`].
        pub shape: u32,
        /// Corner of the panel, in world space.
        pub corner: Vec3,
        /// First side of the panel, from the corner.
        pub x: Vec3,
        /// Second side of the panel, from the corner.
        pub y: Vec3,
        /// Position of the part along both sides, and its relative size; negative for a part rotated by half a turn.
        pub part: Vec3,
        /// Index of the panel's material.
        pub material: u32,
    }
}

record! {
    /// An emitting sphere as a light.
    pub struct SphereLightRecord in 24 {
        /// Kind of the light: [`code::LIGHT_SPHERE`].
        pub kind: u32,
        /// Index of the sphere.
        pub sphere: u32,
    }
}

record! {
    /// A light without extent: the fields common to all kinds.
    pub struct PointLightRecord {
        /// Kind of the light, one of [`code`].
        pub kind: u32,
        /// Position in world space.
        pub position: Vec3,
        /// Radiant intensity per channel, in W·sr⁻¹.
        pub intensity: Vec3,
    }
}

record! {
    /// A spotlight with a cone.
    pub struct SpotLightRecord in 24 {
        /// Fields common to all lights without extent.
        pub point: PointLightRecord,
        /// Direction of the axis, unit length.
        pub direction: Vec3,
        /// Cosine of the angle within which the intensity is full.
        pub cos_inner: f32,
        /// Cosine of the angle beyond which the intensity is 0.
        pub cos_outer: f32,
        /// Code of the light's fall-off, see [`code::SPOT_SQUARED_COSINE`].
        pub falloff: u32,
    }
}

record! {
    /// A goniometric light or a projector.
    pub struct PictureLightRecord in 24 {
        /// Fields common to all lights without extent.
        pub point: PointLightRecord,
        /// Rotation from light space to world space.
        pub world_from_light: Mat3,
        /// Handle of the light's picture.
        pub picture: u32,
        /// Projector: half the height of its picture at distance 1.
        pub half_height: f32,
        /// Projector: width over height of its picture.
        pub aspect: f32,
    }
}

record! {
    /// An emitting triangle, as a reference to the panel of which it is a part.
    pub struct ShiningRecord {
        /// Offset of the light numbers of its panel's parts.
        pub parts: u32,
        /// Shape of the triangle's panel, see [`code::PANEL_TRIANGLE`].
        pub shape: u32,
        /// 1 for the second triangle of a rectangle, else 0.
        pub is_second: bool,
        /// Number of parts per side of the panel.
        pub side: u32,
    }
}

record! {
    /// A light at infinity with parallel rays: a sun without a disc.
    pub struct ParallelRecord {
        /// Direction to the light, unit length.
        pub to_light: Vec3,
        /// Irradiance of a surface that faces the light, in W·m⁻².
        pub irradiance: Vec3,
        /// Luminance of the irradiance.
        pub illuminance: f32,
    }
}

record! {
    /// A node of the light tree; each field has one value for each of four children.
    pub struct TreeNodeRecord {
        /// x of the centres of the boxes.
        pub center_x: [f32; 4],
        /// y of the centres of the boxes.
        pub center_y: [f32; 4],
        /// z of the centres of the boxes.
        pub center_z: [f32; 4],
        /// x of the half-extents of the boxes.
        pub half_x: [f32; 4],
        /// y of the half-extents of the boxes.
        pub half_y: [f32; 4],
        /// z of the half-extents of the boxes.
        pub half_z: [f32; 4],
        /// x of the axes of the cones of normals.
        pub axis_x: [f32; 4],
        /// y of the axes of the cones of normals.
        pub axis_y: [f32; 4],
        /// z of the axes of the cones of normals.
        pub axis_z: [f32; 4],
        /// Half-diagonals of the boxes.
        pub radius: [f32; 4],
        /// Cosines of the cones' half-angles.
        pub cos_spread: [f32; 4],
        /// Sines of the cones' half-angles.
        pub sin_spread: [f32; 4],
        /// Cosines of the angles beyond the cones at which emission ends.
        pub cos_emission: [f32; 4],
        /// Above 0 if both sides emit.
        pub two_sided: [f32; 4],
        /// Shares of the tree's total intensity.
        pub intensity: [f32; 4],
        /// Indices of the children's nodes; [`NONE`](super::NONE) for lights.
        pub child: [u32; 4],
        /// End of each child's range of lights.
        pub end: [u32; 4],
    }
}

record! {
    /// The environment light: a radiance from each direction, uniform or from a picture.
    pub struct EnvironmentRecord {
        /// Code of the environment's sampling, see [`code::DENSITY_NONE`].
        pub kind: u32,
        /// 1 if the environment's picture is an equal-area one, else 0.
        pub is_equal_area: bool,
        /// Factor for the picture; the radiance itself without one.
        pub factor: Vec3,
        /// Rotation from environment space to world space.
        pub world_from_environment: Mat3,
        /// Luminance integrated over the sphere, of the sampled part.
        pub integral: f32,
        /// Handle of the environment's picture; [`NONE`](super::NONE) without one.
        pub picture: u32,
        /// Table of the sampling.
        pub table: TableRecord,
        /// Factor from latitudes to rows of the picture.
        pub rows_scale: f32,
        /// Offset added after [`Self::rows_scale`].
        pub rows_offset: f32,
    }
}

record! {
    /// A table of densities: its size, and offsets of its arrays.
    pub struct TableRecord {
        /// Number of columns.
        pub columns: u32,
        /// Number of rows.
        pub rows: u32,
        /// Offset of the densities at centres; [`NONE`](super::NONE) for a table of cells.
        pub values: u32,
        /// Offset of the cumulative sums along each row.
        pub sums: u32,
        /// Offset of the cumulative sums of the rows.
        pub marginal: u32,
    }
}

impl TableRecord {
    /// Stands for no table.
    pub(crate) const NONE: Self = Self { columns: NONE, rows: NONE, values: NONE, sums: NONE, marginal: NONE };
}

record! {
    /// A camera for pictures of one size.
    pub struct CameraRecord {
        /// Linear part of the transformation from camera to world space.
        pub world_from_camera: Mat3,
        /// Position in world space.
        pub position: Vec3,
        /// Half the picture's width and height: at distance 1, or in scene units for parallel rays.
        pub half_extent: Vec2,
        /// Shift of the lens, in halves of the picture's width and height.
        pub shift: Vec2,
        /// Two over the picture's size in pixels.
        pub double_pixel: Vec2,
        /// Code of the camera's projection, see [`code::CAMERA_PERSPECTIVE`].
        pub kind: u32,
        /// Radius of the lens, in scene units; 0 for a pinhole.
        pub lens_radius: f32,
        /// Distance of the plane in focus, in scene units.
        pub focus: f32,
        /// Width of a ray cone at the camera, in scene units.
        pub cone_width: f32,
        /// Growth of the cone's width per unit of distance.
        pub cone_spread: f32,
        /// Distance of the near plane along the camera's axis, in scene units.
        pub near: f32,
        /// Distance of the far plane along the camera's axis, in scene units.
        pub far: f32,
    }
}

record! {
    /// A separable pixel filter, as a table for importance sampling.
    pub struct FilterRecord {
        /// Radius in pixels.
        pub radius: f32,
        /// Offset of the filter's quantiles from the start of the picture; [`NONE`](super::NONE) for a uniform filter.
        pub quantiles: u32,
        /// Absolute weight of a sample; beyond `sign_change` the weight is negative.
        pub factor: f32,
        /// Relative offset beyond which the filter is negative.
        pub sign_change: f32,
    }
}

record! {
    /// The start of a flat picture: its camera and its filter.
    pub struct PictureRecord {
        /// The camera.
        pub camera: CameraRecord,
        /// The filter; its quantiles follow the record.
        pub filter: FilterRecord,
    }
}
