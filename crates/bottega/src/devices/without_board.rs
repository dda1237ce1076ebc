//! The replacement for `board.rs` in builds without the feature `board`: there are no boards.

use bottega_hra::Lane;
use bottega_render::{PreparedScene, RenderWork};

use super::board_worth::ConnectedBoard;
use crate::error::Error;

pub(super) fn count_bytes(_: &PreparedScene) {}

pub(super) fn open(address: &str) -> Result<(Lane<RenderWork>, ConnectedBoard), Error> {
    Err(Error::NotBuiltIn { device: address.to_owned(), feature: "board" })
}
