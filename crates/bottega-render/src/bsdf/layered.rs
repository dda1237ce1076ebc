//! The layers put together.

use bottega_scene::Spectrum;
use glam::Vec3;

use super::coat::Coat;
use super::diffuse::{Coupled, Cover};
use super::fresnel::{DielectricFresnel, IOR_STEP_MIN, mean};
use super::ggx::Ggx;
use super::interface::{Drawn, Interface, Through};
use super::sheen::Sheen;
use super::tables::{Index, Mu, Rough, Tables};
use super::{BsdfSample, LobeFlags, SurfaceParams, TransportMode, warp};

/// The scattering at one point. See the [module](super) for the frame and for how the layers balance.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    tables: &'static Tables,
    mode: TransportMode,
    /// Whether wo is within a solid: coat and sheen are then on the far side.
    inside: bool,
    rough: Rough,
    index: Index,
    interface: Interface,
    /// What lies over the diffuse base.
    cover: Cover,
    diffuse: Coupled,
    /// Scattered more than once between facets that only reflect (or of a thin sheet).
    multiple: Coupled,
    multiple_through: Coupled,
    /// Scattered more than once between the facets of a solid's boundary.
    boundary: Coupled,
    boundary_through: Coupled,
    coat: Option<Coat>,
    sheen: Option<Sheen>,
}

/// All that depends on one direction alone.
#[derive(Clone, Copy)]
struct Profile {
    /// 1 − E of the facets, of the cover over the diffuse base, and of the solid's boundary.
    multiple: f32,
    diffuse: f32,
    boundary: f32,
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
    Sheen,
}

const LOBES: [Lobe; 5] = [Lobe::Interface, Lobe::Cosine, Lobe::CosineThrough, Lobe::Coat, Lobe::Sheen];

impl Bsdf {
    /// The scattering of paths from the camera.
    pub fn new(params: &SurfaceParams) -> Self {
        let p = params.clamped();
        let tables = Tables::get();
        let refracting = p.ior != 0.0 && (1.0 - p.metallic) * p.transmission > 0.0;
        let through = match (refracting, p.thin) {
            (false, _) => Through::Nothing,
            (true, true) => Through::Thin,
            (true, false) => Through::Solid,
        };
        let inside = through == Through::Solid && !p.front;
        let ggx = Ggx::from_roughness(p.roughness);
        let narrow = through == Through::Solid && !ggx.is_smooth();
        let ior = if narrow { p.ior.max(1.0 + IOR_STEP_MIN) } else { p.ior };
        let fresnel = DielectricFresnel::new(ior, p.specular, p.specular_color, inside);
        // Shares of the surface: metal, and a dielectric that is opaque or lets light through.
        let transmitting = if refracting { (1.0 - p.metallic) * p.transmission } else { 0.0 };
        let opaque = 1.0 - p.metallic - transmitting;
        let interface = Interface {
            ggx,
            metal: p.metallic,
            metal_f0: p.base_color,
            // From within, the opaque share is bare: its dielectric is on the other side.
            dielectric: if inside { transmitting } else { 1.0 - p.metallic },
            fresnel,
            through,
            tint: p.base_color * transmitting,
        };
        let black = Coupled::new(Spectrum::ZERO, 0.0);
        let mut bsdf = Self {
            tables,
            mode: TransportMode::Radiance,
            inside,
            rough: Rough::new(p.roughness),
            index: Index::new(ior.max(1.0)),
            interface,
            cover: Cover::default(),
            diffuse: black,
            multiple: black,
            multiple_through: black,
            boundary: black,
            boundary_through: black,
            coat: Coat::new(p.coat, p.coat_roughness),
            sheen: Sheen::new(tables, p.sheen_color, p.sheen_roughness),
        };
        bsdf.balance(p.base_color, opaque.max(0.0), transmitting);
        bsdf
    }

    /// The same for `mode`.
    pub fn with_mode(self, mode: TransportMode) -> Self {
        Self { mode, ..self }
    }

