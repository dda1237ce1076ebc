//! The processors and devices that render, behind one allocator.

use std::num::NonZeroU32;

use bottega_hra::{CostBook, Hra, HraConfig, HraReport, Lane, Primitive, PrimitiveSet, VirtualCpu};
use bottega_render::RenderWork;

/// The most activity spans kept per resource, for the display.
const SPANS_KEPT: usize = 2048;

/// The devices that render in addition to the CPU.
#[derive(Default)]
pub struct Devices {
    /// The lanes of the devices, which share an allocator with the CPU.
    pub lanes: Vec<Lane<RenderWork>>,
    /// The measured costs of devices and processors, if known.
    pub costs: Option<CostBook>,
}

/// The processors and devices of this machine behind one allocator, which any number of engines may share.
pub struct Resources {
    pub(super) hra: Hra<RenderWork>,
    /// The number of devices, without the CPU.
    pub(super) devices: usize,
}

impl Resources {
    /// Creates the allocator.
    ///
    /// - `threads`: the number of CPU threads; 0: only the devices render.
    /// - `bin`: the most units that wait; `None`: as many as resources do in a fraction of a second.
    pub fn new(threads: usize, devices: Devices, bin: Option<NonZeroU32>) -> Self {
        let Devices { lanes, costs } = devices;
        let devices = lanes.len();
        let processors = VirtualCpu::lanes(threads, RenderWork::perform).into_iter().map(Lane::from);
        let lanes = processors.chain(lanes).chain(looker(threads)).collect();
        let costs = costs.unwrap_or_else(|| CostBook::new(""));
        let usual = HraConfig { spans_kept: SPANS_KEPT, ..HraConfig::default() };
        let config = match bin {
            None => usual,
            Some(units) => HraConfig { bin_capacity: units.get() as usize, bin_min: 1, ..usual },
        };
        Self { hra: Hra::with_costs(config, lanes, &costs), devices }
    }

    /// Returns the work done so far, for all engines.
    pub fn report(&self) -> HraReport {
        self.hra.report()
    }
}

/// Returns a CPU lane for work that devices do not support, the rays of a survey, if no CPU thread renders.
fn looker(threads: usize) -> Option<Lane<RenderWork>> {
    let rays = [Primitive::Intersect, Primitive::Occluded, Primitive::Shade];
    let looker = VirtualCpu::new("cpu".to_owned(), PrimitiveSet::from(rays), RenderWork::perform);
    (threads == 0).then(|| Lane::Direct(Box::new(looker)))
}
