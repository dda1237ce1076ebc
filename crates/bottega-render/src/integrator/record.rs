//! The record of a traced sample: its values, and the work that it took.

use bottega_image::{Aov, Layout, SampleValues};
use bottega_scene::Spectrum;
use glam::Vec3;

use crate::{bsdf::Bsdf, color::luminance, surfaces::PreparedMaterial};

/// Optional values of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Wanted {
    /// First visible reflectance.
    pub(crate) albedo: bool,
    /// Traversal steps and work counts.
    pub(crate) cost: bool,
    /// The share of light that scattered once at most.
    pub(crate) direct: bool,
}

impl Wanted {
    /// Returns what the layers of a picture need.
    pub(crate) fn by(layout: &Layout) -> Self {
        let aovs = layout.aovs();
        Self {
            albedo: aovs.contains(Aov::Albedo),
            cost: aovs.contains(Aov::Cost),
            direct: aovs.contains(Aov::Direct) || aovs.contains(Aov::Indirect),
        }
    }
}

/// The result of one path.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct PathRecord {
    /// Radiance, and the optional values that are wanted.
    pub(crate) values: SampleValues,
    /// Number of vertices.
    pub(crate) vertex_count: u32,
    /// Further work counts, if costs are wanted.
    pub(crate) counts: PathCounts,
    /// Luminance of the light found up to the first bounce; `None`: the path ended there, or costs are not wanted.
    direct: Option<f32>,
    /// `true`: the direct light is in the values; `false`: all light is direct.
    is_split: bool,
    /// `true`: the camera ray met a shadow catcher.
    pub(crate) is_caught: bool,
    /// `true`: the radiance was not finite, and counts as 0.
    pub(crate) is_dropped: bool,
}

/// Work of a path other than traversal steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PathCounts {
    /// Number of shadow rays.
    pub(crate) shadow_rays: u32,
    /// Vertices on surfaces with several lobes, which are slower to evaluate.
    pub(crate) layered: u32,
    /// Texture lookups at the path's vertices.
    pub(crate) lookups: u32,
    /// Segments inside media.
    pub(crate) media: u32,
}

impl PathCounts {
    /// Counts a vertex on a surface with this BSDF.
    #[inline(always)]
    pub(super) fn meet(&mut self, bsdf: &Bsdf<'_>, known: &PreparedMaterial) {
        self.layered += u32::from(bsdf.is_layered());
        self.lookups += u32::from(known.texture_count);
    }
}

impl PathRecord {
    /// Returns the record with its radiance multiplied by `factor`.
    #[inline(always)]
    pub(super) fn scaled(mut self, factor: f32) -> Self {
        self.values.radiance = self.values.radiance.map(|value| value * factor);
        self.values.direct = self.values.direct.map(|value| value * factor);
        self.direct = self.direct.map(|value| value * factor);
        self
    }

    /// Returns the work of the path, in vertices. Counted, not timed, so it is the same on every machine.
    ///
    /// - `is_guided`: `true` if the path looked up a guide at its vertices.
    pub(crate) fn work(&self, is_guided: bool) -> f64 {
        /// Work of a shadow ray, of the start of a path, and of a guide lookup, in vertices.
        const SHADOW_RAY: f64 = 0.5;
        const PATH: f64 = 0.5;
        const GUIDE: f64 = 0.45;
        let vertex = if is_guided { 1.0 + GUIDE } else { 1.0 };
        PATH + vertex * f64::from(self.vertex_count) + SHADOW_RAY * f64::from(self.counts.shadow_rays)
    }

    /// Stores the radiance of a path that has ended; drops it if it is not finite. Returns the share that is kept, from 0
    /// to 1.
    ///
    /// - `most`: greatest channel; see [`PathSettings::sample_max`](crate::settings::PathSettings::sample_max).
    #[inline(always)]
    pub(super) fn keep(&mut self, radiance: Spectrum, most: f32) -> f32 {
        self.is_dropped = !radiance.is_finite();
        if self.is_dropped {
            self.values.direct = [0.0; 3];
            return 0.0;
        }
        let direct = if self.is_split { self.values.direct.into() } else { radiance };
        let greatest = radiance.max_element();
        let is_too_bright = greatest > most;
        let share = if is_too_bright { most / greatest } else { 1.0 };
        let [radiance, direct] =
            if is_too_bright { [radiance, direct].map(|light| light * share) } else { [radiance, direct] };
        self.values.radiance = radiance.to_array();
        self.values.direct = direct.to_array();
        share
    }

    /// Returns the record of a path whose direct light is added by [`Self::add_direct`].
    pub(super) fn split() -> Self {
        Self { is_split: true, ..Self::default() }
    }

    /// Adds light that scattered once at most; all other light is then indirect. Where this is never called, all light
    /// is direct.
    #[inline(always)]
    pub(super) fn add_direct(&mut self, light: Spectrum) {
        self.values.direct = (Spectrum::from(self.values.direct) + light).to_array();
        self.is_split = true;
    }

    /// Adds the light found at the second vertex of a branch to the direct light.
    ///
    /// - `before`, `after`: radiance of the path before and after that light. Before the first branch all is direct.
    #[inline(always)]
    pub(super) fn split_at_second(&mut self, before: Spectrum, after: Spectrum) {
        let light = if self.is_split { after - before } else { after };
        self.add_direct(light);
    }

    /// Records the distance and the normal of the first visible surface.
    #[inline(always)]
    pub(super) fn record_first(&mut self, distance: f32, normal: Vec3) {
        self.values.alpha = 1.0;
        self.values.depth = distance;
        self.values.normal = normal.to_array();
    }

    /// Records the reflectance of the first surface that has one, if it is still wanted.
    #[inline(always)]
    pub(super) fn record_albedo(&mut self, is_wanted: &mut bool, albedo: Spectrum) {
        if *is_wanted {
            self.values.albedo = albedo.to_array();
            *is_wanted = false;
        }
    }

    /// Records the radiance found so far as direct light; later calls do nothing.
    #[inline(always)]
    pub(super) fn mark_direct(&mut self, radiance: Spectrum) {
        self.direct.get_or_insert(luminance(radiance));
    }

    /// Returns the luminance of light that scattered more than once.
    pub(crate) fn indirect(&self) -> f32 {
        let found = luminance(self.values.radiance.into());
        self.direct.map_or(0.0, |direct| (found - direct).max(0.0))
    }
}
