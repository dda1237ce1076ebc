//! The processors and devices that paint, behind one allocator.

use bottega_hra::{CostBook, Hra, HraConfig, HraReport, Lane, Primitive, PrimitiveSet, VirtualCpu};
use bottega_render::RenderWork;

/// Spans of activity that are kept for each resource: a drawing shows no more.
const SPANS_KEPT: usize = 2048;

/// The devices that paint beside the processors.
#[derive(Default)]
pub struct Devices {
    /// Each is told of all work of an allocator that also has the processors.
    pub lanes: Vec<Lane<RenderWork>>,
    /// What is known of the costs of any of them, and of the processors.
    pub costs: Option<CostBook>,
}

/// The processors and devices of this machine behind one allocator, which any number of engines may use.
pub struct Resources {
    pub(super) hra: Hra<RenderWork>,
    /// How many devices there are beside the processors.
    pub(super) devices: usize,
}

impl Resources {
    /// - `threads`: processors; 0: none, the devices do all.
    pub fn new(threads: usize, devices: Devices) -> Self {
        let Devices { lanes, costs } = devices;
        let devices = lanes.len();
        let processors = VirtualCpu::lanes(threads, RenderWork::perform).into_iter().map(Lane::from);
        let lanes = processors.chain(lanes).chain(looker(threads)).collect();
        let costs = costs.unwrap_or_else(|| CostBook::new(""));
        let config = HraConfig { spans_kept: SPANS_KEPT, ..HraConfig::default() };
        Self { hra: Hra::with_costs(config, lanes, &costs), devices }
    }

    /// What they have done so far, for all engines together.
    pub fn report(&self) -> HraReport {
        self.hra.report()
    }
}

/// Where the devices do all, a processor is there for what they know nothing of: the rays of a look at the scene.
fn looker(threads: usize) -> Option<Lane<RenderWork>> {
    let rays = [Primitive::Intersect, Primitive::Occluded, Primitive::Shade];
    let looker = VirtualCpu::new("cpu".to_owned(), PrimitiveSet::from(rays), RenderWork::perform);
    (threads == 0).then(|| Lane::Direct(Box::new(looker)))
}
