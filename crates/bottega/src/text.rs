//! Readable text of values.

use std::{path::Path, time::Duration};

/// Returns a path as readable text; parts that are not Unicode are replaced.
pub fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Returns the readable text of a duration, such as `4.2 s` or `1:30 min`.
pub fn duration(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    match seconds {
        ..10.0 => format!("{seconds:.1} s"),
        ..90.0 => format!("{seconds:.0} s"),
        ..5400.0 => format!("{}:{:02} min", time.as_secs() / 60, time.as_secs() % 60),
        _ => format!("{:.1} h", seconds / 3600.0),
    }
}
