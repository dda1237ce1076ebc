//! Learning from paths.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::tree::{Guide, Record, face_of, place_of};
use crate::luminance;

/// Paths of the last pass, at most; each pass before has half as many as the next.
const PATHS_MAX: u32 = 1 << 16;
/// Passes.
const PASSES: u32 = 4;
/// Vertices of a path that are recorded.
const VERTICES_MAX: usize = 32;

/// A vertex of a path under way.
#[derive(Clone, Copy, Debug)]
struct Step {
    p: Vec3,
    normal: Vec3,
    /// What the path carried when it came, and had gathered.
    throughput: Spectrum,
    radiance: Spectrum,
    went: Option<Went>,
}

/// Where a path went on.
#[derive(Clone, Copy, Debug)]
struct Went {
    wi: Vec3,
    bsdf_pdf: f32,
    pdf: f32,
    /// What the path had gathered when it left.
    radiance: Spectrum,
}

/// The vertices of one path at which it could have gone elsewhere.
#[derive(Debug, Default)]
pub(crate) struct Trail {
    steps: Vec<Step>,
}

impl Trail {
    /// A path comes to a point with a normal, carries `throughput` and has gathered `radiance`.
    pub(crate) fn come(&mut self, p: Vec3, normal: Vec3, throughput: Spectrum, radiance: Spectrum) {
        if self.steps.len() < VERTICES_MAX {
            self.steps.push(Step { p, normal, throughput, radiance, went: None });
        }
    }

    /// It leaves the point where it came last in direction `wi` and has gathered `radiance`.
    pub(crate) fn go(&mut self, wi: Vec3, bsdf_pdf: f32, pdf: f32, radiance: Spectrum) {
        if let Some(step) = self.steps.last_mut()
            && step.went.is_none()
        {
            step.went = Some(Went { wi, bsdf_pdf, pdf, radiance });
        }
    }

    /// The path has ended with `radiance`.
    fn finish(&mut self, radiance: Spectrum, records: &mut Vec<Record>) {
        for (index, step) in self.steps.iter().enumerate() {
            let carried = luminance(step.throughput);
            let next = self.steps.get(index + 1);
            let mut record = Record {
                p: step.p,
                face: face_of(step.normal) as u8,
                has_next: next.is_some(),
                leaving: luminance(radiance - step.radiance) / carried,
                cell: 0,
                weight: next.map_or(0.0, |next| luminance(next.throughput) / carried),
                emitted: 0.0,
                pdf: 0.0,
                bsdf_pdf: 0.0,
                cube: 0.0,
            };
            if let Some(went) = step.went {
                (record.cell, record.cube) = place_of(went.wi);
                record.emitted = luminance(next.map_or(radiance, |next| next.radiance) - went.radiance) / carried;
                (record.pdf, record.bsdf_pdf) = (went.pdf, went.bsdf_pdf);
            }
            records.push(record);
        }
        self.steps.clear();
    }
}

/// Learns by tracing: `trace` takes the guide so far, the index of a path, and the trail to leave, and returns the
/// radiance found.
///
/// - `pixels`: of the picture. A small one is not worth much learning.
pub(crate) fn train(
    pixels: u64,
    mut trace: impl FnMut(Option<&Guide>, u32, &mut Trail) -> Spectrum,
) -> Guide {
    let last = (pixels.min(u64::from(PATHS_MAX)) as u32).max(1);
    let (mut records, mut trail) = (Vec::new(), Trail::default());
    let mut guide: Option<Guide> = None;
    let mut path = 0;
    for pass in (0..PASSES).rev() {
        for _ in 0..last >> pass {
            let radiance = trace(guide.as_ref(), path, &mut trail);
            trail.finish(radiance, &mut records);
            path += 1;
        }
        guide = Some(Guide::learn(&records));
        eprintln!("pass {pass}: {} records; {}", records.len(), guide.as_ref().unwrap().describe());
    }
    guide.unwrap_or_default()
}
