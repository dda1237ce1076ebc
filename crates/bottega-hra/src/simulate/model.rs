//! Models of resources.

use std::time::Duration;

use crate::{Link, Primitive, PrimitiveSet, ResourceDescriptor, Window};

/// A resource in virtual time: speed, link, memory and faults.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// The name of the resource.
    pub name: String,
    /// Nanoseconds per item by primitive, in the order of [`Primitive::ALL`]; `None`: unsupported.
    pub time_per_item: [Option<f64>; Primitive::COUNT],
    /// Time per packet before its first item.
    pub time_per_packet: Duration,
    /// The link in both directions.
    pub link: Link,
    /// The limits of the resource's window. `None`: it is called directly, and its link is not used.
    pub window: Option<Window>,
    /// Memory for data, in bytes.
    pub memory_bytes: Option<u64>,
    /// Times vary uniformly by this share up and down; below 1.
    pub noise: f64,
    /// The faults of the resource.
    pub faults: Faults,
}

/// The faults of a resource, per packet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Probability that the resource stops answering, this packet and all others, until it recovers.
    pub hang: f64,
    /// Probability of an invalid answer.
    pub garbage: f64,
    /// Probability that the resource dies and loses everything in progress.
    pub death: f64,
    /// Time after a hang or death until it can recover.
    pub lasts: Duration,
    /// Packets of more units than this exceed the resource's memory; `None`: none do.
    pub units_max: Option<usize>,
}

impl Model {
    /// Makes a directly called resource without faults, link or limit of memory, which takes `ns_per_item` nanoseconds
    /// per item of every primitive.
    pub fn near(name: impl Into<String>, ns_per_item: f64) -> Self {
        Self {
            name: name.into(),
            time_per_item: [Some(ns_per_item); Primitive::COUNT],
            time_per_packet: Duration::ZERO,
            link: Link::LOCAL,
            window: None,
            memory_bytes: None,
            noise: 0.0,
            faults: Faults::default(),
        }
    }

    /// Makes a resource behind a link, with a default window and otherwise as by [`Model::near`].
    pub fn far(name: impl Into<String>, ns_per_item: f64, link: Link) -> Self {
        Self { link, window: Some(Window::default()), ..Self::near(name, ns_per_item) }
    }

    /// Returns the description of the resource for the allocator.
    pub fn descriptor(&self) -> ResourceDescriptor {
        let able = Primitive::ALL.into_iter().filter(|primitive| self.time_per_item[primitive.index()].is_some());
        let primitives: PrimitiveSet = able.collect();
        ResourceDescriptor { name: self.name.clone(), primitives, memory_bytes: self.memory_bytes, link: self.link }
    }
}
