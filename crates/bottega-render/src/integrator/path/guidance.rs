//! Guidance of a path at a vertex by a guide and its agents.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::state::Path;
use crate::{
    bsdf::{BsdfAt, BsdfSample, LobeFlags, warp::ONE_MINUS_EPSILON},
    density::SolidAnglePdf,
    guide::{Region, RegionAgent},
    interaction::Interaction,
    lights::Choice,
    sampler::Quad,
};

/// The leaf number that stands for no leaf of a guide.
pub(super) const NO_LEAF: u32 = u32::MAX;

/// The learned data at a vertex. [`Guidance::NONE`] changes nothing: the BSDF draws directions, and the light tree
/// draws lights.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct Guidance<'a> {
    /// Distribution of incident light; `None`: not guided.
    region: Option<&'a Region>,
    /// Learned choice of lights, and data for roulette and splitting.
    agent: Option<&'a RegionAgent>,
    /// Number of the leaf of both; [`NO_LEAF`]: none.
    leaf: u32,
}

impl<'a> Guidance<'a> {
    /// No learned data.
    pub(in crate::integrator) const NONE: Self = Self { region: None, agent: None, leaf: NO_LEAF };

    /// Returns `true` if directions are drawn by the guide, too.
    #[inline(always)]
    pub(super) fn is_guided(&self) -> bool {
        self.region.is_some()
    }

    /// Returns the number of the guide's leaf; [`NO_LEAF`]: none.
    #[inline(always)]
    pub(super) fn leaf(&self) -> u32 {
        self.leaf
    }

    /// Returns the agent of the region; `None`: none.
    #[inline(always)]
    pub(super) fn agent(&self) -> Option<&'a RegionAgent> {
        self.agent
    }

    /// Returns the learned choice of lights; `None`: none was learned there.
    #[inline(always)]
    pub(super) fn lights(&self) -> Option<&'a Choice> {
        self.agent?.lights()
    }

    /// Returns the density of a direction, given the BSDF's density of it.
    #[inline(always)]
    pub(super) fn pdf(&self, wi: Vec3, bsdf_pdf: SolidAnglePdf) -> SolidAnglePdf {
        match self.region {
            None => bsdf_pdf,
            Some(region) => SolidAnglePdf::new(mixed(region.share(), region.pdf(wi), bsdf_pdf.per_sr())),
        }
    }

    /// Samples a direction by the guide and the BSDF. Returns the sample with the density of the mixture, and the
    /// density of the BSDF alone. `None`: the path ends.
    #[inline(always)]
    pub(super) fn sample(&self, point: &Interaction, bsdf: &BsdfAt<'_>, u: Quad) -> Option<(BsdfSample, f32)> {
        match self.region {
            Some(region) => guided_sample(point, bsdf, region, u),
            None => bsdf.sample(u[0], [u[1], u[2]]).map(|sample| (sample, sample.pdf)),
        }
    }
}

impl<'a> Path<'a> {
    /// Looks up the learned data at the point where the path arrived, and prefetches what sampling reads first. All paths
    /// in turn do so before any of them is shaded.
    #[inline(always)]
    pub(in crate::integrator) fn look_up<const AGENTS: bool>(&self, point: &Interaction) -> Guidance<'a> {
        let known = self.integrator.prepared.material(point.material).1;
        let mut guidance = Guidance::NONE;
        // Perfect mirrors and glass need no guidance
        if let Some(sides) = &known.bsdfs
            && sides[usize::from(point.front)].is_delta_only()
        {
            return guidance;
        }
        // No closures here: they are compiled without the vector unit's instructions
        // Find the leaf of the guide at the point; rays through glass keep their BSDF's directions
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
        if let Some(region) = guidance.region {
            region.request();
        }
        if let Some(agent) = guidance.agent {
            agent.request();
        }
        guidance
    }

    /// Returns the learned choice of lights at the previous vertex; `None`: none was learned there.
    #[inline(always)]
    pub(super) fn previous_choice(&self) -> Option<&Choice> {
        self.guide?.agent(self.previous.leaf as usize)?.lights()
    }
}

/// Samples the mixture of guide and BSDF. Returns the sample with the density of the mixture, and the density of the
/// BSDF alone.
#[inline(always)]
fn guided_sample(point: &Interaction, bsdf: &BsdfAt<'_>, region: &Region, u: Quad) -> Option<(BsdfSample, f32)> {
    let share = region.share();
    // Sample the guide
    if u[0] < share {
        let (wi, guide_pdf) = region.sample([u[1], u[2]]);
        let wi = point.to_local(wi);
        let (value, bsdf_pdf) = bsdf.eval_pdf(wi);
        let pdf = mixed(share, guide_pdf, bsdf_pdf);
        let lobe = LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE);
        return (value != Spectrum::ZERO).then_some((BsdfSample { wi, value, pdf, lobe, eta: 1.0 }, bsdf_pdf));
    }
    // Sample the BSDF
    let rest = ((u[0] - share) / (1.0 - share)).min(ONE_MINUS_EPSILON);
    let sample = bsdf.sample(rest, [u[1], u[2]])?;
    let guide_pdf = if sample.is_delta() { 0.0 } else { region.pdf(point.to_world(sample.wi)) };
    Some((BsdfSample { pdf: mixed(share, guide_pdf, sample.pdf), ..sample }, sample.pdf))
}

/// Returns the density of the mixture of guide and BSDF.
#[inline(always)]
fn mixed(share: f32, guide_pdf: f32, bsdf_pdf: f32) -> f32 {
    share * guide_pdf + (1.0 - share) * bsdf_pdf
}
