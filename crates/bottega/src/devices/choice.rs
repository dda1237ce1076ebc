//! The choice of devices on this machine: what the user asks for, and what comes of it.

use std::sync::Arc;

use bottega_engines::Resources;
use bottega_image::{Aov, Layout};
use bottega_render::PreparedScene;

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

/// Who is wanted to paint.
#[derive(Clone, Copy, Debug)]
pub struct PainterWish {
    /// Processors.
    pub threads: usize,
    /// Bytes that scenes may take on a GPU; `None`: nearly all that it has.
    pub memory: Option<u64>,
    /// Whether those that paint something else in this process do, however many processors they are: then what is more urgent goes
    /// first, which it cannot where each picture has threads of its own.
    pub joins: bool,
}

/// The devices that will paint.
pub struct DeviceSet {
    /// Processors; 0: none.
    pub threads: usize,
    /// They and the devices beside them, which others may be using, too.
    pub resources: Arc<Resources>,
    /// Names of the GPUs.
    pub gpus: Vec<String>,
    /// The boards that follow rays; none where they are left alone.
    pub boards: Vec<ConnectedBoard>,
    /// The GPUs' memory, in the same order.
    pub scenes: Vec<GpuScenes>,
    /// Why others do not, for the user.
    pub notes: Vec<String>,
}

impl DeviceSet {
    /// Finds those who can paint this scene with these values a pixel.
    ///
    /// - `photons`: whether it is painted by photons.
    ///
    /// # Errors
    /// A device that was asked for by name is not there, or cannot, and no processor may instead.
    pub fn gather(
        choice: &DeviceChoice,
        &PainterWish { threads, memory, joins }: &PainterWish,
        scene: &Arc<PreparedScene>,
        layout: &Layout,
        photons: bool,
    ) -> Result<Self, Error> {
        let lacks = lacks(layout, photons);
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
        // A lone device without room leaves the picture to the processors.
        if painting == 0 && boards.is_empty() {
            gpus.retain(|gpu| {
                let lack = gpu.lacks_room(memory);
                notes.extend(lack.iter().map(|lack| format!("{} does not take part: {lack}", gpu.name())));
                lack.is_none()
            });
            painting = if gpus.is_empty() { threads } else { 0 };
        }
        let mut threads = painting;
        if !gpus.is_empty() {
            threads = beside_gpus(threads, gpus.len());
        }
        let names: Vec<String> = gpus.iter().map(|gpu| gpu.name().to_owned()).collect();
        if !boards.is_empty() {
            board::count_bytes(scene);
        }
        let key = |gpus: &[ChosenGpu], boards: &[String]| ResourceKey::new(threads, gpus, boards, memory);
        let opened = kept::resources(key(&gpus, &boards), joins, &gpus);
        let (opened, gpus) = match opened {
            Ok(opened) => (opened, names),
            Err(error) if threads == 0 || !boards.is_empty() => return Err(error),
            // Refused to that device, not to the picture.
            Err(error) => {
                notes.push(format!("{} does not take part: {}", names.join(", "), error_chain(&error)));
                (kept::resources(key(&[], &[]), joins, &[])?, Vec::new())
            }
        };
        let KeptResources { resources, boards, scenes, .. } = opened;
        Ok(Self { threads: opened.key.threads(), resources, gpus, boards, scenes, notes })
    }

    /// Who paints, in words.
    pub fn names(&self) -> String {
        let boards = self.boards.iter().map(|board| board.name.clone());
        names(self.threads, &self.gpus.iter().cloned().chain(boards).collect::<Vec<_>>())
    }
}

/// Who is asked to paint, while it is found out who can.
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
            // Refused to that device, not to the picture.
            Err(error) => {
                let name = name.map_or("the GPU", String::as_str);
                self.notes.push(format!("{name} does not take part: {}", error_chain(&error)));
                Ok(())
            }
        }
    }
}

/// Processors that paint beside so many GPUs. Where there are many, one for each GPU is left to those who hand out work to it: it
/// does far more than that one would.
pub fn beside_gpus(processors: usize, gpus: usize) -> usize {
    const MANY: usize = 8;
    if processors < MANY { processors } else { processors.saturating_sub(gpus).max(MANY / 2) }
}

/// What is asked for that no GPU does, whatever the scene.
fn lacks(layout: &Layout, photons: bool) -> Vec<String> {
    let cost = layout.offset(Aov::Cost).map(|_| "the cost of pixels (layer `cost`)".to_owned());
    let photons = photons.then(|| "photon mapping".to_owned());
    cost.into_iter().chain(photons).collect()
}

/// What of this machine a choice means beside the processors: names of GPUs, addresses of boards. What is not there is left out.
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

/// Whether it is worth asking the drivers, which takes a while and lets some of them talk.
fn may_have_gpu() -> bool {
    // Without a node for a device there is none that is no software.
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
