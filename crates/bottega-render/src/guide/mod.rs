//! The guide: directions that light comes from, learnt by paths that were traced ahead, for those that count.
//!
//! Lambert's cosine knows nothing of the mirror that throws a spot of light on a wall, or of the one bright corner of a
//! room; where a path turns at random it finds them rarely, and each time with a great weight. The guide holds, for
//! regions of the scene's surfaces, a density of directions proportional to the root of the mean square of what came
//! from there. Paths draw from it and from their BSDF, in shares that each region has found best, and divide by the
//! density of both together: so whatever the guide holds, it moves the noise and never the mean.
//!
//! The guide is a function of the scene, the view and the number of samples planned: learnt with a seed of its own from
//! whole paths all over the picture, in passes whose sizes these decide and whose vertices are folded in the order of the paths. How far
//! learning goes, and where the picture goes by it, is decided from what was learnt and from counted work, never from a clock. All who
//! paint a picture guide their paths alike.
//!
//! Sources: Müller, Gross, Novák 2017, *Practical Path Guiding for Efficient Light-Transport Simulation* (a tree over space,
//! learning in passes that double); Rath et al. 2020, *Variance-Aware Path Guiding* (the root of the mean square as
//! target); Müller 2019, *Path Guiding in Production*, section 10.5 (a learnt share of the BSDF).

mod agent;
mod budget;
mod bytes;
mod directions;
mod expected;
mod learn;
pub(crate) mod octahedron;
mod plan;
mod train;
mod tree;

pub(crate) use agent::Agent;
pub(crate) use budget::LearningBudget;
pub use bytes::UnreadGuide;
pub(crate) use plan::{PaintPlan, PaintingWay};
pub(crate) use train::{FoundLight, LearningPath, Trail, Training};
pub(crate) use tree::{Guide, Region};
