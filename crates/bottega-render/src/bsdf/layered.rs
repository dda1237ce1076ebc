//! The layered material of glTF: base, clear coat and sheen combined into one BSDF.
//!
//! Parameters: base colour, metallic factor, perceptual roughness and anisotropy in [0, 1], index of refraction, specular
//! strength and tint, transmission; the parameters of coat, sheen and film. Source: glTF 2.0, appendix B, with the
//! KHR_materials extensions; energy between the facets by Kulla and Conty 2017, *Revisiting Physically Based Shading at
//! Imageworks*.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::base::{LayeredBase, UnscatteredShares};
use super::coat::Coat;
use super::fresnel::mean;
use super::interface::{BoundarySample, Interface, TransmissionKind};
use super::sheen::Sheen;
use super::tables::Mu;
use super::{BsdfSample, LobeFlags, SurfaceParams, TransportMode, warp};

/// All layers of glTF's material. The [module](super) describes the local frame and the energy balance of the layers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layered {
    base: LayeredBase,
    /// Coat on the outside of the surface; on the far side when wo is within a solid.
    coat: Option<Coat>,
    sheen: Option<Sheen>,
    is_black: bool,
    has_non_delta: bool,
}

/// [`Layered`] for one outgoing direction: values that light sampling and BSDF sampling share.
#[derive(Clone, Copy)]
pub(super) struct LayeredAt<'a> {
    layers: &'a Layered,
    mode: TransportMode,
    wo: Vec3,
    carried: Spectrum,
    profile: Profile,
    /// Probabilities of choosing each of [`LOBES`].
    chances: [f32; 5],
}

/// The values that depend on a single direction.
#[derive(Clone, Copy)]
struct Profile {
    base: UnscatteredShares,
    /// Share of the light that the coat lets pass; `sheen` likewise.
    coat: f32,
    sheen: f32,
}

/// The lobe that a sample is drawn from.
#[derive(Clone, Copy)]
enum Lobe {
    Interface,
    Cosine,
    CosineThrough,
    Coat,
    /// Sheen, and cosine lobes with most of their light near the horizon.
    Uniform,
}

const LOBES: [Lobe; 5] = [Lobe::Interface, Lobe::Cosine, Lobe::CosineThrough, Lobe::Coat, Lobe::Uniform];

impl Layered {
    /// Builds the layers; the caller clamps `p`.
    pub(super) fn new(p: &SurfaceParams) -> Self {
        let base = LayeredBase::new(p);
        let coat = Coat::new(p.coat, p.coat_roughness, p.coat_normal);
        let sheen = Sheen::new(base.tables, p.sheen_color, p.sheen_roughness);
        let rough_base = !base.interface.ggx.is_smooth() && !base.interface.is_black();
        let rough_coat = coat.is_some_and(|coat| !coat.ggx.is_smooth());
        // From within, coat and sheen only attenuate transmitted light.
        let above = !base.inside && (sheen.is_some() || rough_coat);
        Self {
            is_black: base.interface.is_black() && !base.has_cosine() && coat.is_none() && sheen.is_none(),
            has_non_delta: rough_base || base.has_cosine() || above,
            base,
            coat,
            sheen,
        }
    }

    /// Returns the boundary if it is the only lobe and smooth; `None`: it is not.
    pub(super) fn as_smooth_boundary(&self) -> Option<Interface> {
        let is_bare = self.coat.is_none() && self.sheen.is_none();
        (is_bare && !self.has_non_delta && !self.is_black).then_some(self.base.interface)
    }

