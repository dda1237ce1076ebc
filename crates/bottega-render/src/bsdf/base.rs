//! The base below coat and sheen: microfacets, multiple scattering between them, and the diffuse lobe.

use bottega_scene::Spectrum;

use super::diffuse::{CoupledDiffuse, CoverAlbedo};
use super::film::Film;
use super::fresnel::{DielectricFresnel, IOR_STEP_MIN};
use super::ggx::Ggx;
use super::interface::{Interface, TransmissionKind};
use super::params::SurfaceParams;
use super::tables::{Index, Mu, Rough, Tables};

/// Factor of a solid's dispersion: half the spread of its index of refraction is this × (n − 1) × dispersion
/// (KHR_materials_dispersion).
pub const DISPERSION_SCALE: f32 = 0.025;

/// A mix of metal, opaque dielectric and transmitting dielectric with common facets.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayeredBase {
    /// Albedo tables, shared by all materials.
    pub(super) tables: &'static Tables,
    /// GGX boundary: single reflection and transmission.
    pub(super) interface: Interface,
    /// `true`: wo is within a solid.
    pub(super) inside: bool,
    rough: Rough,
    index: Index,
    /// Dielectric layer over the diffuse base.
    cover: CoverAlbedo,
    diffuse: CoupledDiffuse,
    /// Diffuse light that leaves on the other side.
    diffuse_through: CoupledDiffuse,
    /// Multiple scattering between facets that only reflect, or of a thin sheet.
    multiple: CoupledDiffuse,
    multiple_through: CoupledDiffuse,
    /// Multiple scattering between the facets of a solid's boundary.
    boundary: CoupledDiffuse,
    boundary_through: CoupledDiffuse,
    /// The tables that the cosine lobes need.
    uses: NeededTables,
}

#[derive(Clone, Copy, Debug, Default)]
struct NeededTables {
    single: bool,
    rise: bool,
    boundary: bool,
}

/// Shares of the light along one direction that are not scattered once: 1 − E of the facets, of the cover over the
/// diffuse base, and of the solid's boundary. Arbitrary where no lobe uses the value.
#[derive(Clone, Copy)]
pub(super) struct UnscatteredShares {
    multiple: f32,
    diffuse: f32,
    boundary: f32,
}

/// Albedo of each lobe along one direction.
#[derive(Clone, Copy)]
pub(super) struct BaseAlbedo {
    /// Boundary: single reflection and transmission.
    pub(super) interface: Spectrum,
    /// Cosine lobes on the side of wo.
    pub(super) cosine: Spectrum,
    /// Cosine lobes with most of their light near the horizon.
    pub(super) grazing: Spectrum,
    /// Cosine lobes on the far side.
    pub(super) cosine_through: Spectrum,
}

impl LayeredBase {
    /// Builds the base; the caller clamps `p`.
    pub(super) fn new(p: &SurfaceParams) -> Self {
        let refracting = p.ior != 0.0 && (1.0 - p.metallic) * p.transmission > 0.0;
        let through = match (refracting, p.thin) {
            (false, _) => TransmissionKind::Nothing,
            (true, true) => TransmissionKind::Thin,
            (true, false) => TransmissionKind::Solid,
        };
        let inside = through == TransmissionKind::Solid && !p.front;
        let ggx = Ggx::stretched(p.roughness, p.anisotropy);
        // The tables are isotropic: look up the roughness with the same mean slope
        let roughness = if p.anisotropy > 0.0 { ggx.mean_slope().sqrt() } else { p.roughness };
        let narrow = through == TransmissionKind::Solid && !ggx.is_smooth();
        let ior = if narrow { p.ior.max(1.0 + IOR_STEP_MIN) } else { p.ior };
        // Shares of the surface: metal, transmitting dielectric, opaque dielectric
        let transmitting = if refracting { (1.0 - p.metallic) * p.transmission } else { 0.0 };
        let opaque = (1.0 - p.metallic - transmitting).max(0.0);
        let fresnel = DielectricFresnel::new(ior, p.specular, p.specular_color, inside);
        let film = Film::new(p.iridescence, p.iridescence_ior, p.iridescence_thickness);
        let mean_f0 = [p.base_color, fresnel.f0].map(|f0| match &film {
            Some(film) => film.mix(f0, film.mean_f0(f0)),
            None => f0,
        });
        let interface = Interface {
            ggx,
            film,
            mean_f0,
            spread: if through == TransmissionKind::Solid {
                (ior - 1.0) * DISPERSION_SCALE * p.dispersion
            } else {
                0.0
            },
            metal: p.metallic,
            metal_f0: p.base_color,
            dielectric: match (inside, through) {
                // From within, the opaque share has no dielectric: that is on the other side
                (true, _) => transmitting,
                (false, TransmissionKind::Nothing) if p.specular == 0.0 => 0.0,
                (false, _) => 1.0 - p.metallic,
            },
            fresnel,
            through,
            tint: p.base_color * transmitting,
        };
        let mut base = Self {
            tables: Tables::get(),
            interface,
            inside,
            rough: Rough::new(roughness),
            index: Index::new(ior.max(1.0)),
            cover: CoverAlbedo::default(),
            diffuse: CoupledDiffuse::BLACK,
            diffuse_through: CoupledDiffuse::BLACK,
            multiple: CoupledDiffuse::BLACK,
            multiple_through: CoupledDiffuse::BLACK,
            boundary: CoupledDiffuse::BLACK,
            boundary_through: CoupledDiffuse::BLACK,
            uses: NeededTables::default(),
        };
        // A solid has no diffuse transmission
        let beyond = if through == TransmissionKind::Solid { 0.0 } else { p.diffuse_transmission };
        base.balance(p.base_color, opaque * (1.0 - beyond), transmitting, opaque * beyond);
        if beyond > 0.0 {
            base.diffuse_through =
                CoupledDiffuse::new(p.diffuse_transmission_color * (opaque * beyond), base.cover_mean());
        }
        base.uses = base.used();
        base
    }

