//! Where a path goes on.

use bottega_scene::Spectrum;

use super::{
    super::transport::{ROULETTE_SURVIVAL_MAX, SCATTERED_SPREAD},
    state::{NO_LEAF, Path, Previous},
};
use crate::{
    bsdf::{BsdfAt, BsdfSample, LobeFlags, warp::ONE_MINUS_EPSILON},
    guide::Region,
    interaction::Interaction,
    lights::Receiver,
    sampler::Quad,
};

impl Path<'_> {
    /// Chooses where the path goes on. False when it ends here.
    #[inline(always)]
    pub(super) fn scatter<const AGENTS: bool>(
        &mut self,
        point: &Interaction,
        receiver: Receiver,
        bsdf: &BsdfAt<'_>,
        region: Option<&Region>,
        leaf: u32,
        u: Quad,
    ) -> bool {
        let drawn = match region {
            Some(region) => guided_sample(point, bsdf, region, u),
            None => bsdf.sample(u[0], [u[1], u[2]]).map(|sample| (sample, sample.pdf)),
        };
        let Some((sample, bsdf_pdf)) = drawn else { return false };
        let wi = point.to_world(sample.wi);
        let is_reflection = point.is_reflection(wi);
        if (sample.wi.z > 0.0) != is_reflection {
            return false;
        }
        let is_delta = sample.is_delta();
        if let Some(trail) = &mut self.trail
            && !is_delta
        {
            trail.go(wi, bsdf_pdf, sample.pdf, self.radiance);
        }
        self.throughput *= sample.weight();
        if !is_reflection {
            let known = self.integrator.prepared.material(point.material).1;
            // Into the solid when the path came from its outside, else out of it.
            if known.parts_media {
                self.absorption = known.absorption[usize::from(point.front)];
            }
            self.roulette_scale *= sample.eta * sample.eta;
        }
        if !is_delta {
            self.cone.spread = self.cone.spread.max(SCATTERED_SPREAD / sample.pdf.sqrt());
            if region.is_some() {
                self.roulette_scale *= sample.pdf / bsdf_pdf.max(1e-6);
            }
        }
        let leaf = if AGENTS && self.integrator.settings.agents.lights { leaf } else { NO_LEAF };
        self.previous = Previous { receiver, pdf: (!is_delta).then_some(sample.pdf), leaf };
        self.origin = point.ray_origin(wi);
        self.direction = wi;
        self.depth += 1;
        // Where agents say what a path is worth, it is they who end it, at its next vertex.
        if AGENTS && self.integrator.splits {
            return self.throughput.max_element() > 0.0;
        }
        self.survives(u[3])
    }

    /// Russian roulette: a path goes on with the square root of what it still carries as its probability. With that part
    /// itself, error times vertices is up to an eighth larger (`bench/runs/2026-11-21-paths.txt`).
    #[inline(always)]
    fn survives(&mut self, u: f32) -> bool {
        let carried = self.throughput.max_element() * self.roulette_scale;
        if carried <= 0.0 || carried.is_nan() {
            return false;
        }
        if self.depth <= self.integrator.settings.roulette_depth {
            return true;
        }
        let survival = carried.sqrt().min(ROULETTE_SURVIVAL_MAX);
        self.throughput /= survival;
        u < survival
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
pub(super) fn mixed(share: f32, guide_pdf: f32, bsdf_pdf: f32) -> f32 {
    share * guide_pdf + (1.0 - share) * bsdf_pdf
}
