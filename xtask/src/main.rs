//! Commands for developers: `cargo xtask ci | test | fresh | wheel | package | systems | manual | python-stubs | engines | leaks
//! | farm | soak | fuzzy-reference`.
#![allow(clippy::print_stdout, reason = "a command line speaks to its user")]

mod absences;
mod bars;
mod beside;
mod blender;
mod cargo;
mod ci;
#[cfg(test)]
mod circles;
mod cost;
mod deny;
mod engines;
mod farm;
#[cfg(test)]
mod features;
#[cfg(test)]
mod folders;
mod fresh;
mod fuzzy_reference;
mod layers;
mod leaks;
mod links;
mod manual;
mod maps;
#[cfg(test)]
mod method_circles;
#[cfg(test)]
mod module_heads;
#[cfg(test)]
mod modules;
mod needs;
mod node;
mod package;
#[cfg(test)]
mod prose;
mod python;
mod run_head;
mod soak;
mod spelling;
mod suite;
mod symbols;
mod systems;
#[cfg(test)]
mod type_names;
#[cfg(test)]
mod vocabulary;
mod wheel;

use anyhow::Result;
use clap::Parser;

/// The commands of a developer of Bottega.
#[derive(Parser)]
#[command(bin_name = "cargo xtask", version)]
enum Command {
    /// All that continuous integration runs: format, lints, documentation, dependencies (cargo deny), then `test` with `systems` beside it.
    Ci,
    /// Every test, with a summary of what failed and what was skipped. Says first what it installs: packages of the system
    /// (Mesa's software Vulkan, `xmllint`, a NATS server, POV-Ray, Python, Chromium), pinned Python packages below `target/python`, and what drives the browser below
    /// `target/node`.
    Test {
        /// Only the tests that need this: a farm, a browser, Python, other engines, a GPU. Default: all tests.
        group: Option<suite::TestGroup>,
    },
    /// The README's two commands on a fresh machine: a bare Debian with Rust alone, made by mmdebstrap. Only as root.
    Fresh(fresh::FreshArgs),
    /// The Python wheel, with the module and the program: `target/wheels`. Some ten minutes; installs maturin and zig below
    /// `target/python` before.
    Wheel(wheel::WheelArgs),
    /// Makes the pages of the manual that come from the program: commands, and fields of requests.
    Manual(manual::ManualArgs),
    /// Packages: a tarball, a .deb, the licences of all that is compiled in, the bill of materials: `target/packages`.
    Package(package::PackageArgs),
    /// The Blender add-on: its archives in `target/blender`, installed into a fresh profile, and an F12. Installs `bpy` below
    /// `target/blender`, and takes or builds the wheel.
    Blender(blender::BlenderArgs),
    /// Checks that everything compiles for Windows and macOS. Installs their standard libraries by rustup, and zig below
    /// `target/python`.
    Systems,
    /// Makes the Python classes of requests from their schema.
    PythonStubs,
    /// The tests with other people's engines, the checks of their workers, and the bars: pictures in zones are those that
    /// engines render of whole frames by themselves. POV-Ray and Mitsuba, which are installed where they can be.
    Engines(engines::EnginesArgs),
    /// Casts rays from inside closed meshes and fails when one gets out.
    Leaks {
        /// Number of rays; 1e9 is the number to publish, some minutes per core.
        #[arg(long, default_value_t = 1e9)]
        rays: f64,
    },
    /// Measures a farm of real processes on this machine: what the way over a server costs, what a machine costs that waits,
    /// and how long a picture takes while somebody is killed every few seconds. Some minutes; nothing else should run.
    Farm(farm::FarmArgs),
    /// Runs a farm of real processes through random events from a seed: jobs submitted, painted again, paused and called off; machines,
    /// server and `up` killed; guests that join and leave; by command line, HTTP and Python in turn. Fails when the doors differ, a picture
    /// has other bits, or a job waits while a machine is free.
    Soak(soak::SoakArgs),
    /// Evaluates rules by an independent fuzzy library, and keeps the numbers for the tests of bottega-fuzzy.
    FuzzyReference {
        /// A Python 3 that has pyfuzzylite.
        #[arg(long, default_value = "python3")]
        python: String,
    },
}

fn main() -> Result<()> {
    match Command::parse() {
        Command::Ci => ci::ci(),
        Command::Test { group } => ci::test(group),
        Command::Fresh(args) => fresh::fresh(&args),
        Command::Wheel(args) => wheel::wheel(&args),
        Command::Manual(args) => manual::manual(&args),
        Command::Package(args) => package::package(&args),
        Command::Blender(args) => blender::blender(&args),
        Command::Systems => systems::systems(),
        Command::PythonStubs => wheel::python_stubs(),
        Command::Engines(args) => engines::engines(&args),
        Command::Leaks { rays } => leaks::leaks(rays),
        Command::Farm(args) => farm::farm(&args),
        Command::Soak(args) => soak::soak(&args),
        Command::FuzzyReference { python } => fuzzy_reference::fuzzy_reference(&python),
    }
}
