//! Hair and fur: the light that a fibre reflects, transmits, and reflects inside.
//!
//! A fibre is a rough dielectric cylinder that absorbs. One scattering event stands for everything that happens within
//! the fibre: light that it reflects (p = 0), that passes through it (p = 1), that it reflects once inside (p = 2), and
//! the rest (p ≥ 3, spread evenly around the fibre). Each lobe is the product of its attenuation A_p, a distribution M_p
//! of the longitudinal angle θ and a distribution N_p of the azimuth φ. Light leaves where it entered, and the model
//! depends on the offset h of that point across the width of the fibre. White hair loses nothing.
//!
//! Parameters: absorption of the fibre, as σ_a per radius, as the reflectance of many fibres, or as concentrations of
//! eumelanin and pheomelanin; index of refraction; longitudinal and azimuthal roughness β_m and β_n in [0, 1]; angle α of
//! the scales, in degrees. Source: Chiang, Bitterli, Tappan and Burley 2016, *A Practical and Controllable Hair and Fur
//! Model for Production Path Tracing*; M_p by d'Eon and others 2011, *An Energy-Conserving Hair Reflectance Model*, and
//! its sampling by d'Eon 2013, *Importance Sampling for Physically-Based Hair Fiber Models*.

use std::f32::consts::{FRAC_1_PI, PI};

use bottega_kernels::math;
use bottega_scene::Spectrum;
use glam::Vec3;

use super::fresnel::{self, mean};
use super::scatter::{Lobes, Scatter};
use super::{BsdfSample, LobeFlags, TransportMode, warp};
use crate::color::exp;

/// Number of lobes with a direction of their own; one more is spread around the fibre.
const SHARP: usize = 3;
/// Number of lobes.
const LOBES: usize = SHARP + 1;
/// Smallest roughness: narrower lobes are beyond single precision.
const BETA_MIN: f32 = 0.01;
/// Smallest |cos θ| to the normal at which f is computed, as it is divided by it.
const COSINE_MIN: f32 = 1e-6;

/// Absorption per unit of concentration of eumelanin and of pheomelanin, per radius (d'Eon and others 2011, table 1).
const EUMELANIN: Spectrum = Spectrum::new(0.419, 0.697, 1.37);
const PHEOMELANIN: Spectrum = Spectrum::new(0.187, 0.4, 1.05);

/// Returns σ_a of concentrations of the two pigments.
pub(super) fn sigma_a_of_melanin(eumelanin: f32, pheomelanin: f32) -> Spectrum {
    EUMELANIN * eumelanin + PHEOMELANIN * pheomelanin
}

/// Returns σ_a of fibres that together have a reflectance in [0, 1] (Chiang et al. 2016, eq. 9).
pub(super) fn sigma_a_of_reflectance(reflectance: Spectrum, beta_n: f32) -> Spectrum {
    let b = beta_n;
    let fit = 5.969 + b * (-0.215 + b * (2.532 + b * (-10.73 + b * (5.574 + b * 0.245))));
    let channel = |reflectance: f32| {
        let root = math::ln(reflectance.max(f32::MIN_POSITIVE)) / fit;
        root * root
    };
    Spectrum::new(channel(reflectance.x), channel(reflectance.y), channel(reflectance.z))
}

/// The parameters of a fibre at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct HairParams {
    /// Absorption within the fibre, per radius.
    pub(super) sigma_a: Spectrum,
    /// Index of refraction of the fibre over that of the outside.
    pub(super) eta: f32,
    /// Longitudinal roughness, in [0, 1].
    pub(super) beta_m: f32,
    /// Azimuthal roughness, in [0, 1].
    pub(super) beta_n: f32,
    /// Angle of the scales, in radians.
    pub(super) alpha: f32,
    /// Offset of the point across the width, in [−1, 1], as seen from wo; above 0 on the side of wo × x. `None`: the
    /// surface is round, and its normal says it.
    pub(super) h: Option<f32>,
}

