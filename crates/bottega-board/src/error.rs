//! The errors of boards.

use std::io;

/// Why a board cannot be had, or does not answer.
#[derive(Debug, thiserror::Error)]
pub enum BoardError {
    /// It is no address of a board.
    #[error("`{0}` is no address of a board: write tcp://HOST:PORT")]
    Address(String),
    /// Nobody can be reached there, or the connection broke.
    #[error("the board {address} cannot be reached")]
    Unreachable {
        /// The address.
        address: String,
        /// Why.
        source: io::Error,
    },
    /// The address cannot be listened on.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: String,
        /// Why.
        source: io::Error,
    },
    /// The connection broke, or what came is too large.
    #[error("the connection broke")]
    Broken(#[from] io::Error),
    /// It is no board, or one of another build, whose hits would have other bits.
    #[error("the board is of another build: {theirs}, this is {ours}; install the same on both")]
    OtherBuild {
        /// What it says.
        theirs: String,
        /// What it should.
        ours: String,
    },
    /// What came cannot be: too large, cut off, or pointing nowhere.
    #[error("a frame that cannot be: {0}")]
    Malformed(&'static str),
    /// What the board says.
    #[error("the board refused: {0}")]
    Refused(String),
}
