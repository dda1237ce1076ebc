//! Notifications on the user's desktop.

/// Shows a notification with this title and text on the user's desktop.
///
/// # Errors
/// There is no desktop, it refuses, or the program was built without desktop support: the text contains the reason.
pub fn notify(title: &str, text: &str) -> Result<(), String> {
    show(title, text).map_err(|reason| format!("the desktop shows no notifications: {reason}"))
}

#[cfg(all(feature = "desktop", not(target_os = "macos")))]
fn show(title: &str, text: &str) -> Result<(), String> {
    let shown = notify_rust::Notification::new().appname("Bottega").summary(title).body(text).show();
    shown.map(drop).map_err(|error| error.to_string())
}

/// Shows it by a script of the system, which gets the text as arguments, never as code. **Untested.**
#[cfg(all(feature = "desktop", target_os = "macos"))]
fn show(title: &str, text: &str) -> Result<(), String> {
    const SCRIPT: &str = "on run {title, words}\ndisplay notification words with title title\nend run";
    let mut command = std::process::Command::new("/usr/bin/osascript");
    let output = command.args(["-e", SCRIPT, title, text]).output().map_err(|error| error.to_string())?;
    if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().to_owned()) }
}

#[cfg(not(feature = "desktop"))]
fn show(_title: &str, _text: &str) -> Result<(), String> {
    Err("this program was built without the feature `desktop`".to_owned())
}
