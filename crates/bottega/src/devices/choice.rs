//! The choice of devices on this machine, from the devices that a request names.

use std::{num::NonZeroU32, sync::Arc};

use bottega_engines::Resources;
use bottega_image::{Aov, Layout};
use bottega_render::{PreparedScene, camera::is_camera_for_devices, flat::LAYERS};
use bottega_scene::Camera;

use super::{
    board,
    board_worth::ConnectedBoard,
    gpu::{self, ChosenGpu, GpuScenes},
    kept::{self, KeptResources, ResourceKey},
};
use crate::{
    error::{Error, error_chain},
    request::DeviceChoice,
};

/// Settings for the choice of devices, in addition to their names in the request.
#[derive(Clone, Copy, Debug)]
pub struct PainterWish {
    /// Number of CPU threads.
    pub threads: usize,
    /// Memory limit for scenes on each GPU, in bytes; `None`: nearly all free memory.
    pub memory: Option<u64>,
    /// Largest number of work units that wait for a processor or device; `None`: chosen by their speed.
    pub bin: Option<NonZeroU32>,
    /// True if devices that already render another picture in this process are shared, even with another number of CPU threads.
    /// The more urgent picture then goes first.
    pub joins: bool,
}

/// The devices that render a picture.
pub struct DeviceSet {
    /// Number of CPU threads; 0: CPUs do not render.
    pub threads: usize,
    /// The allocator's resources for all chosen devices; other pictures may share these.
    pub resources: Arc<Resources>,
    /// Names of the GPUs.
    pub gpus: Vec<String>,
    /// The boards that trace rays; empty if they are not used.
    pub boards: Vec<ConnectedBoard>,
    /// The scenes in GPU memory, one entry per GPU in the same order.
    pub scenes: Vec<GpuScenes>,
    /// Warnings about devices that do not take part.
    pub notes: Vec<String>,
}

impl DeviceSet {
    /// Opens the devices that support this scene and these layers, or takes those that an earlier picture has left open. Returns
    /// them.
    ///
    /// - `choice`: the devices that the request names.
    /// - `wish`: threads, memory and sharing of the devices.
    /// - `camera`: the camera of the picture.
    /// - `layout`: the layers of the picture.
    /// - `photons`: true if the integrator uses photons.
    ///
    /// # Errors
    /// A device requested by name is missing, cannot be opened or does not support the picture, and CPU threads are not allowed
    /// in its place.
    pub fn gather(
        choice: &DeviceChoice,
        wish: &PainterWish,
        scene: &Arc<PreparedScene>,
        camera: &Camera,
        layout: &Layout,
        photons: bool,
    ) -> Result<Self, Error> {
        let &PainterWish { threads, memory, bin, joins } = wish;
        // Choose the devices that support the picture
        let lacks = lacks(camera, layout, photons);
        let mut wanted = WantedDevices { threads, gpus: Vec::new(), boards: Vec::new(), notes: Vec::new() };
        match choice {
            DeviceChoice::Auto => {
                if may_have_gpu() && gpu::has_hardware() {
                    wanted.add(None, scene, &lacks)?;
                }
            }
            DeviceChoice::These { processors, gpus, boards } => {
                boards.clone_into(&mut wanted.boards);
                wanted.threads = if *processors { threads } else { 0 };
                gpus.iter().try_for_each(|name| wanted.add(Some(name), scene, &lacks))?;
            }
        }
        let WantedDevices { threads: mut painting, mut gpus, boards, mut notes } = wanted;
        // If the only devices are GPUs without enough memory, render on the CPU
        if painting == 0 && boards.is_empty() {
            gpus.retain(|gpu| {
                let lack = gpu.lacks_room(memory);
                notes.extend(lack.iter().map(|lack| format!("{} does not take part: {lack}", gpu.name())));
                lack.is_none()
            });
            painting = if gpus.is_empty() { threads } else { 0 };
        }
        // Open the devices, or take those of an earlier picture
        let mut threads = painting;
        if !gpus.is_empty() {
            threads = beside_gpus(threads, gpus.len());
        }
        let names: Vec<String> = gpus.iter().map(|gpu| gpu.name().to_owned()).collect();
        if !boards.is_empty() {
            board::count_bytes(scene);
        }
        let key = |gpus: &[ChosenGpu], boards: &[String]| ResourceKey::new(threads, gpus, boards, memory, bin);
        let opened = kept::resources(key(&gpus, &boards), joins, &gpus);
        let (opened, gpus) = match opened {
            Ok(opened) => (opened, names),
            Err(error) if threads == 0 || !boards.is_empty() => return Err(error),
            // Only that device is left out; the picture is rendered without it.
            Err(error) => {
                notes.push(format!("{} does not take part: {}", names.join(", "), error_chain(&error)));
                (kept::resources(key(&[], &[]), joins, &[])?, Vec::new())
            }
        };
        let KeptResources { resources, boards, scenes, .. } = opened;
        Ok(Self { threads: opened.key.threads(), resources, gpus, boards, scenes, notes })
    }

