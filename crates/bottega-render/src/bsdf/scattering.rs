//! The BSDF at one point, as a closed set of kinds, with shortcuts for surfaces without layers.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::coated::Stack;
use super::conductor::Conductor;
use super::dielectric::Dielectric;
use super::gloss::Gloss;
use super::hair::Hair;
use super::interface::{Interface, TransmissionKind};
use super::layered::{Layered, LayeredAt};
use super::matte::{RoughMatte, Translucent};
use super::measured::MeasuredReflection;
use super::plastic::Plastic;
use super::principled::{Principled, PrincipledSheet};
use super::scatter::{Lobes, Scatter};
use super::subsurface::SubsurfaceExit;
use super::varnish::Varnish;
use super::{BsdfSample, LiftedNormal, LobeFlags, SurfaceParams, TransportMode, warp};

/// The BSDF at one point. See the [module](super) for the local frame. It may refer to tables of the material.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<'s> {
    mode: TransportMode,
    kind: BsdfKind<'s>,
    change: Option<ScatterChange>,
}

/// A change to everything that the lobes of a BSDF scatter.
#[derive(Clone, Copy, Debug)]
struct ScatterChange {
    lifted: Option<LiftedNormal>,
    /// Factor of what is scattered: the number of surfaces of a sum that one of them stands for.
    gain: f32,
}

impl ScatterChange {
    fn factor(&self, wi: Vec3) -> f32 {
        self.gain * self.lifted.map_or(1.0, |lifted| lifted.factor(wi))
    }
}

#[derive(Clone, Copy, Debug)]
enum BsdfKind<'s> {
    /// A surface that scatters nothing.
    Black,
    /// A Lambertian surface: f = color / π, not black.
    Lambert(Spectrum),
    /// A bare mirror, clear solid or thin sheet: a shortcut with the same result as the layers.
    Smooth(Interface),
    Layered(Layered),
    Other(OtherBsdf<'s>),
}

/// BSDFs of surfaces other than glTF's layered one.
#[derive(Clone, Copy, Debug)]
pub(super) enum OtherBsdf<'s> {
    RoughMatte(RoughMatte),
    Translucent(Translucent),
    Conductor(Conductor),
    Dielectric(Dielectric),
    Plastic(Plastic),
    Stack(Stack),
    Varnish(Varnish),
    Gloss(Gloss),
    Principled(Principled),
    PrincipledSheet(PrincipledSheet),
    Hair(Hair),
    Measured(MeasuredReflection<'s>),
    SubsurfaceExit(SubsurfaceExit),
}

/// Dispatches an expression over all kinds of `OtherBsdf`.
macro_rules! ask {
    ($other:expr, $it:ident => $answer:expr) => {
        match $other {
            OtherBsdf::RoughMatte($it) => $answer,
            OtherBsdf::Translucent($it) => $answer,
            OtherBsdf::Conductor($it) => $answer,
            OtherBsdf::Dielectric($it) => $answer,
            OtherBsdf::Plastic($it) => $answer,
            OtherBsdf::Stack($it) => $answer,
            OtherBsdf::Varnish($it) => $answer,
            OtherBsdf::Gloss($it) => $answer,
            OtherBsdf::Principled($it) => $answer,
            OtherBsdf::PrincipledSheet($it) => $answer,
            OtherBsdf::Hair($it) => $answer,
            OtherBsdf::Measured($it) => $answer,
            OtherBsdf::SubsurfaceExit($it) => $answer,
        }
    };
}

impl Scatter for OtherBsdf<'_> {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Spectrum, f32) {
        ask!(self, it => it.eval_pdf(wo, wi, mode))
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        ask!(self, it => it.sample(wo, u_lobe, u, mode))
    }

    fn diffuse_pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        ask!(self, it => it.diffuse_pdf(wo, wi))
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        ask!(self, it => it.albedo(wo))
    }

    fn lobes(&self) -> Lobes {
        ask!(self, it => it.lobes())
    }
}

/// A [`Bsdf`] for one outgoing direction; several calls share the values that depend on it alone.
#[derive(Clone, Copy)]
pub struct BsdfAt<'a> {
    kind: KindAt<'a>,
    change: Option<&'a ScatterChange>,
}

