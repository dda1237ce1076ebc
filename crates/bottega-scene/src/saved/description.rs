//! The description in a saved scene: everything but the long arrays, whose lengths it gives.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};

use crate::camera::Camera;
use crate::facing_curves::CurveLook;
use crate::grid::Blend;
use crate::hints::RenderHints;
use crate::light::{Environment, Light};
use crate::material::Material;
use crate::medium::Medium;
use crate::motion::Shutter;
use crate::texture::Mapping;

/// A scene without its arrays. The blocks follow in this order: meshes, instances, spheres, images, grids of the media,
/// motion.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Description<'a> {
    /// Meshes, one after another.
    pub(super) meshes: Vec<MeshDescription<'a>>,
    /// Number of instances.
    pub(super) instances: u64,
    /// Number of spheres.
    pub(super) spheres: u64,
    pub(super) materials: Cow<'a, [Material]>,
    pub(super) media: Vec<MediumDescription<'a>>,
    pub(super) images: Vec<ImageDescription<'a>>,
    pub(super) mappings: Cow<'a, [Mapping]>,
    pub(super) lights: Cow<'a, [Light]>,
    pub(super) environment: Cow<'a, Option<Environment>>,
    pub(super) cameras: Cow<'a, [Camera]>,
    /// Origin of the scene in the world space of the file that it was read from.
    pub(super) origin: [f64; 3],
    /// Render settings of the file that the scene was read from.
    pub(super) hints: Cow<'a, RenderHints>,
    /// The keys of moving parts; `None`: the scene stands still.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) motion: Option<MotionDescription>,
}

/// The keys of moving instances, spheres and meshes. Lights and cameras contain their own keys. The blocks come last: the keys of the
/// instances, those of the spheres, and for each mesh the times, then positions and normals of each key.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotionDescription {
    pub(super) shutter: Shutter,
    /// Moving instances: index, and number of keys.
    pub(super) instances: Vec<(u32, u32)>,
    /// Moving spheres: index, and number of keys.
    pub(super) spheres: Vec<(u32, u32)>,
    /// Meshes whose vertices move: index, and number of keys.
    pub(super) meshes: Vec<(u32, u32)>,
}

/// A mesh. Its blocks: positions, normals, tangents, two sets of texture coordinates, colors, triangles, points and pieces of
/// curves; those that it lacks are left out.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MeshDescription<'a> {
    pub(super) name: Cow<'a, str>,
    /// Index of the mesh's material.
    pub(super) material: u32,
    /// Number of vertices.
    pub(super) vertices: u64,
    /// Number of triangles.
    pub(super) triangles: u64,
    pub(super) has_normals: bool,
    pub(super) has_tangents: bool,
    pub(super) has_uvs: [bool; 2],
    pub(super) has_colors: bool,
    pub(super) curves: Option<CurvesDescription>,
}

/// The curves in the hull of a mesh.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CurvesDescription {
    pub(super) look: CurveLook,
    /// Number of points.
    pub(super) points: u64,
}

/// An image. Its block: the texels of the finest level.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImageDescription<'a> {
    pub(super) name: Cow<'a, str>,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) format: TexelFormat,
    /// True if 8-bit codes are encoded as sRGB.
    pub(super) is_srgb: bool,
}

/// The format of texels; see [`LevelTexels`](crate::LevelTexels).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum TexelFormat {
    Gray8,
    Rgb8,
    Rgba8,
    Rgba16,
    Rgb32,
    Rgba32,
}

/// The description of a medium in a saved scene.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MediumDescription<'a> {
    pub(super) medium: Cow<'a, Medium>,
    /// The spatial variation of the medium's coefficients; `None`: homogeneous.
    pub(super) variation: Option<VariationDescription>,
}

/// The spatial variation of a medium. Its blocks: the values of the grids.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct VariationDescription {
    pub(super) density: DensityKind,
    /// The one or two grids of the density, in the order of [`Density`](crate::Density)'s fields.
    pub(super) grids: Vec<GridDescription>,
    pub(super) emission: Option<EmissionDescription>,
    /// World space to the unit cube of the grids, column by column.
    pub(super) grid_from_world: [f32; 12],
}

/// The kinds of [`Density`](crate::Density).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum DensityKind {
    Both,
    Each,
    WithAlbedo,
}

/// The spatial variation of a medium's emission.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EmissionDescription {
    pub(super) grid: GridDescription,
    /// The grid has temperatures; a block of colors follows. `None`: it has factors.
    pub(super) blackbody: Option<BlackbodyDescription>,
}

/// The numbers of a [`Blackbody`](crate::Blackbody).
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BlackbodyDescription {
    pub(super) scale: f32,
    pub(super) offset: f32,
    pub(super) times_density: bool,
}

/// A grid, as the description of a saved scene has it; its values are in the arrays behind the description.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridDescription {
    /// Cells along x, y and z.
    pub(super) size: [u32; 3],
    /// Values per cell: 1 or 3.
    pub(super) channels: u32,
    /// Number of bricks, stored or empty, whose table comes before the values; `None`: all cells are stored.
    pub(super) bricks: Option<u64>,
    /// Number of values in all.
    pub(super) values: u64,
    pub(super) blend: Blend,
}