    /// Prepares sampling and evaluation for `wo`, above the surface, of a path with throughput `carried`. `None` if
    /// nothing is scattered.
    #[inline]
    pub(super) fn at(&self, wo: Vec3, mode: TransportMode, carried: Spectrum) -> Option<LayeredAt<'_>> {
        let (profile, albedo) = self.outgoing(wo);
        let chances = chances(&albedo)?;
        Some(LayeredAt { layers: self, mode, wo, carried, profile, chances })
    }

    /// Returns the directional albedo, see [`Bsdf::albedo`](super::Bsdf::albedo); `wo` is above the surface.
    pub(super) fn albedo(&self, wo: Vec3) -> Spectrum {
        self.outgoing(wo).1.iter().copied().sum()
    }

    /// Returns true if nothing is scattered.
    pub(super) fn is_black(&self) -> bool {
        self.is_black
    }

    /// Returns true if light can be transmitted to the other side.
    pub(super) fn is_transmissive(&self) -> bool {
        self.base.interface.through != TransmissionKind::Nothing || self.base.is_translucent()
    }

    /// Returns true if any lobe is not a Dirac lobe.
    pub(super) fn has_non_delta(&self) -> bool {
        self.has_non_delta
    }

    /// Returns the perceptual roughness, see [`Bsdf::roughness`](super::Bsdf::roughness).
    pub(super) fn roughness(&self) -> f32 {
        let base = if self.base.interface.is_black() { 1.0 } else { self.base.interface.ggx.alpha().sqrt() };
        self.coat.filter(|_| !self.base.inside).map_or(base, |coat| base.min(coat.ggx.alpha().sqrt()))
    }

    /// Returns the profile of `wi`, which may be on either side.
    fn on_side_of(&self, wi: Vec3) -> Profile {
        let crosses = wi.z < 0.0 && self.base.interface.through == TransmissionKind::Solid;
        let inside = self.base.inside != crosses;
        let mu = Mu::new(wi.z.abs());
        self.profile(wi, self.base.rest(mu, inside), inside)
    }

    fn profile(&self, w: Vec3, base: UnscatteredShares, inside: bool) -> Profile {
        let tables = self.base.tables;
        Profile {
            base,
            coat: self.coat.as_ref().filter(|_| !inside).map_or(1.0, |coat| 1.0 - coat.albedo(tables, w)),
            sheen: self
                .sheen
                .as_ref()
                .filter(|_| !inside)
                .map_or(1.0, |sheen| sheen.passed(tables, Mu::new(w.z.abs()))),
        }
    }

    /// Returns the profile of wo and the albedo of each of [`LOBES`].
    fn outgoing(&self, wo: Vec3) -> (Profile, [Spectrum; 5]) {
        let (rest, albedo) = self.base.rest_and_albedo(wo.z);
        let profile = self.profile(wo, rest, self.base.inside);
        let below = profile.coat * profile.sheen;
        let coat = Spectrum::splat(profile.sheen * (1.0 - profile.coat));
        let sheen = self.sheen.as_ref().map_or(Spectrum::ZERO, |sheen| sheen.albedo(profile.sheen));
        let uniform = below * albedo.grazing + sheen;
        (profile, [below * albedo.interface, below * albedo.cosine, below * albedo.cosine_through, coat, uniform])
    }
}

