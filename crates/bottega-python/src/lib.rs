//! The Python module `bottega._native`: the library and the farm, as Python calls them.
//!
//! No logic of its own: requests come in as JSON, which [`bottega::Request`] reads and checks; pictures go out as arrays that look into
//! the film. What Python needs beyond that is in the crates below, so that Rust has it, too. The decision that shaped it: *the thread
//! that calls never paints*. It waits without the interpreter's lock, runs callbacks, and sees Ctrl-C, while other threads paint and
//! hold no Python object. So a callback cannot stop a painter, and whatever a callback raises comes out of the call.
//!
//! The files of Python are in `python/bottega`: `__init__.py` says what is public, `_requests.py` is made from the schema of requests
//! by `cargo xtask python-stubs`, and `_native.pyi` has the types of what is here.
//!
//! # Modules
//!
//! | what | where |
//! |---|---|
//! | waiting for work on another thread: callbacks, Ctrl-C | `src/waiting.rs` |
//! | sessions; what is shown meanwhile | `src/session.rs` |
//! | pictures; arrays that look into the film; files | `src/picture.rs`, `src/arrays.rs`, `src/image_file.rs` |
//! | scenes made of arrays | `src/scene.rs`, `src/material.rs` |
//! | importance maps, zones, rules, differences | `src/analysis.rs`, `src/rules.rs`, `src/difference.rs` |
//! | farms | `src/farm.rs` |
//! | errors as exceptions | `src/errors.rs` |
//! | processes that were forked, interpreters that end | `src/process.rs` |

mod analysis;
mod arrays;
mod difference;
mod errors;
mod farm;
mod image_file;
mod material;
mod picture;
mod process;
mod request;
mod rules;
mod scene;
mod session;
mod values;
mod waiting;

/// What `bottega._native` holds.
#[pyo3::pymodule]
mod _native {
    #[pymodule_export]
    use super::{
        analysis::{PyAnalysis, analyze},
        difference::diff,
        farm::PyFarm,
        image_file::{PyImageFile, read},
        material::PyMaterial,
        picture::PyPicture,
        process::stop_all,
        request::{check_request, schema},
        rules::{check_rules, evaluate_rules, explain_rules},
        scene::PyScene,
        session::PySession,
    };

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
