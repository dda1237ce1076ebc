//! KHR_draco_mesh_compression: primitives with compressed triangles and attributes.

use std::collections::{BTreeMap, BTreeSet};

use draco_core::{DataType, DecodeLimits, DecoderBuffer, MeshDecoder, PointAttribute, PointIndex};
use rayon::prelude::*;

use super::accessor::{Accessor, Component, view_bytes};
use super::document;
use super::error::GltfError;
use super::shape::PrimitiveShape;
use super::source::GltfSource;
use crate::error::SceneError;

/// A decompressed primitive.
pub(super) struct DracoMesh {
    /// Indices into the attributes.
    pub(super) triangles: Vec<[u32; 3]>,
    /// Attributes by their id within the compressed data.
    attributes: BTreeMap<u32, DracoAttribute>,
}

struct DracoAttribute {
    /// All elements, without padding between them.
    bytes: Vec<u8>,
    width: usize,
    component: Component,
}

impl DracoMesh {
    /// Returns an attribute by its id.
    pub(super) fn accessor(&self, number: usize, normalized: bool) -> Result<Accessor<'_>, GltfError> {
        let attribute = u32::try_from(number).ok().and_then(|number| self.attributes.get(&number));
        let attribute = attribute.ok_or(GltfError::DracoAttribute(number))?;
        Ok(Accessor::packed(&attribute.bytes, attribute.width, attribute.component, normalized))
    }
}

/// Decompressed primitives, by their buffer view.
pub(super) type DracoMeshes = BTreeMap<usize, DracoMesh>;

/// Decompresses the primitives of the shapes.
pub(super) fn decompress(source: &GltfSource<'_>, shapes: &[PrimitiveShape]) -> Result<DracoMeshes, SceneError> {
    let mut places: BTreeMap<usize, (String, BTreeSet<u32>)> = BTreeMap::new();
    for shape in shapes {
        let Some(draco) = &shape.primitive(source).extensions.draco else { continue };
        let place = || (shape.place(".extensions.KHR_draco_mesh_compression"), BTreeSet::new());
        places.entry(draco.buffer_view).or_insert_with(place).1.extend(numbers(&draco.attributes));
    }
    // The decoder stops at the remaining memory budget; the result is booked afterwards.
    let left = source.budget.left() as u64;
    let limits = DecodeLimits::default()
        .with_max_decoded_bytes(left)
        .with_max_points(left / size_of::<[f32; 3]>() as u64)
        .with_max_faces(left / size_of::<[u32; 3]>() as u64);
    let decompress = |(view, (place, numbers)): (usize, (String, BTreeSet<u32>))| {
        let bytes = view_bytes(source.document, source.bytes, view);
        let (bytes, _) = bytes.map_err(|problem| source.invalid(&*place, problem))?;
        decode(source, &place, bytes, limits, &numbers).map(|mesh| (view, mesh))
    };
    let decoded: Vec<_> = places.into_par_iter().map(decompress).collect();
    decoded.into_iter().collect()
}

/// Iterates over the ids of the attributes that are used.
fn numbers(attributes: &document::Attributes) -> impl Iterator<Item = u32> {
    let document::Attributes {
        position,
        normal,
        tangent,
        uv0,
        uv1,
        color,
        joints0,
        weights0,
        joints1,
        weights1,
        joints2: _,
    } = attributes;
    let all = [position, normal, tangent, uv0, uv1, color, joints0, weights0, joints1, weights1];
    all.into_iter().flatten().filter_map(|&number| u32::try_from(number).ok())
}

fn decode(
    source: &GltfSource<'_>,
    place: &str,
    bytes: &[u8],
    limits: DecodeLimits,
    numbers: &BTreeSet<u32>,
) -> Result<DracoMesh, SceneError> {
    let mut mesh = draco_core::Mesh::new();
    let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
    let decoded = MeshDecoder::new().decode(&mut buffer, &mut mesh);
    decoded.map_err(|error| source.invalid(place, format!("its data cannot be decompressed ({error})")))?;

    let vertex_count = mesh.num_points();
    let attributes = (0..mesh.num_attributes()).map(|number| mesh.attribute(number));
    let wanted: Vec<&PointAttribute> =
        attributes.filter(|attribute| numbers.contains(&attribute.unique_id())).collect();
    let element_bytes: usize = wanted.iter().map(|attribute| element_bytes(attribute)).sum();
    let memory = vertex_count.saturating_mul(element_bytes);
    source.budget.take(source.path, place, memory.saturating_add(mesh.num_faces() * size_of::<[u32; 3]>()))?;
    let attributes = wanted.into_iter().filter_map(|attribute| {
        let component = component(attribute.data_type())?;
        let bytes = unfold(attribute, vertex_count);
        Some((
            attribute.unique_id(),
            DracoAttribute { bytes, width: usize::from(attribute.num_components()), component },
        ))
    });
    let attributes = attributes.collect();
    let triangles = mesh.faces().iter().map(|face| face.map(|point| point.0)).collect();
    Ok(DracoMesh { triangles, attributes })
}

fn element_bytes(attribute: &PointAttribute) -> usize {
    usize::from(attribute.num_components()) * attribute.data_type().byte_length()
}

/// Expands an attribute to one element per vertex; zeros where the data has none.
fn unfold(attribute: &PointAttribute, vertex_count: usize) -> Vec<u8> {
    let size = element_bytes(attribute);
    let stride = usize::try_from(attribute.byte_stride()).unwrap_or(size);
    let data = attribute.buffer().data();
    let mut bytes = vec![0; vertex_count * size];
    for (vertex, element) in bytes.chunks_exact_mut(size.max(1)).enumerate() {
        let value = attribute.mapped_index(PointIndex(vertex as u32)).0 as usize;
        if let Some(stored) = value.checked_mul(stride).and_then(|at| data.get(at..at.checked_add(size)?)) {
            element.copy_from_slice(stored);
        }
    }
    bytes
}

fn component(data_type: DataType) -> Option<Component> {
    Some(match data_type {
        DataType::Int8 => Component::I8,
        DataType::Uint8 => Component::U8,
        DataType::Int16 => Component::I16,
        DataType::Uint16 => Component::U16,
        DataType::Uint32 => Component::U32,
        DataType::Float32 => Component::F32,
        _ => return None,
    })
}
