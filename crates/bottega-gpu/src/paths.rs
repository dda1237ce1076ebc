//! The resource that renders blocks of pixels of scenes on a GPU.

mod batch;
mod kernels;
mod limits;
mod options;
mod resident;
mod scene;
mod shelf;
mod tracer;
mod worker;

#[cfg(test)]
mod tests;

use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use bottega_hra::{DataId, Link, Packet, Primitive, PrimitiveSet, ResourceDescriptor, WindowedResource};
use bottega_render::{BlockWork, PreparedScene, RenderWork};
use wgpu::Adapter;

use crate::adapter::{AdapterInfo, AdapterKind, choose};
use crate::context::binding_limit;
use crate::error::GpuError;
use crate::memory::{AdapterMemory, memory_of};
use limits::refusal;
pub use options::PathOptions;
use scene::PathScene;
pub use shelf::EncodedScene;
use shelf::SceneShelf;
use tracer::Tracer;
use worker::{Message, PathWorker};

/// An adapter that can be opened, and its description.
#[derive(Clone, Debug)]
pub struct GpuAdapter {
    adapter: Adapter,
    info: AdapterInfo,
}

impl GpuAdapter {
    /// Chooses the most preferred adapter whose name contains `wanted`, ignoring case. `None`: the best GPU, never a software
    /// adapter.
    ///
    /// # Errors
    /// There is no adapter, none has that name, or there are only software adapters and no name is given.
    pub fn choose(wanted: Option<&str>) -> Result<Self, GpuError> {
        let (adapter, info) = choose(wanted)?;
        Ok(Self { adapter, info })
    }

    /// Returns the adapter's description.
    pub fn info(&self) -> &AdapterInfo {
        &self.info
    }

    /// Returns the adapter's total and free memory; `None`: the driver does not report it.
    pub fn memory(&self) -> Option<AdapterMemory> {
        memory_of(&self.adapter)
    }

    /// Converts a scene to the layout of the device.
    ///
    /// # Errors
    /// The device does not support the scene: [`GpuError::Unsupported`] names the missing features; or an array of the scene is
    /// larger than the device can bind, or an index is out of range.
    pub fn encode(&self, scene: &Arc<PreparedScene>) -> Result<EncodedScene, GpuError> {
        let flat = PathScene::new(scene, binding_limit(&self.adapter), &self.info.name)?;
        Ok(EncodedScene { flat: Arc::new(flat), scene: Arc::clone(scene) })
    }
}

/// Path tracing of scenes on a GPU.
///
/// The image equals the CPU's except for rounding: the same samples of the same pixels use the same random numbers, so most paths
/// agree to about 10⁻⁵; where a path diverges (a ray that grazes an edge) the means are equal. Paths are not guided. A scene is
/// uploaded with the first work on it, or with the test pixel of its kernels, and stays until the allocator evicts it. Dropping
/// this waits for the batch under way, unless the device is compiling; canceled work in the queue is not started.
pub struct GpuPaths {
    adapter: GpuAdapter,
    memory_bytes: Option<u64>,
    scenes: GpuScenes,
    worker: Option<JoinHandle<()>>,
}

/// A handle that adds scenes to a device; may outlive the device.
#[derive(Clone)]
pub struct GpuScenes {
    shelf: Arc<SceneShelf>,
    messages: Sender<Message>,
}

impl GpuScenes {
    /// Adds a scene to those that the device can render. Unless that is done, compiles the kernels that it needs and renders one
    /// test pixel before it returns, so that no work waits for the compiler.
    ///
    /// # Errors
    /// The kernels cannot be compiled or run, the device is lost and cannot be opened again, or its thread has ended.
    pub fn admit(&self, encoded: &EncodedScene) -> Result<(), GpuError> {
        let gone = || GpuError::Lost("its thread ended".to_owned());
        let (tell, answer) = channel();
        self.compile(encoded, Some(tell))?;
        answer.recv().map_err(|_| gone())?
    }

    /// Adds a scene as [`GpuScenes::admit`] does, without waiting. Until the kernels are compiled the device returns all work as
    /// [not ready](bottega_hra::Reply::not_ready). An error of the compiler goes to the log.
    ///
    /// # Errors
    /// The thread of the device has ended.
    pub fn admit_later(&self, encoded: &EncodedScene) -> Result<(), GpuError> {
        self.compile(encoded, None)
    }

    fn compile(&self, encoded: &EncodedScene, tell: Option<Sender<Result<(), GpuError>>>) -> Result<(), GpuError> {
        self.shelf.put(encoded);
        self.shelf.begin_compiling();
        let message = Message::Compile(encoded.clone(), tell);
        self.messages.send(message).map_err(|_| GpuError::Lost("its thread ended".to_owned()))
    }

    /// Returns the number of bytes of scenes uploaded to the device so far.
    pub fn sent_bytes(&self) -> u64 {
        self.shelf.sent_bytes()
    }

    /// Returns the size of the scenes on the device, in bytes; data that two scenes share counts once.
    pub fn resident_bytes(&self) -> u64 {
        self.shelf.resident_bytes()
    }
}

