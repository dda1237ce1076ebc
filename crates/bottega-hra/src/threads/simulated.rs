//! A simulated resource with adjustable distance and speed, in real time.

use std::collections::VecDeque;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use crate::{Failed, Link, Packet, PrimitiveSet, Reply, Resource, ResourceDescriptor, WindowedResource, Work};

/// A CPU lane that delivers its results when the simulated device has them: a packet occupies the link for its bytes,
/// arrives after the latency, waits for the packets before it, is served for its items, and its answer takes the
/// latency again.
///
/// As a [`Resource`] it gets one unit at a time, with the whole latency for each; as a [`WindowedResource`] it shows
/// the effect of a window. For tests and planning.
pub struct Simulated<W: Work, F> {
    name: String,
    model: SimulatedModel,
    perform: F,
    /// The thread that delivers answers; started with the first packet.
    far_end: Option<Sender<Flying<W>>>,
    /// The times at which the link, and then the device, is free.
    link_free: Instant,
    device_free: Instant,
    units: u64,
}

/// The parameters of a [`Simulated`] device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedModel {
    /// The supported primitives.
    pub primitives: PrimitiveSet,
    /// Time per item.
    pub time_per_item: Duration,
    /// The link in both directions.
    pub link: Link,
    /// One in this many units is given back as failed; 0: none.
    pub fail_every: u64,
}

/// A packet on its way back.
struct Flying<W: Work> {
    due: Instant,
    outcomes: Vec<Result<W::Output, Failed<W>>>,
    reply: Reply<W>,
}

impl<W, F> Simulated<W, F>
where
    W: Work,
    F: Fn(W) -> W::Output + Send,
{
    /// Makes a device with these parameters, whose outputs come from `perform`, called on this machine.
    pub fn new(name: impl Into<String>, model: SimulatedModel, perform: F) -> Self {
        let now = Instant::now();
        Self { name: name.into(), model, perform, far_end: None, link_free: now, device_free: now, units: 0 }
    }

    fn describe(&self) -> ResourceDescriptor {
        ResourceDescriptor {
            name: self.name.clone(),
            primitives: self.model.primitives,
            memory_bytes: None,
            link: self.model.link,
        }
    }

    /// Returns the time at which the answer to a packet sent now arrives.
    fn due(&mut self, bytes: u64, items: u64) -> Instant {
        let SimulatedModel { time_per_item, link, .. } = self.model;
        self.link_free = self.link_free.max(Instant::now()) + link.transfer(bytes).saturating_sub(link.latency);
        let service = time_per_item.saturating_mul(items.min(u64::from(u32::MAX)) as u32);
        self.device_free = self.device_free.max(self.link_free + link.latency) + service;
        self.device_free + link.latency
    }

    fn outcome(&mut self, work: W) -> Result<W::Output, Failed<W>> {
        self.units += 1;
        if self.model.fail_every > 0 && self.units.is_multiple_of(self.model.fail_every) {
            return Err(Failed { work, reason: "simulated failure".into() });
        }
        Ok((self.perform)(work))
    }
}

impl<W, F> Resource<W> for Simulated<W, F>
where
    W: Work,
    F: Fn(W) -> W::Output + Send,
{
    fn descriptor(&self) -> ResourceDescriptor {
        self.describe()
    }

    fn perform(&mut self, work: W) -> Result<W::Output, Failed<W>> {
        let due = self.due(work.payload_bytes(), work.size());
        let outcome = self.outcome(work);
        thread::sleep(due.saturating_duration_since(Instant::now()));
        outcome
    }
}

impl<W, F> WindowedResource<W> for Simulated<W, F>
where
    W: Work,
    F: Fn(W) -> W::Output + Send,
{
    fn descriptor(&self) -> ResourceDescriptor {
        self.describe()
    }

    fn send(&mut self, packet: Packet<W>) {
        let bytes = packet.works.iter().map(Work::payload_bytes).fold(0, u64::saturating_add);
        let items = packet.works.iter().map(Work::size).fold(0, u64::saturating_add);
        let due = self.due(bytes, items);
        let outcomes = packet.works.into_iter().map(|work| self.outcome(work)).collect();
        let far_end = self.far_end.get_or_insert_with(|| {
            let (sender, receiver) = channel();
            // It ends when the sender is dropped with this resource. If it cannot be started, packets are lost
            let _ = thread::Builder::new().name("hra simulated".into()).spawn(move || fly(&receiver));
            sender
        });
        let _ = far_end.send(Flying { due, outcomes, reply: packet.reply });
    }
}

/// Delivers answers when due. Packets come back in the order in which they were sent.
fn fly<W: Work>(arrivals: &Receiver<Flying<W>>) {
    let mut flying: VecDeque<Flying<W>> = VecDeque::new();
    loop {
        let arrival = match flying.front() {
            Some(first) => arrivals.recv_timeout(first.due.saturating_duration_since(Instant::now())),
            None => arrivals.recv().map_err(RecvTimeoutError::from),
        };
        match arrival {
            Ok(packet) => flying.push_back(packet),
            Err(RecvTimeoutError::Timeout) => {
                let Flying { outcomes, reply, .. } = flying.pop_front().expect("a timeout is that of the first packet");
                reply.send(outcomes);
            }
            Err(RecvTimeoutError::Disconnected) => return,
        }
    }
}
