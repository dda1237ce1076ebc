//! Tables of the albedos of rough layers, which balance the energy of the layers.
//!
//! They are integrated once, at the first material, with fixed nodes in a fixed order, so that every run has the same
//! bits. All are functions of the cosine μ to the normal (nodes uniform in √μ, near 0 the curves bend most) and of the
//! perceptual roughness (nodes uniform in its root: at grazing angles α / μ matters). Means over the cosine-weighted
//! hemisphere are those of the *interpolated* tables, so that lobes normalized with them balance exactly.

mod compute;

use std::fmt;
use std::sync::OnceLock;

use glam::Vec3;

use super::fresnel;
use super::ggx::Ggx;

/// Number of nodes of an albedo curve over the cosine.
pub const MU: usize = 32;
/// Number of values of a curve: nodes, mean and peak.
pub(super) const CURVE: usize = MU + 2;
/// Number of nodes of the albedo tables over the roughness.
pub const ROUGHNESS: usize = 16;
/// Number of nodes over the index of refraction, uniform in √r with r = (n − 1) / (n + 1) from 0 to `R_MAX`: the cosine
/// of the critical angle is proportional to √r.
pub const INDEX: usize = 12;
const R_MAX: f32 = (fresnel::IOR_MAX - 1.0) / (fresnel::IOR_MAX + 1.0);

/// Albedos by μ for one roughness (and index), and their mean 2 ∫ v μ dμ.
#[derive(Clone, Copy)]
struct AlbedoCurve {
    at: [f32; MU],
    mean: f32,
}

/// Directional albedos by μ, roughness and index of refraction.
pub(super) struct Tables {
    /// Single reflection with F = 1.
    single: Vec<AlbedoCurve>,
    /// Single reflection with F = Schlick's weight.
    schlick: Vec<AlbedoCurve>,
    /// Single reflection with F = s, the rise of the exact Fresnel term (see `DielectricFresnel`), from outside; by
    /// index.
    rise: Vec<AlbedoCurve>,
    /// Single reflection plus transmission at the boundary of a solid, from outside and from within; by index.
    boundary: [Vec<AlbedoCurve>; 2],
    /// White sheen, by its own roughness.
    sheen: Vec<AlbedoCurve>,
}

impl fmt::Debug for Tables {
    /// Omits the values.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tables").finish_non_exhaustive()
    }
}

/// A node of an axis, and the fraction of the way to the next one.
#[derive(Clone, Copy, Debug)]
struct TablePosition {
    index: u32,
    fraction: f32,
}

impl TablePosition {
    fn new(position: f32, nodes: usize) -> Self {
        let position = position.clamp(0.0, (nodes - 1) as f32);
        let index = (position as u32).min(nodes as u32 - 2);
        Self { index, fraction: position - index as f32 }
    }

    fn mix(self, value: impl Fn(usize) -> f32) -> f32 {
        let (a, b) = (value(self.index as usize), value(self.index as usize + 1));
        a + (b - a) * self.fraction
    }
}

/// A position on the axis of cosines.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mu(TablePosition);

impl Mu {
    /// Returns the position of a cosine; negative ones count as 0.
    pub(super) fn new(cos: f32) -> Self {
        Self(TablePosition::new(cos.max(0.0).sqrt() * (MU - 1) as f32, MU))
    }
}

/// A position on the axis of roughness.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rough(TablePosition);

impl Rough {
    /// Returns the position of a perceptual roughness in [0, 1].
    pub(super) fn new(roughness: f32) -> Self {
        Self::at(roughness.sqrt())
    }

    /// Creates a position from a number in [0, 1] along the axis.
    pub(super) fn at(position: f32) -> Self {
        Self(TablePosition::new(position * (ROUGHNESS - 1) as f32, ROUGHNESS))
    }
}

/// A position on the axis of indices of refraction (n ≥ 1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Index(TablePosition);

impl Index {
    /// Returns the position of an index of refraction of at least 1.
    pub(super) fn new(ior: f32) -> Self {
        let root = ((ior - 1.0) / (ior + 1.0) / R_MAX).max(0.0).sqrt();
        Self(TablePosition::new(root * (INDEX - 1) as f32, INDEX))
    }
}

