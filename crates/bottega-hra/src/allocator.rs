//! The allocator: starts the lanes, creates clients, and shuts everything down.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use crate::policy::core::Core;
use crate::policy::ledger::Ledger;
use crate::threads::far::WindowedResource;
use crate::threads::shared::{AllocatorState, LaneEnd, LanePost};
use crate::threads::sync::Post;
use crate::threads::{direct, far, watch};
use crate::{CostBook, HraClient, HraConfig, HraReport, Resource, ResourceDescriptor, ResourceId, Window, Work};

/// A resource, and the way it is called.
pub enum Lane<W: Work> {
    /// Called directly, one unit at a time: for low latency.
    Direct(Box<dyn Resource<W>>),
    /// Sent several packets before their answers arrive: for high latency.
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

    fn window(&self) -> Option<Window> {
        match self {
            Self::Direct(_) => None,
            Self::Windowed(_, window) => Some(*window),
        }
    }
}

/// Maximum time to wait at shutdown for idle resources to be dropped, because a driver may hang there, too.
const TEARDOWN_MAX: Duration = Duration::from_secs(2);

/// The Hardware Resource Allocator. Owns the work bin, a thread for each resource, and a thread that watches them.
///
/// When dropped it accepts no more units, answers waiting ones with [`UnitError::Closed`](crate::UnitError::Closed),
/// lets those in progress be finished and answered, and waits for its threads, except those of resources that hang:
/// such a thread ends when its resource answers, or with the process. Clients may be dropped before or after it.
pub struct Hra<W: Work> {
    shared: Arc<AllocatorState<W>>,
    lanes: Vec<Option<JoinHandle<()>>>,
    watch: Option<JoinHandle<()>>,
}

impl<W: Work> Hra<W> {
    /// Creates an allocator of directly called resources. Without resources it refuses all units.
    pub fn new(config: HraConfig, resources: Vec<Box<dyn Resource<W>>>) -> Self {
        Self::with_lanes(config, resources.into_iter().map(Lane::from).collect())
    }

    /// Creates an allocator of resources of both kinds. Without resources it refuses all units.
    pub fn with_lanes(config: HraConfig, lanes: Vec<Lane<W>>) -> Self {
        Self::with_costs(config, lanes, &CostBook::new(""))
    }

    /// Creates an allocator of resources of both kinds, with costs from an earlier run: resources are found in `costs` by
    /// their names, and others start without costs.
    pub fn with_costs(config: HraConfig, lanes: Vec<Lane<W>>, costs: &CostBook) -> Self {
        let described: Vec<_> = lanes.iter().map(|lane| (lane.descriptor(), lane.window())).collect();
        let posts = described.iter().map(|(descriptor, window)| LanePost {
            descriptor: descriptor.clone(),
            is_far: window.is_some(),
            post: Post::default(),
            ledger: Mutex::new(Ledger::new()),
            inbox: Mutex::new(Vec::new()),
        });
        let posts = posts.collect();
        let core = Core::new(config, described, costs);
        let shared = Arc::new(AllocatorState::new(core, posts, config.max_delay_bound));
        let watched = Arc::clone(&shared);
        let watch = thread::Builder::new().name("hra watch".to_owned()).spawn(move || watch::watch(&watched)).ok();
        let lanes = lanes.into_iter().zip(0..).map(|(lane, id)| start(&shared, ResourceId(id), lane)).collect();
        Self { shared, lanes, watch }
    }

    /// Creates a client with a results bin of its own.
    pub fn client(&self) -> HraClient<W> {
        self.client_of(0)
    }

    /// Creates a client with a results bin of its own, whose units all have this priority in addition to their own;
    /// higher goes first.
    pub fn client_of(&self, priority: i32) -> HraClient<W> {
        HraClient::new(Arc::clone(&self.shared), priority)
    }

    /// Returns the activity of each resource and of the work bin since the allocator was made.
    pub fn report(&self) -> HraReport {
        let pending = self.shared.room.taken();
        self.shared.with_core(|core, now, _| HraReport::of(core, now, pending))
    }
}

/// Starts the thread of a lane. A lane whose thread cannot be started is retired at once.
fn start<W: Work>(shared: &Arc<AllocatorState<W>>, id: ResourceId, lane: Lane<W>) -> Option<JoinHandle<()>> {
    let name = format!("hra {}", shared.lanes[id.index()].descriptor.name.replace('\0', " "));
    let lanes_shared = Arc::clone(shared);
    let run = move || {
        // Drivers catch panics in calls of a resource; this catches one in its `Drop`.
        let _ = catch_unwind(AssertUnwindSafe(|| {
            let mut lane = lane;
            match &mut lane {
                Lane::Direct(resource) => direct::drive(&lanes_shared, id, &mut **resource),
                Lane::Windowed(resource, _) => far::drive(&lanes_shared, id, &mut **resource),
            }
            lanes_shared.tear_down(id);
            drop(lane);
        }));
        lanes_shared.set_end(id, LaneEnd::Over);
    };
    let started = thread::Builder::new().name(name).spawn(run).ok();
    if started.is_none() {
        shared.with_core(|core, now, out| {
            core.retire(now, id, out);
            shared.publish(core);
        });
        shared.set_end(id, LaneEnd::Over);
    }
    started
}

impl<W: Work> Drop for Hra<W> {
    fn drop(&mut self) {
        self.shared.close();
        let this_thread = thread::current().id();
        let is_here =
            |thread: &Option<JoinHandle<()>>| thread.as_ref().is_some_and(|thread| thread.thread().id() == this_thread);
        // A unit that holds the last handle of its own allocator drops it on a lane, which cannot wait for itself
        for (lane, id) in self.lanes.iter().zip(0..) {
            if is_here(lane) {
                self.shared.set_end(ResourceId(id), LaneEnd::Over);
            }
        }
        self.shared.wait_until_over(TEARDOWN_MAX);
        self.shared.alarm.end();
        if let Some(watch) = self.watch.take().filter(|_| !is_here(&self.watch)) {
            let _ = watch.join();
        }
    }
}
