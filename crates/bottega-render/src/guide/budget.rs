//! The budget of learning: how many paths are worth learning from.

/// What a pass showed.
#[derive(Clone, Copy, Debug)]
pub(super) struct PassFindings {
    /// Variance of one path relative to what its part of the picture shows, without a guide.
    pub(super) noise: f64,
    /// Error times work with the guide of the passes before over that without. `None`: there was none.
    pub(super) ratio: Option<f64>,
    pub(super) work: f64,
}

impl PassFindings {
    pub(super) fn new(mut errors: [Vec<f64>; 2], work: [f64; 2], samples: usize, has_guide: bool) -> Self {
        let [plain, guided] = errors.each_mut().map(|errors| {
            errors.sort_unstable_by(f64::total_cmp);
            let kept = errors.len() - (errors.len() as f64 * 0.005) as usize;
            errors[..kept].iter().sum::<f64>() / kept.max(1) as f64
        });
        let noise = 0.5 * samples as f64 * plain;
        let ratio = has_guide.then(|| guided * work[1] / (plain * work[0]));
        Self { noise, ratio, work: work[1] / work[0] }
    }
}

/// How far learning goes.
#[derive(Debug)]
pub(super) struct Budget {
    samples: u64,
    findings: Vec<PassFindings>,
}

impl Budget {
    pub(super) fn new(samples: u64) -> Self {
        Self { samples, findings: Vec::new() }
    }

    pub(super) fn next_pass(&self) -> Option<u32> {
        let forced: usize = std::env::var("GUIDE_PASSES").ok().and_then(|it| it.parse().ok()).unwrap_or(5);
        let pass = self.findings.len();
        (pass < forced).then(|| ((self.samples / 512) << pass).clamp(512, 1 << 18) as u32)
    }

    pub(super) fn take(&mut self, findings: PassFindings) {
        eprintln!("pass {}: {findings:?}", self.findings.len());
        self.findings.push(findings);
    }

    pub(super) fn is_lost(&self) -> bool {
        false
    }
}