/// A fibre along x of the local frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hair {
    sigma_a: Spectrum,
    eta: f32,
    /// Variance v_p of each longitudinal lobe.
    variance: [f32; LOBES],
    /// Scale s of the azimuthal logistic distribution.
    scale: f32,
    /// Sine and cosine of the angle by which scales turn θ_o, for each p.
    tilt: [(f32, f32); SHARP],
    h: Option<f32>,
    /// The lower of both roughnesses.
    roughness: f32,
}

/// Values that all lobes of a fibre share for one outgoing direction.
struct OutgoingTerms {
    sin_theta: f32,
    cos_theta: f32,
    phi: f32,
    /// Angles between the normal and the direction in the cross-section, outside and inside.
    gamma_o: f32,
    gamma_t: f32,
    /// A_p.
    attenuation: [Spectrum; LOBES],
}

/// The longitudinal angles of a pair of directions, as sines and cosines.
#[derive(Clone, Copy, Debug)]
struct Inclinations {
    sin_i: f32,
    cos_i: f32,
    sin_o: f32,
    cos_o: f32,
}

impl Hair {
    pub(super) fn new(params: &HairParams) -> Self {
        let [m, n] = [params.beta_m, params.beta_n].map(|beta| if beta > BETA_MIN { beta.min(1.0) } else { BETA_MIN });
        // Chiang et al. 2016, eq. 7 and 8
        let deviation = 0.726 * m + 0.812 * m * m + 3.7 * power(m, 20);
        let v = deviation * deviation;
        let scale = (PI / 8.0).sqrt() * (0.265 * n + 1.194 * n * n + 5.372 * power(n, 22));
        Self {
            sigma_a: params.sigma_a,
            eta: params.eta,
            variance: [v, 0.25 * v, 4.0 * v, 4.0 * v],
            scale,
            tilt: [-2.0, 1.0, 4.0].map(|factor| math::sin_cos(factor * params.alpha)),
            h: params.h,
            roughness: m.min(n),
        }
    }

    /// Computes what depends on the outgoing direction alone.
    fn outgoing(&self, wo: Vec3) -> OutgoingTerms {
        let sin_theta = wo.x.clamp(-1.0, 1.0);
        let cos_theta = across(wo).min(1.0);
        let h = match self.h {
            Some(h) => h,
            None if cos_theta > 0.0 => -wo.y / cos_theta,
            None => 0.0,
        };
        let h = h.clamp(-1.0, 1.0);
        // Refract in the cross-section by the index η′ of a slanted fibre (Marschner et al. 2003, appendix B)
        let slanted = (self.eta * self.eta - sin_theta * sin_theta).max(1e-6).sqrt();
        let sin_gamma_t = (h * cos_theta / slanted).clamp(-1.0, 1.0);
        let cos_gamma_t = (1.0 - sin_gamma_t * sin_gamma_t).sqrt();
        let sin_theta_t = sin_theta / self.eta;
        let cos_theta_t = (1.0 - sin_theta_t * sin_theta_t).max(1e-6).sqrt();
        // Attenuate by the boundary and along the way through the fibre
        let reflected = fresnel::dielectric(cos_theta * (1.0 - h * h).sqrt(), self.eta);
        let transmittance = exp(self.sigma_a * (-2.0 * cos_gamma_t / cos_theta_t));
        let through = transmittance * ((1.0 - reflected) * (1.0 - reflected));
        let inside = transmittance * reflected;
        let once = through * inside;
        let rest = once * inside / (Spectrum::ONE - inside).max(Spectrum::splat(1e-6));
        OutgoingTerms {
            sin_theta,
            cos_theta,
            phi: math::atan2(wo.z, wo.y),
            gamma_o: math::asin(h),
            gamma_t: math::asin(sin_gamma_t),
            attenuation: [Spectrum::splat(reflected), through, once, rest],
        }
    }

