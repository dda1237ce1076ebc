//! The layers put together.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::base::{Base, Rest};
use super::coat::Coat;
use super::fresnel::mean;
use super::interface::{Drawn, Through};
use super::sheen::Sheen;
use super::tables::Mu;
use super::{BsdfSample, LobeFlags, SurfaceParams, TransportMode, warp};

/// The scattering at one point. See the [module](super) for the frame and for how the layers balance.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    mode: TransportMode,
    base: Base,
    /// Outside: on the far side when wo is within a solid.
    coat: Option<Coat>,
    sheen: Option<Sheen>,
}

/// All that depends on one direction alone.
#[derive(Clone, Copy)]
struct Profile {
    base: Rest,
    /// What coat and sheen let pass.
    coat: f32,
    sheen: f32,
}

/// A lobe to choose.
#[derive(Clone, Copy)]
enum Lobe {
    Interface,
    Cosine,
    CosineThrough,
    Coat,
    /// Sheen, and cosine lobes that are mostly near the horizon.
    Uniform,
}

const LOBES: [Lobe; 5] = [Lobe::Interface, Lobe::Cosine, Lobe::CosineThrough, Lobe::Coat, Lobe::Uniform];

impl Bsdf {
    /// The scattering of paths from the camera.
    pub fn new(params: &SurfaceParams) -> Self {
        let p = params.clamped();
        let base = Base::new(&p);
        Self {
            mode: TransportMode::Radiance,
            base,
            coat: Coat::new(p.coat, p.coat_roughness, p.coat_normal),
            sheen: Sheen::new(base.tables, p.sheen_color, p.sheen_roughness),
        }
    }

    /// The same for `mode`.
    pub fn with_mode(self, mode: TransportMode) -> Self {
        Self { mode, ..self }
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
        if !is_above(wo) || wi.z == 0.0 {
            return (Spectrum::ZERO, 0.0);
        }
        let (profile, albedo) = self.outgoing(wo);
        chances(&albedo).map_or((Spectrum::ZERO, 0.0), |chances| self.mixture(wo, wi, &profile, &chances))
    }

