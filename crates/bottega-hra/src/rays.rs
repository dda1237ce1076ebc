//! Work that is a batch of rays, so that a resource that knows rays and no renderer can do it.

use bottega_kernels::{Hit, Ray};

use crate::Work;

/// A batch of rays and what is asked of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayQuery<'a> {
    /// The closest hit of each ray.
    Intersect(&'a [Ray]),
    /// Whether each ray hits anything.
    Occluded(&'a [Ray]),
}

impl<'a> RayQuery<'a> {
    /// The rays.
    pub fn rays(&self) -> &'a [Ray] {
        match self {
            Self::Intersect(rays) | Self::Occluded(rays) => rays,
        }
    }
}

/// Work of which some is a batch of rays.
pub trait RayWork: Work {
    /// The rays, if this work is nothing but rays; then [`Work::primitive`] is `Intersect` or `Occluded` to match.
    fn query(&self) -> Option<RayQuery<'_>>;

    /// The output made of the hits, one a ray in the rays' order. Called after [`RayQuery::Intersect`] alone.
    fn hits(self, hits: Vec<Hit>) -> Self::Output;

    /// The output made of the answers, one a ray in the rays' order. Called after [`RayQuery::Occluded`] alone.
    fn occlusion(self, occluded: Vec<bool>) -> Self::Output;
}
