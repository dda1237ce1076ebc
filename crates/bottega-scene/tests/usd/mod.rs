//! Stages of USD: what they become, and what is said of those that are wrong.

mod composition;
mod fuzz;
mod geometry;
mod lights;
mod materials;
mod shared_scenes;
mod subdivision;
mod support;