    /// Computes the cosine lobes: the energy lost between facets, and the diffuse base.
    ///
    /// - `opaque`, `transmitting`, `beyond`: shares of the surface whose light stays on its side, is refracted, and is
    ///   transmitted diffusely.
    fn balance(&mut self, base_color: Spectrum, opaque: f32, transmitting: f32, beyond: f32) {
        let [metal_f0, f0] = self.interface.mean_f0;
        let fresnel = DielectricFresnel { f0, ..self.interface.fresnel };
        let single_mean = self.tables.single(None, self.rough);
        // At zero roughness the table of s is s itself, and its mean that of the Fresnel term
        let fresnel_mean = fresnel.of_rise(self.rise(None, Rough::new(0.0)));

        let metal = multiply_scattered(metal_f0 * (20.0 / 21.0) + 1.0 / 21.0, single_mean);
        let dielectric = multiply_scattered(fresnel_mean, single_mean);
        let mut multiple = self.interface.metal * metal;
        if !self.inside {
            multiple += (opaque + beyond) * dielectric;
            let mut fresnel = fresnel;
            if let Some(film) = &self.interface.film {
                // Where the film is brightest, the base must not reflect light that the film already reflects
                let bare = self.interface.fresnel;
                let peak = film.peak_f0(bare.f0, |cos| bare.rise(cos));
                fresnel.f0 = film.mix(bare.f0, bare.f0.max(Spectrum::splat(peak)));
            }
            self.cover = CoverAlbedo::new(&fresnel, dielectric.max_element());
        }
        self.diffuse = CoupledDiffuse::new(base_color * opaque, self.cover_mean());
        match self.interface.through {
            TransmissionKind::Nothing => {}
            TransmissionKind::Thin => {
                multiple += transmitting * fresnel_mean;
                let through = transmitting * (1.0 - fresnel_mean.max_element()) * base_color;
                self.multiple_through = CoupledDiffuse::new(through, single_mean);
            }
            TransmissionKind::Solid => self.balance_boundary(base_color, transmitting),
        }
        self.multiple = CoupledDiffuse::new(multiple, single_mean);
    }

    /// Returns the mean share of the light that the cover withholds from the diffuse base.
    fn cover_mean(&self) -> f32 {
        self.cover.at(self.tables.single(None, self.rough), self.rise(None, self.rough))
    }

    /// Computes the lobes that return the energy lost between the facets of a solid's boundary, on both sides. The shares
    /// make f(wo, wi) / η_i² symmetric.
    fn balance_boundary(&mut self, base_color: Spectrum, transmitting: f32) {
        let fresnel = self.interface.fresnel;
        let near = self.tables.boundary(None, self.rough, self.index, self.inside);
        let far = self.tables.boundary(None, self.rough, self.index, !self.inside);
        let outside = fresnel.f0_exact + (1.0 - fresnel.f0_exact) * self.rise(None, Rough::new(0.0));
        // Hemispherical transmittance: n² times smaller from within
        let passed = (1.0 - outside) * if self.inside { fresnel.eta * fresnel.eta } else { 1.0 };
        let rest_max = (1.0 - near).max(1.0 - far).max(1e-9);
        let crossed = passed * (1.0 - far) / rest_max;
        // The tables hold for full strength and a white tint; return less otherwise
        let tint = (fresnel.f0 / fresnel.f0_exact.max(1e-9)).min_element().min(1.0);
        let weight = transmitting * fresnel.specular * tint;
        self.boundary = CoupledDiffuse::new(Spectrum::splat(weight * (1.0 - crossed)), near);
        self.boundary_through = CoupledDiffuse::new(base_color * (weight * crossed), far);
    }

