//! The shaders against the processor: the same function of the same thousands of random inputs.

mod compare;
mod device;
mod heads;
mod kinds;
mod limits;
mod numbers;
mod scattering;
mod textures;
