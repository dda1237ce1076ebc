//! The capabilities of the resources.

use super::unit::{Data, Meta};
use crate::{Primitive, PrimitiveSet, ResourceDescriptor, ResourceId};

/// The capabilities of all resources that are not retired.
pub(crate) struct Capabilities {
    able: Vec<PrimitiveSet>,
    memory: Vec<u64>,
    counts: [u32; Primitive::COUNT],
    /// For each primitive, the largest memory of a resource that supports it.
    roomiest: [u64; Primitive::COUNT],
}

impl Capabilities {
    pub(crate) fn new(descriptors: &[ResourceDescriptor]) -> Self {
        let able = descriptors.iter().map(|descriptor| descriptor.primitives).collect();
        let memory = descriptors.iter().map(|descriptor| descriptor.memory_bytes.unwrap_or(u64::MAX)).collect();
        let mut capabilities = Self { able, memory, counts: [0; Primitive::COUNT], roomiest: [0; Primitive::COUNT] };
        capabilities.count();
        capabilities
    }

    fn count(&mut self) {
        for primitive in Primitive::ALL {
            let able = || self.able.iter().zip(&self.memory).filter(|(set, _)| set.contains(primitive));
            self.counts[primitive.index()] = able().count() as u32;
            self.roomiest[primitive.index()] = able().map(|(_, &memory)| memory).max().unwrap_or(0);
        }
    }

    /// Removes a resource permanently.
    pub(crate) fn retire(&mut self, resource: ResourceId) {
        self.able[resource.index()] = PrimitiveSet::NONE;
        self.count();
    }

    pub(crate) fn primitives(&self, resource: ResourceId) -> PrimitiveSet {
        self.able[resource.index()]
    }

    /// Returns the number of resources that support it, regardless of data.
    pub(crate) fn count_of(&self, primitive: Primitive) -> u32 {
        self.counts[primitive.index()]
    }

    /// Returns the maximum size of data for which it is supported; `None`: unsupported.
    pub(crate) fn most_data(&self, primitive: Primitive) -> Option<u64> {
        (self.count_of(primitive) > 0).then_some(self.roomiest[primitive.index()])
    }

    /// Returns true if a resource supports `primitive` on this much data.
    pub(crate) fn anybody_can(&self, primitive: Primitive, data_bytes: u64) -> bool {
        self.count_of(primitive) > 0 && data_bytes <= self.roomiest[primitive.index()]
    }

    /// Returns true if the data fits into the memory of `resource`.
    pub(crate) fn holds(&self, resource: ResourceId, data: Option<Data>) -> bool {
        data.is_none_or(|data| data.bytes <= self.memory[resource.index()])
    }

    pub(crate) fn can(&self, resource: ResourceId, primitive: Primitive, data: Option<Data>) -> bool {
        self.able[resource.index()].contains(primitive) && self.holds(resource, data)
    }

    /// Returns true if `resource` may try a unit that failed elsewhere: not if it failed here, unless it failed on
    /// all.
    pub(crate) fn may_try(&self, resource: ResourceId, meta: &Meta) -> bool {
        let can = |index: usize| self.can(ResourceId(index as u32), meta.primitive, meta.data);
        let failed = |index: usize| meta.failed_on.iter().any(|failed| failed.index() == index);
        can(resource.index())
            && (!failed(resource.index()) || (0..self.able.len()).all(|index| !can(index) || failed(index)))
    }
}
