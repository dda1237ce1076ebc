//! Tests that need more than Rust, as named groups: `cargo xtask test GROUP` runs one of them alone.

use clap::ValueEnum;

/// A group of tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(crate) enum TestGroup {
    /// Farms of real processes: they need a NATS server.
    Farm,
    /// The page in Chromium, and its scripts in Node.js.
    Browser,
    /// The Python module: it needs Python with NumPy, pytest and mypy.
    Python,
    /// Other renderers: they need POV-Ray and Mitsuba.
    Engines,
    /// GPU kernels: they need a Vulkan driver, such as Mesa's software one.
    Gpu,
}

/// The tests of one package that belong to a group.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    pub(crate) group: TestGroup,
    pub(crate) package: &'static str,
    /// The modules of the test program whose tests belong to it. Empty: the whole program.
    pub(crate) modules: &'static [&'static str],
    /// The measured number of processors that it keeps busy; it waits for the rest of its time.
    pub(crate) load: f64,
}

/// All parts, the longest first.
pub(crate) const PARTS: &[Part] = &[
    Part { group: TestGroup::Farm, package: "bottega-cli", modules: &["farm"], load: 1.0 },
    Part { group: TestGroup::Browser, package: "bottega-cli", modules: &["page"], load: 0.7 },
    Part { group: TestGroup::Python, package: "bottega-python", modules: &[], load: 1.0 },
    Part { group: TestGroup::Engines, package: "bottega-cli", modules: &["engines"], load: 1.0 },
    Part { group: TestGroup::Gpu, package: "bottega-gpu", modules: &[], load: 1.0 },
    Part { group: TestGroup::Farm, package: "bottega-bench", modules: &["farm"], load: 0.5 },
    Part { group: TestGroup::Browser, package: "bottega-web", modules: &["scripts"], load: 1.0 },
];

/// Returns packages whose programs a group's tests need, in addition to those of its parts.
pub(crate) fn beside(group: TestGroup) -> &'static [&'static str] {
    match group {
        // The example `submit`, and the Python module for the short soak test.
        TestGroup::Farm => &["bottega-cluster", "bottega-python"],
        // The program, with which the module is compared.
        TestGroup::Python => &["bottega-cli"],
        TestGroup::Browser | TestGroup::Engines | TestGroup::Gpu => &[],
    }
}
