//! The list of adapters, and the choice of one by name.

use std::sync::LazyLock;

use bottega_platform::standard_error::capture;
use wgpu::{Adapter, Backend, Backends, DeviceType, Instance, InstanceDescriptor, InstanceFlags};

use crate::error::GpuError;

/// A device that a driver of this machine offers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// The driver's name for the device; users select a device by a part of it.
    pub name: String,
    /// The driver's name, with its version if the driver reports one.
    pub driver: String,
    /// The graphics API in lower case: `vulkan`, ….
    pub backend: String,
    /// The kind of device.
    pub kind: AdapterKind,
}

/// Kinds of devices, in order of preference: the first is preferred.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU lent by a hypervisor.
    Virtual,
    /// A kind that the driver does not report.
    Other,
    /// A software renderer on the CPU, such as llvmpipe: used only when selected by name.
    Software,
}

impl AdapterInfo {
    fn of(adapter: &Adapter) -> Self {
        let info = adapter.get_info();
        // A software driver behind a layer may report another type than CPU.
        let pretends = ["llvmpipe", "lavapipe", "swiftshader", "softpipe"];
        let name = info.name.to_lowercase();
        let kind = match info.device_type {
            _ if pretends.iter().any(|software| name.contains(software)) => AdapterKind::Software,
            DeviceType::Cpu => AdapterKind::Software,
            DeviceType::DiscreteGpu => AdapterKind::Discrete,
            DeviceType::IntegratedGpu => AdapterKind::Integrated,
            DeviceType::VirtualGpu => AdapterKind::Virtual,
            DeviceType::Other => AdapterKind::Other,
        };
        let driver = format!("{} {}", info.driver, info.driver_info).trim().to_owned();
        Self { name: info.name, driver, backend: info.backend.to_string(), kind }
    }
}

/// Returns all devices of this machine. Empty if there is no driver or no Vulkan loader.
pub fn adapters() -> Vec<AdapterInfo> {
    enumerate().iter().map(AdapterInfo::of).collect()
}

/// Chooses the most preferred device whose name contains `wanted`, ignoring case. `None`: the most preferred one that is not a
/// software adapter.
///
/// # Errors
/// There is no device, none has that name, or there are only software adapters and no name is given.
pub(crate) fn choose(wanted: Option<&str>) -> Result<(Adapter, AdapterInfo), GpuError> {
    let mut found: Vec<_> = enumerate().into_iter().map(|adapter| (AdapterInfo::of(&adapter), adapter)).collect();
    if found.is_empty() {
        return Err(GpuError::NoAdapter);
    }
    let names = |found: &[(AdapterInfo, Adapter)]| found.iter().map(|(info, _)| info.name.clone()).collect();
    found.sort_by_key(|(info, _)| info.kind); // A stable sort keeps the driver's order among equals.
    let meant = |info: &AdapterInfo| match wanted {
        Some(wanted) => info.name.to_lowercase().contains(&wanted.to_lowercase()),
        None => info.kind != AdapterKind::Software,
    };
    match (found.iter().position(|(info, _)| meant(info)), wanted) {
        (Some(index), _) => {
            let (info, adapter) = found.swap_remove(index);
            Ok((adapter, info))
        }
        (None, Some(wanted)) => Err(GpuError::UnknownAdapter { wanted: wanted.to_owned(), found: names(&found) }),
        (None, None) => Err(GpuError::SoftwareOnly(names(&found))),
    }
}

/// The compiled-in backends: Vulkan, also Metal on macOS and Direct3D 12 on Windows.
const BACKENDS: Backends = Backends::VULKAN.union(Backends::METAL).union(Backends::DX12);

/// One instance for the whole program, never dropped. A driver that is unloaded may leave threads behind that end in its code,
/// and may fail to load a second time (both seen with NVIDIA's).
static INSTANCE: LazyLock<Instance> = LazyLock::new(|| {
    Instance::new(InstanceDescriptor {
        backends: BACKENDS,
        // The driver's own validation layers are for debugging it; wgpu validates every command in any case.
        flags: InstanceFlags::empty(),
        ..InstanceDescriptor::new_without_display_handle()
    })
});

/// Lists all devices. A device that several backends offer is listed once, by Vulkan, the tested one. Output of drivers during
/// the listing, such as Mesa's where there is no display, goes to the log.
fn enumerate() -> Vec<Adapter> {
    let (found, said) = capture(|| pollster::block_on(INSTANCE.enumerate_adapters(BACKENDS)));
    said.lines().for_each(|line| tracing::debug!("a driver says: {line}"));
    let (by_vulkan, others): (Vec<_>, Vec<_>) =
        found.into_iter().partition(|adapter| adapter.get_info().backend == Backend::Vulkan);
    let known: Vec<String> = by_vulkan.iter().map(|adapter| adapter.get_info().name).collect();
    let others = others.into_iter().filter(|adapter| !known.contains(&adapter.get_info().name));
    by_vulkan.into_iter().chain(others).collect()
}
