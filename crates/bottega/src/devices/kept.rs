//! Devices that stay open between pictures: for the second picture of a process the devices are open, the kernels compiled, and
//! unchanged parts of the scene in device memory.

use std::{
    num::NonZeroU32,
    sync::{Arc, Mutex, PoisonError},
};

use bottega_engines::{Devices, Resources};

use super::{
    board,
    board_worth::{ConnectedBoard, are_worth_waves},
    costs,
    gpu::{ChosenGpu, GpuScenes},
};
use crate::error::Error;

/// Largest number of resource sets kept open; the least recently used one is closed first.
const KEPT_MAX: usize = 2;

static KEPT: Mutex<Vec<KeptResources>> = Mutex::new(Vec::new());

/// The settings that two pictures must have in common to share resources.
#[derive(Clone, PartialEq, Eq)]
pub(super) struct ResourceKey {
    threads: usize,
    gpus: Vec<String>,
    boards: Vec<String>,
    memory: Option<u64>,
    bin: Option<NonZeroU32>,
}

impl ResourceKey {
    /// Makes the key of a set of resources.
    ///
    /// - `boards`: addresses of the boards that trace rays.
    /// - `memory`: memory limit for scenes on each GPU, in bytes.
    /// - `bin`: largest number of work units that wait.
    pub(super) fn new(
        threads: usize,
        gpus: &[ChosenGpu],
        boards: &[String],
        memory: Option<u64>,
        bin: Option<NonZeroU32>,
    ) -> Self {
        let gpus = gpus.iter().map(|gpu| gpu.name().to_owned()).collect();
        Self { threads, gpus, boards: boards.to_vec(), memory, bin }
    }

    /// Returns the number of CPU threads; 0: CPUs do not render.
    pub(super) fn threads(&self) -> usize {
        self.threads
    }

    /// Returns true if both keys have CPU threads, in different numbers, and are otherwise equal.
    fn differs_in_threads(&self, other: &Self) -> bool {
        let have_threads = self.threads > 0 && other.threads > 0;
        have_threads && Self { threads: other.threads, ..self.clone() } == *other
    }
}

/// Resources with the boards and GPU scenes behind them.
#[derive(Clone)]
pub(super) struct KeptResources {
    pub(super) key: ResourceKey,
    pub(super) resources: Arc<Resources>,
    pub(super) boards: Vec<ConnectedBoard>,
    pub(super) scenes: Vec<GpuScenes>,
}

impl KeptResources {
    fn is_painting(&self) -> bool {
        Arc::strong_count(&self.resources) > 1
    }

    /// Returns true if the boards were too slow for this number of CPU threads when they were connected. They may be faster
    /// now.
    fn are_boards_slow(&self) -> bool {
        !self.boards.is_empty() && !are_worth_waves(&self.boards, self.key.threads)
    }
}

/// Returns processors, GPUs and boards behind one allocator: those of an earlier picture, or new ones. The GPUs compile the
/// kernels of the scene while CPU threads render, if there are any.
///
/// - `joins`: true if resources that are rendering now may be shared although their number of CPU threads differs; the returned
///   key holds that number.
///
/// # Errors
/// A GPU cannot be opened, its kernels cannot be compiled, or a board cannot be reached.
pub(super) fn resources(key: ResourceKey, joins: bool, gpus: &[ChosenGpu]) -> Result<KeptResources, Error> {
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    kept.retain(|known| known.is_painting() || !known.are_boards_slow());
    let may_join = |known: &KeptResources| joins && known.is_painting() && known.key.differs_in_threads(&key);
    let painting = kept.iter().position(|known| known.key == key && known.is_painting());
    let found = painting.or_else(|| kept.iter().position(may_join));
    let found = match found.or_else(|| kept.iter().position(|known| known.key == key)) {
        Some(at) => kept.remove(at),
        None => {
            make_room(&mut kept, &key);
            open(key, gpus)?
        }
    };
    // Without CPU threads wait for the kernels; otherwise those render in the meantime.
    let waits = found.key.threads == 0;
    let admitted = found.scenes.iter().zip(gpus).try_for_each(|(scenes, gpu)| gpu.admit(scenes, waits));
    // A device that failed is not kept: the next picture opens it again.
    admitted?;
    kept.push(found.clone());
    Ok(found)
}

fn open(key: ResourceKey, gpus: &[ChosenGpu]) -> Result<KeptResources, Error> {
    let (mut lanes, mut scenes, mut boards) = (Vec::new(), Vec::new(), Vec::new());
    for gpu in gpus {
        let (lane, place) = gpu.open(key.memory)?;
        lanes.push(lane);
        scenes.push(place);
    }
    for address in &key.boards {
        let (lane, board) = board::open(address)?;
        lanes.push(lane);
        boards.push(board);
    }
    let costs = if gpus.is_empty() { None } else { costs::read() };
    let resources = Arc::new(Resources::new(key.threads, Devices { lanes, costs }, key.bin));
    Ok(KeptResources { key, resources, boards, scenes })
}

/// Closes idle resources: those that hold a GPU needed by `key`, and further ones until there is room for one more.
fn make_room(kept: &mut Vec<KeptResources>, key: &ResourceKey) {
    let is_idle = |known: &KeptResources| !known.is_painting();
    kept.retain(|known| !(is_idle(known) && known.key.gpus.iter().any(|gpu| key.gpus.contains(gpu))));
    while kept.len() >= KEPT_MAX {
        let Some(at) = kept.iter().position(is_idle) else { return };
        kept.remove(at);
    }
}

/// Closes all devices of this process that no picture uses.
pub fn release() {
    let idle: Vec<_> = {
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        kept.extract_if(.., |known| !known.is_painting()).collect()
    };
    drop(idle); // Outside the lock: devices may take a moment to end.
}
