//! Pictures against known answers, equal means and equal bits.

mod agents;
mod determinism;
mod furnace;
mod guiding;
mod known_answers;
mod layers;
mod light_groups;
mod lighting_agents;
mod lookouts;
mod media;
mod mitsuba;
mod motion;
mod no_negative_light;
mod pbrt;
mod photon_options;
mod photon_scenes;
mod photons;
mod scenes;
mod sheets;
mod soft_lights;
mod speckles;
mod strategies;
mod subsurface;
mod sums;
mod surveys;
mod visibility;
