//! Boards behind cables as resources of the allocator.

use std::time::Duration;

use bottega_board::{BoardAddress, RemoteBoard};
use bottega_hra::{Lane, Window};
use bottega_render::{PreparedScene, RenderWork};

use super::board_worth::ConnectedBoard;
use crate::{error::Error, identity::identity};

/// A board that does not answer for this long is gone.
const PATIENCE: Duration = Duration::from_secs(20);

/// Checks the address of a board.
///
/// # Errors
/// What is wrong with it.
pub(crate) fn check_address(name: &str) -> Result<(), String> {
    BoardAddress::of(name).map(drop).map_err(|error| error.to_string())
}

/// Counts the bytes that boards are sent of a scene.
pub(super) fn count_bytes(scene: &PreparedScene) {
    RemoteBoard::tell_bytes(scene);
}

/// Connects the board of an address.
///
/// # Errors
/// It cannot be reached, or is of another build.
pub(super) fn open(address: &str) -> Result<(Lane<RenderWork>, ConnectedBoard), Error> {
    let board = RemoteBoard::connect(BoardAddress::of(address)?, identity())?;
    let connected =
        ConnectedBoard { name: address.to_owned(), threads: board.threads(), bandwidth: board.link().bandwidth };
    let window = Window { patience: PATIENCE, ..Window::default() };
    Ok((Lane::Windowed(Box::new(board) as _, window), connected))
}
