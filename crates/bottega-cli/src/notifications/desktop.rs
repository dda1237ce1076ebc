//! The desktop of the user, where there is one.

use super::message::Notification;

/// Shows a notification on the desktop.
#[cfg(feature = "desktop")]
pub(super) fn show(notification: &Notification) -> Result<(), String> {
    let shown = notify_rust::Notification::new()
        .appname("Bottega")
        .summary(&notification.title())
        .body(&notification.text())
        .show();
    shown.map(|_| ()).map_err(|error| format!("the desktop shows no notifications: {error}"))
}

/// Says why nothing is shown.
#[cfg(not(feature = "desktop"))]
pub(super) fn show(notification: &Notification) -> Result<(), String> {
    Err(format!(
        "this program was built without the feature `desktop` ({}; {})",
        notification.title(),
        notification.text()
    ))
}