impl GpuPaths {
    /// Opens a GPU and adds a scene to it.
    ///
    /// # Errors
    /// Those of [`GpuAdapter::choose`], [`GpuAdapter::encode`], [`GpuPaths::open`] and [`GpuScenes::admit`].
    pub fn new(scene: &Arc<PreparedScene>, options: &PathOptions) -> Result<Self, GpuError> {
        let adapter = GpuAdapter::choose(options.adapter.as_deref())?;
        let encoded = adapter.encode(scene)?;
        let paths = Self::open(adapter, options)?;
        paths.scenes.admit(&encoded)?;
        Ok(paths)
    }

    /// Opens a GPU without a scene.
    ///
    /// # Errors
    /// The device or its thread cannot be started.
    pub fn open(adapter: GpuAdapter, options: &PathOptions) -> Result<Self, GpuError> {
        let paths = if options.paths == 0 { usual_paths(adapter.info.kind) } else { options.paths };
        let memory_bytes = options.memory.or_else(|| adapter.memory().map(|memory| for_scenes(memory, paths)));
        let make = {
            let (adapter, options) = (adapter.clone(), PathOptions { paths, ..options.clone() });
            move || Tracer::new(&adapter.adapter, &adapter.info, &options)
        };
        let shelf = Arc::new(SceneShelf::default());
        let worker = PathWorker::new(Arc::clone(&shelf), adapter.info.name.clone(), Box::new(make))?;
        let (messages, inbox) = channel();
        let name = format!("gpu {}", adapter.info.name.replace('\0', " "));
        let spawned = thread::Builder::new().name(name).spawn(move || worker.run(&inbox));
        let worker = Some(spawned.map_err(|error| GpuError::Lost(error.to_string()))?);
        Ok(Self { adapter, memory_bytes, scenes: GpuScenes { shelf, messages }, worker })
    }

    /// Returns the description of the chosen adapter.
    pub fn adapter(&self) -> &AdapterInfo {
        &self.adapter.info
    }

    /// Returns a handle that adds scenes, also after the resource was given to an allocator.
    pub fn scenes(&self) -> GpuScenes {
        self.scenes.clone()
    }

    /// Returns the reason why the device does not render a block, as a clause; `None`: it does, if the scene was added to it.
    pub fn refuses(&self, block: &BlockWork) -> Option<String> {
        refusal(block)
    }
}

/// Returns the bytes of the device's memory that are left for scenes with this many paths under way.
fn for_scenes(memory: AdapterMemory, paths: u64) -> u64 {
    /// Upper bound of the memory per path with its share of the sums, in bytes.
    const PATH_BYTES: u64 = 512;
    let free = memory.free.unwrap_or(memory.total);
    (free - free / 10).saturating_sub(paths * PATH_BYTES)
}

fn usual_paths(kind: AdapterKind) -> u64 {
    match kind {
        AdapterKind::Discrete | AdapterKind::Virtual | AdapterKind::Other => 1 << 20,
        AdapterKind::Integrated => 1 << 18,
        AdapterKind::Software => 1 << 15,
    }
}

impl WindowedResource<RenderWork> for GpuPaths {
    fn descriptor(&self) -> ResourceDescriptor {
        // Typical values of the bus of each kind; the allocator learns the actual cost per unit.
        let (latency_us, bandwidth) = match self.adapter.info.kind {
            AdapterKind::Discrete | AdapterKind::Virtual | AdapterKind::Other => (50, 12e9),
            AdapterKind::Integrated | AdapterKind::Software => (20, 20e9),
        };
        ResourceDescriptor {
            name: self.adapter.info.name.clone(),
            primitives: PrimitiveSet::from([Primitive::Intersect, Primitive::Occluded, Primitive::PixelBlock]),
            memory_bytes: self.memory_bytes,
            link: Link { latency: Duration::from_micros(latency_us), bandwidth },
        }
    }

    fn send(&mut self, packet: Packet<RenderWork>) {
        if self.scenes.shelf.is_compiling() {
            return packet.reply.not_ready(packet.works);
        }
        // If the worker has ended, the reply is dropped, which reports the packet as lost.
        let _ = self.scenes.messages.send(Message::Paint(packet.works, packet.reply));
    }

    fn recover(&mut self) -> Result<(), String> {
        let gone = || "the device's thread ended".to_owned();
        let (tell, answer) = channel();
        self.scenes.messages.send(Message::Recover(tell)).map_err(|_| gone())?;
        answer.recv().map_err(|_| gone())?
    }

    fn evict(&mut self, data: DataId) {
        // A worker that has ended has no scenes.
        let _ = self.scenes.messages.send(Message::Evict(data));
    }

    fn memory_free(&self) -> Option<u64> {
        self.adapter.memory()?.free
    }
}

impl Drop for GpuPaths {
    fn drop(&mut self) {
        let _ = self.scenes.messages.send(Message::End);
        // A driver that is compiling cannot be interrupted; its thread ends when it is done.
        let worker = self.worker.take().filter(|_| !self.scenes.shelf.is_compiling());
        if let Some(worker) = worker {
            let _ = worker.join();
        }
    }
}
