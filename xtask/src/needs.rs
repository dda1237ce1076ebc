//! The needs of the tests in addition to Rust. Rendering on one machine needs none of them.

use std::{
    env,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use crate::{
    bars::root,
    node,
    python::{self, Requirements},
};

/// Debian packages that some tests need.
struct SystemPackages {
    names: &'static [&'static str],
    /// The tests that need them.
    tests: &'static str,
    are_installed: fn() -> bool,
}

/// The variable that lists NATS servers for the tests, separated as in `PATH`.
const NATS_SERVERS: &str = "BOTTEGA_NATS_SERVERS";

const SYSTEM_PACKAGES: &[SystemPackages] = &[
    SystemPackages {
        names: &["mesa-vulkan-drivers", "libvulkan1"],
        tests: "GPU kernels, on Mesa's software driver",
        are_installed: has_vulkan_driver,
    },
    SystemPackages {
        names: &["libxml2-utils"],
        tests: "XML forms of messages, by xmllint",
        are_installed: || answers("xmllint", &["--version"]),
    },
    SystemPackages {
        names: &["nats-server"],
        tests: "farms, on the distribution's NATS server",
        are_installed: || distribution_server().is_some(),
    },
    SystemPackages { names: &["povray", "povray-includes"], tests: "POV-Ray as an engine", are_installed: has_povray },
    SystemPackages {
        names: &["python3", "python3-venv"],
        tests: "workers of engines",
        are_installed: || answers("python3", &["-c", "import venv, ensurepip"]),
    },
    SystemPackages {
        names: &["nodejs", "npm"],
        tests: "scripts of the page",
        are_installed: || answers("node", &["--version"]) && answers("npm", &["--version"]),
    },
    SystemPackages {
        names: &["dbus-daemon"],
        tests: "notifications on the desktop",
        are_installed: || answers("dbus-daemon", &["--version"]),
    },
    SystemPackages { names: &["chromium"], tests: "the page in a browser", are_installed: has_chromium },
];

/// Installs what the tests lack, after announcing it. Failures are reported, and the tests that need the package are skipped.
///
/// - `large`: also install Cycles and LuxCore.
pub(crate) fn install(large: bool) {
    let lacking: Vec<_> = SYSTEM_PACKAGES.iter().filter(|packages| !(packages.are_installed)()).collect();
    let lists = [python::TESTS, python::LARGE_ENGINES];
    let lacking_lists: Vec<_> =
        lists.into_iter().take(if large { 2 } else { 1 }).filter(|list| !list.are_installed()).collect();
    let lacks_browser_driver = !node::are_installed();
    announce(&lacking, &lacking_lists, lacks_browser_driver);
    if !lacking.is_empty() && !run("apt-get", &["update"]) {
        println!("cannot update the lists of packages (no apt-get, or not root)");
    }
    for packages in lacking {
        let arguments = [&["install", "-y", "--no-install-recommends"], packages.names].concat();
        if !run("apt-get", &arguments) {
            println!("cannot install {}: tests of {} are skipped", packages.names.join(" "), packages.tests);
        } else if packages.names.contains(&"nats-server") && !run("systemctl", &["disable", "--now", "nats-server"]) {
            println!("(the package's own service was not stopped: there is no systemd)");
        }
    }
    for list in lacking_lists {
        if !list.install() {
            println!("cannot install {} into target/python: tests of these are skipped", list.packages().join(" "));
        }
    }
    if lacks_browser_driver && !node::install() {
        println!("cannot install {} into target/node: tests of the page in a browser are skipped", node::PACKAGES);
    }
}

/// Prints what is about to be installed.
fn announce(packages: &[&SystemPackages], lists: &[Requirements], lacks_browser_driver: bool) {
    if packages.is_empty() && lists.is_empty() && !lacks_browser_driver {
        println!("All that the tests need is installed.");
        return;
    }
    println!("The tests need these, which are installed now:");
    for packages in packages {
        println!("  apt-get  {:36} {}", packages.names.join(" "), packages.tests);
    }
    for list in lists {
        println!("  pip      {} (into target/python)", list.packages().join(" "));
    }
    if lacks_browser_driver {
        println!("  npm      {} (into target/node)", node::PACKAGES);
    }
}

/// Returns the variables by which the tests find what is installed. Values set by the caller win.
pub(crate) fn variables() -> Vec<(&'static str, OsString)> {
    [python::engine_variable(), nats_servers(), denoiser(), node::search_path()].into_iter().flatten().collect()
}

fn has_vulkan_driver() -> bool {
    ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"]
        .iter()
        .any(|folder| Path::new(folder).read_dir().is_ok_and(|mut entries| entries.any(|entry| entry.is_ok())))
}

fn has_chromium() -> bool {
    ["chromium", "chromium-browser", "google-chrome"].iter().any(|program| answers(program, &["--version"]))
}

/// Debian has the include files of POV-Ray in a separate package.
fn has_povray() -> bool {
    let lacks_includes = answers("dpkg", &["-s", "povray"]) && !answers("dpkg", &["-s", "povray-includes"]);
    !lacks_includes && answers("povray", &["--version"])
}

/// Returns the newest NATS server on which farms are tested, if there is one.
pub(crate) fn nats_server() -> Option<PathBuf> {
    let servers = env::var_os(NATS_SERVERS).or_else(|| Some(nats_servers()?.1))?;
    env::split_paths(&servers).last().filter(|server| server.is_file())
}

/// Returns the NATS servers on which farms are tested: the distribution's old one and a new one, if installed.
fn nats_servers() -> Option<(&'static str, OsString)> {
    if env::var_os(NATS_SERVERS).is_some() {
        return None;
    }
    let new = Some(python::program("nats-server")).filter(|server| server.is_file());
    let servers: Vec<PathBuf> = [distribution_server(), new].into_iter().flatten().collect();
    Some((NATS_SERVERS, env::join_paths(servers).ok()?))
}

fn distribution_server() -> Option<PathBuf> {
    ["/usr/sbin/nats-server", "/usr/bin/nats-server"].map(PathBuf::from).into_iter().find(|it| it.is_file())
}

/// Returns Open Image Denoise from the wheel `oidn` (1.4).
fn denoiser() -> Option<(&'static str, OsString)> {
    const VARIABLE: &str = "BOTTEGA_OIDN";
    if env::var_os(VARIABLE).is_some() {
        return None;
    }
    // The wheel's libraries lack the names by which they load each other.
    const NAMES: [(&str, &str); 2] =
        [("libOpenImageDenoise.so.1.4.3", "libOpenImageDenoise.so.1"), ("libtbb.so.12.5", "libtbb.so.12")];
    let wheel = python::package("oidn/lib.linux.x64")?;
    let folder = root().join("target/oidn");
    let lib = folder.join("lib");
    fs::create_dir_all(&lib).ok()?;
    let is_named =
        |(from, to): &(&str, &str)| lib.join(to).is_file() || fs::copy(wheel.join(from), lib.join(to)).is_ok();
    NAMES.iter().all(is_named).then(|| (VARIABLE, folder.into_os_string()))
}

/// True if a program can be run successfully.
pub(crate) fn answers(program: &str, arguments: &[&str]) -> bool {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// Runs a program that installs something; its errors are shown.
pub(crate) fn run(program: &str, arguments: &[&str]) -> bool {
    let mut command = Command::new(program);
    command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdin(Stdio::null()).stdout(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
