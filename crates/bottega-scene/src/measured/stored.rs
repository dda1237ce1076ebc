//! Measured materials as serialized values, for `#[serde(with = "crate::measured::stored")]`: tables are the base64 of
//! their `f32`.

use std::borrow::Cow;
use std::sync::Arc;

use base64::prelude::{BASE64_STANDARD, Engine};
use bytemuck::{Pod, Zeroable, cast_slice, cast_slice_mut};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::material::{Measured, MeasuredTables};
use super::warp::SquareTable;
use crate::color::Spectrum;

const _: () =
    assert!(cfg!(target_endian = "little"), "tables are copied as they are in memory, which must be little-endian");

/// A material as it is stored.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MeasuredRecord<'a> {
    name: Cow<'a, str>,
    phi: Cow<'a, [f32]>,
    theta: Cow<'a, [f32]>,
    normals: TableRecord,
    area: TableRecord,
    visible: TableRecord,
    luminance: TableRecord,
    reflection: TableRecord,
    is_relative: bool,
}

/// A table as it is stored: columns and rows, and the numbers of all nodes.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TableRecord {
    size: [usize; 2],
    numbers: String,
}

impl TableRecord {
    fn new<T: Pod>(size: [usize; 2], values: &[T]) -> Self {
        Self { size, numbers: BASE64_STANDARD.encode(cast_slice::<T, u8>(values)) }
    }

    fn values<T: Pod + Zeroable>(&self) -> Result<Vec<T>, String> {
        let bytes = BASE64_STANDARD.decode(&self.numbers).map_err(|error| error.to_string())?;
        let mut values = vec![T::zeroed(); bytes.len() / size_of::<T>()];
        if size_of_val(&*values) != bytes.len() {
            return Err(format!("a table of a measured material has {} bytes", bytes.len()));
        }
        cast_slice_mut(&mut values).copy_from_slice(&bytes);
        Ok(values)
    }
}

/// Serializes a material with its tables.
pub(crate) fn serialize<S: Serializer>(measured: &Arc<Measured>, serializer: S) -> Result<S::Ok, S::Error> {
    let size = measured.luminance.size;
    let record = MeasuredRecord {
        name: Cow::Borrowed(&measured.name),
        phi: Cow::Borrowed(&measured.nodes.phi),
        theta: Cow::Borrowed(&measured.nodes.theta),
        normals: TableRecord::new(measured.normals.size, &measured.normals.values),
        area: TableRecord::new(measured.area.size, &measured.area.values),
        visible: TableRecord::new(measured.visible.size, &measured.visible.densities),
        luminance: TableRecord::new(size, &measured.luminance.densities),
        reflection: TableRecord::new(size, &measured.reflection),
        is_relative: measured.is_relative,
    };
    record.serialize(serializer)
}

/// Reads a material. Its tables are checked.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<Measured>, D::Error> {
    let record = MeasuredRecord::deserialize(deserializer)?;
    let made = tables(record).and_then(|tables| Measured::new(tables).map_err(|error| error.to_string()));
    made.map(Arc::new).map_err(serde::de::Error::custom)
}

fn tables(record: MeasuredRecord<'_>) -> Result<MeasuredTables, String> {
    let table = |record: &TableRecord| Ok::<_, String>(SquareTable { size: record.size, values: record.values()? });
    Ok(MeasuredTables {
        normals: table(&record.normals)?,
        area: table(&record.area)?,
        visible_size: record.visible.size,
        visible: record.visible.values()?,
        size: record.luminance.size,
        luminance: record.luminance.values()?,
        reflection: record.reflection.values::<Spectrum>()?,
        name: record.name.into_owned(),
        phi: record.phi.into_owned(),
        theta: record.theta.into_owned(),
        is_relative: record.is_relative,
    })
}
