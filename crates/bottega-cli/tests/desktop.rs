//! `--on done=desktop`, with a bus of its own and a notification service on it.
#![cfg(all(target_os = "linux", feature = "desktop"))]

use std::{
    collections::HashMap,
    io::{BufRead, BufReader},
    path::Path,
    process::{Child, Command, Stdio},
    sync::mpsc,
    thread,
    time::Duration,
};

use crate::support::{bottega, text};
use tokio_stream::StreamExt;
use zbus::{MessageStream, OwnedVariant, block_on, message::Type};

const WAIT: Duration = Duration::from_secs(60);
/// `Notify` of the *Desktop Notifications Specification* 1.2: application, replaced number, icon, title, text, actions, hints, and
/// milliseconds.
type NotifyArguments = (String, u32, String, String, String, Vec<String>, HashMap<String, OwnedVariant>, i32);

/// A bus, which ends when this value is dropped.
struct Bus {
    daemon: Child,
    address: String,
}

impl Bus {
    /// Starts a bus without services; `None`: `dbus-daemon` is not installed.
    fn start() -> Option<Self> {
        let mut command = Command::new("dbus-daemon");
        command.args(["--session", "--nofork", "--nopidfile", "--print-address"]).stdout(Stdio::piped());
        let Ok(mut daemon) = command.spawn() else {
            eprintln!("SKIPPED: there is no dbus-daemon; `cargo xtask test` installs it");
            return None;
        };
        let mut address = String::new();
        let mut said = BufReader::new(daemon.stdout.take().expect("piped"));
        said.read_line(&mut address).expect("its address");
        Some(Self { daemon, address: address.trim().to_owned() })
    }

    /// A notification service: records title and text of each.
    fn desktop(&self) -> mpsc::Receiver<(String, String)> {
        let (sender, shown) = mpsc::channel();
        let address = self.address.clone();
        let (ready, begun) = mpsc::channel();
        thread::spawn(move || {
            block_on(async move {
                let connection = zbus::connection::Builder::address(address.as_str()).build().await?;
                let mut messages = MessageStream::from(&connection);
                connection.request_name("org.freedesktop.Notifications").await?;
                ready.send(()).expect("somebody waits");
                while let Some(message) = messages.next().await {
                    let message = message?;
                    let header = message.header();
                    let is_notify = header.member().is_some_and(|member| member.as_str() == "Notify");
                    if header.message_type() == Type::MethodCall && is_notify {
                        let (_, _, _, title, text, ..): NotifyArguments = message.body().deserialize()?;
                        connection.reply(&header, &1_u32).await?;
                        // The test may be over.
                        _ = sender.send((title, text));
                    }
                }
                Ok::<(), zbus::Error>(())
            })
        });
        begun.recv_timeout(WAIT).expect("it is on the bus");
        shown
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        _ = self.daemon.kill();
        _ = self.daemon.wait();
    }
}

/// Renders a small picture with this bus. Returns the output.
fn paint(folder: &Path, bus: &str) -> String {
    let output = folder.join("p.png");
    let words =
        ["render", "diffuse-box.glb", "-o", text(&output), "--size", "24x18", "--spp", "2", "--on", "done=desktop"];
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenes");
    let mut command = bottega(&words);
    let ran = command.current_dir(scenes).env("DBUS_SESSION_BUS_ADDRESS", bus).output().expect("the program starts");
    let said = String::from_utf8_lossy(&ran.stderr).into_owned();
    assert!(ran.status.success(), "{said}");
    said
}

#[test]
fn the_desktop_shows_that_a_picture_is_done_and_a_missing_desktop_is_reported() {
    let Some(bus) = Bus::start() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let said = paint(folder.path(), &bus.address);
    assert!(said.contains("cannot notify the desktop of `done`"), "nobody shows it yet: {said}");
    let desktop = bus.desktop();
    let said = paint(folder.path(), &bus.address);
    assert!(!said.contains("cannot notify"), "{said}");
    let (title, body) = desktop.recv_timeout(WAIT).expect("it is shown");
    assert!(title.contains("done") && body.contains("p.png"), "{title}: {body}");
}
