//! Simulated devices: time and kind of the answer to a packet.

use std::collections::BTreeMap;

use super::model::Model;
use super::random::LoadRandom;
use crate::policy::cable::CableBytes;
use crate::policy::incident::Fault;
use crate::policy::time::Time;
use crate::{DataId, Primitive, Transfer};

/// A packet, as the device sees it.
pub(super) struct Parcel {
    pub(super) primitive: Primitive,
    pub(super) units: usize,
    pub(super) items: u64,
    pub(super) bytes: CableBytes,
    pub(super) data: Option<(DataId, u64)>,
}

/// The outcome of a packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fate {
    /// Time of the answer; for a directly called device that hangs, of its return. `None`: never.
    pub(super) at: Option<Time>,
    /// The fault, if it fails.
    pub(super) fault: Option<Fault>,
}

/// A device in virtual time: its model and its state.
pub(super) struct SimulatedDevice {
    model: Model,
    random: LoadRandom,
    link_free: Time,
    free: Time,
    back_free: Time,
    /// Down until this time.
    down_until: Option<Time>,
    /// Increases when everything in progress is lost.
    pub(super) generation: u64,
    held: BTreeMap<DataId, u64>,
    /// True if the device ever had to hold more than its memory.
    pub(super) overfull: bool,
}

impl SimulatedDevice {
    pub(super) fn new(model: Model, seed: u64) -> Self {
        let (held, random) = (BTreeMap::new(), LoadRandom::new(seed));
        let (link_free, free, back_free) = (Time::ZERO, Time::ZERO, Time::ZERO);
        Self { model, random, link_free, free, back_free, down_until: None, generation: 0, held, overfull: false }
    }

    pub(super) fn is_far(&self) -> bool {
        self.model.window.is_some()
    }

    pub(super) fn evict(&mut self, data: DataId) {
        self.held.remove(&data);
    }

    /// Recovers, if it is no longer down.
    pub(super) fn recover(&mut self, now: Time) -> Result<(), String> {
        if self.down_until.is_some_and(|until| now < until) {
            return Err("still down".to_owned());
        }
        self.down_until = None;
        Ok(())
    }

    /// Takes a packet. Returns the time at which it ends, and its fault if there is one.
    pub(super) fn send(&mut self, now: Time, parcel: &Parcel) -> Fate {
        let faults = self.model.faults;
        if self.down_until.is_some() {
            return Fate { at: self.down_until.filter(|_| !self.is_far()), fault: Some(Fault::Hung) };
        }
        let moved = self.hold(parcel.data);
        let fault = self.draw_fault(parcel.units);
        let answered = self.serve(now, parcel, moved);
        match fault {
            Some(Fault::Hung) => {
                let until = now.after(faults.lasts);
                self.fall(until);
                Fate { at: (!self.is_far()).then_some(until), fault }
            }
            Some(Fault::Died) => {
                self.fall(now.after(faults.lasts));
                Fate { at: Some(now), fault }
            }
            fault => Fate { at: Some(answered), fault },
        }
    }

    fn fall(&mut self, until: Time) {
        self.down_until = Some(until);
        self.generation += 1;
        self.held.clear();
    }

    fn draw_fault(&mut self, units: usize) -> Option<Fault> {
        let faults = self.model.faults;
        if faults.units_max.is_some_and(|max| units > max) {
            return Some(Fault::OutOfMemory);
        }
        let kinds = [(Fault::Hung, faults.hang), (Fault::Died, faults.death), (Fault::Garbage, faults.garbage)];
        kinds.into_iter().find(|&(_, chance)| chance > 0.0 && self.random.chance(chance)).map(|(fault, _)| fault)
    }

    /// Returns the traffic that a driver measures, if bytes take time on the link.
    pub(super) fn transfers(&self, bytes: CableBytes) -> Option<[Transfer; 2]> {
        let link = self.model.link;
        let passed =
            |bytes| Transfer { bytes, timed_bytes: bytes, time: link.transfer(bytes).saturating_sub(link.latency) };
        (self.is_far() && link.bandwidth.is_finite()).then(|| [passed(bytes.there), passed(bytes.back)])
    }

    /// Returns the time at which a packet sent now is answered: it occupies the link for its bytes, arrives after the
    /// latency, waits for the packets before it and is served; its answer occupies the way back and takes the latency
    /// again.
    fn serve(&mut self, now: Time, parcel: &Parcel, moved_bytes: u64) -> Time {
        let per_item = self.model.time_per_item[parcel.primitive.index()].unwrap_or(0.0);
        let noise = 1.0 + self.model.noise * self.random.between(-1.0, 1.0);
        let service = (self.model.time_per_packet.as_nanos() as f64 + per_item * parcel.items as f64) * noise;
        if !self.is_far() {
            return now.plus_ns(service);
        }
        let link = self.model.link;
        let passing = |bytes| link.transfer(bytes).saturating_sub(link.latency);
        let bytes = parcel.bytes.there.saturating_add(moved_bytes);
        self.link_free = self.link_free.max(now).after(passing(bytes));
        self.free = self.free.max(self.link_free.after(link.latency)).plus_ns(service);
        self.back_free = self.back_free.max(self.free).after(passing(parcel.bytes.back));
        self.back_free.after(link.latency)
    }

    /// Makes data resident. Returns the bytes to send.
    fn hold(&mut self, data: Option<(DataId, u64)>) -> u64 {
        let Some((id, bytes)) = data else { return 0 };
        if self.held.insert(id, bytes).is_some() {
            return 0;
        }
        self.overfull |= self.held.values().sum::<u64>() > self.model.memory_bytes.unwrap_or(u64::MAX);
        bytes
    }
}
