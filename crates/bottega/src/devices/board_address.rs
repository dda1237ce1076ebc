//! Addresses of boards, as requests name them.

use thiserror::Error as ThisError;

/// The reason why the address of a board cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, ThisError)]
pub enum BoardAddressError {
    /// The address is not one of a board.
    #[error("{problem}")]
    Invalid {
        /// The problem, with the address.
        problem: String,
    },
    /// This build of the library does not support boards.
    #[error("{address}: the library was built without boards; build it with the feature `board` of the crate bottega")]
    NotBuiltIn {
        /// The address of the requested board.
        address: String,
    },
}

/// Checks the address of a board.
///
/// # Errors
/// The address is not one of a board.
#[cfg(feature = "board")]
pub(crate) fn check(address: &str) -> Result<(), BoardAddressError> {
    let checked = bottega_board::BoardAddress::of(address);
    checked.map(drop).map_err(|error| BoardAddressError::Invalid { problem: error.to_string() })
}

/// Refuses every address: this build of the library does not support boards.
///
/// # Errors
/// Always.
#[cfg(not(feature = "board"))]
pub(crate) fn check(address: &str) -> Result<(), BoardAddressError> {
    Err(BoardAddressError::NotBuiltIn { address: address.to_owned() })
}
