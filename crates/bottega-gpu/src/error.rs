//! Errors of the GPU backend.

/// An error in opening or using a GPU.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// There is no Vulkan loader, no driver, or no device.
    #[error("no GPU found: there is no Vulkan driver, or no device that it drives")]
    NoAdapter,
    /// Only software adapters were found; those must be selected by name.
    #[error("no GPU found, only software adapters, which are used only when named: {}", .0.join(", "))]
    SoftwareOnly(Vec<String>),
    /// No adapter has the name.
    #[error("no adapter is named `{wanted}`; there are: {}", .found.join(", "))]
    UnknownAdapter {
        /// The name that was requested.
        wanted: String,
        /// The names of the adapters found.
        found: Vec<String>,
    },
    /// The driver refused to open a device, for instance because its limits are too small.
    #[error("`{adapter}` cannot be opened")]
    Device {
        /// The adapter's name.
        adapter: String,
        /// The driver's error.
        source: wgpu::RequestDeviceError,
    },
    /// An array of the scene is larger than the device can bind.
    #[error("{what} take {bytes} bytes, more than the {limit} that `{adapter}` can bind")]
    TooLarge {
        /// The name of the buffer.
        what: &'static str,
        /// The size required, in bytes.
        bytes: u64,
        /// The largest size allowed, in bytes.
        limit: u64,
        /// The adapter's name.
        adapter: String,
    },
    /// The scene uses features that the GPU does not support.
    #[error("not for a GPU: {}", .0.join("; "))]
    Unsupported(Vec<String>),
    /// A material is not opaque, or a mesh consists of curves: rays on the GPU do not evaluate alpha, so hits would be wrong.
    /// With the name of the material or mesh.
    #[error("material `{0}` is cut out by its alpha, which rays on the GPU do not support")]
    AlphaTested(String),
    /// An index of the scene is out of range.
    #[error("{0}")]
    Invalid(String),
    /// The device has no memory left for an array of a scene.
    #[error("the device has no memory for {wanted} bytes more")]
    OutOfMemory {
        /// The size of the array, in bytes; 0: unknown.
        wanted: u64,
    },
    /// wgpu refused a command: because of a bug in this crate, or because the device's memory is full.
    #[error("the device refused a command: {0}")]
    Refused(String),
    /// The device was lost or removed.
    #[error("the device was lost: {0}")]
    Lost(String),
    /// The device did not answer in time.
    #[error("the device did not answer within {0:?}")]
    Timeout(std::time::Duration),
}
