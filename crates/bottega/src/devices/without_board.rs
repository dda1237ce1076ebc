//! In place of `board.rs` where the library is built without the feature `board`: there are no boards.

use bottega_hra::Lane;
use bottega_render::{PreparedScene, RenderWork};

use super::board_worth::ConnectedBoard;
use crate::error::Error;

pub(crate) fn check_address(name: &str) -> Result<(), String> {
    Err(not_built_in(name).to_string())
}

pub(super) fn count_bytes(_: &PreparedScene) {}

pub(super) fn open(address: &str) -> Result<(Lane<RenderWork>, ConnectedBoard), Error> {
    Err(not_built_in(address))
}

fn not_built_in(address: &str) -> Error {
    Error::NotBuiltIn { device: address.to_owned(), feature: "board" }
}