    fn used(&self) -> NeededTables {
        let is_bare = self.diffuse.is_black() && self.diffuse_through.is_black();
        let diffuse = !(is_bare || self.cover.is_constant());
        NeededTables {
            single: diffuse || !(self.multiple.is_black() && self.multiple_through.is_black()),
            rise: diffuse,
            boundary: self.interface.through == TransmissionKind::Solid,
        }
    }

    /// Returns true if diffuse light leaves on the other side.
    pub(super) fn is_translucent(&self) -> bool {
        !self.diffuse_through.is_black()
    }

    /// Returns true if any cosine lobe is not black.
    pub(super) fn has_cosine(&self) -> bool {
        let across = [self.diffuse_through, self.multiple_through, self.boundary_through];
        [self.diffuse, self.multiple, self.boundary].iter().chain(&across).any(|lobe| !lobe.is_black())
    }

    fn rise(&self, mu: Option<Mu>, rough: Rough) -> f32 {
        let total = self.interface.fresnel.is_total();
        if total { self.tables.schlick(mu, rough) } else { self.tables.rise(mu, rough, self.index) }
    }

    /// Returns the shares not scattered once along a direction; `inside`: `true` if the direction is within the solid.
    pub(super) fn rest(&self, mu: Mu, inside: bool) -> UnscatteredShares {
        let mu = Some(mu);
        let single = if self.uses.single { self.tables.single(mu, self.rough) } else { 1.0 };
        let rise = if self.uses.rise { self.rise(mu, self.rough) } else { 0.0 };
        let boundary = if self.uses.boundary { self.tables.boundary(mu, self.rough, self.index, inside) } else { 1.0 };
        self.rest_of(single, rise, boundary)
    }

    fn rest_of(&self, single: f32, rise: f32, boundary: f32) -> UnscatteredShares {
        UnscatteredShares {
            multiple: 1.0 - single,
            diffuse: 1.0 - self.cover.at(single, rise),
            boundary: 1.0 - boundary,
        }
    }

    /// Returns the shares not scattered once along wo, and the albedo of each lobe.
    pub(super) fn rest_and_albedo(&self, cos: f32) -> (UnscatteredShares, BaseAlbedo) {
        let mu = Mu::new(cos);
        let at = Some(mu);
        let (rest, interface) = if self.inside {
            let rest = self.rest(mu, true);
            (rest, self.interface.smooth_albedo(cos) * (1.0 - rest.boundary))
        } else {
            let single = self.tables.single(at, self.rough);
            let rise = if self.interface.dielectric > 0.0 { self.rise(at, self.rough) } else { 0.0 };
            let schlick = if self.interface.metal > 0.0 { self.tables.schlick(at, self.rough) } else { 0.0 };
            let solid = self.uses.boundary;
            let all = if solid { self.tables.boundary(at, self.rough, self.index, false) } else { single };
            (self.rest_of(single, rise, all), self.interface.albedo(single, schlick, rise, all))
        };
        let (mut cosine, mut grazing) = (self.diffuse.color * rest.diffuse, Spectrum::ZERO);
        for (lobe, rest) in [(&self.multiple, rest.multiple), (&self.boundary, rest.boundary)] {
            *if lobe.is_grazing { &mut grazing } else { &mut cosine } += lobe.color * rest;
        }
        let cosine_through = self.diffuse_through.color * rest.diffuse
            + self.multiple_through.color * rest.multiple
            + self.boundary_through.color * rest.boundary;
        (rest, BaseAlbedo { interface, cosine, grazing, cosine_through })
    }

    /// Returns f of the cosine lobes on the side of wo.
    pub(super) fn cosine(&self, o: &UnscatteredShares, i: &UnscatteredShares) -> Spectrum {
        self.diffuse.eval(o.diffuse, i.diffuse)
            + self.multiple.eval(o.multiple, i.multiple)
            + self.boundary.eval(o.boundary, i.boundary)
    }

    /// Returns f of diffuse light from below that leaves along a direction with cosine `cos`. It does not depend on wi.
    pub(super) fn leaving(&self, cos: f32) -> Spectrum {
        self.diffuse_through.eval(1.0, self.rest(Mu::new(cos), false).diffuse)
    }

    /// Returns f of the cosine lobes on the far side, in importance mode.
    pub(super) fn cosine_through(&self, o: &UnscatteredShares, i: &UnscatteredShares) -> Spectrum {
        self.diffuse_through.eval(o.diffuse, i.diffuse)
            + self.multiple_through.eval(o.multiple, i.multiple)
            + self.boundary_through.eval(o.boundary, i.boundary)
    }
}

/// Returns the colour of light reflected more than once, as a share of the energy that single scattering loses.
/// `fresnel`, `single`: hemispherical means of the reflectance of a facet and of the share scattered once.
fn multiply_scattered(fresnel: Spectrum, single: f32) -> Spectrum {
    fresnel * fresnel * single / (Spectrum::ONE - fresnel * (1.0 - single))
}
