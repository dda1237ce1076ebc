//! The result of a sample: its values, and what it took.

use bottega_image::SampleValues;
use bottega_scene::Spectrum;
use glam::Vec3;

use crate::{bsdf::Bsdf, luminance, surfaces::PreparedMaterial};

/// Which values beside radiance a sample is asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    pub(crate) albedo: bool,
    pub(crate) cost: bool,
}

/// What came of one path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PathRecord {
    pub(crate) values: SampleValues,
    /// Surfaces that it met.
    pub(crate) vertex_count: u32,
    /// What else it took, if that was asked for.
    pub(crate) counts: PathCounts,
    /// Luminance found before light could come over more than one scattering; `None` when the path ended there, or when what
    /// it took was not asked for.
    direct: Option<f32>,
    /// Whether its radiance was not finite, and counts as 0.
    pub(crate) is_dropped: bool,
}

/// What a path takes beside its traversal steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PathCounts {
    /// Rays towards lights.
    pub(crate) shadow_rays: u32,
    /// Vertices at surfaces of several lobes, which are dearer to evaluate than a single one.
    pub(crate) layered: u32,
    /// Textures of the surfaces at its vertices.
    pub(crate) lookups: u32,
    /// Segments of it that lie in media.
    pub(crate) media: u32,
}

impl PathCounts {
    /// Counts a vertex.
    #[inline(always)]
    pub(super) fn meet(&mut self, bsdf: &Bsdf, known: &PreparedMaterial) {
        self.layered += u32::from(bsdf.is_layered());
        self.lookups += u32::from(known.texture_count);
    }
}

impl PathRecord {
    /// With `factor` times the radiance.
    #[inline(always)]
    pub(super) fn scaled(mut self, factor: f32) -> Self {
        self.values.radiance = self.values.radiance.map(|value| value * factor);
        self.direct = self.direct.map(|value| value * factor);
        self
    }

    /// What it took, in vertices. Counted, not timed: so it is the same everywhere.
    ///
    /// - `is_guided`: whether it asked a guide at its vertices.
    pub(crate) fn work(&self, is_guided: bool) -> f64 {
        /// A ray towards a light; a path beside its vertices; a question to a guide.
        const SHADOW_RAY: f64 = 0.5;
        const PATH: f64 = 0.5;
        const GUIDE: f64 = 0.45;
        let vertex = if is_guided { 1.0 + GUIDE } else { 1.0 };
        PATH + vertex * f64::from(self.vertex_count) + SHADOW_RAY * f64::from(self.counts.shadow_rays)
    }

    /// Takes in what the path found, when it is at its end.
    ///
    /// - `most`: see [`PathSettings::sample_max`](crate::PathSettings::sample_max).
    #[inline(always)]
    pub(super) fn keep(&mut self, radiance: Spectrum, most: f32) {
        self.is_dropped = !radiance.is_finite();
        if self.is_dropped {
            return;
        }
        let greatest = radiance.max_element();
        let radiance = if greatest > most { radiance * (most / greatest) } else { radiance };
        self.values.radiance = radiance.to_array();
    }

    /// Takes in the first surface that is seen: how far it is, and its normal.
    #[inline(always)]
    pub(super) fn record_first(&mut self, distance: f32, normal: Vec3) {
        self.values.alpha = 1.0;
        self.values.depth = distance;
        self.values.normal = normal.to_array();
    }

    /// Takes in the reflectance of the first surface that has one, if it is wanted still.
    #[inline(always)]
    pub(super) fn record_albedo(&mut self, is_wanted: &mut bool, albedo: Spectrum) {
        if *is_wanted {
            self.values.albedo = albedo.to_array();
            *is_wanted = false;
        }
    }

    /// Marks all that was found so far as direct light; only the first mark counts.
    #[inline(always)]
    pub(super) fn mark_direct(&mut self, radiance: Spectrum) {
        self.direct.get_or_insert(luminance(radiance));
    }

    /// Luminance that came over more than one scattering.
    pub(crate) fn indirect(&self) -> f32 {
        let found = luminance(self.values.radiance.into());
        self.direct.map_or(0.0, |direct| (found - direct).max(0.0))
    }
}
