//! Guidance: what a guide and its agents say of a point where a path is scattered.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::state::Path;
use crate::{
    bsdf::{BsdfAt, BsdfSample, LobeFlags, warp::ONE_MINUS_EPSILON},
    guide::{Agent, Region},
    interaction::Interaction,
    lights::Choice,
    sampler::Quad,
    surfaces::PreparedMaterial,
};

/// No leaf of a guide.
pub(super) const NO_LEAF: u32 = u32::MAX;

/// What is known of the light at a point. [`Guidance::NONE`] changes nothing: paths go where the BSDF sends them, and lights
/// are drawn by the tree.
#[derive(Clone, Copy)]
pub(super) struct Guidance<'a> {
    /// Where light comes from.
    region: Option<&'a Region>,
    /// What agents know beside.
    agent: Option<&'a Agent>,
    /// The leaf of both.
    leaf: u32,
}

impl<'a> Guidance<'a> {
    pub(super) const NONE: Self = Self { region: None, agent: None, leaf: NO_LEAF };

    #[inline(always)]
    pub(super) fn is_guided(&self) -> bool {
        self.region.is_some()
    }

    #[inline(always)]
    pub(super) fn leaf(&self) -> u32 {
        self.leaf
    }

    #[inline(always)]
    pub(super) fn agent(&self) -> Option<&'a Agent> {
        self.agent
    }

    /// Which lights matter.
    #[inline(always)]
    pub(super) fn lights(&self) -> Option<&'a Choice> {
        self.agent?.lights()
    }

    /// Density of a direction that the BSDF alone draws with `bsdf_pdf`.
    #[inline(always)]
    pub(super) fn pdf(&self, wi: Vec3, bsdf_pdf: f32) -> f32 {
        match self.region {
            None => bsdf_pdf,
            Some(region) => mixed(region.share(), region.pdf(wi), bsdf_pdf),
        }
    }

    /// Draws where the path goes on. Tells the density of the BSDF alone as well.
    #[inline(always)]
    pub(super) fn sample(&self, point: &Interaction, bsdf: &BsdfAt<'_>, u: Quad) -> Option<(BsdfSample, f32)> {
        match self.region {
            Some(region) => guided_sample(point, bsdf, region, u),
            None => bsdf.sample(u[0], [u[1], u[2]]).map(|sample| (sample, sample.pdf)),
        }
    }
}

impl<'a> Path<'a> {
    /// What is known of the light at a point that spreads some.
    #[inline(always)]
    pub(super) fn guidance<const AGENTS: bool>(&self, point: &Interaction, known: &PreparedMaterial) -> Guidance<'a> {
        let mut guidance = Guidance::NONE;
        // (Closures are not compiled for the vector unit: there are none where it is busy.)
        let Some(guide) = self.guide else { return guidance };
        if !AGENTS {
            if !known.transmits {
                guidance.region = guide.at(point.p, point.frame[2]);
            }
        } else if let Some(number) = guide.leaf(point.p, point.frame[2]) {
            if self.integrator.settings.guiding && !known.transmits {
                guidance.region = guide.region(number);
            }
            guidance.agent = guide.agent(number);
            guidance.leaf = number as u32;
        }
        guidance
    }

    /// What is known of the lights where the path comes from.
    #[inline(always)]
    pub(super) fn previous_choice(&self) -> Option<&Choice> {
        self.guide?.agent(self.previous.leaf as usize)?.lights()
    }
}

/// Draws a direction by the guide or the BSDF, with the density of both together, and tells that of the BSDF as well.
#[inline(always)]
fn guided_sample(point: &Interaction, bsdf: &BsdfAt<'_>, region: &Region, u: Quad) -> Option<(BsdfSample, f32)> {
    let share = region.share();
    if u[0] < share {
        let (wi, guide_pdf) = region.sample([u[1], u[2]]);
        let wi = point.to_local(wi);
        let (value, bsdf_pdf) = bsdf.eval_pdf(wi);
        let pdf = mixed(share, guide_pdf, bsdf_pdf);
        let lobe = LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE);
        return (value != Spectrum::ZERO).then_some((BsdfSample { wi, value, pdf, lobe, eta: 1.0 }, bsdf_pdf));
    }
    let rest = ((u[0] - share) / (1.0 - share)).min(ONE_MINUS_EPSILON);
    let sample = bsdf.sample(rest, [u[1], u[2]])?;
    let guide_pdf = if sample.is_delta() { 0.0 } else { region.pdf(point.to_world(sample.wi)) };
    Some((BsdfSample { pdf: mixed(share, guide_pdf, sample.pdf), ..sample }, sample.pdf))
}

/// Density of a choice between the guide and the BSDF.
#[inline(always)]
fn mixed(share: f32, guide_pdf: f32, bsdf_pdf: f32) -> f32 {
    share * guide_pdf + (1.0 - share) * bsdf_pdf
}