/// Returns the value of a curve at `mu`, or its mean for `None`.
fn pick(curve: &AlbedoCurve, mu: Option<Mu>) -> f32 {
    mu.map_or(curve.mean, |mu| mu.0.mix(|i| curve.at[i]))
}

/// Lookups. `mu`: `None` selects the mean over the cosine-weighted hemisphere.
impl Tables {
    /// Returns the tables; the first caller computes them.
    pub(super) fn get() -> &'static Self {
        static TABLES: OnceLock<Tables> = OnceLock::new();
        TABLES.get_or_init(Self::compute)
    }

    /// Returns the albedo of single reflection with F = 1.
    pub(super) fn single(&self, mu: Option<Mu>, rough: Rough) -> f32 {
        rough.0.mix(|i| pick(&self.single[i], mu))
    }

    /// Returns the albedo of single reflection with F = Schlick's weight.
    pub(super) fn schlick(&self, mu: Option<Mu>, rough: Rough) -> f32 {
        rough.0.mix(|i| pick(&self.schlick[i], mu))
    }

    /// Returns the albedo of single reflection with F = s, from outside.
    pub(super) fn rise(&self, mu: Option<Mu>, rough: Rough, index: Index) -> f32 {
        index.0.mix(|k| rough.0.mix(|i| pick(&self.rise[k * ROUGHNESS + i], mu)))
    }

    /// Returns the albedo of a solid's boundary; `inside`: `true` if the direction is within the solid.
    pub(super) fn boundary(&self, mu: Option<Mu>, rough: Rough, index: Index, inside: bool) -> f32 {
        let curves = &self.boundary[usize::from(inside)];
        index.0.mix(|k| rough.0.mix(|i| pick(&curves[k * ROUGHNESS + i], mu)))
    }

    /// Returns the albedo of white sheen; `rough`: on the axis of sheen, see [`sheen::roughness_at`].
    pub(super) fn sheen(&self, mu: Mu, rough: Rough) -> f32 {
        rough.0.mix(|i| pick(&self.sheen[i], Some(mu)))
    }

    /// Returns the largest albedo of white sheen over all μ.
    pub(super) fn sheen_peak(&self, rough: Rough) -> f32 {
        rough.0.mix(|i| self.sheen[i].peak())
    }

    /// Iterates over all curves: `single` and `schlick` by roughness, `rise` and both of `boundary` by index and
    /// roughness, `sheen`. Each has its values by √μ, its mean, and its peak.
    pub(super) fn curves(&self) -> impl Iterator<Item = [f32; CURVE]> {
        let [outside, inside] = &self.boundary;
        let curves = [&self.single, &self.schlick, &self.rise, outside, inside, &self.sheen];
        curves.into_iter().flatten().map(|curve| {
            std::array::from_fn(|i| match i {
                MU => curve.mean,
                _ if i > MU => curve.peak(),
                _ => curve.at[i],
            })
        })
    }
}

/// Returns μ of a node.
fn node_mu(j: usize) -> f32 {
    let root = j as f32 / (MU - 1) as f32;
    (root * root).max(1e-4)
}

/// Returns the index of refraction of a node.
fn node_ior(k: usize) -> f32 {
    let root = k as f32 / (INDEX - 1) as f32;
    let r = R_MAX * root * root;
    (1.0 + r) / (1.0 - r)
}

impl AlbedoCurve {
    fn new(at: [f32; MU]) -> Self {
        // Between two nodes the value is linear in t = √μ, and 2 μ dμ = 4 t³ dt: two-point Gauss is accurate enough for a
        // quartic over 31 pieces
        let mut mean = 0.0f64;
        for i in 0..MU - 1 {
            for node in [0.5 - 0.5 / 3f64.sqrt(), 0.5 + 0.5 / 3f64.sqrt()] {
                let t = (i as f64 + node) / (MU - 1) as f64;
                let value = f64::from(at[i]) * (1.0 - node) + f64::from(at[i + 1]) * node;
                mean += value * 4.0 * t * t * t * 0.5 / (MU - 1) as f64;
            }
        }
        Self { at, mean: mean as f32 }
    }

