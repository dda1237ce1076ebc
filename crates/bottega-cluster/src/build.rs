//! The identity of this build of the farm: another one may paint other bits or write other messages.

use std::sync::LazyLock;

use bottega::identity::{Build, Provenance};

const PROVENANCE: Provenance =
    bottega_build::provenance!("bottega-web", "bottega-python", "bottega-bench", "bottega-cli");

static BUILD: LazyLock<Build> = LazyLock::new(|| Build::new(PROVENANCE));

/// The build of this crate, the library among what it is made of.
pub fn build() -> &'static Build {
    &BUILD
}
