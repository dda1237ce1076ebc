//! The wire format of the farm: rows and messages as `postcard` records, tiles as a record and raw sums.
//!
//! The farm's types are not serialized themselves, but through records that mirror them: the format is a promise to
//! other processes and to journals, and this way its changes are visible. `postcard` checks the structure of the input;
//! limits of lengths and validity of numbers are checked where a record is converted to a type of the farm.
//!
//! A version precedes each message, row and tile ([`WIRE_VERSION`](bottega_agents::codec::WIRE_VERSION)), and another
//! each journal. **If you change a record, change both.**

mod codec;
mod error;
mod layout;
mod message;
mod row;
mod tile;
mod values;

#[cfg(test)]
mod tests;

pub use self::{codec::FarmCodec, error::WireError, tile::digest};
pub(crate) use self::{
    row::{put_work, put_zone, read_work, take_zone},
    tile::{put_tile, read_tile},
};
