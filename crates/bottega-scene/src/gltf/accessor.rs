//! Typed, bounds-checked reading of numbers in buffers: glTF 2.0, section 3.6.
//!
//! All ranges are checked when an [`Accessor`] is made; after that, reading cannot fail. Allocations are limited to
//! what the buffers hold, except for the zeros of an accessor without buffer view, whose number the caller limits.

use super::document::{self, Document};
use super::error::GltfError;

/// The storage of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn new(code: u64) -> Result<Self, GltfError> {
        Ok(match code {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            _ => return Err(GltfError::ComponentType(code)),
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }
}

/// Elements in a buffer; without bytes, all are 0.
#[derive(Clone, Copy, Debug)]
struct Elements<'a> {
    bytes: Option<&'a [u8]>,
    stride: usize,
}

/// The bytes of a document's buffers and buffer views.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bytes<'a> {
    /// A slice for each buffer; empty if it has no bytes of its own.
    pub(super) buffers: &'a [&'a [u8]],
    /// Contents of each compressed buffer view; `None` for others.
    pub(super) decompressed: &'a [Option<Vec<u8>>],
}

/// A validated view of `count` elements of `width` components each.
#[derive(Clone, Debug)]
pub(super) struct Accessor<'a> {
    elements: Elements<'a>,
    /// Number of elements.
    pub(super) count: usize,
    /// Components per element: 1 for SCALAR, 3 for VEC3, 16 for MAT4.
    pub(super) width: usize,
    /// Type of the components in the file.
    pub(super) component: Component,
    /// `true`: integers stand for numbers in [0, 1] or [−1, 1].
    pub(super) normalized: bool,
    sparse: Option<Sparse<'a>>,
}

#[derive(Clone, Debug)]
struct Sparse<'a> {
    /// Indices of replaced elements: strictly increasing, below the accessor's count.
    indices: Vec<u32>,
    values: &'a [u8],
}

/// Maximal number of elements: vertex indices have 32 bits.
const COUNT_MAX: u64 = u32::MAX as u64;

impl<'a> Accessor<'a> {
    /// Resolves an accessor index and checks all ranges.
    ///
    /// - `data`: bytes of the document's buffers.
    pub(super) fn new(document: &Document, data: Bytes<'a>, index: usize) -> Result<Self, GltfError> {
        let description = find("accessor", &document.accessors, index)?;
        Self::of(document, data, description).map_err(|error| GltfError::Accessor { index, error: Box::new(error) })
    }

    /// Makes an accessor of consecutive elements in `bytes`, whose length is a multiple of theirs.
    pub(super) fn packed(bytes: &'a [u8], width: usize, component: Component, normalized: bool) -> Self {
        let stride = width * component.bytes();
        let elements = Elements { bytes: Some(bytes), stride };
        Self { elements, count: bytes.len() / stride.max(1), width, component, normalized, sparse: None }
    }

    fn of(document: &Document, data: Bytes<'a>, description: &document::Accessor) -> Result<Self, GltfError> {
        let component = Component::new(description.component_type)?;
        let width = match description.kind.as_str() {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" | "MAT2" => 4,
            "MAT3" => 9,
            "MAT4" => 16,
            other => return Err(GltfError::AccessorType(other.into())),
        };
        if description.count > COUNT_MAX {
            return Err(GltfError::TooManyElements(description.count));
        }
        let count = description.count as usize;
        let size = width * component.bytes();
        let elements = match description.buffer_view {
            None => Elements { bytes: None, stride: size },
            Some(view) => {
                let (bytes, stride) = view_bytes(document, data, view)?;
                let stride = stride.unwrap_or(size);
                if stride < size {
                    return Err(GltfError::Stride { stride, size });
                }
                let bytes = range(bytes, description.byte_offset, count, stride, size)?;
                Elements { bytes: Some(bytes), stride }
            }
        };
        let sparse = description.sparse.as_ref();
        let sparse = sparse.map(|sparse| read_sparse(document, data, sparse, count, size)).transpose()?;
        let normalized = description.normalized;
        Ok(Self { elements, count, width, component, normalized, sparse })
    }

