//! The errors of devices.

/// Why a GPU cannot be had, or did not do its work.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// There is no Vulkan loader, no driver, or no device.
    #[error("no GPU found: there is no Vulkan driver, or no device that it drives")]
    NoAdapter,
    /// Only adapters that compute on the processor; they must be asked for by name.
    #[error("no GPU found, only software adapters, which are used when asked for by name: {}", .0.join(", "))]
    SoftwareOnly(Vec<String>),
    /// No adapter has the name.
    #[error("no adapter is named `{wanted}`; there are: {}", .found.join(", "))]
    UnknownAdapter {
        /// What was asked for.
        wanted: String,
        /// What there is.
        found: Vec<String>,
    },
    /// The adapter gave no device, for instance because its limits are too small.
    #[error("`{adapter}` gives no device")]
    Device {
        /// The adapter.
        adapter: String,
        /// What the driver said.
        source: wgpu::RequestDeviceError,
    },
    /// The scene does not fit.
    #[error("{what} take {bytes} bytes, more than the {limit} that `{adapter}` can bind")]
    TooLarge {
        /// Which buffer.
        what: &'static str,
        /// What it would take.
        bytes: u64,
        /// What there may be.
        limit: u64,
        /// The adapter.
        adapter: String,
    },
    /// The scene has what paths on the GPU have not.
    #[error("not for a GPU: {}", .0.join("; "))]
    Unsupported(Vec<String>),
    /// Coverage by a texture cannot be seen here, so hits would be wrong.
    #[error("material `{0}` is cut out by its alpha, which rays on the GPU do not see")]
    AlphaTested(String),
    /// An index of the scene points nowhere.
    #[error("{0}")]
    Invalid(String),
    /// The device has not the memory for an array of a scene.
    #[error("the device has no memory for {wanted} bytes more")]
    OutOfMemory {
        /// Bytes of the array.
        wanted: u64,
    },
    /// wgpu refused a command: a bug of ours, or the device's memory is full.
    #[error("the device refused a command: {0}")]
    Refused(String),
    /// The device is gone, or was taken away.
    #[error("the device was lost: {0}")]
    Lost(String),
    /// The device did not answer in time.
    #[error("the device did not answer within {0:?}")]
    Timeout(std::time::Duration),
}
