//! The model of a resource.

use std::time::Duration;

use crate::{Link, Primitive, PrimitiveSet, ResourceDescriptor, Window};

/// A resource in virtual time: how fast, how far away, how large, and what goes wrong with it.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Its name.
    pub name: String,
    /// Nanoseconds an item by primitive, in the order of [`Primitive::ALL`]; `None`: it cannot do that.
    pub time_per_item: [Option<f64>; Primitive::COUNT],
    /// Time of a packet before its first item.
    pub time_per_packet: Duration,
    /// The way there, and back again.
    pub link: Link,
    /// Bounds of its window. `None`: it is called directly, and its link is not used.
    pub window: Option<Window>,
    /// Memory for data.
    pub memory_bytes: Option<u64>,
    /// Times vary evenly by this share up and down; below 1.
    pub noise: f64,
    /// What goes wrong.
    pub faults: Faults,
}

/// The faults of a resource, by packet.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    /// Probability that it stops answering, this packet and all others, until it is made to recover.
    pub hang: f64,
    /// Probability that it answers with garbage.
    pub garbage: f64,
    /// Probability that it dies: all that it has in hand is lost at once.
    pub death: f64,
    /// How long it cannot recover after it hung or died.
    pub lasts: Duration,
    /// Packets of more units than this run out of memory.
    pub units_max: Option<usize>,
}

impl Model {
    /// A sound resource next to the processor, of which an item takes `ns_per_item`, whatever the primitive.
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

    /// A sound resource behind a link.
    pub fn far(name: impl Into<String>, ns_per_item: f64, link: Link) -> Self {
        Self { link, window: Some(Window::default()), ..Self::near(name, ns_per_item) }
    }

    /// What the allocator is told of it.
    pub fn descriptor(&self) -> ResourceDescriptor {
        let able = Primitive::ALL.into_iter().filter(|primitive| self.time_per_item[primitive.index()].is_some());
        let primitives: PrimitiveSet = able.collect();
        ResourceDescriptor { name: self.name.clone(), primitives, memory_bytes: self.memory_bytes, link: self.link }
    }
}
