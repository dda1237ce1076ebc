//! The scenes that a device can render, encoded for upload.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use bottega_hra::DataId;
use bottega_render::PreparedScene;

use super::scene::PathScene;

/// The encoded scenes of one device. The allocator decides which of them are in its memory, see
/// [`Work::data`](bottega_hra::Work::data). A scene is forgotten when its last owner drops it.
#[derive(Debug, Default)]
pub(super) struct SceneShelf {
    scenes: Mutex<BTreeMap<DataId, ShelvedScene>>,
    sent_bytes: AtomicU64,
    resident_bytes: AtomicU64,
    /// The number of scenes whose kernels are not compiled yet.
    uncompiled: AtomicUsize,
}

#[derive(Debug)]
struct ShelvedScene {
    flat: Arc<PathScene>,
    owner: Weak<PreparedScene>,
}

/// A scene in the layout of a device: see [`GpuAdapter::encode`](crate::GpuAdapter::encode).
#[derive(Clone)]
pub struct EncodedScene {
    pub(super) flat: Arc<PathScene>,
    pub(super) scene: Arc<PreparedScene>,
}

impl EncodedScene {
    /// Returns the size of the scene on the device, in bytes.
    pub fn bytes(&self) -> u64 {
        self.flat.memory_bytes()
    }
}

impl SceneShelf {
    /// Adds a scene to those that the device can render.
    pub(super) fn put(&self, encoded: &EncodedScene) {
        let EncodedScene { flat, scene } = encoded;
        scene.note_device_bytes(flat.memory_bytes());
        let mut scenes = self.scenes.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.retain(|_, shelved| shelved.owner.strong_count() > 0);
        let shelved = ShelvedScene { flat: Arc::clone(flat), owner: Arc::downgrade(scene) };
        scenes.insert(scene.data_id(), shelved);
    }

    /// Returns the number of bytes of scenes uploaded to the device so far.
    pub(super) fn sent_bytes(&self) -> u64 {
        self.sent_bytes.load(Ordering::Relaxed)
    }

    /// Returns the size of the scenes on the device, in bytes; data that two scenes share counts once.
    pub(super) fn resident_bytes(&self) -> u64 {
        self.resident_bytes.load(Ordering::Relaxed)
    }

    pub(super) fn note(&self, sent: u64, resident: u64) {
        self.sent_bytes.fetch_add(sent, Ordering::Relaxed);
        self.resident_bytes.store(resident, Ordering::Relaxed);
    }

    /// Counts one more scene whose kernels must be compiled.
    pub(super) fn begin_compiling(&self) {
        self.uncompiled.fetch_add(1, Ordering::SeqCst);
    }

    /// Counts one scene fewer, after its kernels were compiled or failed to.
    pub(super) fn end_compiling(&self) {
        self.uncompiled.fetch_sub(1, Ordering::SeqCst);
    }

    /// Returns true if the device has kernels to compile before it does other work.
    pub(super) fn is_compiling(&self) -> bool {
        self.uncompiled.load(Ordering::SeqCst) > 0
    }

    pub(super) fn get(&self, id: DataId) -> Option<Arc<PathScene>> {
        let scenes = self.scenes.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.get(&id).map(|shelved| Arc::clone(&shelved.flat))
    }
}