    /// Fills in the cosine lobes: what the facets lose, and the diffuse base.
    fn balance(&mut self, base_color: Spectrum, opaque: f32, transmitting: f32) {
        let (tables, fresnel) = (self.tables, self.interface.fresnel);
        let single_mean = tables.single(None, self.rough);
        // Mean of the dielectric's Fresnel term from outside; at zero roughness the table of s is s itself.
        let smooth = Rough::new(0.0);
        let rise_mean =
            if fresnel.is_total() { tables.schlick(None, smooth) } else { tables.rise(None, smooth, self.index) };
        let fresnel_mean = fresnel.of_rise(rise_mean);

        let metal = multiply_scattered(self.interface.metal_f0 * (20.0 / 21.0) + 1.0 / 21.0, single_mean);
        let dielectric = multiply_scattered(fresnel_mean, single_mean);
        let mut multiple = self.interface.metal * metal;
        if !self.inside {
            multiple += opaque * dielectric;
            let f0 = fresnel.specular * fresnel.f0.max_element();
            let constant = dielectric.max_element();
            self.cover =
                Cover { single: f0 - constant, rise: fresnel.specular - f0, constant, schlick: fresnel.is_total() };
        }
        let cover_mean = self.cover.at(tables, None, self.rough, self.index);
        self.diffuse = Coupled::new(base_color * opaque, cover_mean);
        match self.interface.through {
            Through::Nothing => {}
            Through::Thin => {
                multiple += transmitting * fresnel_mean;
                let through = transmitting * (1.0 - fresnel_mean.max_element()) * base_color;
                self.multiple_through = Coupled::new(through, single_mean);
            }
            Through::Solid => self.balance_boundary(base_color * transmitting, transmitting, rise_mean),
        }
        self.multiple = Coupled::new(multiple, single_mean);
    }

    /// What the facets of a solid's boundary lose, given back on both sides. The shares are such that
    /// f(wo, wi) / η_i² is symmetric.
    fn balance_boundary(&mut self, tint: Spectrum, weight: f32, rise_mean: f32) {
        let (tables, fresnel) = (self.tables, self.interface.fresnel);
        let near = tables.boundary(None, self.rough, self.index, self.inside);
        let far = tables.boundary(None, self.rough, self.index, !self.inside);
        let outside = fresnel.f0_exact + (1.0 - fresnel.f0_exact) * rise_mean;
        // (1 − F̅) n² is the same on both sides.
        let passed = (1.0 - outside) * if self.inside { fresnel.eta * fresnel.eta } else { 1.0 };
        let rest_max = (1.0 - near).max(1.0 - far);
        // The tables hold for full strength and a white tint; elsewhere less is given back.
        let weight_white = fresnel.specular * (fresnel.f0 / fresnel.f0_exact.max(1e-9)).min_element().min(1.0);
        if rest_max <= 1e-4 {
            return;
        }
        let crossed = passed * (1.0 - far) / rest_max;
        self.boundary = Coupled::new(Spectrum::splat(weight * weight_white * (1.0 - crossed)), near);
        self.boundary_through = Coupled::new(tint * (weight_white * crossed), far);
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
        let profile = self.near(wo.z);
        self.chances(wo.z, &profile).map_or((Spectrum::ZERO, 0.0), |chances| self.mixture(wo, wi, &profile, &chances))
    }