    /// Returns true if no buffer holds the elements, so their number is not limited by any data.
    pub(super) fn is_unbacked(&self) -> bool {
        self.elements.bytes.is_none()
    }

    /// Reads elements as floats: integers as numbers, or mapped to [0, 1] or [−1, 1] if normalized.
    ///
    /// - `selection`: indices of the elements, in order, each below `count`; `None`: all.
    ///
    /// # Panics
    ///
    /// Unless elements have `N` components.
    pub(super) fn read<const N: usize, T>(&self, selection: Option<&[u32]>, make: impl Fn([f32; N]) -> T) -> Vec<T> {
        assert_eq!(self.width, N, "components of an element");
        let component = |bytes: &[u8], index: usize| float(bytes, index, self.component, self.normalized);
        let element = |bytes: &[u8]| make(std::array::from_fn(|index| component(bytes, index)));
        let mut values: Vec<T> = match (self.elements.bytes, selection) {
            (None, _) => {
                let count = selection.map_or(self.count, <[u32]>::len);
                (0..count).map(|_| make([0.0; N])).collect()
            }
            (Some(bytes), None) => {
                (0..self.count).map(|index| element(&bytes[index * self.elements.stride..])).collect()
            }
            (Some(bytes), Some(selection)) => {
                selection.iter().map(|&index| element(&bytes[index as usize * self.elements.stride..])).collect()
            }
        };
        if let Some(sparse) = &self.sparse {
            let size = N * self.component.bytes();
            let replacement = |position: usize| element(&sparse.values[position * size..]);
            match selection {
                None => {
                    for (position, &index) in sparse.indices.iter().enumerate() {
                        values[index as usize] = replacement(position);
                    }
                }
                Some(selection) => {
                    for (value, index) in values.iter_mut().zip(selection) {
                        if let Ok(position) = sparse.indices.binary_search(index) {
                            *value = replacement(position);
                        }
                    }
                }
            }
        }
        values
    }

    /// Returns the memory of the list of replaced elements, in bytes.
    pub(super) fn sparse_bytes(&self) -> usize {
        self.sparse.as_ref().map_or(0, |sparse| size_of_val(sparse.indices.as_slice()))
    }

    /// Reads one element as [`read`](Self::read) does. Panics unless `index < count` and elements have `N` components.
    pub(super) fn at<const N: usize>(&self, index: usize) -> [f32; N] {
        assert!(index < self.count && self.width == N, "element {index} of {}", self.count);
        let replaced = self.sparse.as_ref().and_then(|sparse| {
            let position = sparse.indices.binary_search(&(index as u32)).ok()?;
            Some(&sparse.values[position * N * self.component.bytes()..])
        });
        let stored = self.elements.bytes.map(|bytes| &bytes[index * self.elements.stride..]);
        replaced.or(stored).map_or([0.0; N], |bytes| {
            std::array::from_fn(|component| float(bytes, component, self.component, self.normalized))
        })
    }

    /// Reads the `index`-th scalar as an unsigned integer; negative and non-integer values become `u32::MAX`. Panics
    /// unless `index < count`.
    pub(super) fn index_at(&self, index: usize) -> u32 {
        assert!(index < self.count, "element {index} of {}", self.count);
        if let Some(sparse) = &self.sparse
            && let Ok(position) = sparse.indices.binary_search(&(index as u32))
        {
            return unsigned(&sparse.values[position * self.component.bytes()..], self.component);
        }
        self.elements.bytes.map_or(0, |bytes| unsigned(&bytes[index * self.elements.stride..], self.component))
    }
}

