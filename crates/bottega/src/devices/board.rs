//! Boards behind cables as resources of the allocator.

use std::time::Duration;

use bottega_board::{BoardAddress, RemoteBoard};
use bottega_hra::{Lane, Window};
use bottega_render::{PreparedScene, RenderWork};

use super::board_worth::ConnectedBoard;
use crate::{error::Error, identity::identity};

/// Time without an answer after which a board counts as lost.
const PATIENCE: Duration = Duration::from_secs(20);

/// Registers a scene so that the bytes of it sent to boards are counted.
pub(super) fn count_bytes(scene: &PreparedScene) {
    RemoteBoard::tell_bytes(scene);
}

/// Connects the board at an address.
///
/// # Errors
/// The board cannot be reached, or runs another build.
pub(super) fn open(address: &str) -> Result<(Lane<RenderWork>, ConnectedBoard), Error> {
    let board = RemoteBoard::connect(BoardAddress::of(address)?, identity())?;
    let connected =
        ConnectedBoard { name: address.to_owned(), threads: board.threads(), bandwidth: board.link().bandwidth };
    let window = Window { patience: PATIENCE, ..Window::default() };
    Ok((Lane::Windowed(Box::new(board) as _, window), connected))
}