#[derive(Clone, Copy)]
enum KindAt<'a> {
    Nothing,
    Lambert(Spectrum),
    Smooth(&'a Interface, Vec3, TransportMode, Spectrum),
    Layered(LayeredAt<'a>),
    Other(&'a OtherBsdf<'a>, Vec3, TransportMode),
}

impl<'s> Bsdf<'s> {
    /// Creates the BSDF of the layered material for the transport of radiance; values outside of their ranges are
    /// clamped.
    pub fn new(params: &SurfaceParams) -> Self {
        let p = params.clamped();
        if is_lambert(&p) {
            return Self::lambert(p.base_color);
        }
        let layers = Layered::new(&p);
        let kind = match layers.as_smooth_boundary() {
            _ if layers.is_black() => BsdfKind::Black,
            Some(boundary) => BsdfKind::Smooth(boundary),
            None => BsdfKind::Layered(layers),
        };
        Self::of(kind)
    }

    /// Creates the BSDF of light that leaves a layered material from below; see [`Subsurface`](bottega_scene::Subsurface).
    pub(super) fn leaving(params: &SurfaceParams) -> Self {
        Self::other(Some(OtherBsdf::SubsurfaceExit(SubsurfaceExit::new(&params.clamped()))))
    }

    const fn of(kind: BsdfKind<'s>) -> Self {
        Self { mode: TransportMode::Radiance, kind, change: None }
    }

    /// Returns a BSDF that scatters nothing.
    pub(super) fn black() -> Self {
        Self::of(BsdfKind::Black)
    }

    /// Returns a Lambertian BSDF; `color`: albedo in [0, 1].
    pub(super) fn lambert(color: Spectrum) -> Self {
        Self::of(if color == Spectrum::ZERO { BsdfKind::Black } else { BsdfKind::Lambert(color) })
    }

    /// Wraps one of the other kinds; `None`: black.
    pub(super) fn other(other: Option<OtherBsdf<'s>>) -> Self {
        Self::of(other.map_or(BsdfKind::Black, BsdfKind::Other))
    }

    /// Returns the same BSDF if it refers to no tables of a scene; else `None`.
    pub(crate) fn without_tables(self) -> Option<Bsdf<'static>> {
        let kind = match self.kind {
            BsdfKind::Black => BsdfKind::Black,
            BsdfKind::Lambert(color) => BsdfKind::Lambert(color),
            BsdfKind::Smooth(boundary) => BsdfKind::Smooth(boundary),
            BsdfKind::Layered(layers) => BsdfKind::Layered(layers),
            BsdfKind::Other(other) => BsdfKind::Other(match other {
                OtherBsdf::RoughMatte(it) => OtherBsdf::RoughMatte(it),
                OtherBsdf::Translucent(it) => OtherBsdf::Translucent(it),
                OtherBsdf::Conductor(it) => OtherBsdf::Conductor(it),
                OtherBsdf::Dielectric(it) => OtherBsdf::Dielectric(it),
                OtherBsdf::Plastic(it) => OtherBsdf::Plastic(it),
                OtherBsdf::Stack(it) => OtherBsdf::Stack(it),
                OtherBsdf::Varnish(it) => OtherBsdf::Varnish(it),
                OtherBsdf::Gloss(it) => OtherBsdf::Gloss(it),
                OtherBsdf::Principled(it) => OtherBsdf::Principled(it),
                OtherBsdf::PrincipledSheet(it) => OtherBsdf::PrincipledSheet(it),
                OtherBsdf::Hair(it) => OtherBsdf::Hair(it),
                OtherBsdf::SubsurfaceExit(it) => OtherBsdf::SubsurfaceExit(it),
                OtherBsdf::Measured(_) => return None,
            }),
        };
        Some(Bsdf { mode: self.mode, kind, change: self.change })
    }

    /// Returns the same BSDF with a perturbed shading normal.
    pub(super) fn with_lifted(self, lifted: Option<LiftedNormal>) -> Self {
        match lifted {
            None => self,
            Some(_) => Self { change: Some(ScatterChange { lifted, gain: self.gain() }), ..self },
        }
    }

    /// Returns the same BSDF scattering `factor` times as much.
    pub(super) fn times(self, factor: f32) -> Self {
        let lifted = self.change.and_then(|change| change.lifted);
        Self { change: Some(ScatterChange { lifted, gain: factor * self.gain() }), ..self }
    }

    fn gain(&self) -> f32 {
        self.change.map_or(1.0, |change| change.gain)
    }

    /// Returns the same BSDF for the transport of radiance or of importance.
    pub fn with_mode(self, mode: TransportMode) -> Self {
        Self { mode, ..self }
    }

    /// Returns the BSDF for the outgoing direction `wo`, unit length, local frame. It scatters nothing unless `wo` is
    /// above the surface.
    #[inline(always)]
    pub fn at(&self, wo: Vec3) -> BsdfAt<'_> {
        self.at_carrying(wo, Spectrum::ONE)
    }

    /// Returns the BSDF for the outgoing direction `wo` of a path with throughput `carried`, of which only the ratios
    /// matter. Dispersive boundaries choose reflection and channel by it, so that a path with a single channel left
    /// follows that channel's direction.
    #[inline(always)]
    pub fn at_carrying(&self, wo: Vec3, carried: Spectrum) -> BsdfAt<'_> {
        if !is_above(wo) {
            return BsdfAt { kind: KindAt::Nothing, change: None };
        }
        let kind = match &self.kind {
            BsdfKind::Lambert(color) => KindAt::Lambert(*color),
            BsdfKind::Smooth(boundary) => KindAt::Smooth(boundary, wo, self.mode, carried),
            BsdfKind::Layered(layers) => layers.at(wo, self.mode, carried).map_or(KindAt::Nothing, KindAt::Layered),
            BsdfKind::Other(other) => KindAt::Other(other, wo, self.mode),
            BsdfKind::Black => KindAt::Nothing,
        };
        BsdfAt { kind, change: self.change.as_ref() }
    }

    /// Returns f(wo, wi) in sr⁻¹, without the cosine, summed over all lobes but Dirac ones; see [`Self::eval_pdf`].
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Spectrum {
        self.eval_pdf(wo, wi).0
    }

    /// Returns the density in sr⁻¹ with which [`Self::sample`] draws `wi`, without Dirac lobes; see [`Self::eval_pdf`].
    pub fn pdf(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.eval_pdf(wo, wi).1
    }

    /// Returns f(wo, wi) and the pdf of `wi`, at the cost of one of them. (0, 0) unless wo is above the surface.
    pub fn eval_pdf(&self, wo: Vec3, wi: Vec3) -> (Spectrum, f32) {
        self.at(wo).eval_pdf(wi)
    }

    /// Draws a direction for the outgoing direction `wo`; see [`BsdfAt::sample`]. `None`: the path ends.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        self.at(wo).sample(u_lobe, u)
    }

    /// Returns the share of the light arriving along `wo` that a smooth thin sheet transmits without deflection; 0 for
    /// other surfaces.
    pub(crate) fn straight(&self, wo: Vec3) -> Spectrum {
        match &self.kind {
            BsdfKind::Other(OtherBsdf::Dielectric(dielectric)) if is_above(wo) => dielectric.straight(wo) * self.gain(),
            _ => Spectrum::ZERO,
        }
    }

    /// Returns the share of the light arriving along `wo` that is scattered in any direction, per channel, according to
    /// the tables: within two percent for the reflection of a base without coat and sheen, up to about a tenth too high
    /// below these, and an estimate for transmission. 0 unless `wo` is above the surface.
    pub fn albedo(&self, wo: Vec3) -> Spectrum {
        if !is_above(wo) {
            return Spectrum::ZERO;
        }
        let albedo = match &self.kind {
            BsdfKind::Lambert(color) => *color,
            BsdfKind::Smooth(boundary) => boundary.smooth_albedo(wo.z),
            BsdfKind::Layered(layers) => layers.albedo(wo),
            BsdfKind::Other(other) => other.albedo(wo),
            BsdfKind::Black => Spectrum::ZERO,
        };
        albedo * self.gain()
    }

    /// Returns true if nothing is scattered.
    pub fn is_black(&self) -> bool {
        matches!(self.kind, BsdfKind::Black)
    }

    /// Returns true if light can be transmitted to the other side.
    pub fn is_transmissive(&self) -> bool {
        match &self.kind {
            BsdfKind::Lambert(_) | BsdfKind::Black => false,
            BsdfKind::Smooth(boundary) => boundary.through != TransmissionKind::Nothing,
            BsdfKind::Layered(layers) => layers.is_transmissive(),
            BsdfKind::Other(other) => other.lobes().is_transmissive,
        }
    }

    /// Returns true unless the BSDF is a single lobe of one colour or a bare smooth boundary: evaluation is then
    /// expensive.
    #[inline(always)]
    pub(crate) fn is_layered(&self) -> bool {
        matches!(self.kind, BsdfKind::Layered(_) | BsdfKind::Other(_))
    }

    /// Returns true if all lobes are Dirac lobes, so that next-event estimation is useless.
    #[inline(always)]
    pub fn is_delta_only(&self) -> bool {
        match &self.kind {
            BsdfKind::Lambert(_) | BsdfKind::Black => false,
            BsdfKind::Smooth(_) => true,
            BsdfKind::Layered(layers) => !layers.has_non_delta(),
            BsdfKind::Other(other) => !other.lobes().has_non_delta,
        }
    }

    /// Returns true if any light is scattered into lobes that `eval` and `pdf` cover.
    pub fn has_non_delta(&self) -> bool {
        match &self.kind {
            BsdfKind::Lambert(_) => true,
            BsdfKind::Smooth(_) | BsdfKind::Black => false,
            BsdfKind::Layered(layers) => layers.has_non_delta(),
            BsdfKind::Other(other) => other.lobes().has_non_delta,
        }
    }

    /// Returns the perceptual roughness of the sharpest lobe: 0 for a mirror, 1 if all lobes are diffuse.
    pub fn roughness(&self) -> f32 {
        match &self.kind {
            BsdfKind::Lambert(_) | BsdfKind::Black => 1.0,
            BsdfKind::Smooth(boundary) => boundary.ggx.alpha().sqrt(),
            BsdfKind::Layered(layers) => layers.roughness(),
            BsdfKind::Other(other) => other.lobes().roughness,
        }
    }
}

