//! The resource: blocks of pixels of scenes, painted by a GPU.

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

/// An adapter that may be opened, and what it says of itself.
#[derive(Clone, Debug)]
pub struct GpuAdapter {
    adapter: Adapter,
    info: AdapterInfo,
}

impl GpuAdapter {
    /// The adapter whose name contains `wanted`; `None`: the best GPU, never a software adapter.
    ///
    /// # Errors
    /// There is none such.
    pub fn choose(wanted: Option<&str>) -> Result<Self, GpuError> {
        let (adapter, info) = choose(wanted)?;
        Ok(Self { adapter, info })
    }

    /// What it is.
    pub fn info(&self) -> &AdapterInfo {
        &self.info
    }

    /// How much memory it has, and has free just now; `None`: the driver does not tell.
    pub fn memory(&self) -> Option<AdapterMemory> {
        memory_of(&self.adapter)
    }

    /// Puts a scene down as the device is to be sent it.
    ///
    /// # Errors
    /// The scene is none for it: [`GpuError::Unsupported`] names what it has not.
    pub fn encode(&self, scene: &Arc<PreparedScene>) -> Result<EncodedScene, GpuError> {
        let flat = PathScene::new(scene, binding_limit(&self.adapter), &self.info.name)?;
        Ok(EncodedScene { flat: Arc::new(flat), scene: Arc::clone(scene) })
    }
}

/// Paths of scenes on a GPU; rays alone as well, where somebody asks for these.
///
/// What it paints is the processor's picture but for rounding: the same samples of the same pixels take the same numbers, so
/// most paths are the same to some 10⁻⁵, and where one takes another way (a ray that grazes an edge) the means are the same.
/// Paths are not guided. A scene is sent with the first work on it, or with the pixel that its kernels are tried on, and stays until the
/// allocator throws it out. Dropped, it waits for what is under way, unless that is compiling; what is queued behind that and was given
/// up is not begun.
pub struct GpuPaths {
    adapter: GpuAdapter,
    memory_bytes: Option<u64>,
    scenes: GpuScenes,
    worker: Option<JoinHandle<()>>,
}

/// Tells a device of the scenes that it may be asked to paint; may outlive it.
#[derive(Clone)]
pub struct GpuScenes {
    shelf: Arc<SceneShelf>,
    messages: Sender<Message>,
}

impl GpuScenes {
    /// From now on the device paints this scene, too. Its kernels are compiled now, and have painted a pixel when this returns, so that
    /// no work waits for that.
    ///
    /// # Errors
    /// The kernels cannot be compiled, or the device is gone.
    pub fn admit(&self, encoded: &EncodedScene) -> Result<(), GpuError> {
        let gone = || GpuError::Lost("its thread ended".to_owned());
        let (tell, answer) = channel();
        self.compile(encoded, Some(tell))?;
        answer.recv().map_err(|_| gone())?
    }

    /// The same without waiting: until the kernels are compiled the device gives all work back, as one that is
    /// [not ready](bottega_hra::Reply::not_ready).
    ///
    /// # Errors
    /// The device is gone.
    pub fn admit_later(&self, encoded: &EncodedScene) -> Result<(), GpuError> {
        self.compile(encoded, None)
    }

    fn compile(&self, encoded: &EncodedScene, tell: Option<Sender<Result<(), GpuError>>>) -> Result<(), GpuError> {
        self.shelf.put(encoded);
        self.shelf.begin_compiling();
        let message = Message::Compile(encoded.clone(), tell);
        self.messages.send(message).map_err(|_| GpuError::Lost("its thread ended".to_owned()))
    }

    /// Bytes of scenes that were sent to the device so far.
    pub fn sent_bytes(&self) -> u64 {
        self.shelf.sent_bytes()
    }

    /// Bytes of scenes that are on the device; what two of them share counts once.
    pub fn resident_bytes(&self) -> u64 {
        self.shelf.resident_bytes()
    }
}

impl GpuPaths {
    /// Opens a GPU and tells it of a scene.
    ///
    /// # Errors
    /// There is no such adapter, or the scene is none for it: [`GpuError::Unsupported`] names what it has not.
    pub fn new(scene: &Arc<PreparedScene>, options: &PathOptions) -> Result<Self, GpuError> {
        let adapter = GpuAdapter::choose(options.adapter.as_deref())?;
        let encoded = adapter.encode(scene)?;
        let paths = Self::open(adapter, options)?;
        paths.scenes.admit(&encoded)?;
        Ok(paths)
    }

    /// Opens a GPU that knows of no scene yet.
    ///
    /// # Errors
    /// It cannot be had.
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

    /// The adapter that was chosen.
    pub fn adapter(&self) -> &AdapterInfo {
        &self.adapter.info
    }

    /// Tells it of scenes, also after it was given to an allocator.
    pub fn scenes(&self) -> GpuScenes {
        self.scenes.clone()
    }

    /// Why it does not paint a block; `None`: it does.
    pub fn refuses(&self, block: &BlockWork) -> Option<String> {
        refusal(block)
    }
}

/// What is left to scenes of a device's memory, with so many paths under way.
fn for_scenes(memory: AdapterMemory, paths: u64) -> u64 {
    /// What a path takes, its sums and all, with room to spare.
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
        // Of the usual bus of each kind; what a unit costs is learnt anyway.
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
        // A worker that is gone drops the reply, which says that the packet is lost.
        let _ = self.scenes.messages.send(Message::Paint(packet.works, packet.reply));
    }

    fn recover(&mut self) -> Result<(), String> {
        let gone = || "the device's thread ended".to_owned();
        let (tell, answer) = channel();
        self.scenes.messages.send(Message::Recover(tell)).map_err(|_| gone())?;
        answer.recv().map_err(|_| gone())?
    }

    fn evict(&mut self, data: DataId) {
        // A worker that is gone has nothing.
        let _ = self.scenes.messages.send(Message::Evict(data));
    }

    fn memory_free(&self) -> Option<u64> {
        self.adapter.memory()?.free
    }
}

impl Drop for GpuPaths {
    fn drop(&mut self) {
        let _ = self.scenes.messages.send(Message::End);
        // A driver that compiles cannot be called back; its thread ends after that.
        let worker = self.worker.take().filter(|_| !self.scenes.shelf.is_compiling());
        if let Some(worker) = worker {
            let _ = worker.join();
        }
    }
}
