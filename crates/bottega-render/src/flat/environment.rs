//! Flattening of the environment and of the table from which its directions are drawn.

use bottega_scene::EnvironmentMapping;

use super::{EnvironmentRecord, NONE, Record as _, TableRecord, WordBuffer, code, place_of};
use crate::lights::{Bilinear, Cells, EnvironmentLight, EnvironmentRows, EnvironmentTable};

/// Writes the environment without its portals: its table, then its record. Returns the offset of the record.
pub(super) fn write(light: &EnvironmentLight, words: &mut WordBuffer) -> u32 {
    let (kind, table) = match &light.table {
        EnvironmentTable::None => (code::DENSITY_NONE, TableRecord::NONE),
        EnvironmentTable::Uniform => (code::DENSITY_UNIFORM, TableRecord::NONE),
        EnvironmentTable::Bilinear(table) => (code::DENSITY_BILINEAR, write_bilinear(table, words)),
        EnvironmentTable::Cells(table) => (code::DENSITY_CELLS, write_cells(table, words)),
    };
    let EnvironmentRows { scale, offset } = light.rows;
    let place = words.record(&EnvironmentRecord {
        kind,
        is_equal_area: match light.mapping {
            EnvironmentMapping::EqualArea => true,
            EnvironmentMapping::LatitudeLongitude | EnvironmentMapping::LatitudeLongitudeToPoles => false,
        },
        factor: light.factor,
        world_from_environment: light.world_from_environment,
        integral: light.integral,
        picture: NONE,
        table,
        rows_scale: scale,
        rows_offset: offset,
    });
    if let Some(picture) = light.picture {
        words.picture(place + const { place_of(EnvironmentRecord::FIELDS, "picture") }, picture);
    }
    place
}

/// Writes the sums along each row, and the sums of the rows.
fn write_cells(table: &Cells, words: &mut WordBuffer) -> TableRecord {
    let Cells { columns, rows, conditional, marginal } = table;
    let sums = words.place();
    words.numbers(conditional);
    let sums_of_rows = words.place();
    words.numbers(marginal);
    TableRecord { columns: *columns as u32, rows: *rows as u32, values: NONE, sums, marginal: sums_of_rows }
}

/// Writes the values, the sums along each row, and the sums of the rows.
fn write_bilinear(table: &Bilinear, words: &mut WordBuffer) -> TableRecord {
    let Bilinear { columns, rows, values, sums, marginal } = table;
    let place_of_values = words.place();
    words.numbers(values);
    let place_of_sums = words.place();
    words.numbers(sums);
    let place_of_marginal = words.place();
    words.numbers(marginal);
    TableRecord {
        columns: *columns as u32,
        rows: *rows as u32,
        values: place_of_values,
        sums: place_of_sums,
        marginal: place_of_marginal,
    }
}
