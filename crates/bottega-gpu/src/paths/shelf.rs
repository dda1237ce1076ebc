//! The scenes that a device may be asked to paint, as it is sent them.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use bottega_hra::DataId;
use bottega_render::PreparedScene;

use super::scene::PathScene;

/// Scenes put down for one device: which of them are on it is the allocator's business, see
/// [`Work::data`](bottega_hra::Work::data). A scene is forgotten when nobody has it any more.
#[derive(Debug, Default)]
pub(super) struct SceneShelf {
    scenes: Mutex<BTreeMap<DataId, ShelvedScene>>,
    sent_bytes: AtomicU64,
    resident_bytes: AtomicU64,
    /// Scenes whose kernels are to be compiled.
    uncompiled: AtomicUsize,
}

#[derive(Debug)]
struct ShelvedScene {
    flat: Arc<PathScene>,
    owner: Weak<PreparedScene>,
}

/// A scene as a device is sent it: see [`GpuAdapter::encode`](crate::GpuAdapter::encode).
#[derive(Clone)]
pub struct EncodedScene {
    pub(super) flat: Arc<PathScene>,
    pub(super) scene: Arc<PreparedScene>,
}

impl EncodedScene {
    /// Bytes on the device.
    pub fn bytes(&self) -> u64 {
        self.flat.memory_bytes()
    }
}

impl SceneShelf {
    /// From now on the device paints this scene, too.
    pub(super) fn put(&self, encoded: &EncodedScene) {
        let EncodedScene { flat, scene } = encoded;
        scene.note_device_bytes(flat.memory_bytes());
        let mut scenes = self.scenes.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.retain(|_, shelved| shelved.owner.strong_count() > 0);
        let shelved = ShelvedScene { flat: Arc::clone(flat), owner: Arc::downgrade(scene) };
        scenes.insert(scene.data_id(), shelved);
    }

    /// Bytes of scenes that were sent to the device so far.
    pub(super) fn sent_bytes(&self) -> u64 {
        self.sent_bytes.load(Ordering::Relaxed)
    }

    /// Bytes of scenes that are on the device; what two of them share counts once.
    pub(super) fn resident_bytes(&self) -> u64 {
        self.resident_bytes.load(Ordering::Relaxed)
    }

    pub(super) fn note(&self, sent: u64, resident: u64) {
        self.sent_bytes.fetch_add(sent, Ordering::Relaxed);
        self.resident_bytes.store(resident, Ordering::Relaxed);
    }

    /// The kernels of a scene are to be compiled.
    pub(super) fn begin_compiling(&self) {
        self.uncompiled.fetch_add(1, Ordering::SeqCst);
    }

    /// They are, or cannot be.
    pub(super) fn end_compiling(&self) {
        self.uncompiled.fetch_sub(1, Ordering::SeqCst);
    }

    /// Whether the device has kernels to compile before it does anything else.
    pub(super) fn is_compiling(&self) -> bool {
        self.uncompiled.load(Ordering::SeqCst) > 0
    }

    pub(super) fn get(&self, id: DataId) -> Option<Arc<PathScene>> {
        let scenes = self.scenes.lock().unwrap_or_else(PoisonError::into_inner);
        scenes.get(&id).map(|shelved| Arc::clone(&shelved.flat))
    }
}
