//! Folders for a user's settings and state.

use std::{env, path::PathBuf};

use etcetera::base_strategy::BaseStrategy;
#[cfg(windows)]
use etcetera::base_strategy::Windows as Usual;
#[cfg(not(windows))]
use etcetera::base_strategy::Xdg as Usual;

/// The name of the subfolder in each of them.
const NAME: &str = "bottega";

/// Returns the folder of settings: `$XDG_CONFIG_HOME/bottega`, or else `~/.config/bottega`, on Windows `%APPDATA%\bottega`;
/// without a home folder `bottega` in the working folder. It may not exist yet.
pub fn config_folder() -> PathBuf {
    folder("XDG_CONFIG_HOME", BaseStrategy::config_dir)
}

/// Returns the folder of state kept between runs: `$XDG_STATE_HOME/bottega`, or else `~/.local/state/bottega`, on Windows
/// `%LOCALAPPDATA%\bottega`; without a home folder `bottega` in the working folder. It may not exist yet.
pub fn state_folder() -> PathBuf {
    folder("XDG_STATE_HOME", |base| base.state_dir().unwrap_or_else(|| base.cache_dir()))
}

/// - `variable`: the environment variable that names the base on every system.
/// - `usual`: the base if it is not set; without a home folder the working folder is used.
fn folder(variable: &str, usual: fn(&Usual) -> PathBuf) -> PathBuf {
    let named = env::var_os(variable).filter(|path| !path.is_empty()).map(PathBuf::from);
    let base = named.or_else(|| Usual::new().ok().map(|base| usual(&base)));
    base.unwrap_or_else(|| PathBuf::from(".")).join(NAME)
}
