//! What the tests need beside Rust. Nothing here is needed to render.

use std::{
    path::Path,
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
    let apt = |arguments: &[&str]| {
        Command::new("apt-get")
            .args(arguments)
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdout(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    };
    let installed =
        apt(&["update"]) && apt(&["install", "-y", "--no-install-recommends", "mesa-vulkan-drivers", "libvulkan1"]);
    if !installed {
        println!("could not install it (no apt-get, or not root): the GPU tests will be skipped");
    }
}