    /// Returns θ_o of a lobe, turned by the scales: its sine and cosine.
    fn tilted(&self, p: usize, outgoing: &OutgoingTerms) -> (f32, f32) {
        let OutgoingTerms { sin_theta, cos_theta, .. } = *outgoing;
        let Some((sin, cos)) = self.tilt.get(p) else { return (sin_theta, cos_theta) };
        (sin_theta * cos + cos_theta * sin, (cos_theta * cos - sin_theta * sin).abs())
    }

    /// Returns f |cos θ_i| to the normal, and the density of `wi`.
    ///
    /// - `longitudinal`: M_p by angles and variance.
    fn scattered(&self, wo: Vec3, wi: Vec3, longitudinal: impl Fn(&Inclinations, f32) -> f32) -> (Spectrum, f32) {
        let outgoing = self.outgoing(wo);
        let chances = outgoing.chances();
        let (sin_i, cos_i) = (wi.x, across(wi));
        let turn = math::atan2(wi.z, wi.y) - outgoing.phi;
        let (mut value, mut pdf) = (Spectrum::ZERO, 0.0);
        for (p, (attenuation, chance)) in outgoing.attenuation.into_iter().zip(chances).enumerate() {
            let (sin_o, cos_o) = self.tilted(p, &outgoing);
            let azimuthal =
                if p < SHARP { trimmed_logistic(turn - outgoing.turn(p), self.scale) } else { 0.5 * FRAC_1_PI };
            let lobe = longitudinal(&Inclinations { sin_i, cos_i, sin_o, cos_o }, self.variance[p]) * azimuthal;
            value += attenuation * lobe;
            pdf += chance * lobe;
        }
        (value, pdf)
    }
}

impl OutgoingTerms {
    /// Returns the probability with which each lobe is sampled.
    fn chances(&self) -> [f32; LOBES] {
        let weights = self.attenuation.map(mean);
        let sum = weights.iter().sum::<f32>().max(f32::MIN_POSITIVE);
        weights.map(|weight| weight / sum)
    }

    /// Returns the angle by which a smooth fibre turns light in the cross-section (Chiang et al. 2016, Φ).
    fn turn(&self, p: usize) -> f32 {
        let p = p as f32;
        2.0 * p * self.gamma_t - 2.0 * self.gamma_o + p * PI
    }
}

impl Scatter for Hair {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        if wi.z.abs() < COSINE_MIN {
            return (Spectrum::ZERO, 0.0);
        }
        let (value, pdf) = self.scattered(wo, wi, longitudinal);
        (value / wi.z.abs(), pdf)
    }

    fn sample(&self, wo: Vec3, u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let outgoing = self.outgoing(wo);
        // Choose a lobe
        let chances = outgoing.chances();
        let (mut p, mut rest) = (0, u_lobe);
        while p < SHARP && rest >= chances[p] {
            rest -= chances[p];
            p += 1;
        }
        let u_phi = (rest / chances[p].max(f32::MIN_POSITIVE)).clamp(0.0, warp::ONE_MINUS_EPSILON);
        // Sample the longitudinal angle: a cone around the mirror direction
        let v = self.variance[p];
        let (sin_o, cos_o) = self.tilted(p, &outgoing);
        let below = -v * math::ln((u[0] + (1.0 - u[0]) * math::exp(-2.0 / v)).max(1e-30));
        let below = below.clamp(0.0, 2.0);
        let (cos_cone, sin_cone) = (1.0 - below, (below * (2.0 - below)).sqrt());
        let sin_i = sin_cone * math::cos(2.0 * PI * u[1]) * cos_o - cos_cone * sin_o;
        let sin_i = sin_i.clamp(-1.0, 1.0);
        let cos_i = (1.0 - sin_i * sin_i).sqrt();
        // Sample the azimuth
        let turn =
            if p < SHARP { outgoing.turn(p) + sample_trimmed_logistic(u_phi, self.scale) } else { 2.0 * PI * u_phi };
        let (sin_phi, cos_phi) = math::sin_cos(outgoing.phi + turn);
        let wi = Vec3::new(sin_i, cos_i * cos_phi, cos_i * sin_phi);
        let side = if wi.z > 0.0 { LobeFlags::REFLECTION } else { LobeFlags::TRANSMISSION };
        self.spread(wo, wi, mode, side.union(LobeFlags::GLOSSY), 1.0)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        self.outgoing(wo).attenuation.into_iter().sum()
    }

    fn lobes(&self) -> Lobes {
        Lobes { has_non_delta: true, is_transmissive: true, roughness: self.roughness }
    }
}

