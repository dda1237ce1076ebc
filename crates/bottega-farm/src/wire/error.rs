//! Why bytes are refused.

use bottega_agents::codec::WIRE_VERSION;
use bottega_image::LayersError;

/// Bytes that are no row, message or tile.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WireError {
    /// There are none.
    #[error("nothing is there")]
    Empty,
    /// They were written by a build with another layout.
    #[error("it is of layout {found}, and this build reads layout {WIRE_VERSION}")]
    Version {
        /// Their layout.
        found: u8,
    },
    /// They are cut off, name a variant that does not exist, or are of another layout.
    #[error("{what} is cut off or has another layout")]
    Layout {
        /// What should have been there.
        what: &'static str,
        /// What is wrong with it.
        source: postcard::Error,
    },
    /// More follows than belongs to it.
    #[error("{count} bytes follow after {what}")]
    Trailing {
        /// What was read.
        what: &'static str,
        /// How many bytes follow.
        count: usize,
    },
    /// A number that cannot be computed with.
    #[error("{what} is {value}, which is not finite")]
    NotFinite {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// A rectangle that ends before it begins.
    #[error("the rectangle from {x0}, {y0} to {x1}, {y1} ends before it begins", x0 = .0[0], y0 = .0[1], x1 = .0[2], y1 = .0[3])]
    Rectangle(
        /// x0, y0, x1, y1.
        [u32; 4],
    ),
    /// A text, in bytes, or a list, in elements, that is longer than any that is written.
    #[error("{what} has a length of {length}, and at most {max} is read")]
    TooLong {
        /// Which.
        what: &'static str,
        /// Its length.
        length: usize,
        /// The greatest length that is read.
        max: usize,
    },
    /// A set of AOVs with one that does not exist.
    #[error("the set of AOVs {bits:#010b} has one that does not exist")]
    Aovs {
        /// The set, one bit an AOV.
        bits: u8,
    },
    /// Layers that no picture can have.
    #[error("the layers of a tile are unsound")]
    Layers(#[from] LayersError),
    /// A tile with more or fewer sums than its pixels have.
    #[error("a tile has {found} bytes of sums, and its pixels need {needed}")]
    Sums {
        /// How many follow.
        found: usize,
        /// How many are needed.
        needed: u64,
    },
}