impl BsdfAt<'_> {
    /// Returns f(wo, wi) in sr⁻¹, without the cosine, summed over all lobes but Dirac ones, and the density in sr⁻¹ with
    /// which [`Self::sample`] draws `wi`.
    #[inline(always)]
    pub fn eval_pdf(&self, wi: Vec3) -> (Spectrum, f32) {
        let (value, pdf) = self.eval_pdf_of_kind(wi);
        match self.change.map(|change| change.factor(wi)) {
            None => (value, pdf),
            Some(0.0) => (Spectrum::ZERO, 0.0),
            Some(factor) => (value * factor, pdf),
        }
    }

    /// Returns the probability that a sample in direction `wi`, on the side of wo, comes from a diffuse lobe.
    pub(crate) fn diffuse_share(&self, wi: Vec3) -> f32 {
        let (diffuse, pdf) = match &self.kind {
            KindAt::Nothing | KindAt::Smooth(..) => return 0.0,
            KindAt::Lambert(_) => return 1.0,
            KindAt::Layered(layers) => (layers.diffuse_pdf(wi), layers.eval_pdf(wi).1),
            KindAt::Other(other, wo, mode) => (other.diffuse_pdf(*wo, wi), other.eval_pdf(*wo, wi, *mode).1),
        };
        if pdf > 0.0 { (diffuse / pdf).min(1.0) } else { 0.0 }
    }

    /// Draws a direction. `None`: no light is scattered for these numbers; the path ends.
    ///
    /// - `u_lobe`: uniform random number in [0, 1) that chooses the lobe.
    /// - `u`: uniform random numbers in [0, 1) that choose the direction.
    #[inline(always)]
    pub fn sample(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let sample = self.sample_kind(u_lobe, u)?;
        let Some(change) = self.change else { return Some(sample) };
        let factor = change.factor(sample.wi);
        (factor > 0.0).then_some(BsdfSample { value: sample.value * factor, ..sample })
    }

    /// Returns reflection and transmission of a smooth boundary, the likelier one first, if these two Dirac lobes are
    /// all; else `None`.
    pub(crate) fn both_ways(&self) -> Option<[BsdfSample; 2]> {
        const ROUNDING: f32 = 1e-5;
        let [first, last] = [0.0, 1.0_f32.next_down()].map(|u_lobe| self.sample(u_lobe, [0.5; 2]));
        let (first, last) = (first?, last?);
        let are_two = first.is_delta() && last.is_delta() && first.lobe != last.lobe;
        let are_all = (first.pdf + last.pdf - 1.0).abs() < ROUNDING;
        (are_two && are_all).then_some(if first.pdf < last.pdf { [last, first] } else { [first, last] })
    }

    #[inline(always)]
    fn eval_pdf_of_kind(&self, wi: Vec3) -> (Spectrum, f32) {
        match &self.kind {
            KindAt::Lambert(color) if wi.z > 0.0 => {
                (*color * std::f32::consts::FRAC_1_PI, warp::cosine_hemisphere_pdf(wi.z))
            }
            KindAt::Layered(layers) if wi.z != 0.0 => layers.eval_pdf(wi),
            KindAt::Other(other, wo, mode) if wi.z != 0.0 => other.eval_pdf(*wo, wi, *mode),
            _ => (Spectrum::ZERO, 0.0),
        }
    }

    #[inline(always)]
    fn sample_kind(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        match &self.kind {
            KindAt::Nothing => None,
            KindAt::Lambert(_) => {
                let wi = warp::cosine_hemisphere(u);
                let (value, pdf) = self.eval_pdf_of_kind(wi);
                let lobe = LobeFlags::REFLECTION.union(LobeFlags::DIFFUSE);
                (pdf > 0.0).then_some(BsdfSample { wi, value, pdf, lobe, eta: 1.0 })
            }
            KindAt::Smooth(boundary, wo, mode, carried) => {
                let drawn = boundary.sample(*wo, u_lobe, u, *mode, *carried)?;
                let (reflectance, pdf) = drawn.delta?;
                let value = reflectance / drawn.wi.z.abs();
                let sound = pdf > 0.0 && value.max_element() > 0.0;
                sound.then_some(BsdfSample { wi: drawn.wi, value, pdf, lobe: drawn.flags, eta: drawn.eta })
            }
            KindAt::Layered(layers) => layers.sample(u_lobe, u),
            KindAt::Other(other, wo, mode) => other.sample(*wo, u_lobe, u, *mode),
        }
    }
}