/// Returns the bytes of a buffer view, and its stride if it has one.
pub(super) fn view_bytes<'a>(
    document: &Document,
    data: Bytes<'a>,
    index: usize,
) -> Result<(&'a [u8], Option<usize>), GltfError> {
    let view = find("buffer view", &document.buffer_views, index)?;
    let stride = view.byte_stride.filter(|&stride| stride > 0);
    // A stride beyond the buffer's length is valid for a single element.
    let stride = stride.map(|stride| usize::try_from(stride).unwrap_or(usize::MAX));
    if let Some(Some(bytes)) = data.decompressed.get(index) {
        return Ok((bytes, stride));
    }
    let buffer = find("buffer", data.buffers, view.buffer)?;
    let end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= buffer.len() as u64);
    let Some(end) = end else {
        let end = view.byte_offset.saturating_add(view.byte_length);
        return Err(GltfError::BufferView { view: index, end, buffer: view.buffer, bytes: buffer.len() });
    };
    Ok((&buffer[view.byte_offset as usize..end as usize], stride))
}

fn read_sparse<'a>(
    document: &Document,
    data: Bytes<'a>,
    sparse: &document::Sparse,
    count: usize,
    size: usize,
) -> Result<Sparse<'a>, GltfError> {
    let component = Component::new(sparse.indices.component_type)?;
    if !matches!(component, Component::U8 | Component::U16 | Component::U32) {
        return Err(GltfError::SparseType);
    }
    if sparse.count > count as u64 {
        return Err(GltfError::SparseCount { sparse: sparse.count, count });
    }
    let sparse_count = sparse.count as usize;
    let (bytes, _) = view_bytes(document, data, sparse.indices.buffer_view)?;
    let bytes = range(bytes, sparse.indices.byte_offset, sparse_count, component.bytes(), component.bytes())?;
    let (values, _) = view_bytes(document, data, sparse.values.buffer_view)?;
    let values = range(values, sparse.values.byte_offset, sparse_count, size, size)?;
    let indices: Vec<u32> =
        (0..sparse_count).map(|index| unsigned(&bytes[index * component.bytes()..], component)).collect();
    if !indices.is_sorted_by(|a, b| a < b) {
        return Err(GltfError::SparseOrder);
    }
    if let Some(&index) = indices.last().filter(|&&last| last as usize >= count) {
        return Err(GltfError::SparseIndex { index, count });
    }
    Ok(Sparse { indices, values })
}

/// Returns the bytes from the first element to the end of the last.
fn range(bytes: &[u8], offset: u64, count: usize, stride: usize, size: usize) -> Result<&[u8], GltfError> {
    let length = match count.checked_sub(1) {
        None => Some(0),
        Some(gaps) => gaps.checked_mul(stride).and_then(|length| length.checked_add(size)),
    };
    let end = length.and_then(|length| usize::try_from(offset).ok()?.checked_add(length));
    end.and_then(|end| bytes.get(offset as usize..end)).ok_or(GltfError::Range {
        count,
        size,
        offset,
        bytes: bytes.len(),
    })
}

/// Resolves an index of the document.
pub(super) fn find<'a, T>(what: &'static str, list: &'a [T], index: usize) -> Result<&'a T, GltfError> {
    list.get(index).ok_or(GltfError::NoSuch { what, index, count: list.len() })
}

#[inline]
fn head<const N: usize>(bytes: &[u8]) -> [u8; N] {
    *bytes.first_chunk().expect("ranges were checked when the accessor was made")
}

/// Reads one component of an element. Normalization: glTF 2.0, section 3.6.2.2.
#[inline]
fn float(bytes: &[u8], index: usize, component: Component, normalized: bool) -> f32 {
    let bytes = &bytes[index * component.bytes()..];
    let scaled = |value: f32, greatest: f32| if normalized { (value / greatest).max(-1.0) } else { value };
    match component {
        Component::I8 => scaled(f32::from(i8::from_le_bytes(head(bytes))), 127.0),
        Component::U8 => scaled(f32::from(bytes[0]), 255.0),
        Component::I16 => scaled(f32::from(i16::from_le_bytes(head(bytes))), 32767.0),
        Component::U16 => scaled(f32::from(u16::from_le_bytes(head(bytes))), 65535.0),
        Component::U32 => scaled(u32::from_le_bytes(head(bytes)) as f32, 4_294_967_295.0),
        Component::F32 => f32::from_le_bytes(head(bytes)),
    }
}

