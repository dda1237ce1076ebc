//! Errors of boards.

use std::io;

/// An error in connecting to a board, using it, or serving one.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// The text is not an address of a board.
    #[error("`{0}` is not the address of a board: write tcp://HOST:PORT")]
    Address(String),
    /// No connection to the board can be made, or its host is unknown.
    #[error("the board {address} cannot be reached")]
    Unreachable {
        /// The address that was tried.
        address: String,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address to listen at.
        address: String,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The connection broke, or a thread for it cannot be started.
    #[error("the connection broke")]
    Broken(#[from] io::Error),
    /// The board has another build, so that its hits may differ in bits.
    #[error("the board has another build: {theirs}, this is {ours}; install the same on both machines")]
    OtherBuild {
        /// The answer of the board, which names its build.
        theirs: String,
        /// The expected build.
        ours: String,
    },
    /// A frame is invalid: not of this protocol and version, too large, truncated, or with an index out of range.
    #[error("an invalid frame: {0}")]
    Malformed(&'static str),
    /// The board refused a request, or cannot start its threads; with its message.
    #[error("the board refused: {0}")]
    Refused(String),
}
