//! Which build of the farm this is: machines of another one neither paint the same bits nor read the same messages for certain.

use std::sync::LazyLock;

use bottega::identity::{Build, Provenance};

const PROVENANCE: Provenance =
    bottega_build::provenance!("bottega-web", "bottega-python", "bottega-bench", "bottega-cli");

static BUILD: LazyLock<Build> = LazyLock::new(|| Build::new(PROVENANCE));

/// The build of this crate, the library among what it is made of.
pub fn build() -> &'static Build {
    &BUILD
}
