//! Tests that compare shaders with the CPU: the same functions of the same thousands of random inputs.

mod compare;
mod device;
mod heads;
mod kinds;
mod limits;
mod numbers;
mod scattering;
mod textures;
