//! Work on batches of rays, for resources that only trace rays.

use bottega_kernels::{Hit, Ray};

use crate::Work;

/// A batch of rays and the query about it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayQuery<'a> {
    /// The closest hit of each ray.
    Intersect(&'a [Ray]),
    /// A visibility test per ray: true if it hits anything.
    Occluded(&'a [Ray]),
}

impl<'a> RayQuery<'a> {
    /// Returns the rays of the query.
    pub fn rays(&self) -> &'a [Ray] {
        match self {
            Self::Intersect(rays) | Self::Occluded(rays) => rays,
        }
    }
}

/// Work that may be a batch of rays.
pub trait RayWork: Work {
    /// Returns the query, if this work consists of rays only; [`Work::primitive`] is then `Intersect` or `Occluded` to
    /// match. `None`: it is other work.
    fn query(&self) -> Option<RayQuery<'_>>;

    /// Makes the output from the hits, one per ray in order. Called only after [`RayQuery::Intersect`].
    fn hits(self, hits: Vec<Hit>) -> Self::Output;

    /// Makes the output from the answers, one per ray in order. Called only after [`RayQuery::Occluded`].
    fn occlusion(self, occluded: Vec<bool>) -> Self::Output;
}
