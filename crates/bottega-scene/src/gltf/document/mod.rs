//! The glTF 2.0 document as in its JSON: <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>, section 5.
//!
//! Only the parts that the importer uses. Only JSON types are checked here: an index may be out of range, a count
//! absurd. The code that follows an index checks it and reports its location.

use serde::Deserialize;

/// Declares a struct of the document: camelCase names; absent members have their default. Rare members are boxed, so
/// that a small text cannot become large in memory.
macro_rules! object {
    ($(#[$meta:meta])* $name:ident { $($(#[$field_meta:meta])* $field:ident: $type:ty),* $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Debug, Default, Deserialize)]
        #[serde(rename_all = "camelCase", default)]
        pub(in crate::gltf) struct $name {
            $($(#[$field_meta])* pub(in crate::gltf) $field: $type,)*
        }
    };
}

/// Declares a struct like `object!`, but members are required unless they are optional or have a default of their own.
macro_rules! strict_object {
    ($name:ident { $($(#[$field_meta:meta])* $field:ident: $type:ty),* $(,)? }) => {
        #[derive(Clone, Debug, Default, Deserialize)]
        #[serde(rename_all = "camelCase")]
        pub(in crate::gltf) struct $name {
            $($(#[$field_meta])* pub(in crate::gltf) $field: $type,)*
        }
    };
}

mod looks;

pub(in crate::gltf) use looks::*;

object!(Document {
    asset: Asset,
    scene: Option<usize>,
    scenes: Vec<SceneNodes>,
    nodes: Vec<Node>,
    meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<BufferView>,
    buffers: Vec<Buffer>,
    materials: Vec<Material>,
    textures: Vec<Texture>,
    images: Vec<Image>,
    samplers: Vec<Sampler>,
    cameras: Vec<Camera>,
    skins: Vec<Skin>,
    animations: Vec<Animation>,
    extensions_used: Vec<String>,
    extensions_required: Vec<String>,
    extensions: DocumentExtensions,
});

object!(DocumentExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    lights: Option<Lights>,
    #[serde(rename = "KHR_materials_variants")]
    variants: Option<Variants>,
});

object!(Variants {
    variants: Vec<Variant>,
});

object!(Variant { name: String });

strict_object!(Asset {
    version: String,
    min_version: Option<String>,
    generator: Option<String>,
});

object!(SceneNodes {
    nodes: Vec<usize>,
});

object!(Node {
    name: String,
    children: Vec<usize>,
    matrix: Option<Box<[f64; 16]>>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
    mesh: Option<usize>,
    skin: Option<usize>,
    camera: Option<usize>,
    weights: Option<Vec<f32>>,
    extensions: Option<Box<NodeExtensions>>,
});

object!(NodeExtensions {
    #[serde(rename = "KHR_lights_punctual")]
    light: Option<NodeLight>,
    #[serde(rename = "EXT_mesh_gpu_instancing")]
    instancing: Option<Box<Instancing>>,
    #[serde(rename = "KHR_node_visibility")]
    visibility: Option<Visibility>,
});

object!(Visibility { visible: Option<bool> });

strict_object!(NodeLight { light: usize });

strict_object!(Instancing { attributes: InstancingAttributes });

object!(InstancingAttributes {
    #[serde(rename = "TRANSLATION")]
    translation: Option<usize>,
    #[serde(rename = "ROTATION")]
    rotation: Option<usize>,
    #[serde(rename = "SCALE")]
    scale: Option<usize>,
});

object!(Mesh {
    name: String,
    primitives: Vec<Primitive>,
    weights: Option<Vec<f32>>,
});

object!(Primitive {
    attributes: Box<Attributes>,
    indices: Option<usize>,
    material: Option<usize>,
    mode: Option<u64>,
    targets: Vec<Target>,
    extensions: PrimitiveExtensions,
});

object!(PrimitiveExtensions {
    #[serde(rename = "KHR_draco_mesh_compression")]
    draco: Option<Box<Draco>>,
    #[serde(rename = "KHR_materials_variants")]
    variants: Option<Box<VariantMappings>>,
});

strict_object!(Draco {
    buffer_view: usize,
    /// Ids of the attributes within the compressed data.
    attributes: Box<Attributes>,
});

object!(VariantMappings {
    mappings: Vec<VariantMapping>,
});

strict_object!(VariantMapping { material: usize, variants: Vec<usize> });

object!(Attributes {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
    #[serde(rename = "NORMAL")]
    normal: Option<usize>,
    #[serde(rename = "TANGENT")]
    tangent: Option<usize>,
    #[serde(rename = "TEXCOORD_0")]
    uv0: Option<usize>,
    #[serde(rename = "TEXCOORD_1")]
    uv1: Option<usize>,
    #[serde(rename = "COLOR_0")]
    color: Option<usize>,
    #[serde(rename = "JOINTS_0")]
    joints0: Option<usize>,
    #[serde(rename = "WEIGHTS_0")]
    weights0: Option<usize>,
    #[serde(rename = "JOINTS_1")]
    joints1: Option<usize>,
    #[serde(rename = "WEIGHTS_1")]
    weights1: Option<usize>,
    /// Present only to report that it is left out.
    #[serde(rename = "JOINTS_2")]
    joints2: Option<usize>,
});

object!(Target {
    #[serde(rename = "POSITION")]
    position: Option<usize>,
    #[serde(rename = "NORMAL")]
    normal: Option<usize>,
    #[serde(rename = "TANGENT")]
    tangent: Option<usize>,
    #[serde(rename = "TEXCOORD_0")]
    uv0: Option<usize>,
    #[serde(rename = "TEXCOORD_1")]
    uv1: Option<usize>,
    #[serde(rename = "COLOR_0")]
    color: Option<usize>,
});

strict_object!(Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u64,
    #[serde(default)]
    normalized: bool,
    count: u64,
    #[serde(rename = "type")]
    kind: String,
    sparse: Option<Box<Sparse>>,
});

strict_object!(Sparse { count: u64, indices: SparseIndices, values: SparseValues });

strict_object!(SparseIndices {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: u64,
    component_type: u64,
});

strict_object!(SparseValues {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: u64,
});

strict_object!(BufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
    #[serde(default)]
    extensions: BufferViewExtensions,
});

object!(BufferViewExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext_meshopt: Option<Box<Meshopt>>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr_meshopt: Option<Box<Meshopt>>,
});

impl BufferViewExtensions {
    /// Returns the compression of the view, and the name of its extension; `None`: it is not compressed.
    pub(in crate::gltf) fn meshopt(&self) -> Option<(&'static str, &Meshopt)> {
        let khr = self.khr_meshopt.as_deref().map(|meshopt| ("KHR_meshopt_compression", meshopt));
        khr.or(self.ext_meshopt.as_deref().map(|meshopt| ("EXT_meshopt_compression", meshopt)))
    }
}

strict_object!(Meshopt {
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: String,
    filter: Option<String>,
});

strict_object!(Buffer {
    uri: Option<String>,
    byte_length: u64,
    #[serde(default)]
    extensions: BufferExtensions,
});

object!(BufferExtensions {
    #[serde(rename = "EXT_meshopt_compression")]
    ext_meshopt: Option<MeshoptFallback>,
    #[serde(rename = "KHR_meshopt_compression")]
    khr_meshopt: Option<MeshoptFallback>,
});

impl BufferExtensions {
    /// Returns true if the buffer is only for readers without the decompression extension.
    pub(in crate::gltf) fn is_fallback(&self) -> bool {
        [&self.ext_meshopt, &self.khr_meshopt].into_iter().flatten().any(|meshopt| meshopt.fallback)
    }
}

object!(MeshoptFallback { fallback: bool });

object!(Camera {
    name: String,
    #[serde(rename = "type")]
    kind: String,
    perspective: Option<Perspective>,
    orthographic: Option<Orthographic>,
});

strict_object!(Perspective {
    yfov: f32,
    aspect_ratio: Option<f32>,
    znear: Option<f32>,
    zfar: Option<f32>,
});

strict_object!(Orthographic {
    xmag: f32,
    ymag: f32,
    znear: Option<f32>,
    zfar: Option<f32>,
});

object!(Animation {
    name: String,
    channels: Vec<AnimationChannel>,
    samplers: Vec<AnimationSampler>,
});

strict_object!(AnimationChannel { sampler: usize, target: AnimationTarget });

strict_object!(AnimationTarget {
    node: Option<usize>,
    path: String,
    extensions: Option<Box<TargetExtensions>>,
});

object!(TargetExtensions {
    #[serde(rename = "KHR_animation_pointer")]
    pointer: Option<AnimationPointer>,
});

object!(AnimationPointer { pointer: String });

impl AnimationTarget {
    /// Returns the JSON pointer of KHR_animation_pointer; `None`: the target is a node.
    pub(in crate::gltf) fn pointer(&self) -> Option<&str> {
        self.extensions.as_ref()?.pointer.as_ref().map(|pointer| pointer.pointer.as_str())
    }
}

strict_object!(AnimationSampler {
    input: usize,
    output: usize,
    interpolation: Option<String>,
});

object!(Skin {
    inverse_bind_matrices: Option<usize>,
    joints: Vec<usize>,
});

object!(Lights {
    lights: Vec<Light>,
});

object!(Light {
    name: String,
    color: Option<[f32; 3]>,
    intensity: Option<f32>,
    #[serde(rename = "type")]
    kind: String,
    /// Present only to report that it is ignored.
    range: Option<f32>,
    spot: Spot,
});

object!(Spot {
    inner_cone_angle: f32,
    outer_cone_angle: Option<f32>,
});

/// Maximal memory of an object, so that the number of objects in a text bounds the memory of its document.
pub(in crate::gltf) const OBJECT_BYTES_MAX: usize = 320;

const _: () = {
    let sizes = [
        size_of::<Node>(),
        size_of::<NodeExtensions>() + size_of::<Instancing>(),
        size_of::<Mesh>(),
        size_of::<Primitive>() + size_of::<Attributes>(),
        size_of::<Material>(),
        size_of::<MaterialExtensions>(),
        size_of::<MetallicRoughness>(),
        size_of::<SpecularGlossiness>(),
        size_of::<Clearcoat>(),
        size_of::<Iridescence>(),
        size_of::<DiffuseTransmission>(),
        size_of::<TextureInfo>(),
        size_of::<Accessor>(),
        size_of::<BufferView>(),
        size_of::<Meshopt>(),
        size_of::<Draco>() + size_of::<Attributes>(),
        size_of::<Animation>(),
        size_of::<AnimationChannel>(),
        size_of::<AnimationSampler>(),
        size_of::<Texture>(),
        size_of::<Camera>(),
        size_of::<Light>(),
        size_of::<Image>(),
        size_of::<Skin>(),
    ];
    let mut index = 0;
    while index < sizes.len() {
        assert!(sizes[index] <= OBJECT_BYTES_MAX);
        index += 1;
    }
};
