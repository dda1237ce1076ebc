//! The total and the free memory of an adapter, from Vulkan, because wgpu does not report them.
//!
//! Unsafe: this calls Vulkan's functions past wgpu. It only queries properties, of a handle that wgpu holds meanwhile.
#![allow(unsafe_code)]

#[cfg(not(target_vendor = "apple"))]
use ash::{ext::memory_budget, vk};
use wgpu::Adapter;

/// The memory of an adapter, in bytes: the largest of its device-local heaps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdapterMemory {
    /// The size of the heap, in bytes.
    pub total: u64,
    /// The bytes that this process can still use without evicting other data; `None`: the driver does not report them.
    pub free: Option<u64>,
}

/// Queries the driver. `None`: the adapter is not a Vulkan adapter.
#[cfg(not(target_vendor = "apple"))]
pub(crate) fn memory_of(adapter: &Adapter) -> Option<AdapterMemory> {
    // SAFETY: the handle is only queried for properties while wgpu holds it; nothing is created or destroyed.
    let hal = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let instance = hal.shared_instance();
    if instance.instance_api_version() < vk::API_VERSION_1_1 {
        return None;
    }
    let has_budget = hal.physical_device_capabilities().supports_extension(memory_budget::NAME);
    let mut budget = vk::PhysicalDeviceMemoryBudgetPropertiesEXT::default();
    let mut properties = vk::PhysicalDeviceMemoryProperties2::default();
    if has_budget {
        properties = properties.push_next(&mut budget);
    }
    // SAFETY: the instance is of version 1.1, which has the function; both structures are complete, and the second is in the
    // chain only if the device supports it.
    unsafe {
        instance.raw_instance().get_physical_device_memory_properties2(hal.raw_physical_device(), &mut properties);
    }
    let heaps = properties.memory_properties;
    let own = (0..heaps.memory_heap_count as usize)
        .filter(|&heap| heaps.memory_heaps[heap].flags.contains(vk::MemoryHeapFlags::DEVICE_LOCAL));
    let heap = own.max_by_key(|&heap| heaps.memory_heaps[heap].size)?;
    let total = heaps.memory_heaps[heap].size;
    let free = budget.heap_budget[heap].saturating_sub(budget.heap_usage[heap]).min(total);
    Some(AdapterMemory { total, free: has_budget.then_some(free) })
}

/// Returns `None`: Metal is not queried.
#[cfg(target_vendor = "apple")]
pub(crate) fn memory_of(_adapter: &Adapter) -> Option<AdapterMemory> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_reports_its_memory() {
        let Ok((adapter, info)) = crate::adapter::choose(Some("")) else {
            eprintln!("skipped: no Vulkan adapter; install a driver, or Mesa's llvmpipe");
            return;
        };
        let memory = memory_of(&adapter).unwrap_or_else(|| panic!("{} does not tell", info.name));
        assert!(memory.total >= 64 << 20, "{memory:?}");
        assert!(memory.free.is_none_or(|free| free > 0 && free <= memory.total), "{memory:?}");
    }
}
