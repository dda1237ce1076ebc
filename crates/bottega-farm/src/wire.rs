//! The wire form of the farm: rows and messages as records in the layout of `postcard`, tiles as a record and raw sums.
//!
//! The types of the farm are not written themselves, but records that mirror them: what is written is a promise to other
//! processes and to journals, and a change of it is seen here. `postcard` sees to the shape of what is read; that lengths
//! are within their limits and numbers can be computed with is checked where a record becomes a value of the farm.
//!
//! A version stands in front of each message, row and tile ([`WIRE_VERSION`](bottega_agents::codec::WIRE_VERSION)),
//! and another at the head of a journal. **Change a record, and both change.**

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