/// Returns true if only the diffuse base scatters; the caller clamps `p`.
fn is_lambert(p: &SurfaceParams) -> bool {
    let is_bare = p.coat == 0.0 && p.sheen_color == Spectrum::ZERO;
    let is_bare = is_bare && p.diffuse_transmission == 0.0;
    is_bare && p.specular == 0.0 && p.metallic == 0.0 && p.transmission == 0.0 && p.base_color != Spectrum::ZERO
}

#[inline(always)]
fn is_above(wo: Vec3) -> bool {
    wo.z > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layered(params: &SurfaceParams) -> Bsdf<'static> {
        Bsdf::of(BsdfKind::Layered(Layered::new(&params.clamped())))
    }

    fn close(a: f32, b: f32) -> bool {
        (a - b).abs() <= 2e-6 * a.abs().max(b.abs())
    }

    /// Returns random directions and numbers.
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
            assert!(!matches!(short.kind, BsdfKind::Layered(_)));
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
    fn glass_alone_has_two_ways() {
        let glass = SurfaceParams { transmission: 1.0, roughness: 0.0, ..SurfaceParams::default() };
        let inside = SurfaceParams { front: false, ..glass };
        let sheet = SurfaceParams { thin: true, base_color: Spectrum::new(0.9, 0.5, 0.2), ..glass };
        for (params, (wo, numbers)) in [glass, inside, sheet].iter().flat_map(|it| cases().map(move |case| (it, case)))
        {
            let bsdf = Bsdf::new(params);
            let at = bsdf.at(wo);
            let [u_lobe, u, v] = numbers;
            match (at.both_ways(), at.sample(u_lobe, [u, v])) {
                (Some(ways), Some(drawn)) => {
                    assert!(ways[0].pdf >= ways[1].pdf);
                    assert!(ways.iter().any(|way| (way.wi, way.value, way.pdf) == (drawn.wi, drawn.value, drawn.pdf)));
                }
                // Everything is reflected
                (None, Some(drawn)) => assert!(drawn.pdf > 1.0 - 1e-5 && drawn.wi.z > 0.0, "{wo} {drawn:?}"),
                (_, None) => {}
            }
        }
        let has_two = |params: &SurfaceParams| Bsdf::new(params).at(Vec3::new(0.6, 0.0, 0.8)).both_ways().is_some();
        assert!(has_two(&glass) && has_two(&sheet));
        let mirror = SurfaceParams { metallic: 1.0, roughness: 0.0, specular: 0.0, ..SurfaceParams::default() };
        for other in [
            SurfaceParams::default(),
            mirror,
            SurfaceParams { coat: 0.5, ..glass },
            SurfaceParams { transmission: 0.5, ..glass },
            SurfaceParams { roughness: 0.1, ..glass },
        ] {
            assert!(!has_two(&other), "{other:?}");
        }
    }

    #[test]
    fn layered_surfaces_are_not_simplified() {
        let lambert = SurfaceParams { specular: 0.0, ..SurfaceParams::default() };
        let glass = SurfaceParams { transmission: 1.0, roughness: 0.0, ..SurfaceParams::default() };
        for params in [
            SurfaceParams::default(),
            SurfaceParams { coat: 0.1, ..lambert },
            SurfaceParams { sheen_color: Spectrum::splat(0.1), ..lambert },
            SurfaceParams { metallic: 0.1, ..lambert },
            SurfaceParams { transmission: 0.1, ..lambert },
            SurfaceParams { coat: 0.1, ..glass },
            SurfaceParams { transmission: 0.5, ..glass },
            SurfaceParams { roughness: 0.1, ..glass },
        ] {
            assert!(matches!(Bsdf::new(&params).kind, BsdfKind::Layered(_)), "{params:?}");
        }
    }
}
