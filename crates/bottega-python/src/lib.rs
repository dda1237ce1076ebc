//! The Python module `bottega._native`: bindings of the library and the farm.
//!
//! It has no logic of its own: requests come in as JSON, which [`bottega::Request`] reads and checks; pictures go out as arrays
//! that are views of the film. Functions that Python needs are in the crates below, so that Rust has them too. The decision
//! that shaped it: *the calling thread never renders*. It waits without the interpreter's lock, runs callbacks and sees Ctrl-C,
//! while other threads render and hold no Python object. So a callback cannot block a rendering thread, and an exception of a
//! callback is raised by the call.
//!
//! The Python files are in `python/bottega`: `__init__.py` lists the public names, `_requests.py` is generated from the schema
//! of requests by `cargo xtask python-stubs`, and `_native.pyi` has the types of this module.
//!
//! # Modules
//!
//! | subject | where |
//! |---|---|
//! | waiting for work on another thread: callbacks, Ctrl-C | `src/waiting.rs` |
//! | sessions; the picture while it is rendered | `src/session.rs`; `src/live.rs` |
//! | pictures; arrays as views of the film; files | `src/picture.rs`, `src/arrays.rs`, `src/image_file.rs` |
//! | scenes in memory; arrays as their input | `src/scene.rs`; `src/numpy_input.rs`, `src/image_input.rs` |
//! | grids of voxels for media; measured materials; profiles of lamps | `src/voxels.rs`; `src/measured.rs`; `src/ies.rs` |
//! | interactive views | `src/viewport.rs` |
//! | importance maps, zones, rules, differences | `src/analysis.rs`, `src/rules.rs`, `src/difference.rs` |
//! | farms; by HTTP | `src/farm.rs`; `src/http_farm.rs` |
//! | errors as exceptions | `src/errors.rs` |
//! | forked processes, the end of the interpreter | `src/process.rs` |

mod analysis;
mod arrays;
mod difference;
mod errors;
mod farm;
mod http_farm;
mod ies;
mod image_file;
mod image_input;
mod live;
mod measured;
mod numpy_input;
mod picture;
mod process;
mod request;
mod rules;
mod scene;
mod session;
mod values;
mod viewport;
mod voxels;
mod waiting;

/// The contents of `bottega._native`.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::{
        analysis::{PyAnalysis, analyze},
        difference::diff,
        farm::{PyFarm, farms},
        http_farm::{digests, preview_array, submission},
        ies::PyIesProfile,
        image_file::{PyImageFile, read},
        measured::PyMeasuredFile,
        picture::PyPicture,
        process::stop_all,
        request::{check_request, schema},
        rules::{check_rules, evaluate_rules, explain_rules},
        scene::PyScene,
        session::PySession,
        viewport::PyViewport,
        voxels::PyVoxels,
    };

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
