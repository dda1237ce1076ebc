//! Values as people read them.

use std::{path::Path, time::Duration};

/// The name of a file as people write it.
pub fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A length of time as people say it.
pub fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    match seconds {
        ..10.0 => format!("{seconds:.1} s"),
        ..90.0 => format!("{seconds:.0} s"),
        ..5400.0 => format!("{}:{:02} min", time.as_secs() / 60, time.as_secs() % 60),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}
