//! The resource: blocks of pixels of a scene, painted by a GPU.

mod batch;
mod kernels;
mod limits;
mod options;
mod scene;
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

use crate::adapter::{AdapterInfo, AdapterKind, choose};
use crate::context::binding_limit;
use crate::error::GpuError;
use limits::refusal;
pub use options::PathOptions;
use scene::PathScene;
use tracer::Tracer;
use worker::{Message, Worker};

/// Paths of a scene on a GPU; rays alone as well, where somebody asks for these.
///
/// What it paints is the processor's picture but for rounding: the same samples of the same pixels take the same numbers, so
/// most paths are the same to some 10⁻⁵, and where one takes another way (a ray that grazes an edge) the means are the same.
/// Paths are not guided. Dropped, it waits for what is under way; what is queued behind that and was given up is not begun.
pub struct GpuPaths {
    info: AdapterInfo,
    memory_bytes: u64,
    data: DataId,
    messages: Option<Sender<Message>>,
    worker: Option<JoinHandle<()>>,
}

impl GpuPaths {
    /// Puts a scene on a GPU.
    ///
    /// # Errors
    /// There is no such adapter, or the scene is none for it: [`GpuError::Unsupported`] names what it has not.
    pub fn new(scene: &Arc<PreparedScene>, options: &PathOptions) -> Result<Self, GpuError> {
        let (adapter, info) = choose(options.adapter.as_deref())?;
        let flat = PathScene::new(scene, binding_limit(&adapter), &info.name)?;
        let memory_bytes = flat.memory_bytes();
        let paths = if options.paths == 0 { usual_paths(info.kind) } else { options.paths };
        let make = {
            let (info, options) = (info.clone(), PathOptions { paths, ..options.clone() });
            move || Tracer::new(&adapter, &info, &flat, &options)
        };
        let worker = Worker::new(Arc::clone(scene), Box::new(make))?;
        let (messages, inbox) = channel();
        let name = format!("gpu {}", info.name.replace('\0', " "));
        let spawned = thread::Builder::new().name(name).spawn(move || worker.run(&inbox));
        let worker = spawned.map_err(|error| GpuError::Lost(error.to_string()))?;
        Ok(Self { info, memory_bytes, data: scene.data_id(), messages: Some(messages), worker: Some(worker) })
    }

    /// The adapter that was chosen.
    pub fn adapter(&self) -> &AdapterInfo {
        &self.info
    }

    /// Bytes of the scene on the device.
    pub fn memory_bytes(&self) -> u64 {
        self.memory_bytes
    }

    /// Why it does not paint a block; `None`: it does.
    pub fn refuses(&self, block: &BlockWork) -> Option<String> {
        refusal(self.data, block)
    }
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
        let (latency_us, bandwidth) = match self.info.kind {
            AdapterKind::Discrete | AdapterKind::Virtual | AdapterKind::Other => (50, 12e9),
            AdapterKind::Integrated | AdapterKind::Software => (20, 20e9),
        };
        ResourceDescriptor {
            name: self.info.name.clone(),
            primitives: PrimitiveSet::from([Primitive::Intersect, Primitive::Occluded, Primitive::PixelBlock]),
            memory_bytes: None,
            link: Link { latency: Duration::from_micros(latency_us), bandwidth },
        }
    }

    fn send(&mut self, packet: Packet<RenderWork>) {
        if let Some(messages) = &self.messages {
            // A worker that is gone drops the reply, which says that the packet is lost.
            let _ = messages.send(Message::Paint(packet.works, packet.reply));
        }
    }

    fn recover(&mut self) -> Result<(), String> {
        let gone = || "the device's thread ended".to_owned();
        let (tell, answer) = channel();
        let messages = self.messages.as_ref().ok_or_else(gone)?;
        messages.send(Message::Recover(tell)).map_err(|_| gone())?;
        answer.recv().map_err(|_| gone())?
    }
}

impl Drop for GpuPaths {
    fn drop(&mut self) {
        self.messages = None;
        if let Some(worker) = self.worker.take() {
            let _ = worker.join();
        }
    }
}