impl LayeredAt<'_> {
    /// Draws a direction; arguments and `None` as for [`BsdfAt::sample`](super::BsdfAt::sample).
    pub(super) fn sample(&self, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        let Self { layers, mode, wo, carried, profile, chances } = self;
        let base = &layers.base;
        // Choose a lobe by its albedo
        let (lobe, chance, u_rest) = choose(chances, u_lobe)?;
        let reflected =
            |wi, flags| BoundarySample { wi, flags: LobeFlags::REFLECTION.union(flags), eta: 1.0, delta: None };
        // Draw wi from the lobe
        let drawn = match lobe {
            Lobe::Interface => base.interface.sample(*wo, u_rest, u, *mode, *carried)?,
            Lobe::Cosine => reflected(warp::cosine_hemisphere(u), LobeFlags::DIFFUSE),
            Lobe::Uniform => reflected(warp::uniform_hemisphere(u), LobeFlags::DIFFUSE),
            Lobe::Coat => layers.coat.as_ref()?.sample(*wo, u)?,
            Lobe::CosineThrough => BoundarySample {
                wi: -warp::cosine_hemisphere(u),
                flags: LobeFlags::TRANSMISSION.union(LobeFlags::DIFFUSE),
                eta: base.interface.eta(),
                delta: None,
            },
        };
        let BoundarySample { wi, flags, eta, delta } = drawn;
        if wi.z == 0.0 {
            return None;
        }
        // Evaluate all lobes, or the Dirac lobe alone
        let (value, pdf) = match delta {
            None => self.eval_pdf(wi),
            Some((reflectance, probability)) => {
                let other = layers.on_side_of(wi);
                let passed = match lobe {
                    Lobe::Coat => profile.sheen.min(other.sheen),
                    _ => passed(profile, &other),
                };
                (reflectance * (passed / wi.z.abs()), chance * probability)
            }
        };
        (pdf > 0.0 && value.max_element() > 0.0).then_some(BsdfSample { wi, value, pdf, lobe: flags, eta })
    }

    /// Returns the density with which [`Self::sample`] draws `wi`, on the side of wo, from a diffuse lobe.
    pub(super) fn diffuse_pdf(&self, wi: Vec3) -> f32 {
        let [_, cosine, _, _, uniform] = self.chances;
        cosine * warp::cosine_hemisphere_pdf(wi.z) + uniform * warp::UNIFORM_HEMISPHERE_PDF
    }

    /// Returns f and pdf summed over all lobes but Dirac ones; wi.z must not be 0.
    pub(super) fn eval_pdf(&self, wi: Vec3) -> (Spectrum, f32) {
        let Self { layers, mode, wo, carried, profile, chances } = self;
        let [interface, cosine, cosine_through, coat, uniform] = *chances;
        let base = &layers.base;
        let other = layers.on_side_of(wi);
        let (facets, facets_pdf) = base.interface.eval_pdf(*wo, wi, *mode, *carried);
        let (diffuse, diffuse_chance) = if wi.z > 0.0 {
            (base.cosine(&profile.base, &other.base), cosine)
        } else {
            let scale = mode.radiance_scale(base.interface.eta());
            (scale * base.cosine_through(&profile.base, &other.base), cosine_through)
        };
        let mut value = (facets + diffuse) * passed(profile, &other);
        let mut pdf = interface * facets_pdf + diffuse_chance * warp::cosine_hemisphere_pdf(wi.z.abs());
        if wi.z < 0.0 {
            return (value, pdf);
        }
        pdf += uniform * warp::UNIFORM_HEMISPHERE_PDF;
        if base.inside {
            return (value, pdf);
        }
        // Add coat and sheen
        if let Some(layer) = &layers.coat {
            let (coat_value, coat_pdf) = layer.eval_pdf(*wo, wi);
            value += profile.sheen.min(other.sheen) * coat_value;
            pdf += coat * coat_pdf;
        }
        if let Some(layer) = &layers.sheen {
            value += layer.eval(*wo, wi);
        }
        (value, pdf)
    }
}

/// Returns the share of the light scattered below coat and sheen that they let pass.
fn passed(o: &Profile, i: &Profile) -> f32 {
    o.coat.min(i.coat) * o.sheen.min(i.sheen)
}

/// Returns the probability of choosing each lobe, proportional to its mean albedo; `None` if nothing is scattered.
fn chances(albedo: &[Spectrum; 5]) -> Option<[f32; 5]> {
    let weights = albedo.map(mean);
    let sum: f32 = weights.iter().sum();
    (sum > 0.0).then(|| weights.map(|weight| weight / sum))
}

/// Returns the lobe chosen by `u`, its probability, and `u` rescaled to [0, 1) within its share.
fn choose(chances: &[f32; 5], u: f32) -> Option<(Lobe, f32, f32)> {
    let mut below = 0.0;
    let mut last = None;
    for (lobe, chance) in LOBES.into_iter().zip(*chances).filter(|&(_, chance)| chance > 0.0) {
        let rest = ((u - below) / chance).clamp(0.0, warp::ONE_MINUS_EPSILON);
        last = Some((lobe, chance, rest));
        below += chance;
        if u < below {
            break;
        }
    }
    last
}