    fn peak(&self) -> f32 {
        self.at.iter().copied().fold(0.0, f32::max)
    }
}

/// Number of azimuths of visible normals, uniform over half a turn by symmetry.
const AZIMUTHS: usize = 12;
/// Number of steps over the cap of visible normals.
const CAPS: usize = 16;

/// All tables at one μ and one roughness, except sheen.
#[derive(Clone, Copy, Default)]
struct TableValues {
    single: f32,
    schlick: f32,
    rise: [f32; INDEX],
    boundary: [[f32; INDEX]; 2],
}

impl TableValues {
    fn integrate(mu: f32, roughness: f32) -> Self {
        let ggx = Ggx::from_roughness(roughness);
        let wo = Vec3::new((1.0 - mu * mu).max(0.0).sqrt(), 0.0, mu);
        let mut cell = Self::default();
        if roughness == 0.0 {
            cell.add(&ggx, wo, Vec3::Z, 1.0);
            return cell;
        }
        for cap in 0..CAPS {
            for azimuth in 0..AZIMUTHS {
                // Rotate alternate rings, so that they do not all meet an edge at once
                let shift = 0.25 + 0.5 * (cap % 2) as f32;
                let u = [0.5 * (azimuth as f32 + shift) / AZIMUTHS as f32, (cap as f32 + 0.5) / CAPS as f32];
                cell.add(&ggx, wo, ggx.sample_visible_normal(wo, u), 1.0 / (CAPS * AZIMUTHS) as f32);
            }
        }
        cell
    }

    /// Adds the contribution of a facet `h` visible from `wo`, with the weights of `Interface`.
    fn add(&mut self, ggx: &Ggx, wo: Vec3, h: Vec3, weight: f32) {
        let cos = wo.dot(h);
        let mirrored = fresnel::reflect(wo, h);
        let reflects = if mirrored.z > 0.0 { weight * ggx.shadowing(wo, mirrored) } else { 0.0 };
        self.single += reflects;
        self.schlick += reflects * fresnel::schlick_weight(cos);
        for k in 0..INDEX {
            let ior = node_ior(k);
            let f0 = fresnel::at_normal_incidence(ior);
            self.rise[k] += reflects * (fresnel::dielectric(cos, ior) - f0) / (1.0 - f0);
            for (side, eta) in [ior, 1.0 / ior].into_iter().enumerate() {
                let reflectance = fresnel::dielectric(cos, eta);
                let transmits =
                    fresnel::refract(wo, h, eta).filter(|wi| wi.z < 0.0).map_or(0.0, |wi| weight * ggx.masking(wi));
                self.boundary[side][k] += reflectance * reflects + (1.0 - reflectance) * transmits;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_smooth_boundary_has_its_exact_reflectance_at_the_nodes() {
        let tables = Tables::get();
        for mu in [0.01, 0.25, 1.0] {
            let (at, smooth) = (Some(Mu::new(mu)), Rough::new(0.0));
            assert_eq!(tables.single(at, smooth), 1.0);
            for ior in [1.0, 1.3, 1.5, 2.4, 5.0] {
                let f0 = fresnel::at_normal_incidence(ior);
                let reflectance = f0 + (1.0 - f0) * tables.rise(at, smooth, Index::new(ior));
                let exact = fresnel::dielectric(mu, ior);
                assert!((reflectance - exact).abs() < 0.01, "{mu} {ior}: {reflectance} {exact}");
                for inside in [false, true] {
                    assert!((tables.boundary(at, smooth, Index::new(ior), inside) - 1.0).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn no_table_gives_more_than_it_gets() {
        let tables = Tables::get();
        let curves = [&tables.single, &tables.schlick, &tables.boundary[0], &tables.boundary[1]];
        for curve in curves.into_iter().flatten() {
            assert!(
                curve.at.iter().all(|&v| (0.0..=1.0 + 1e-5).contains(&v)) && (0.0..=1.0 + 1e-5).contains(&curve.mean)
            );
        }
    }

    #[test]
    fn the_mean_of_a_constant_is_the_constant() {
        assert!((AlbedoCurve::new([0.7; MU]).mean - 0.7).abs() < 1e-5);
    }
}
