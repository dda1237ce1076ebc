//! The owner of a Windows machine, as its last input shows him.

use std::time::Duration;

/// For how long nobody has touched this machine.
#[allow(unsafe_code, reason = "two calls of the system that no library wraps")]
pub fn idle() -> Option<Duration> {
    use windows_sys::Win32::{
        System::SystemInformation::GetTickCount,
        UI::Input::KeyboardAndMouse::{GetLastInputInfo, LASTINPUTINFO},
    };
    let mut last = LASTINPUTINFO { cbSize: size_of::<LASTINPUTINFO>() as u32, dwTime: 0 };
    // SAFETY: the structure is this function's and says its size.
    let is_told = unsafe { GetLastInputInfo(&raw mut last) } != 0;
    // SAFETY: it has no conditions.
    let now = unsafe { GetTickCount() };
    // Both begin anew every 49 days.
    is_told.then(|| Duration::from_millis(now.wrapping_sub(last.dwTime).into()))
}

/// By the time at which a terminal was read last: not told here; what is typed is seen by [`idle`].
pub fn idle_terminals() -> Option<Duration> {
    None
}
