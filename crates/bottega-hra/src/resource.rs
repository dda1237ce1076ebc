//! Resources: who does the work, and how far away they are.

use std::marker::PhantomData;
use std::time::Duration;

use crate::{DataId, Failed, PrimitiveSet, Work};

/// The distance of a resource from the memory of this process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Time that one byte needs, one way.
    pub latency: Duration,
    /// Bytes a second; infinite where nothing is copied.
    pub bandwidth: f64,
}

impl Link {
    /// In place: nothing travels.
    pub const LOCAL: Self = Self { latency: Duration::ZERO, bandwidth: f64::INFINITY };

    /// Time to send `bytes` one way.
    pub fn transfer(&self, bytes: u64) -> Duration {
        let seconds = bytes as f64 / self.bandwidth;
        self.latency.saturating_add(Duration::try_from_secs_f64(seconds).unwrap_or(Duration::ZERO))
    }
}

/// The description of a resource: what it is and can do.
#[derive(Clone, Debug, PartialEq)]
pub struct ResourceDescriptor {
    /// The name that users see.
    pub name: String,
    /// What it can do; may be a part only.
    pub primitives: PrimitiveSet,
    /// Memory of its own for data; `None` where it works in that of this process, or does not tell.
    pub memory_bytes: Option<u64>,
    /// The way there.
    pub link: Link,
}

/// Something that computes work units one at a time, called from a thread of its own.
///
/// A panic in `perform` is taken for a failure of the resource (see [`Work::backup`]). After a failure the resource is
/// left alone for a pause that doubles each time, then [`Resource::recover`] is called, and then it gets work again.
pub trait Resource<W: Work>: Send {
    /// What it is. Asked once, before the first unit.
    fn descriptor(&self) -> ResourceDescriptor;

    /// Does the work; only asked for primitives of the descriptor. Must end in bounded time, must not submit to the
    /// allocator that calls it (a full bin would then wait for itself), and gives the work back if it cannot do it.
    fn perform(&mut self, work: W) -> Result<W::Output, Failed<W>>;

    /// Makes the resource ready again after a failure, or says why that cannot be done yet.
    fn recover(&mut self) -> Result<(), String> {
        Ok(())
    }

    /// Throws data out of the resource's memory: it is the least recently used, and room is needed. Called before
    /// `perform`; data that was never seen here may be named.
    fn evict(&mut self, data: DataId) {
        let _ = data;
    }

    /// Asked when `perform` gave work back: whether that was for want of memory.
    fn is_out_of_memory(&self) -> bool {
        false
    }

    /// Bytes of memory that are free for data, if the resource can tell; asked now and then.
    fn memory_free(&self) -> Option<u64> {
        None
    }
}

/// Bounds of what is under way to a far resource. Within them the allocator finds the least that keeps it busy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Packets that may be under way at once; at least 1.
    pub packets: usize,
    /// Most units in a packet; at least 1.
    pub units_per_packet: usize,
    /// A packet without an answer for so long is lost, and with it the resource, until it has recovered; sooner where
    /// it is known how long it should take, or when it is the last that is waited for and others could have done it long
    /// since. Also the longest time that shutting down waits for it.
    pub patience: Duration,
    /// Whether data stays in the resource's memory when it has given no answer for long and answers again: then it is not sent twice.
    pub keeps_data: bool,
}

impl Default for Window {
    fn default() -> Self {
        Self { packets: 256, units_per_packet: 1024, patience: Duration::from_secs(10), keeps_data: false }
    }
}

/// A lane of the processor: calls a function in place, on the thread that the allocator gives it.
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
    /// One lane that can do `primitives` by calling `perform`.
    pub fn new(name: impl Into<String>, primitives: PrimitiveSet, perform: F) -> Self {
        Self { name: name.into(), primitives, perform, work: PhantomData }
    }

    /// As many lanes as `threads`, each of which can do everything.
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
