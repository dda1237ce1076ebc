//! Path guiding: directions that light comes from, learned from paths that are traced before the picture.
//!
//! Sampling by the BSDF knows nothing of a mirror that throws a spot of light on a wall, or of the one bright corner of
//! a room: random paths find them rarely, and with great weights. For regions of the scene's surfaces, the guide holds
//! a density of directions proportional to the root of the mean square of incident light. Paths draw from it and from
//! their BSDF, in shares that each region has learned, and divide by the density of the mixture. So the guide changes
//! the noise of a picture, never its mean.
//!
//! The guide is a function of the scene, the view and the number of samples planned. It is learned with its own seed
//! from whole paths all over the picture, in passes; the vertices are processed in the order of the paths. How long
//! learning goes on, and where the picture uses it, depends on what was learned and on counted work, never on a clock.
//! So all machines that render a picture guide their paths alike.
//!
//! Sources: Müller, Gross, Novák 2017, *Practical Path Guiding for Efficient Light-Transport Simulation* (a tree over
//! space, learning in passes that double); Rath et al. 2020, *Variance-Aware Path Guiding* (the root of the mean square
//! as target); Müller 2019, *Path Guiding in Production*, section 10.5 (a learned share of the BSDF).

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

pub(crate) use agent::RegionAgent;
pub(crate) use budget::LearningBudget;
pub use bytes::UnreadGuide;
pub(crate) use plan::{PaintPlan, PaintingWay};
pub(crate) use train::{FoundLight, LearningPath, Trail, Training};
pub(crate) use tree::{Guide, Region};
