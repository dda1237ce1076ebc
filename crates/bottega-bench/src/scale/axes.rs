//! The axes: what grows, how far, and what is measured over it.

use std::{sync::Arc, time::Instant};

use bottega::{Event, Request, Session, StopSwitch};
use bottega_farm::simulate::{FarmSpec, Plan, SyntheticSpread, Workpiece, simulate};
use clap::ValueEnum;

use super::{
    curve::Curve,
    render::{self, SizedRender},
};
use crate::error::Error;

/// The quantity that grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum GrowthAxis {
    /// Triangles of a terrain.
    Triangles,
    /// Small lights above a floor.
    Lights,
    /// Textures of 128 × 128 texels.
    Textures,
    /// Pixels of a picture.
    Pixels,
    /// Samples per pixel.
    Samples,
    /// Zones of a picture.
    Zones,
    /// Simulated agents, with ten zones each.
    Agents,
}

/// A quantity that is measured over an axis.
pub(super) struct Quantity {
    name: &'static str,
    law: &'static str,
    expected: [f64; 2],
}

impl Quantity {
    /// Returns the empty curve of this quantity.
    pub(super) fn curve(&self, axis: GrowthAxis) -> Curve {
        let &Self { name, law, expected } = self;
        Curve { axis: axis.word(), quantity: name, law, expected, exponent: None, points: Vec::new() }
    }
}

const fn quantity(name: &'static str, law: &'static str, expected: [f64; 2]) -> Quantity {
    Quantity { name, law, expected }
}

/// Seconds of a render that should hardly depend on the size.
const LOGARITHMIC: [f64; 2] = [-0.1, 0.3];
/// Seconds or bytes in proportion to the size.
const LINEAR: [f64; 2] = [0.8, 1.1];
/// Seconds of sorting.
const N_LOG_N: [f64; 2] = [0.9, 1.2];

impl GrowthAxis {
    /// Returns the name of the axis, in the plural.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Triangles => "triangles",
            Self::Lights => "lights",
            Self::Textures => "textures",
            Self::Pixels => "pixels",
            Self::Samples => "samples",
            Self::Zones => "zones",
            Self::Agents => "agents",
        }
    }

    /// Returns the measured quantities, in the order of [`Self::measure`].
    pub(super) fn quantities(self) -> &'static [Quantity] {
        const TRIANGLES: [Quantity; 3] = [
            quantity("preparing the scene, s", "n log n", N_LOG_N),
            quantity("rendering 256 × 256 pixels, 4 samples, s", "log n", LOGARITHMIC),
            quantity("prepared memory, MB", "n", LINEAR),
        ];
        const LIGHTS: [Quantity; 3] = [
            quantity("preparing the scene, s", "n log n", N_LOG_N),
            quantity("rendering 256 × 256 pixels, 4 samples, s", "log n", LOGARITHMIC),
            quantity("prepared memory, MB", "n", LINEAR),
        ];
        const TEXTURES: [Quantity; 2] = [
            quantity("preparing the scene, s", "n", LINEAR),
            quantity("rendering 256 × 256 pixels, 4 samples, s", "1", LOGARITHMIC),
        ];
        const PIXELS: [Quantity; 1] = [quantity("rendering 4 samples per pixel, s", "n", LINEAR)];
        const SAMPLES: [Quantity; 1] = [quantity("rendering 128 × 128 pixels, s", "n", LINEAR)];
        const ZONES: [Quantity; 1] = [quantity("painting 512 × 512 pixels by two agents, s", "1, then n", [-0.1, 1.1])];
        const AGENTS: [Quantity; 3] = [
            quantity("messages per zone", "1", [-0.1, 0.2]),
            quantity("makespan over its lower bound", "1", [-0.1, 0.1]),
            quantity("simulating it, s", "n log n", [0.9, 1.4]),
        ];
        match self {
            Self::Triangles => &TRIANGLES,
            Self::Lights => &LIGHTS,
            Self::Textures => &TEXTURES,
            Self::Pixels => &PIXELS,
            Self::Samples => &SAMPLES,
            Self::Zones => &ZONES,
            Self::Agents => &AGENTS,
        }
    }

    /// Returns the sizes, ascending.
    pub(super) fn sizes(self, is_small: bool) -> Vec<u64> {
        let (first, factor, count, small) = match self {
            Self::Triangles => (10_000, 10, 4, 2),
            Self::Lights => (1, 10, 5, 4),
            Self::Textures => (1, 4, 6, 4),
            Self::Pixels => (64 * 64, 4, 6, 4),
            Self::Samples => (1, 4, 6, 4),
            Self::Zones => (4, 4, 7, 5),
            Self::Agents => (1, 10, 5, 3),
        };
        let sizes = std::iter::successors(Some(first), |size| Some(size * factor));
        sizes.take(if is_small { small } else { count }).collect()
    }

    /// Measures one size. Returns a value for each of [`Self::quantities`].
    pub(super) fn measure(self, size: u64, threads: usize) -> Result<Vec<f64>, Error> {
        let usual = SizedRender { side: 256, samples: 4, threads };
        match self {
            Self::Triangles => Ok(usual.of(render::terrain(size))?.to_vec()),
            Self::Lights => Ok(usual.of(render::lit_floor(size))?.to_vec()),
            Self::Textures => Ok(usual.of(render::tiles(size))?[..2].to_vec()),
            Self::Pixels => {
                let side = (size as f64).sqrt().round() as u32;
                Ok(vec![SizedRender { side, ..usual }.of(render::lit_floor(4))?[1]])
            }
            Self::Samples => {
                let picture = SizedRender { side: 128, samples: size as u32, threads };
                Ok(vec![picture.of(render::lit_floor(4))?[1]])
            }
            Self::Zones => Ok(vec![zones(size as u32, threads)?]),
            Self::Agents => agents(size as usize),
        }
    }
}

/// Paints a picture of many zones by two agents. Returns the seconds.
fn zones(count: u32, threads: usize) -> Result<f64, Error> {
    let mut request = Request::new("a lit floor");
    request.film.size = Some([512, 512]);
    request.goal.samples = Some(1);
    request.work.zones = Some(count);
    request.work.agents = Some(2);
    request.work.zone_min_size = 1;
    request.devices.names = vec!["cpu".to_owned()];
    request.devices.threads = u16::try_from(threads).ok();
    let session = Session::of_scene(&request, render::lit_floor(4))?;
    let begun = Instant::now();
    session.render(Arc::new(|_: Event| {}), &StopSwitch::new())?;
    Ok(begun.elapsed().as_secs_f64())
}

/// Simulates equal agents with ten zones each. Returns messages per zone, makespan over its lower bound, seconds.
fn agents(count: usize) -> Result<Vec<f64>, Error> {
    let piece = Arc::new(Workpiece::synthetic(10 * count, &SyntheticSpread::default(), 1)?);
    let begun = Instant::now();
    let outcome = simulate(&piece, &Plan::calm(FarmSpec::equal(count), 1))?;
    let seconds = begun.elapsed().as_secs_f64();
    Ok(vec![outcome.messages_per_zone(), 1.0 / outcome.efficiency().max(1e-12), seconds])
}
