//! EXT_meshopt_compression and KHR_meshopt_compression: compressed buffer views.

mod attributes;
mod filters;
mod indices;

use std::path::Path;

use filters::Filter;
use rayon::prelude::*;

use super::accessor::find;
use super::document::{BufferView, Document, Meshopt};
use super::error::GltfError;
use crate::budget::MemoryBudget;
use crate::error::SceneError;

/// Decompresses every compressed buffer view; `None` for the others.
pub(super) fn decompress(
    document: &Document,
    buffers: &[&[u8]],
    path: &Path,
    budget: &MemoryBudget,
) -> Result<Vec<Option<Vec<u8>>>, SceneError> {
    let decompress = |(index, view): (usize, &BufferView)| {
        let Some((name, compressed)) = view.extensions.meshopt() else { return Ok(None) };
        let place = format!("bufferViews[{index}].extensions.{name}");
        let invalid = |error: GltfError| SceneError::Invalid {
            path: path.into(),
            place: place.clone(),
            problem: error.to_string(),
        };
        let layout = BufferLayout::of(compressed).map_err(invalid)?;
        let data = bytes(compressed, buffers).map_err(invalid)?;
        budget.take(path, &place, layout.count.saturating_mul(layout.stride))?;
        layout.decode(data).map(Some).map_err(|problem| invalid(GltfError::MeshoptData(problem)))
    };
    // Decode all even if one fails, so that the error does not depend on thread timing.
    let decoded: Vec<_> = document.buffer_views.par_iter().enumerate().map(decompress).collect();
    decoded.into_iter().collect()
}

/// Returns the compressed bytes.
fn bytes<'a>(compressed: &Meshopt, buffers: &[&'a [u8]]) -> Result<&'a [u8], GltfError> {
    let buffer = find("buffer", buffers, compressed.buffer)?;
    let end = compressed.byte_offset.checked_add(compressed.byte_length).filter(|&end| end <= buffer.len() as u64);
    let Some(end) = end else {
        let end = compressed.byte_offset.saturating_add(compressed.byte_length);
        return Err(GltfError::MeshoptEnd { end, buffer: compressed.buffer, bytes: buffer.len() });
    };
    Ok(&buffer[compressed.byte_offset as usize..end as usize])
}

enum CompressionMode {
    Attributes(Option<Filter>),
    Triangles,
    Indices,
}

/// The expected layout of the decompressed bytes.
struct BufferLayout {
    mode: CompressionMode,
    count: usize,
    stride: usize,
}

impl BufferLayout {
    fn of(compressed: &Meshopt) -> Result<Self, GltfError> {
        let filter = Filter::of(compressed.filter.as_deref())?;
        let stride = compressed.byte_stride;
        let mode = match compressed.mode.as_str() {
            "ATTRIBUTES" => CompressionMode::Attributes(filter),
            "TRIANGLES" if compressed.count.is_multiple_of(3) => CompressionMode::Triangles,
            "TRIANGLES" => return Err(GltfError::MeshoptTriangles(compressed.count)),
            "INDICES" => CompressionMode::Indices,
            other => return Err(GltfError::MeshoptMode(other.into())),
        };
        let fits = match mode {
            CompressionMode::Attributes(filter) => {
                stride.is_multiple_of(4)
                    && (4..=256).contains(&stride)
                    && filter.is_none_or(|filter| filter.fits(stride as usize))
            }
            CompressionMode::Triangles | CompressionMode::Indices => matches!(stride, 2 | 4) && filter.is_none(),
        };
        if !fits {
            return Err(GltfError::MeshoptStride(stride));
        }
        let count = usize::try_from(compressed.count).map_err(|_| GltfError::MeshoptCount)?;
        Ok(Self { mode, count, stride: stride as usize })
    }

    fn decode(&self, data: &[u8]) -> Result<Vec<u8>, &'static str> {
        let indices = match self.mode {
            CompressionMode::Attributes(filter) => {
                let mut elements = attributes::decode(data, self.count, self.stride)?;
                if let Some(filter) = filter {
                    filter.undo(self.stride, &mut elements);
                }
                return Ok(elements);
            }
            CompressionMode::Triangles => indices::triangles(data, self.count)?,
            CompressionMode::Indices => indices::sequence(data, self.count)?,
        };
        Ok(match self.stride {
            2 => indices.iter().flat_map(|&index| (index as u16).to_le_bytes()).collect(),
            _ => indices.iter().flat_map(|&index| index.to_le_bytes()).collect(),
        })
    }
}
