//! Resources: the executors of work, and their distance.

use std::marker::PhantomData;
use std::time::Duration;

use crate::{DataId, Failed, PrimitiveSet, Work};

/// The link between this process and a resource.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Time that one byte takes one way.
    pub latency: Duration,
    /// Bytes per second; infinite if nothing is copied.
    pub bandwidth: f64,
}

impl Link {
    /// No link: the resource uses this process's memory.
    pub const LOCAL: Self = Self { latency: Duration::ZERO, bandwidth: f64::INFINITY };

    /// Returns the time to send this many bytes one way, including the latency.
    pub fn transfer(&self, bytes: u64) -> Duration {
        let seconds = bytes as f64 / self.bandwidth;
        self.latency.saturating_add(Duration::try_from_secs_f64(seconds).unwrap_or(Duration::ZERO))
    }
}

/// The description of a resource: its name and capabilities.
#[derive(Clone, Debug, PartialEq)]
pub struct ResourceDescriptor {
    /// The name, for messages; a [`CostBook`](crate::CostBook) stores costs by it.
    pub name: String,
    /// The supported primitives.
    pub primitives: PrimitiveSet,
    /// The resource's own memory for data, in bytes; `None`: it uses this process's memory, or the size is unknown.
    pub memory_bytes: Option<u64>,
    /// The link to the resource.
    pub link: Link,
}

/// A resource that computes work units one at a time, called from a thread of its own.
///
/// A panic in `perform` counts as a failure of the resource (see [`Work::backup`]). After a failure the resource is
/// suspended for a time that doubles with each one, then [`Resource::recover`] is called, and then it gets work again.
pub trait Resource<W: Work>: Send {
    /// Returns the description. Called once, before the first unit.
    fn descriptor(&self) -> ResourceDescriptor;

    /// Does the work and returns its output; only called with supported primitives. Must end in bounded time, and must
    /// not submit to the allocator that calls it (with a full bin it deadlocks).
    ///
    /// # Errors
    /// The resource cannot do the work, and gives it back with the reason.
    fn perform(&mut self, work: W) -> Result<W::Output, Failed<W>>;

    /// Makes the resource ready again after a failure.
    ///
    /// # Errors
    /// The resource is not ready yet, with the reason for the user. It is called again after a longer suspension, until
    /// it is given up.
    fn recover(&mut self) -> Result<(), String> {
        Ok(())
    }

    /// Evicts data from the resource's memory: the least recently used, to make room. Called before `perform`; may name
    /// data that was never sent here.
    fn evict(&mut self, data: DataId) {
        let _ = data;
    }

    /// Returns true if the last failure of `perform` was for lack of memory.
    fn is_out_of_memory(&self) -> bool {
        false
    }

    /// Returns the bytes of memory free for data; `None`: unknown. Called from time to time.
    fn memory_free(&self) -> Option<u64> {
        None
    }
}

/// Limits on packets in flight to a far resource. Within them the allocator uses the least that keeps the resource
/// busy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Maximum number of packets in flight; at least 1.
    pub packets: usize,
    /// Maximum number of units per packet; at least 1.
    pub units_per_packet: usize,
    /// Time after which an unanswered packet counts as lost, and the resource as failed; earlier if its expected time
    /// is known, or if it is the last pending packet and other resources could have done it long ago. Also the maximum
    /// time that shutdown waits for it.
    pub patience: Duration,
    /// True if data stays in the resource's memory while it does not answer for a long time: then it is not sent again.
    pub keeps_data: bool,
}

impl Default for Window {
    fn default() -> Self {
        Self { packets: 256, units_per_packet: 1024, patience: Duration::from_secs(10), keeps_data: false }
    }
}

/// A CPU lane: calls a function on the thread that the allocator gives it.
pub struct VirtualCpu<W, F> {
    name: String,
    primitives: PrimitiveSet,
    perform: F,
    work: PhantomData<fn(W)>,
}

impl<W, F> VirtualCpu<W, F>
where
    W: Work,
    F: Fn(W) -> W::Output + Send,
{
    /// Makes a lane of this name that supports `primitives` by calling `perform`.
    pub fn new(name: impl Into<String>, primitives: PrimitiveSet, perform: F) -> Self {
        Self { name: name.into(), primitives, perform, work: PhantomData }
    }

    /// Returns `threads` lanes named `cpu 0`, `cpu 1`, …, each of which supports all primitives by calling `perform`.
    pub fn lanes(threads: usize, perform: F) -> Vec<Box<dyn Resource<W>>>
    where
        F: Clone + 'static,
    {
        (0..threads)
            .map(|lane| {
                let lane = Self::new(format!("cpu {lane}"), PrimitiveSet::ALL, perform.clone());
                Box::new(lane) as Box<dyn Resource<W>>
            })
            .collect()
    }
}

impl<W, F> Resource<W> for VirtualCpu<W, F>
where
    W: Work,
    F: Fn(W) -> W::Output + Send,
{
    fn descriptor(&self) -> ResourceDescriptor {
        ResourceDescriptor {
            name: self.name.clone(),
            primitives: self.primitives,
            memory_bytes: None,
            link: Link::LOCAL,
        }
    }

    fn perform(&mut self, work: W) -> Result<W::Output, Failed<W>> {
        Ok((self.perform)(work))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transfer_takes_the_latency_and_the_time_of_its_bytes() {
        let link = Link { latency: Duration::from_millis(3), bandwidth: 1e6 };
        assert_eq!(link.transfer(2_000), Duration::from_millis(5));
        assert_eq!(Link::LOCAL.transfer(u64::MAX), Duration::ZERO);
    }
}