    /// Returns the devices as readable text, such as `8 processors and H200`.
    pub fn names(&self) -> String {
        let boards = self.boards.iter().map(|board| board.name.clone());
        names(self.threads, &self.gpus.iter().cloned().chain(boards).collect::<Vec<_>>())
    }
}

/// The devices collected so far while their support for the scene is checked.
struct WantedDevices {
    threads: usize,
    gpus: Vec<ChosenGpu>,
    boards: Vec<String>,
    notes: Vec<String>,
}

impl WantedDevices {
    fn add(&mut self, name: Option<&String>, scene: &Arc<PreparedScene>, lacks: &[String]) -> Result<(), Error> {
        let found = match lacks {
            [] => ChosenGpu::choose(name.map(String::as_str), scene),
            lacks => Err(gpu::unsupported(lacks)),
        };
        match found {
            Ok(gpu) => {
                self.gpus.push(gpu);
                Ok(())
            }
            Err(error) if self.threads == 0 || name.is_some() && gpu::is_absence(&error) => Err(error),
            // Only that device is left out; the picture is rendered without it.
            Err(error) => {
                let name = name.map_or("the GPU", String::as_str);
                self.notes.push(format!("{name} does not take part: {}", error_chain(&error)));
                Ok(())
            }
        }
    }
}

/// Returns the number of CPU threads that render together with `gpus` GPUs. From 8 processors on, one per GPU stays free to feed
/// it, which is worth more than its own rendering, but at least 4 render.
///
/// - `processors`: number of CPU threads without GPUs.
pub fn beside_gpus(processors: usize, gpus: usize) -> usize {
    const MANY: usize = 8;
    if processors < MANY { processors } else { processors.saturating_sub(gpus).max(MANY / 2) }
}

/// Returns the requested features that no GPU supports.
fn lacks(camera: &Camera, layout: &Layout, photons: bool) -> Vec<String> {
    let camera = (!is_camera_for_devices(camera)).then(|| "the projection or the lens of the camera".to_owned());
    let cost = layout.offset(Aov::Cost).map(|_| "the cost of pixels (layer `cost`)".to_owned());
    let is_lacking = |aov: &Aov| *aov != Aov::Cost && !LAYERS.contains(aov);
    let others = layout.aovs().iter().filter(is_lacking).map(|aov| format!("layer `{}`", aov.name()));
    let groups = layout.layers().iter().map(|layer| format!("layer `{}`", layer.name));
    let photons = photons.then(|| "photon mapping".to_owned());
    camera.into_iter().chain(cost).chain(others).chain(groups).chain(photons).collect()
}

/// Returns the names of GPUs and the addresses of boards that a choice selects on this machine; the processors are not listed.
/// Missing GPUs are left out.
pub fn beside_processors(choice: &DeviceChoice) -> Vec<String> {
    match choice {
        DeviceChoice::Auto if may_have_gpu() => gpu::name_of(None).into_iter().collect(),
        DeviceChoice::Auto => Vec::new(),
        DeviceChoice::These { gpus, boards, .. } => {
            let gpus = gpus.iter().filter_map(|wanted| gpu::name_of(Some(wanted)));
            gpus.chain(boards.iter().cloned()).collect()
        }
    }
}

/// Returns false if there is certainly no GPU, which saves loading drivers: that is slow, and some of them print messages.
fn may_have_gpu() -> bool {
    // On Linux every hardware GPU has a device node.
    let is_node = |entry: std::fs::DirEntry| {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        ["renderD", "nvidia", "dxg", "mali", "kgsl"].iter().any(|start| name.starts_with(start))
    };
    let has_node = |folder: &str| std::fs::read_dir(folder).is_ok_and(|all| all.flatten().any(is_node));
    !cfg!(target_os = "linux") || has_node("/dev/dri") || has_node("/dev")
}

fn names(threads: usize, gpus: &[String]) -> String {
    let processors = match threads {
        0 => Vec::new(),
        1 => vec!["1 processor".to_owned()],
        more => vec![format!("{more} processors")],
    };
    let all: Vec<String> = processors.into_iter().chain(gpus.iter().cloned()).collect();
    let none = if gpus.is_empty() { ", no GPU" } else { "" };
    format!("{}{none}", all.join(" and "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_paints_is_said_in_words() {
        assert_eq!(names(1, &[]), "1 processor, no GPU");
        assert_eq!(names(8, &["H200".to_owned()]), "8 processors and H200");
        assert_eq!(names(0, &["H200".to_owned()]), "H200");
    }
}
