//! Addresses of boards, as requests name them.

/// Checks the address of a board.
///
/// # Errors
/// The problem with the address, as text.
#[cfg(feature = "board")]
pub(crate) fn check(address: &str) -> Result<(), String> {
    bottega_board::BoardAddress::of(address).map(drop).map_err(|error| error.to_string())
}

/// Refuses every address: this build of the library does not support boards.
///
/// # Errors
/// Always.
#[cfg(not(feature = "board"))]
pub(crate) fn check(address: &str) -> Result<(), String> {
    Err(format!(
        "{address}: the library was built without boards; build it with the feature `board` of the crate bottega"
    ))
}
