//! Tensor files, version 1.0: named arrays of numbers, as Mitsuba 3 and pbrt-v4 read them.
//!
//! | bytes | contents |
//! |---|---|
//! | 12 | `tensor_file` and a zero byte |
//! | 2 | version: 1, 0 |
//! | 4 | number of fields |
//! | 2 + n | of each field: its name, behind the name's length |
//! | 2 | number of axes |
//! | 1 | kind of numbers: 1 bytes, 10 `f32` |
//! | 8 | place of the first number, in bytes from the begin of the file |
//! | 8 each | length of each axis; the last axis varies fastest |
//!
//! All numbers are little-endian.

use super::error::MeasuredError;

const MAGIC: &[u8; 12] = b"tensor_file\0";
/// The most fields of a file; measured materials have ten.
const FIELDS_MAX: u32 = 1024;
/// The most axes of a field; spectra have five.
const AXES_MAX: u16 = 16;

/// Kind of a field's numbers: bytes.
pub(super) const U8: u8 = 1;
/// Kind of a field's numbers: `f32`.
pub(super) const F32: u8 = 10;

/// The fields of a file.
#[derive(Debug)]
pub(super) struct TensorFile<'a> {
    fields: Vec<TensorField<'a>>,
}

/// A named array of numbers.
#[derive(Clone, Debug)]
pub(super) struct TensorField<'a> {
    name: &'a [u8],
    /// Kind of numbers, as the file says it.
    pub(super) kind: u8,
    /// Length of each axis.
    pub(super) shape: Vec<usize>,
    /// The numbers.
    pub(super) bytes: &'a [u8],
}

impl<'a> TensorFile<'a> {
    /// Reads the list of fields. Numbers stay where they are.
    pub(super) fn read(bytes: &'a [u8]) -> Result<Self, MeasuredError> {
        if !bytes.starts_with(MAGIC) {
            return Err(MeasuredError::NotTensors);
        }
        let mut cursor = TensorCursor { bytes, place: MAGIC.len() };
        let [major, minor] = cursor.array("its version")?;
        if (major, minor) != (1, 0) {
            return Err(MeasuredError::Version { major, minor });
        }
        let place = cursor.place;
        let count = u32::from_le_bytes(cursor.array("the number of its fields")?);
        at_most(count.into(), FIELDS_MAX.into(), "the number of its fields", place)?;
        let fields = (0..count).map(|_| cursor.field()).collect::<Result<_, _>>()?;
        Ok(Self { fields })
    }

    /// Returns a field; `None`: there is none of that name.
    pub(super) fn find(&self, name: &str) -> Option<&TensorField<'a>> {
        self.fields.iter().find(|field| field.name == name.as_bytes())
    }

    /// Returns a field of numbers of one kind and of a number of axes.
    pub(super) fn field(&self, name: &'static str, kind: u8, axes: usize) -> Result<&TensorField<'a>, MeasuredError> {
        let field = self.find(name).ok_or(MeasuredError::Missing { name })?;
        if field.kind != kind {
            let wanted = if kind == U8 { "1 (bytes)" } else { "10 (32-bit floating point)" };
            return Err(MeasuredError::Kind { name, found: field.kind, wanted });
        }
        if field.shape.len() != axes {
            return Err(MeasuredError::Shape {
                name,
                found: field.shape_text(),
                wanted: format!("one of {axes} axes"),
            });
        }
        Ok(field)
    }
}

impl TensorField<'_> {
    /// Returns the numbers of a field of the kind [`F32`]; the error names the first that is not finite.
    pub(super) fn numbers(&self, name: &'static str) -> Result<Vec<f32>, MeasuredError> {
        let (words, _) = self.bytes.as_chunks::<4>();
        let numbers = words.iter().map(|&word| f32::from_le_bytes(word)).enumerate();
        numbers
            .map(
                |(index, value)| {
                    if value.is_finite() { Ok(value) } else { Err(MeasuredError::Value { name, index, value }) }
                },
            )
            .collect()
    }

    /// Returns the lengths of the axes for a message, such as `1 × 8 × 32 × 32`.
    pub(super) fn shape_text(&self) -> String {
        let lengths: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        lengths.join(" × ")
    }
}

/// A place in a file's bytes.
struct TensorCursor<'a> {
    bytes: &'a [u8],
    place: usize,
}

impl<'a> TensorCursor<'a> {
    fn take(&mut self, count: usize, what: &'static str) -> Result<&'a [u8], MeasuredError> {
        let rest = self.bytes.get(self.place..).unwrap_or_default();
        let Some(taken) = rest.get(..count) else { return Err(MeasuredError::End { place: self.bytes.len(), what }) };
        self.place += count;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self, what: &'static str) -> Result<[u8; N], MeasuredError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N, what)?);
        Ok(array)
    }

    /// Reads the description of a field, and finds its numbers.
    fn field(&mut self) -> Result<TensorField<'a>, MeasuredError> {
        let what = "the description of a field";
        let length = u16::from_le_bytes(self.array(what)?);
        let name = self.take(length.into(), what)?;
        let place = self.place;
        let axes = u16::from_le_bytes(self.array(what)?);
        at_most(axes.into(), AXES_MAX.into(), "the number of axes of a field", place)?;
        let [kind] = self.array(what)?;
        let offset = u64::from_le_bytes(self.array(what)?);
        let beyond = || MeasuredError::Beyond { name: String::from_utf8_lossy(name).into_owned() };
        let mut shape = Vec::with_capacity(axes.into());
        for _ in 0..axes {
            let length = u64::from_le_bytes(self.array(what)?);
            shape.push(usize::try_from(length).map_err(|_| beyond())?);
        }
        let size = match kind {
            1 | 2 => 1,
            3 | 4 | 9 => 2,
            5 | 6 | F32 => 4,
            _ => 8,
        };
        let length = shape.iter().try_fold(size, |bytes: usize, &length| bytes.checked_mul(length));
        let range = length.zip(usize::try_from(offset).ok());
        let range = range.and_then(|(length, start)| Some(start..start.checked_add(length)?));
        let bytes = range.and_then(|range| self.bytes.get(range)).ok_or_else(beyond)?;
        Ok(TensorField { name, kind, shape, bytes })
    }
}

fn at_most(found: u64, most: u64, what: &'static str, place: usize) -> Result<(), MeasuredError> {
    if found <= most { Ok(()) } else { Err(MeasuredError::Many { place, what, found, most }) }
}