    /// Draws a direction, from numbers in [0, 1). `None`: these numbers scatter no light, and the path ends.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        if !is_above(wo) {
            return None;
        }
        let (profile, albedo) = self.outgoing(wo);
        let chances = chances(&albedo)?;
        let (lobe, chance, u_rest) = choose(&chances, u_lobe)?;
        let reflected = |wi, flags| Drawn { wi, flags: LobeFlags::REFLECTION.union(flags), eta: 1.0, delta: None };
        let drawn = match lobe {
            Lobe::Interface => self.base.interface.sample(wo, u_rest, u, self.mode)?,
            Lobe::Cosine => reflected(warp::cosine_hemisphere(u), LobeFlags::DIFFUSE),
            Lobe::Uniform => reflected(warp::uniform_hemisphere(u), LobeFlags::DIFFUSE),
            Lobe::Coat => self.coat?.sample(wo, u)?,
            Lobe::CosineThrough => Drawn {
                wi: -warp::cosine_hemisphere(u),
                flags: LobeFlags::TRANSMISSION.union(LobeFlags::DIFFUSE),
                eta: self.base.interface.eta(),
                delta: None,
            },
        };
        let Drawn { wi, flags, eta, delta } = drawn;
        if wi.z == 0.0 {
            return None;
        }
        let (value, pdf) = match delta {
            None => self.mixture(wo, wi, &profile, &chances),
            Some((reflectance, probability)) => {
                let other = self.on_side_of(wi);
                let passed = match lobe {
                    Lobe::Coat => profile.sheen.min(other.sheen),
                    _ => passed(&profile, &other),
                };
                (reflectance * (passed / wi.z.abs()), chance * probability)
            }
        };
        (pdf > 0.0 && value.max_element() > 0.0).then_some(BsdfSample { wi, value, pdf, lobe: flags, eta })
    }

    /// Share of the light arriving along `wo` that is scattered anywhere, as the tables know it: within two percent for
    /// what is reflected by a base without coat and sheen, up to a tenth or so too much below these, and an estimate of
    /// what goes through.
    pub fn albedo(&self, wo: Vec3) -> Spectrum {
        if !is_above(wo) {
            return Spectrum::ZERO;
        }
        self.outgoing(wo).1.iter().copied().sum()
    }

    /// Whether nothing is scattered at all.
    pub fn is_black(&self) -> bool {
        self.base.interface.is_black() && !self.base.has_cosine() && self.coat.is_none() && self.sheen.is_none()
    }

    /// Whether light can go to the other side.
    pub fn is_transmissive(&self) -> bool {
        self.base.interface.through != Through::Nothing
    }

    /// Whether all light goes into single directions, so that connecting to a light is of no use.
    pub fn is_delta_only(&self) -> bool {
        !self.is_black() && !self.has_non_delta()
    }

    /// Whether some light is spread over solid angles: what `eval` and `pdf` tell of.
    pub fn has_non_delta(&self) -> bool {
        let rough_base = !self.base.interface.ggx.is_smooth() && !self.base.interface.is_black();
        let rough_coat = self.coat.is_some_and(|coat| !coat.ggx.is_smooth());
        // From within, coat and sheen only weaken what goes through.
        let above = !self.base.inside && (self.sheen.is_some() || rough_coat);
        rough_base || self.base.has_cosine() || above
    }

    /// Perceptual roughness of the sharpest lobe that this surface has: 0 for a mirror, 1 where there are only diffuse
    /// ones.
    pub fn roughness(&self) -> f32 {
        let base = if self.base.interface.is_black() { 1.0 } else { self.base.interface.ggx.alpha().sqrt() };
        self.coat.filter(|_| !self.base.inside).map_or(base, |coat| base.min(coat.ggx.alpha().sqrt()))
    }

    /// Sums of all lobes but Dirac ones.
    fn mixture(&self, wo: Vec3, wi: Vec3, profile: &Profile, chances: &[f32; 5]) -> (Spectrum, f32) {
        let [interface, cosine, cosine_through, coat, uniform] = *chances;
        let other = self.on_side_of(wi);
        let (facets, facets_pdf) = self.base.interface.eval_pdf(wo, wi, self.mode);
        let (diffuse, diffuse_chance) = if wi.z > 0.0 {
            (self.base.cosine(&profile.base, &other.base), cosine)
        } else {
            let scale = self.mode.radiance_scale(self.base.interface.eta());
            (scale * self.base.cosine_through(&profile.base, &other.base), cosine_through)
        };
        let mut value = (facets + diffuse) * passed(profile, &other);
        let mut pdf = interface * facets_pdf + diffuse_chance * warp::cosine_hemisphere_pdf(wi.z.abs());
        if wi.z < 0.0 {
            return (value, pdf);
        }
        pdf += uniform * warp::UNIFORM_HEMISPHERE_PDF;
        if self.base.inside {
            return (value, pdf);
        }
        if let Some(layer) = &self.coat {
            let (coat_value, coat_pdf) = layer.eval_pdf(wo, wi);
            value += profile.sheen.min(other.sheen) * coat_value;
            pdf += coat * coat_pdf;
        }
        if let Some(layer) = &self.sheen {
            value += layer.eval(wo, wi);
        }
        (value, pdf)
    }

    /// The profile of wi, on whichever side it is.
    fn on_side_of(&self, wi: Vec3) -> Profile {
        let crosses = wi.z < 0.0 && self.base.interface.through == Through::Solid;
        let inside = self.base.inside != crosses;
        let mu = Mu::new(wi.z.abs());
        self.profile(wi, self.base.rest(mu, inside), inside)
    }

    fn profile(&self, w: Vec3, base: Rest, inside: bool) -> Profile {
        let tables = self.base.tables;
        Profile {
            base,
            coat: self.coat.filter(|_| !inside).map_or(1.0, |coat| 1.0 - coat.albedo(tables, w)),
            sheen: self.sheen.filter(|_| !inside).map_or(1.0, |sheen| sheen.passed(tables, Mu::new(w.z.abs()))),
        }
    }

    /// The profile of wo, and the share of the light from there that each of [`LOBES`] scatters.
    fn outgoing(&self, wo: Vec3) -> (Profile, [Spectrum; 5]) {
        let (rest, albedo) = self.base.rest_and_albedo(wo.z);
        let profile = self.profile(wo, rest, self.base.inside);
        let below = profile.coat * profile.sheen;
        let coat = Spectrum::splat(profile.sheen * (1.0 - profile.coat));
        let sheen = self.sheen.map_or(Spectrum::ZERO, |sheen| sheen.albedo(profile.sheen));
        let uniform = below * albedo.grazing + sheen;
        (profile, [below * albedo.interface, below * albedo.cosine, below * albedo.cosine_through, coat, uniform])
    }
}

/// What coat and sheen leave of light that is scattered below them.
fn passed(o: &Profile, i: &Profile) -> f32 {
    o.coat.min(i.coat) * o.sheen.min(i.sheen)
}

/// With which probability each lobe is chosen, by what it scatters; `None` where nothing is scattered.
fn chances(albedo: &[Spectrum; 5]) -> Option<[f32; 5]> {
    let weights = albedo.map(mean);
    let sum: f32 = weights.iter().sum();
    (sum > 0.0).then(|| weights.map(|weight| weight / sum))
}

fn is_above(wo: Vec3) -> bool {
    wo.z > 0.0
}

/// The lobe that `u` falls to, its chance, and where in its share `u` lies.
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
