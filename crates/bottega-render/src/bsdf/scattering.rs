//! The scattering at one point, as one of a closed set of kinds: short ways for the surfaces that need no layers.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::interface::{Interface, Through};
use super::layered::{Layered, LayeredAt};
use super::{BsdfSample, LobeFlags, SurfaceParams, TransportMode, warp};

/// The scattering at one point. See the [module](super) for the frame.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    mode: TransportMode,
    kind: Kind,
}

/// What is cheaper than the layers is only a shorter way to the same numbers.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::large_enum_variant, reason = "a box would allocate at every textured point")]
enum Kind {
    /// f = color / π, not black.
    Lambert(Spectrum),
    /// A mirror, or a clear solid or sheet, bare.
    Smooth(Interface),
    Layered(Layered),
}

/// A [`Bsdf`] seen from one direction: who asks for more than one thing from there pays once for what they share.
#[derive(Clone, Copy)]
pub struct BsdfAt<'a>(KindAt<'a>);

#[derive(Clone, Copy)]
enum KindAt<'a> {
    Nothing,
    Lambert(Spectrum),
    Smooth(&'a Interface, Vec3, TransportMode),
    Layered(LayeredAt<'a>),
}

impl Bsdf {
    /// The scattering of paths from the camera.
    pub fn new(params: &SurfaceParams) -> Self {
        let p = params.clamped();
        let kind = if is_lambert(&p) {
            Kind::Lambert(p.base_color)
        } else {
            let layers = Layered::new(&p);
            layers.as_smooth_boundary().map_or(Kind::Layered(layers), Kind::Smooth)
        };
        Self { mode: TransportMode::Radiance, kind }
    }

    /// The same for `mode`.
    pub fn with_mode(self, mode: TransportMode) -> Self {
        Self { mode, ..self }
    }

    /// What is seen from `wo`; nothing unless wo is above the surface.
    #[inline]
    pub fn at(&self, wo: Vec3) -> BsdfAt<'_> {
        if !is_above(wo) {
            return BsdfAt(KindAt::Nothing);
        }
        BsdfAt(match &self.kind {
            Kind::Lambert(color) => KindAt::Lambert(*color),
            Kind::Smooth(boundary) => KindAt::Smooth(boundary, wo, self.mode),
            Kind::Layered(layers) => layers.at(wo, self.mode).map_or(KindAt::Nothing, KindAt::Layered),
        })
    }

    /// f(wo, wi) in sr⁻¹, without the cosine, of all lobes but Dirac ones; see [`Self::eval_pdf`].
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum {
        self.eval_pdf(wo, wi).0
    }

    /// Density in sr⁻¹ with which [`Self::sample`] draws `wi`, Dirac lobes left out; see [`Self::eval_pdf`].
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_pdf(wo, wi).1
    }

    /// f(wo, wi) and the density of `wi`, at the price of one of them. (0, 0) unless wo is above the surface.
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Spectrum, f32) {
        self.at(wo).eval_pdf(wi)
    }

    /// Draws a direction: see [`BsdfAt::sample`].
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        self.at(wo).sample(u_lobe, u)
    }

    /// Share of the light arriving along `wo` that is scattered anywhere, as the tables know it: within two percent for
    /// what is reflected by a base without coat and sheen, up to a tenth or so too much below these, and an estimate of
    /// what goes through.
    pub fn albedo(&self, wo: Vec3) -> Spectrum {
        if !is_above(wo) {
            return Spectrum::ZERO;
        }
        match &self.kind {
            Kind::Lambert(color) => *color,
            Kind::Smooth(boundary) => boundary.smooth_albedo(wo.z),
            Kind::Layered(layers) => layers.albedo(wo),
        }
    }

    /// Whether nothing is scattered at all.
    pub fn is_black(&self) -> bool {
        matches!(&self.kind, Kind::Layered(layers) if layers.is_black())
    }

    /// Whether light can go to the other side.
    pub fn is_transmissive(&self) -> bool {
        match &self.kind {
            Kind::Lambert(_) => false,
            Kind::Smooth(boundary) => boundary.through != Through::Nothing,
            Kind::Layered(layers) => layers.is_transmissive(),
        }
    }

    /// Whether all light goes into single directions, so that connecting to a light is of no use.
    #[inline]
    pub fn is_delta_only(&self) -> bool {
        match &self.kind {
            Kind::Lambert(_) => false,
            Kind::Smooth(_) => true,
            Kind::Layered(layers) => !layers.is_black() && !layers.has_non_delta(),
        }
    }

    /// Whether some light is spread over solid angles: what `eval` and `pdf` tell of.
    pub fn has_non_delta(&self) -> bool {
        match &self.kind {
            Kind::Lambert(_) => true,
            Kind::Smooth(_) => false,
            Kind::Layered(layers) => layers.has_non_delta(),
        }
    }

    /// Perceptual roughness of the sharpest lobe that this surface has: 0 for a mirror, 1 where there are only diffuse
    /// ones.
    pub fn roughness(&self) -> f32 {
        match &self.kind {
            Kind::Lambert(_) => 1.0,
            Kind::Smooth(boundary) => boundary.ggx.alpha().sqrt(),
            Kind::Layered(layers) => layers.roughness(),
        }
    }
}

