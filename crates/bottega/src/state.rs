//! The state folder: what this program has learnt from one run to the next.

use std::{env, path::PathBuf};

/// The folder of what is kept for this user: `$XDG_STATE_HOME/bottega`, or `~/.local/state/bottega`.
pub fn state_folder() -> PathBuf {
    let in_home = |folder: &str| env::home_dir().map(|home| home.join(folder));
    let base = env::var_os("XDG_STATE_HOME").filter(|path| !path.is_empty()).map(PathBuf::from);
    base.or_else(|| in_home(".local/state")).unwrap_or_else(|| PathBuf::from(".")).join("bottega")
}
