//! Times, memory and errors of all ways to paint.

use bottega_image::{Canvas, FlipOptions, Picture, flip};

use super::{elsewhere::ElsewhereResult, ludd::UsefulData, ways::MethodResult};
use crate::error::Error;

/// FLIP above which a pixel looks wrong.
const WRONG: f32 = 0.1;

/// How shadows by agents differ from those by rays, all else being equal.
#[derive(Clone, Debug)]
pub(super) struct Shadows {
    pub(super) name: String,
    /// Share of the shadow rays that were traced.
    pub(super) traced: f64,
    /// Share of the pixels that look wrong.
    pub(super) wrong: f64,
    /// Both pictures, by agents and by rays.
    pub(super) pictures: [Picture; 2],
}

/// Times, memory and errors of all ways to paint, and their pictures.
pub(super) struct AlaReport {
    pub(super) samples: u32,
    pub(super) reference: Picture,
    /// Photon mapping of the paper's comparison; all else is told beside it.
    pub(super) photons: MethodResult,
    /// The same with cache and shadow photons, with the paper's four maps, paths, agents of the paper, and our own.
    pub(super) others: Vec<MethodResult>,
    /// Photons and our agents with other budgets.
    pub(super) budgets: Vec<MethodResult>,
    pub(super) shadows: Vec<Shadows>,
    /// Photon mapping with four maps, agents of the paper and our own without indirect light.
    pub(super) without_indirect: Vec<MethodResult>,
    /// Agents beside photon mapping in other scenes.
    pub(super) elsewhere: Vec<ElsewhereResult>,
    /// The proximity network of some of our agents, over the scene of the paper.
    pub(super) network: Canvas,
    pub(super) useful_data: Vec<UsefulData>,
}

impl AlaReport {
    /// Our own agents of the paper's comparison.
    pub(super) fn ours(&self) -> Option<&MethodResult> {
        self.others.last()
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &MethodResult> {
        std::iter::once(&self.photons).chain(&self.others).chain(&self.budgets)
    }

    /// Photon mapping with the four maps of the paper.
    pub(super) fn four_maps(&self) -> Option<&MethodResult> {
        self.others.get(1)
    }

    /// Photon mapping, and photon mapping as the paper had it.
    pub(super) fn baselines(&self) -> impl Iterator<Item = &MethodResult> {
        std::iter::once(&self.photons).chain(self.others.iter().take(2))
    }

    /// Of all budgets of our agents the one that is first at the error of some photon mapping, casting included.
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