    /// Draws a direction, from numbers in [0, 1). `None`: these numbers scatter no light, and the path ends.
    pub fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2]) -> Option<BsdfSample> {
        if !is_above(wo) {
            return None;
        }
        let profile = self.near(wo.z);
        let chances = self.chances(wo.z, &profile)?;
        let (lobe, chance, u_rest) = choose(&chances, u_lobe)?;
        let reflected = |wi, flags| Drawn { wi, flags: LobeFlags::REFLECTION.union(flags), eta: 1.0, delta: None };
        let drawn = match lobe {
            Lobe::Interface => self.interface.sample(wo, u_rest, u, self.mode)?,
            Lobe::Cosine => reflected(warp::cosine_hemisphere(u), LobeFlags::DIFFUSE),
            Lobe::Sheen => reflected(warp::uniform_hemisphere(u), LobeFlags::DIFFUSE),
            Lobe::Coat => self.coat?.sample(wo, u)?,
            Lobe::CosineThrough => Drawn {
                wi: -warp::cosine_hemisphere(u),
                flags: LobeFlags::TRANSMISSION.union(LobeFlags::DIFFUSE),
                eta: self.interface.eta(),
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
                let passed = match lobe {
                    Lobe::Coat => profile.sheen,
                    _ => self.passed(&profile, &self.on_side_of(wi)),
                };
                (reflectance * (passed / wi.z.abs()), chance * probability)
            }
        };
        (pdf > 0.0 && value.max_element() > 0.0).then_some(BsdfSample { wi, value, pdf, lobe: flags, eta })
    }

    /// Share of the light arriving along `wo` that is scattered anywhere, as the tables know it: within a percent or so
    /// for reflection, an estimate for what goes through.
    pub fn albedo(&self, wo: Vec3) -> Spectrum {
        if !is_above(wo) {
            return Spectrum::ZERO;
        }
        let profile = self.near(wo.z);
        LOBES.iter().fold(Spectrum::ZERO, |sum, &lobe| sum + self.lobe_albedo(lobe, wo.z, &profile))
    }

    /// Whether nothing is scattered at all.
    pub fn is_black(&self) -> bool {
        self.interface.is_black() && !self.has_cosine() && self.coat.is_none() && self.sheen.is_none()
    }

    /// Whether light can go to the other side.
    pub fn is_transmissive(&self) -> bool {
        self.interface.through != Through::Nothing
    }

    /// Whether all light goes into single directions, so that connecting to a light is of no use.
    pub fn is_delta_only(&self) -> bool {
        !self.is_black() && !self.has_non_delta()
    }

    /// Whether some light is spread over solid angles: what `eval` and `pdf` tell of.
    pub fn has_non_delta(&self) -> bool {
        let rough_base = !self.interface.ggx.is_smooth() && !self.interface.is_black();
        rough_base || self.has_cosine() || self.sheen.is_some() || self.coat.is_some_and(|coat| !coat.ggx.is_smooth())
    }

    /// Perceptual roughness of the sharpest lobe that this surface has: 0 for a mirror, 1 where there are only diffuse
    /// ones.
    pub fn roughness(&self) -> f32 {
        let base = if self.interface.is_black() { 1.0 } else { self.interface.ggx.alpha().sqrt() };
        self.coat.map_or(base, |coat| base.min(coat.ggx.alpha().sqrt()))
    }

    fn has_cosine(&self) -> bool {
        [self.diffuse, self.multiple, self.boundary, self.multiple_through, self.boundary_through]
            .iter()
            .any(|lobe| !lobe.is_black())
    }

    /// Sums of all lobes but Dirac ones.
    fn mixture(&self, wo: Vec3, wi: Vec3, profile: &Profile, chances: &[f32; 5]) -> (Spectrum, f32) {
        let [interface, cosine, cosine_through, coat, sheen] = *chances;
        let other = self.on_side_of(wi);
        let (facets, facets_pdf) = self.interface.eval_pdf(wo, wi, self.mode);
        let mut value = facets + self.cosine(wi.z > 0.0, profile, &other);
        value *= self.passed(profile, &other);
        let cosine = if wi.z > 0.0 { cosine } else { cosine_through };
        let mut pdf = interface * facets_pdf + cosine * warp::cosine_hemisphere_pdf(wi.z.abs());
        if wi.z < 0.0 || self.inside {
            return (value, pdf);
        }
        if let Some(layer) = &self.coat {
            let (coat_value, coat_pdf) = layer.eval_pdf(wo, wi);
            value += profile.sheen.min(other.sheen) * coat_value;
            pdf += coat * coat_pdf;
        }
        if let Some(layer) = &self.sheen {
            value += layer.eval(wo, wi);
            pdf += sheen * warp::UNIFORM_HEMISPHERE_PDF;
        }
        (value, pdf)
    }

    /// The cosine lobes of one side.
    fn cosine(&self, reflection: bool, o: &Profile, i: &Profile) -> Spectrum {
        if reflection {
            return self.diffuse.eval(o.diffuse, i.diffuse)
                + self.multiple.eval(o.multiple, i.multiple)
                + self.boundary.eval(o.boundary, i.boundary);
        }
        let eta = self.interface.eta();
        let scale = if self.mode == TransportMode::Radiance { 1.0 / (eta * eta) } else { 1.0 };
        self.multiple_through.eval(o.multiple, i.multiple) + scale * self.boundary_through.eval(o.boundary, i.boundary)
    }

    /// What coat and sheen leave of light that is scattered below them.
    fn passed(&self, o: &Profile, i: &Profile) -> f32 {
        o.coat.min(i.coat) * o.sheen.min(i.sheen)
    }

    fn on_side_of(&self, w: Vec3) -> Profile {
        let solid = self.interface.through == Through::Solid;
        if w.z < 0.0 && solid { self.profile(-w.z, !self.inside) } else { self.near(w.z.abs()) }
    }

    fn near(&self, cos: f32) -> Profile {
        self.profile(cos, self.inside)
    }

    fn profile(&self, cos: f32, inside: bool) -> Profile {
        let (tables, mu) = (self.tables, Mu::new(cos));
        let rest = |wanted: bool, albedo: &dyn Fn() -> f32| if wanted { 1.0 - albedo() } else { 1.0 };
        let multiple = !(self.multiple.is_black() && self.multiple_through.is_black());
        let boundary = !(self.boundary.is_black() && self.boundary_through.is_black());
        Profile {
            multiple: rest(multiple, &|| tables.single(Some(mu), self.rough)),
            diffuse: rest(!self.diffuse.is_black(), &|| self.cover.at(tables, Some(mu), self.rough, self.index)),
            boundary: rest(boundary, &|| tables.boundary(Some(mu), self.rough, self.index, inside)),
            coat: self.coat.filter(|_| !inside).map_or(1.0, |coat| 1.0 - coat.albedo(tables, mu)),
            sheen: self.sheen.filter(|_| !inside).map_or(1.0, |sheen| sheen.passed(tables, mu)),
        }
    }

    /// What a lobe scatters of light at cosine `cos`.
    fn lobe_albedo(&self, lobe: Lobe, cos: f32, profile: &Profile) -> Spectrum {
        let (tables, mu) = (self.tables, Mu::new(cos));
        let below = profile.coat * profile.sheen;
        let coat = self.coat.filter(|_| !self.inside);
        let sheen = self.sheen.filter(|_| !self.inside);
        match lobe {
            Lobe::Interface => below * self.interface_albedo(cos),
            Lobe::Cosine => {
                below
                    * (self.diffuse.color * profile.diffuse
                        + self.multiple.color * profile.multiple
                        + self.boundary.color * profile.boundary)
            }
            Lobe::CosineThrough => {
                below
                    * (self.multiple_through.color * profile.multiple + self.boundary_through.color * profile.boundary)
            }
            Lobe::Coat => coat.map_or(Spectrum::ZERO, |coat| Spectrum::splat(profile.sheen * coat.albedo(tables, mu))),
            Lobe::Sheen => sheen.map_or(Spectrum::ZERO, |sheen| sheen.albedo(tables, mu)),
        }
    }

    fn interface_albedo(&self, cos: f32) -> Spectrum {
        let (tables, mu) = (self.tables, Some(Mu::new(cos)));
        let solid = || tables.boundary(mu, self.rough, self.index, self.inside);
        if self.inside {
            return self.interface.smooth_albedo(cos) * solid();
        }
        let single = tables.single(mu, self.rough);
        let schlick = tables.schlick(mu, self.rough);
        let total = self.interface.fresnel.is_total();
        let rise = if total { schlick } else { tables.rise(mu, self.rough, self.index) };
        let all = if self.interface.through == Through::Solid { solid() } else { single };
        self.interface.albedo(single, schlick, rise, all)
    }

    /// With which probability each lobe is chosen for light at cosine `cos`; `None` where nothing is scattered.
    fn chances(&self, cos: f32, profile: &Profile) -> Option<[f32; 5]> {
        let weights = LOBES.map(|lobe| mean(self.lobe_albedo(lobe, cos, profile)));
        let sum: f32 = weights.iter().sum();
        (sum > 0.0).then(|| weights.map(|weight| weight / sum))
    }
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

/// Colour of the light that was reflected more than once, as a share of what single scattering loses.
/// `fresnel`, `single`: means over the hemisphere of the reflectance of a facet and of the share scattered once.
fn multiply_scattered(fresnel: Spectrum, single: f32) -> Spectrum {
    fresnel * fresnel * single / (Spectrum::ONE - fresnel * (1.0 - single))
}
