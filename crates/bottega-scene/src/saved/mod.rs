//! Bottega's own scene file (`.bottega`): a scene in memory, bit for bit.
//!
//! | bytes | contents |
//! |---|---|
//! | 8 | `89 42 4f 54 54 45 47 41`: 0x89 and `BOTTEGA` |
//! | 4 | version of the format |
//! | 8 | length of the description in bytes |
//! | … | the description: JSON of a [`Description`](description::Description) |
//! | … | blocks of numbers in the order of the description, without gaps |
//!
//! Tables of measured materials are in the description as base64. All numbers are little-endian. A file is read whole or
//! refused: unknown fields and other versions are errors. Equal scenes give equal files, and an unchanged mesh or image gives
//! the same bytes in the next file.

mod blocks;
mod description;
mod motion;
mod read;
mod variation;
mod write;

pub(crate) use self::read::{import, recognizes};
pub use self::write::save_scene;

/// The first bytes of a file.
const MAGIC: [u8; 8] = *b"\x89BOTTEGA";

/// The version that is written and read.
const VERSION: u32 = 3;