impl BsdfAt<'_> {
    /// f(wo, wi) in sr⁻¹, without the cosine, of all lobes but Dirac ones, and the density in sr⁻¹ with which
    /// [`Self::sample`] draws `wi`.
    #[inline]
    pub fn eval_pdf(&self, wi: Vec3) -> (Spectrum, f32) {
        match &self.0 {
            KindAt::Lambert(color) if wi.z > 0.0 => {
                (*color * std::f32::consts::FRAC_1_PI, warp::cosine_hemisphere_pdf(wi.z))
            }
            KindAt::Layered(layers) if wi.z != 0.0 => layers.eval_pdf(wi),
            _ => (Spectrum::ZERO, 0.0),
        }
    }

    /// Draws a direction, from numbers in [0, 1). `None`: these numbers scatter no light, and the path ends.
    #[inline]
    pub fn sample(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        match &self.0 {
            KindAt::Nothing => None,
            KindAt::Lambert(_) => {
                let wi = warp::cosine_hemisphere(u);
                let (value, pdf) = self.eval_pdf(wi);
                let lobe = LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE);
                (pdf > 0.0).then_some(BsdfSample { wi, value, pdf, lobe, eta: 1.0 })
            }
            KindAt::Smooth(boundary, wo, mode) => {
                let drawn = boundary.sample(*wo, u_lobe, u, *mode)?;
                let (reflectance, pdf) = drawn.delta?;
                let value = reflectance / drawn.wi.z.abs();
                let sound = pdf > 0.0 && value.max_element() > 0.0;
                sound.then_some(BsdfSample { wi: drawn.wi, value, pdf, lobe: drawn.flags, eta: drawn.eta })
            }
            KindAt::Layered(layers) => layers.sample(u_lobe, u),
        }
    }
}

/// Whether nothing but the diffuse base scatters. `p` is clamped.
fn is_lambert(p: &SurfaceParams) -> bool {
    let is_bare = p.coat == 0.0 && p.sheen_color == Spectrum::ZERO;
    is_bare && p.specular == 0.0 && p.metallic == 0.0 && p.transmission == 0.0 && p.base_color != Spectrum::ZERO
}

fn is_above(wo: Vec3) -> bool {
    wo.z > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layered(params: &SurfaceParams) -> Bsdf {
        Bsdf { mode: TransportMode::Radiance, kind: Kind::Layered(Layered::new(&params.clamped())) }
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() <= 2e-6 * a.abs().max(b.abs())
    }

    /// Directions and numbers.
    fn cases() -> impl Iterator<Item = (Vec3, [f32; 3])> {
        (0..400_u32).map(|i| {
            let part = |prime: u32| (i * prime % 401) as f32 / 401.0;
            (warp::uniform_hemisphere([part(1), part(29)]), [part(71), part(113), part(197)])
        })
    }

    #[test]
    fn short_ways_lead_where_the_layers_lead() {
        let lambert = SurfaceParams { specular: 0.0, base_color: Spectrum::new(0.7, 0.2, 0.0), ..Default::default() };
        let mirror = SurfaceParams { metallic: 1.0, roughness: 0.0, ..lambert };
        let glass = SurfaceParams { transmission: 1.0, roughness: 0.0, ..SurfaceParams::default() };
        let sheet = SurfaceParams { thin: true, base_color: Spectrum::new(0.9, 0.5, 0.2), ..glass };
        for params in [lambert, mirror, glass, SurfaceParams { front: false, ..glass }, sheet] {
            let (short, long) = (Bsdf::new(&params), layered(&params));
            assert!(!matches!(short.kind, Kind::Layered(_)));
            assert_eq!(short.is_black(), long.is_black());
            assert_eq!(short.is_transmissive(), long.is_transmissive());
            assert_eq!(short.is_delta_only(), long.is_delta_only());
            assert_eq!(short.has_non_delta(), long.has_non_delta());
            assert_eq!(short.roughness(), long.roughness());
            for (wo, [u_lobe, u, v]) in cases() {
                assert!((short.albedo(wo) - long.albedo(wo)).abs().max_element() < 0.02, "{params:?} {wo}");
                for wi in [warp::cosine_hemisphere([v, u]), -warp::cosine_hemisphere([v, u]), -wo] {
                    let ((f, p), (g, q)) = (short.eval_pdf(wo, wi), long.eval_pdf(wo, wi));
                    assert!((0..3).all(|i| close(f[i], g[i])) && close(p, q), "{params:?} {wo} {wi}");
                }
                let (a, b) = (short.sample(wo, u_lobe, [u, v]), long.sample(wo, u_lobe, [u, v]));
                assert_eq!(a.is_some(), b.is_some());
                let (Some(a), Some(b)) = (a, b) else { continue };
                assert_eq!((a.wi, a.lobe, a.eta), (b.wi, b.lobe, b.eta));
                assert!((0..3).all(|i| close(a.value[i], b.value[i])) && close(a.pdf, b.pdf), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn what_needs_layers_takes_no_short_way() {
        let lambert = SurfaceParams { specular: 0.0, ..SurfaceParams::default() };
        let glass = SurfaceParams { transmission: 1.0, roughness: 0.0, ..SurfaceParams::default() };
        for params in [
            SurfaceParams::default(),
            SurfaceParams::BLACK,
            SurfaceParams { coat: 0.1, ..lambert },
            SurfaceParams { sheen_color: Spectrum::splat(0.1), ..lambert },
            SurfaceParams { metallic: 0.1, ..lambert },
            SurfaceParams { transmission: 0.1, ..lambert },
            SurfaceParams { coat: 0.1, ..glass },
            SurfaceParams { transmission: 0.5, ..glass },
            SurfaceParams { roughness: 0.1, ..glass },
        ] {
            assert!(matches!(Bsdf::new(&params).kind, Kind::Layered(_)), "{params:?}");
        }
    }
}
