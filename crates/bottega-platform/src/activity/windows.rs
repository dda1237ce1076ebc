//! The activity of a Windows machine's owner by the last input.

use std::time::Duration;

/// Returns the time since the owner's last input; `None`: unknown.
#[allow(unsafe_code, reason = "two calls of the system that no library wraps")]
pub fn idle() -> Option<Duration> {
    use windows_sys::Win32::{
        System::SystemInformation::GetTickCount,
        UI::Input::KeyboardAndMouse::{GetLastInputInfo, LASTINPUTINFO},
    };
    let mut last = LASTINPUTINFO { cbSize: size_of::<LASTINPUTINFO>() as u32, dwTime: 0 };
    // SAFETY: the structure is local and contains its size.
    let is_known = unsafe { GetLastInputInfo(&raw mut last) } != 0;
    // SAFETY: the function has no preconditions.
    let now = unsafe { GetTickCount() };
    // Both counters wrap every 49 days.
    is_known.then(|| Duration::from_millis(now.wrapping_sub(last.dwTime).into()))
}

/// Returns `None`: not available here; [`idle`] includes typing in terminals.
pub fn idle_terminals() -> Option<Duration> {
    None
}
