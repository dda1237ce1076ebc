//! Results printed in the paper (Herubel, Biri and Deverly 2009, tables 2 and 3): 1600 × 1200 on four cores of a Core i7 920.

/// Seconds for casting photons, and for casting agents and their exploration.
pub(super) const CASTING: [f64; 2] = [46.0, 27.0];
/// Megabytes of the direct, indirect, caustic and shadow photon maps.
pub(super) const MAPS: [f64; 4] = [18.0, 9.4, 0.004, 4.9];
/// Megabytes of the agents and their network.
pub(super) const AGENTS: f64 = 5.2;
/// Seconds of rendering, with photons and with agents.
pub(super) const RENDERING: [f64; 2] = [21570.0, 16557.0];
