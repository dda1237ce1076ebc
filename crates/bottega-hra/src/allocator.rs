//! The allocator: makes the lanes, hands out clients, ends everything.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::shared::Shared;
use crate::window::{self, Window, WindowedResource};
use crate::{HraClient, HraReport, Resource, ResourceDescriptor, ResourceId, Work, lane};

/// Bounds of the allocator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HraConfig {
    /// Units that the work bin holds; submitters wait beyond it. At least 1. More gives the allocator more to choose
    /// from, less makes a change of mind take effect sooner.
    pub bin_capacity: usize,
    /// How often a unit is tried before it is answered as failed; at least 1.
    pub max_attempts: u32,
    /// Upper bound of every unit's maximum delay.
    pub max_delay_bound: Duration,
    /// Pause of a resource after its first failure in a row; doubles with each further one.
    pub pause_min: Duration,
    /// Longest pause of a resource.
    pub pause_max: Duration,
    /// A resource with so many failures in a row is given up.
    pub max_failures: u32,
}

impl Default for HraConfig {
    fn default() -> Self {
        Self {
            bin_capacity: 1024,
            max_attempts: 3,
            max_delay_bound: Duration::from_secs(60),
            pause_min: Duration::from_millis(10),
            pause_max: Duration::from_secs(5),
            max_failures: 12,
        }
    }
}

/// A resource, and how it is served.
pub enum Lane<W: Work> {
    /// Called directly, one unit at a time: for low latency.
    Direct(Box<dyn Resource<W>>),
    /// Sent packets ahead of their answers: for high latency.
    Windowed(Box<dyn WindowedResource<W>>, Window),
}

impl<W: Work> From<Box<dyn Resource<W>>> for Lane<W> {
    fn from(resource: Box<dyn Resource<W>>) -> Self {
        Self::Direct(resource)
    }
}

impl<W: Work> Lane<W> {
    fn descriptor(&self) -> ResourceDescriptor {
        match self {
            Self::Direct(resource) => resource.descriptor(),
            Self::Windowed(resource, _) => resource.descriptor(),
        }
    }
}

/// The Hardware Resource Allocator. Owns a thread for each resource, and the work bin.
///
/// Dropped, it takes nothing more, answers the units that wait with [`UnitError::Closed`](crate::UnitError::Closed),
/// lets those under way be finished and answered, and waits for its threads. Clients may go before or after it.
pub struct Hra<W: Work> {
    shared: Arc<Shared<W>>,
    threads: Vec<JoinHandle<()>>,
}

impl<W: Work> Hra<W> {
    /// An allocator of resources that are called directly. Without any resource it refuses all units.
    pub fn new(config: HraConfig, resources: Vec<Box<dyn Resource<W>>>) -> Self {
        Self::with_lanes(config, resources.into_iter().map(Lane::from).collect())
    }

    /// An allocator of resources of both kinds.
    pub fn with_lanes(config: HraConfig, lanes: Vec<Lane<W>>) -> Self {
        let shared = Arc::new(Shared::new(config, lanes.iter().map(Lane::descriptor).collect()));
        let threads =
            lanes.into_iter().zip(0..).filter_map(|(lane, id)| start(&shared, ResourceId(id), lane)).collect();
        Self { shared, threads }
    }

    /// A new client, with a results bin of its own.
    pub fn client(&self) -> HraClient<W> {
        HraClient::new(Arc::clone(&self.shared))
    }

    /// What each resource did so far.
    pub fn report(&self) -> HraReport {
        self.shared.report()
    }
}

/// Starts the thread of a lane. A lane whose thread the system refuses is retired at once.
fn start<W: Work>(shared: &Arc<Shared<W>>, id: ResourceId, lane: Lane<W>) -> Option<JoinHandle<()>> {
    let name = format!("hra {}", shared.lanes[id.index()].descriptor.name.replace('\0', " "));
    let lanes_shared = Arc::clone(shared);
    let run = move || {
        // The drivers catch what resources panic with; this is for a resource that panics in its `Drop`.
        let _ = catch_unwind(AssertUnwindSafe(|| match lane {
            Lane::Direct(resource) => lane::drive(&lanes_shared, id, resource),
            Lane::Windowed(resource, window) => window::drive(&lanes_shared, id, resource, window),
        }));
    };
    let started = thread::Builder::new().name(name).spawn(run).ok();
    if started.is_none() {
        shared.retire(id);
    }
    started
}

impl<W: Work> Drop for Hra<W> {
    fn drop(&mut self) {
        self.shared.close();
        let this_thread = thread::current().id();
        for thread in self.threads.drain(..) {
            // A unit that owned the last handle of its own allocator drops it on a lane, which cannot await itself.
            if thread.thread().id() != this_thread {
                let _ = thread.join();
            }
        }
    }
}
