//! The identity of this build of the farm: another build may render different bits or use other messages.

use std::sync::LazyLock;

use bottega::identity::{Build, Provenance};

const PROVENANCE: Provenance =
    bottega_build::provenance!("bottega-web", "bottega-python", "bottega-bench", "bottega-cli");

static BUILD: LazyLock<Build> = LazyLock::new(|| Build::new(PROVENANCE));

/// Returns the identity and the commit of this build: of this crate and its dependencies, the library included.
pub fn build() -> &'static Build {
    &BUILD
}