#[inline]
fn unsigned(bytes: &[u8], component: Component) -> u32 {
    match component {
        Component::U8 => u32::from(bytes[0]),
        Component::U16 => u32::from(u16::from_le_bytes(head(bytes))),
        Component::U32 => u32::from_le_bytes(head(bytes)),
        Component::I8 | Component::I16 | Component::F32 => u32::MAX,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(accessor: &str, view: &str) -> Document {
        let json = format!(r#"{{"accessors":[{accessor}],"bufferViews":[{view}]}}"#);
        serde_json::from_str(&json).unwrap()
    }

    fn floats(accessor: &str, view: &str, buffer: &[u8]) -> Result<Vec<[f32; 2]>, GltfError> {
        let document = document(accessor, view);
        let data = Bytes { buffers: &[buffer], decompressed: &[] };
        Accessor::new(&document, data, 0).map(|accessor| accessor.read(None, |v| v))
    }

    const VIEW: &str = r#"{"buffer":0,"byteOffset":1,"byteLength":7,"byteStride":3}"#;

    #[test]
    fn stride_and_offsets_are_followed() {
        let accessor = r#"{"bufferView":0,"byteOffset":1,"componentType":5121,"type":"VEC2","count":2}"#;
        assert_eq!(floats(accessor, VIEW, &[9, 9, 1, 2, 9, 3, 4, 9]), Ok(vec![[1.0, 2.0], [3.0, 4.0]]));
    }

    #[test]
    fn normalized_integers_reach_the_ends_of_their_range() {
        let view = r#"{"buffer":0,"byteLength":4}"#;
        let signed = r#"{"bufferView":0,"componentType":5120,"normalized":true,"type":"VEC2","count":2}"#;
        assert_eq!(floats(signed, view, &[127, 0, 0x80, 0x81]), Ok(vec![[1.0, 0.0], [-1.0, -1.0]]));
        let unsigned = r#"{"bufferView":0,"componentType":5123,"normalized":true,"type":"VEC2","count":1}"#;
        assert_eq!(floats(unsigned, view, &[255, 255, 0, 0]), Ok(vec![[1.0, 0.0]]));
    }

    #[test]
    fn ranges_that_leave_their_buffer_are_errors() {
        for (accessor, view) in [
            (r#""byteOffset":1,"count":3"#, VIEW),
            (r#""byteOffset":18446744073709551615,"count":1"#, VIEW),
            (r#""count":4000000000"#, VIEW),
            (r#""count":18446744073709551615"#, VIEW),
            (r#""count":1"#, r#"{"buffer":0,"byteOffset":6,"byteLength":3}"#),
            (r#""count":1"#, r#"{"buffer":0,"byteOffset":18446744073709551615,"byteLength":3}"#),
            (r#""count":1"#, r#"{"buffer":1,"byteLength":3}"#),
            (r#""count":2"#, r#"{"buffer":0,"byteLength":8,"byteStride":1}"#),
            (r#""count":2"#, r#"{"buffer":0,"byteLength":8,"byteStride":18446744073709551615}"#),
        ] {
            let accessor = format!(r#"{{"bufferView":0,"componentType":5121,"type":"VEC2",{accessor}}}"#);
            assert!(floats(&accessor, view, &[0; 8]).is_err(), "{accessor} {view}");
        }
    }

    #[test]
    fn sparse_values_replace_zeros() {
        let accessor = r#"{"componentType":5121,"type":"VEC2","count":3,"sparse":{"count":1,
            "indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":0,"byteOffset":1}}}"#;
        let view = r#"{"buffer":0,"byteLength":3}"#;
        assert_eq!(floats(accessor, view, &[1, 7, 8]), Ok(vec![[0.0; 2], [7.0, 8.0], [0.0; 2]]));
        assert!(floats(accessor, view, &[3, 7, 8]).is_err());
        let document = document(accessor, view);
        let data = Bytes { buffers: &[&[1, 7, 8]], decompressed: &[] };
        let accessor = Accessor::new(&document, data, 0).unwrap();
        assert_eq!(accessor.read(Some(&[2, 1]), |v: [f32; 2]| v), vec![[0.0; 2], [7.0, 8.0]]);
    }
}
