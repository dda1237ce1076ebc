//! Errors in a glTF document or its data.

use crate::camera::ClipError;
use crate::text::shortened;

/// An error in a glTF document or its data, as a clause about the place where it is.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub(super) enum GltfError {
    /// An index of the document is out of range.
    #[error("refers to {what} {index}, but there are {count}")]
    NoSuch { what: &'static str, index: usize, count: usize },

    /// An accessor is invalid.
    #[error("accessor {index}: {error}")]
    Accessor { index: usize, error: Box<GltfError> },
    #[error("unknown component type {0}")]
    ComponentType(u64),
    #[error("unknown type `{}`", shortened(.0))]
    AccessorType(String),
    #[error("{0} elements are more than can be indexed")]
    TooManyElements(u64),
    #[error("a stride of {stride} bytes is less than the {size} bytes of an element")]
    Stride { stride: usize, size: usize },
    #[error("{count} elements of {size} bytes each from byte {offset} do not fit into {bytes} bytes")]
    Range { count: usize, size: usize, offset: u64, bytes: usize },
    #[error("buffer view {view} ends at byte {end} of buffer {buffer}, which has {bytes}")]
    BufferView { view: usize, end: u64, buffer: usize, bytes: usize },
    #[error("sparse indices must be unsigned integers")]
    SparseType,
    #[error("{sparse} sparse values for {count} elements")]
    SparseCount { sparse: u64, count: usize },
    #[error("sparse indices do not increase")]
    SparseOrder,
    #[error("sparse index {index} of {count} elements")]
    SparseIndex { index: u32, count: usize },

    #[error("unknown mode {0}")]
    PrimitiveMode(u64),
    #[error("its attribute {0} is missing, or of a kind unknown to glTF")]
    DracoAttribute(usize),

    #[error("ends at byte {end} of buffer {buffer}, which has {bytes}")]
    MeshoptEnd { end: u64, buffer: usize, bytes: usize },
    #[error("{0} indices are not whole triangles")]
    MeshoptTriangles(u64),
    #[error("unknown mode `{}`", shortened(.0))]
    MeshoptMode(String),
    #[error("unknown filter `{}`", shortened(.0))]
    MeshoptFilter(String),
    #[error("elements of {0} bytes cannot be compressed in this mode with this filter")]
    MeshoptStride(u64),
    #[error("has too many elements")]
    MeshoptCount,
    /// The compressed bytes are invalid.
    #[error("{0}")]
    MeshoptData(&'static str),

    #[error("a field of view of {0} radians cannot be shown")]
    FieldOfView(f32),
    #[error("a window of {width} × {height} cannot be shown")]
    Window { width: f32, height: f32 },
    #[error("there is no description of its type `{}`", shortened(.0))]
    CameraType(String),
    #[error(transparent)]
    Clip(#[from] ClipError),
    #[error("a light of the colour {0} cannot be")]
    LightColor(glam::Vec3),
    #[error("its position is not finite")]
    LightPosition,
    #[error("its node's transformation leaves no direction")]
    LightDirection,
    #[error("cone angles from {inner} to {outer} radians cannot be")]
    ConeAngles { inner: f32, outer: f32 },
    #[error("its type `{}` is unknown", shortened(.0))]
    LightType(String),

    #[error("the header of the GLB container is cut off")]
    GlbHeader,
    #[error("its GLB container has version {0}, only version 2 is supported")]
    GlbVersion(u32),
    #[error("its header announces {announced} bytes, there are {bytes}")]
    GlbTooShort { announced: usize, bytes: usize },
    #[error("its header announces {0} bytes, fewer than the header itself has")]
    GlbLength(usize),
    /// A chunk of a GLB file is invalid.
    #[error("chunk {index}: {error}")]
    GlbChunk { index: usize, error: Box<GltfError> },
    #[error("its header is cut off")]
    ChunkHeader,
    #[error("its header announces {announced} bytes, {bytes} are left")]
    ChunkTooShort { announced: u32, bytes: usize },
    #[error("its first chunk is not JSON")]
    GlbWithoutJson,
    #[error("it has no JSON chunk")]
    GlbEmptyJson,
}