/// Returns the length of a direction in the cross-section: cos θ.
fn across(w: Vec3) -> f32 {
    (w.y * w.y + w.z * w.z).sqrt()
}

/// Returns M_p: the density of θ_i around the mirror direction of θ_o, over the sine of θ_i (d'Eon et al. 2011, eq. 7):
///
/// M = I₀(cos θ_i cos θ_o ∕ v) exp(−sin θ_i sin θ_o ∕ v) ∕ (2 v sinh(1 ∕ v))
///
/// Factors that grow beyond the range of numbers for a small v are joined to exp((cos(θ_i + θ_o) − 1) ∕ v).
fn longitudinal(angles: &Inclinations, v: f32) -> f32 {
    let Inclinations { sin_i, cos_i, sin_o, cos_o } = *angles;
    let (cosines, sines) = (cos_i - cos_o, sin_i + sin_o);
    let off = 0.5 * (cosines * cosines + sines * sines);
    bessel_i0_scaled(cos_i * cos_o / v) * math::exp(-off / v) / (v * (1.0 - math::exp(-2.0 / v)))
}

/// Returns exp(−x) I₀(x) for x ≥ 0: the modified Bessel function of the first kind (Abramowitz and Stegun 1964, 9.8.1
/// and 9.8.2), to 3 · 10⁻⁷.
fn bessel_i0_scaled(x: f32) -> f32 {
    let polynomial = |coefficients: &[f32], t: f32| coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c);
    if x < 3.75 {
        let t = x / 3.75;
        let series = [1.0, 3.515_623, 3.089_942_5, 1.206_749_2, 0.265_973_2, 0.036_076_8, 0.004_581_3];
        return polynomial(&series, t * t) * math::exp(-x);
    }
    let series = [
        0.398_942_3,
        0.013_285_92,
        0.002_253_19,
        -0.001_575_65,
        0.009_162_81,
        -0.020_577_06,
        0.026_355_37,
        -0.016_476_33,
        0.003_923_77,
    ];
    polynomial(&series, 3.75 / x) / x.sqrt()
}

/// Returns the logistic distribution of scale `s` trimmed to [−π, π], at an angle of any number of turns.
fn trimmed_logistic(angle: f32, s: f32) -> f32 {
    let angle = angle - 2.0 * PI * (angle / (2.0 * PI)).round();
    let falling = math::exp(-angle.abs() / s);
    falling / (s * (1.0 + falling) * (1.0 + falling)) / (1.0 - 2.0 * logistic_tail(s))
}

/// Returns the share of the logistic distribution of scale `s` that lies below −π.
fn logistic_tail(s: f32) -> f32 {
    let falling = math::exp(-PI / s);
    falling / (1.0 + falling)
}

/// Draws an angle in [−π, π] from [`trimmed_logistic`].
fn sample_trimmed_logistic(u: f32, s: f32) -> f32 {
    let tail = logistic_tail(s);
    let share = (tail + u * (1.0 - 2.0 * tail)).clamp(1e-7, 1.0 - 1e-7);
    (-s * math::ln(1.0 / share - 1.0)).clamp(-PI, PI)
}

/// Returns x to a power, by products alone, which are the same everywhere.
fn power(x: f32, exponent: u32) -> f32 {
    let (mut product, mut square, mut rest) = (1.0, x, exponent);
    while rest > 0 {
        if rest % 2 == 1 {
            product *= square;
        }
        square *= square;
        rest /= 2;
    }
    product
}

#[cfg(test)]
mod tests;
