//! The results of all methods: times, memory and errors.

use bottega_image::{Canvas, FlipOptions, Picture, flip};

use super::{elsewhere::ElsewhereResult, ludd::UsefulData, ways::MethodResult};
use crate::error::Error;

/// The FLIP error above which a pixel counts as wrong.
const WRONG: f32 = 0.1;

/// The difference between shadows by agents and by rays, with all else equal.
#[derive(Clone, Debug)]
pub(super) struct Shadows {
    pub(super) name: String,
    /// The share of shadow rays that were traced.
    pub(super) traced: f64,
    /// The share of wrong pixels.
    pub(super) wrong: f64,
    /// The images by agents and by rays.
    pub(super) pictures: [Picture; 2],
}

/// The results and images of all methods.
pub(super) struct AlaReport {
    pub(super) samples: u32,
    pub(super) reference: Picture,
    /// Photon mapping, to which all others are compared.
    pub(super) photons: MethodResult,
    /// Photon mapping with cache and shadow photons, the same with the paper's four maps, paths, the paper's agents, and our own.
    pub(super) others: Vec<MethodResult>,
    /// Photons and our agents with other budgets.
    pub(super) budgets: Vec<MethodResult>,
    pub(super) shadows: Vec<Shadows>,
    /// Photon mapping with four maps, the paper's agents and our own, without indirect light.
    pub(super) without_indirect: Vec<MethodResult>,
    /// Agents and photon mapping in other scenes.
    pub(super) elsewhere: Vec<ElsewhereResult>,
    /// The proximity network of some of our agents, over the paper's scene.
    pub(super) network: Canvas,
    pub(super) useful_data: Vec<UsefulData>,
}

impl AlaReport {
    /// Returns the result of our own agents.
    pub(super) fn ours(&self) -> Option<&MethodResult> {
        self.others.last()
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &MethodResult> {
        std::iter::once(&self.photons).chain(&self.others).chain(&self.budgets)
    }

    /// Returns the result of photon mapping with the paper's four maps.
    pub(super) fn four_maps(&self) -> Option<&MethodResult> {
        self.others.get(1)
    }

    /// Returns the results of photon mapping, plain and as in the paper.
    pub(super) fn baselines(&self) -> impl Iterator<Item = &MethodResult> {
        std::iter::once(&self.photons).chain(self.others.iter().take(2))
    }

    /// Returns the budget of our agents that reaches a baseline's error first, casting included.
    pub(super) fn best(&self, baseline: &MethodResult) -> Option<&MethodResult> {
        let error = baseline.error();
        let total = |result: &MethodResult| result.seconds_to(error).map(|seconds| seconds + result.casting);
        let ours = self.ours().into_iter().chain(self.budgets.iter().filter(|result| result.agents.is_some()));
        ours.filter(|result| total(result).is_some())
            .min_by(|a, b| total(a).unwrap_or(f64::MAX).total_cmp(&total(b).unwrap_or(f64::MAX)))
    }
}

impl Shadows {
    pub(super) fn new(agents: &MethodResult, rays: &MethodResult) -> Result<Self, Error> {
        let error = flip(&rays.picture, &agents.picture, &FlipOptions::default())?;
        let wrong = error.map.iter().filter(|&&error| error > WRONG).count();
        Ok(Self {
            name: agents.way.name.clone(),
            traced: agents.traced().unwrap_or(1.0),
            wrong: wrong as f64 / error.map.len().max(1) as f64,
            pictures: [agents.picture.clone(), rays.picture.clone()],
        })
    }
}
