//! Who paints on this machine: what the user asks for, and what comes of it.

use std::{sync::Arc, time::Duration};

use bottega_engines::Devices;
use bottega_gpu::{AdapterKind, GpuError, GpuPaths, PathOptions, adapters};
use bottega_hra::{Lane, Window};
use bottega_image::{Aov, Layout};
use bottega_render::{PreparedScene, RenderWork};

use super::costs;
use crate::{
    error::{Error, error_chain},
    request::DeviceChoice,
    state::state_folder,
};

/// A device that does not answer for so long hangs, whatever it was expected to take: a slow one may be the only one.
const PATIENCE: Duration = Duration::from_secs(120);

/// Most units of work that a device is handed over at once: each is thousands of paths, and a fast one does millions in the time
/// that handing over takes.
const UNITS_PER_PACKET: usize = 4096;

/// Who will paint.
pub struct DeviceSet {
    /// Processors; 0: none.
    pub threads: usize,
    /// The devices beside them, and what their work costs.
    pub devices: Devices,
    /// Names of the GPUs.
    pub gpus: Vec<String>,
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
        threads: usize,
        scene: &Arc<PreparedScene>,
        layout: &Layout,
        photons: bool,
    ) -> Result<Self, Error> {
        let lacks = lacks(layout, photons);
        let mut crew = Self { threads, devices: Devices::default(), gpus: Vec::new(), notes: Vec::new() };
        match choice {
            DeviceChoice::Auto => {
                if may_have_gpu() && adapters().iter().any(|adapter| adapter.kind != AdapterKind::Software) {
                    crew.add(None, scene, &lacks)?;
                }
            }
            DeviceChoice::These { processors, gpus } => {
                crew.threads = if *processors { threads } else { 0 };
                gpus.iter().try_for_each(|name| crew.add(Some(name), scene, &lacks))?;
            }
        }
        if !crew.gpus.is_empty() {
            crew.devices.costs = costs::read();
            crew.threads = beside_gpus(crew.threads, crew.gpus.len());
        }
        Ok(crew)
    }

    fn add(&mut self, name: Option<&String>, scene: &Arc<PreparedScene>, lacks: &[String]) -> Result<(), Error> {
        let lacks = if lacks.is_empty() { Ok(()) } else { Err(GpuError::Unsupported(lacks.to_vec())) };
        match lacks.and_then(|()| open(name.cloned(), scene)) {
            Ok((adapter, lane)) => {
                self.gpus.push(adapter);
                self.devices.lanes.push(lane);
                Ok(())
            }
            Err(error @ (GpuError::UnknownAdapter { .. } | GpuError::NoAdapter)) if name.is_some() => Err(error.into()),
            Err(error) if self.threads == 0 => Err(error.into()),
            // Refused to that device, not to the picture.
            Err(error) => {
                let name = name.map_or("the GPU", String::as_str);
                self.notes.push(format!("{name} does not take part: {}", error_chain(&error)));
                Ok(())
            }
        }
    }

    /// Who paints, in words.
    pub fn names(&self) -> String {
        names(self.threads, &self.gpus)
    }
}

/// Processors that paint beside so many GPUs. Where there are many, one for each GPU is left to those who hand out work to it: it
/// does far more than that one would.
pub fn beside_gpus(processors: usize, gpus: usize) -> usize {
    const MANY: usize = 8;
    if processors < MANY { processors } else { processors.saturating_sub(gpus).max(MANY / 2) }
}

/// A GPU that paints a scene, and its name; `name`: a part of it.
pub(crate) fn open(name: Option<String>, scene: &Arc<PreparedScene>) -> Result<(String, Lane<RenderWork>), GpuError> {
    let cache = Some(state_folder().join("kernels"));
    let options = PathOptions { adapter: name, timeout: PATIENCE, cache, ..PathOptions::default() };
    let gpu = GpuPaths::new(scene, &options)?;
    let window = Window { patience: PATIENCE, units_per_packet: UNITS_PER_PACKET, ..Window::default() };
    Ok((gpu.adapter().name.clone(), Lane::Windowed(Box::new(gpu) as _, window)))
}

/// What is asked for that no GPU does, whatever the scene.
fn lacks(layout: &Layout, photons: bool) -> Vec<String> {
    let cost = layout.offset(Aov::Cost).map(|_| "the cost of pixels (layer `cost`)".to_owned());
    let photons = photons.then(|| "photon mapping".to_owned());
    cost.into_iter().chain(photons).collect()
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
