//! Errors in bytes from the wire or a journal.

use bottega_agents::codec::WIRE_VERSION;
use bottega_image::LayersError;

/// An error in bytes that should be a row, message or tile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WireError {
    /// There are no bytes.
    #[error("nothing is there")]
    Empty,
    /// The bytes have another version of the layout.
    #[error("it has layout {found}, but this build reads layout {WIRE_VERSION}")]
    Version {
        /// The version found.
        found: u8,
    },
    /// The bytes are cut off, name an unknown variant, or have another layout.
    #[error("{what} is cut off or has another layout")]
    Layout {
        /// The kind of record expected.
        what: &'static str,
        /// The error of `postcard`.
        source: postcard::Error,
    },
    /// More bytes follow the record.
    #[error("{count} bytes follow after {what}")]
    Trailing {
        /// The kind of record.
        what: &'static str,
        /// The number of bytes that follow.
        count: usize,
    },
    /// A number is not finite.
    #[error("{what} is {value}, which is not finite")]
    NotFinite {
        /// The name of the number.
        what: &'static str,
        /// The value that was read.
        value: f64,
    },
    /// A rectangle ends before it begins.
    #[error("the rectangle from {x0}, {y0} to {x1}, {y1} ends before it begins", x0 = .0[0], y0 = .0[1], x1 = .0[2], y1 = .0[3])]
    Rectangle(
        /// The coordinates x0, y0, x1, y1.
        [u32; 4],
    ),
    /// A text, in bytes, or a list, in elements, exceeds its limit.
    #[error("{what} has a length of {length}, and at most {max} is read")]
    TooLong {
        /// The name of the text or list.
        what: &'static str,
        /// The length that was read, in bytes of a text or elements of a list.
        length: usize,
        /// The greatest length that is accepted.
        max: usize,
    },
    /// A set of AOVs contains an unknown one.
    #[error("the set of AOVs {bits:#010b} has one that does not exist")]
    Aovs {
        /// The set, one bit per AOV.
        bits: u32,
    },
    /// The layers are invalid.
    #[error("the layers of a tile are unsound")]
    Layers(#[from] LayersError),
    /// A tile has a wrong number of sums for its pixels.
    #[error("a tile has {found} bytes of sums, and its pixels need {needed}")]
    Sums {
        /// Number of bytes found.
        found: usize,
        /// Number of bytes needed.
        needed: u64,
    },
}
