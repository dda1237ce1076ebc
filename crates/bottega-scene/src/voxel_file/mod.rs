//! Files of sparse voxels: OpenVDB (`.vdb`) and NanoVDB (`.nvdb`).
//!
//! Both have named grids in trees of three levels: below a root, nodes of 32³ nodes of 16³ leaves of 8³ voxels. A value
//! lies at its integer coordinates in index space; between, values are interpolated linearly. Tiles, which have one
//! value for a whole node, and leaves are taken over as a [`VoxelGrid`](voxels::VoxelGrid).

mod blosc;
mod cursor;
mod error;
mod format;
mod lattice;
pub(crate) mod medium;
mod nanovdb;
mod nodes;
mod openvdb;
pub(crate) mod scene;
mod voxels;

pub(crate) use self::format::recognizes;
pub use self::medium::Voxels;
