//! A surface whose reflectance was measured.
//!
//! Parameters: a file of tables (`.bsdf`) for some directions of view, isotropic or anisotropic, by red, green and blue or
//! by wavelengths in nanometres, which become colors when it is read. Two warps lead from even points of the unit square to
//! directions of light: the first by the luminance, the second by the area of the facets that is visible. At the first one's
//! points f cos θ = M D(h) ∕ (4 σ(ωo)): M is the table of the reflection, D the distribution of the facets' normals h, and
//! σ the area of the facets as seen from ωo. All tables are bilinear, also between the directions of view. Values differ
//! slightly when both directions are exchanged.
//!
//! Source: Dupuy and Jakob 2018, *An Adaptive Parameterization for Efficient Material Acquisition and Rendering*. The
//! materials `measured` of pbrt-v4 and Mitsuba 3 have the same formulas.

use std::f32::consts::{FRAC_PI_2, PI, TAU};

use bottega_kernels::math;
use bottega_scene::{Measured, NodeWeights, Spectrum, Symmetry};
use glam::Vec3;

use super::fresnel;
use super::scatter::{Lobes, Scatter};
use super::{BsdfSample, LobeFlags, TransportMode};

/// The least Jacobian of the warp from the square to facets, as in pbrt and Mitsuba.
const JACOBIAN_MIN: f32 = 1e-6;

/// A measured material. It refers to the tables of the scene.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasuredReflection<'s>(pub(super) &'s Measured);

/// A direction of view, and the tables around it.
struct View {
    /// Signs of x and y that turn the direction, and those of light, to where the material has tables.
    signs: [f32; 2],
    wo: Vec3,
    phi: f32,
    /// The point of a facet whose normal is the direction.
    point: [f32; 2],
    nodes: NodeWeights,
}

impl View {
    fn new(measured: &Measured, wo: Vec3) -> Self {
        let toward_minus = |x: f32| if x > 0.0 { -1.0 } else { 1.0 };
        let signs = match measured.symmetry() {
            Symmetry::Isotropic | Symmetry::None => [1.0; 2],
            Symmetry::HalfTurn => [toward_minus(wo.y); 2],
            Symmetry::TwoPlanes => [toward_minus(wo.x), toward_minus(wo.y)],
        };
        let wo = turned(wo, signs);
        let (phi, theta) = angles(wo);
        Self { signs, wo, phi, point: point_of(phi, theta), nodes: measured.nodes(phi, theta) }
    }

    /// Returns the angle around the normal at which angles of facets count as 0.
    fn zero(&self, measured: &Measured) -> f32 {
        if measured.symmetry() == Symmetry::Isotropic { self.phi } else { 0.0 }
    }
}

/// Applies signs to x and y.
fn turned(w: Vec3, signs: [f32; 2]) -> Vec3 {
    Vec3::new(w.x * signs[0], w.y * signs[1], w.z)
}

/// Returns the angles of a direction around and against the normal.
fn angles(w: Vec3) -> (f32, f32) {
    // Also accurate near the normal
    (math::atan2(w.y, w.x), 2.0 * math::asin(0.5 * (w - Vec3::Z).length()))
}

/// Returns the point of the square for a facet's angles around and against the normal.
fn point_of(phi: f32, theta: f32) -> [f32; 2] {
    let turns = phi / TAU + 0.5;
    [(theta / FRAC_PI_2).sqrt(), turns - turns.floor()]
}

impl Scatter for MeasuredReflection<'_> {
    fn eval_pdf(&self, wo: Vec3, wi: Vec3, _mode: TransportMode) -> (Spectrum, f32) {
        let (measured, nothing) = (self.0, (Spectrum::ZERO, 0.0));
        if wi.z <= 0.0 {
            return nothing;
        }
        let view = View::new(measured, wo);
        let Some(h) = (view.wo + turned(wi, view.signs)).try_normalize() else { return nothing };
        let (phi, theta) = angles(h);
        let facet = point_of(phi - view.zero(measured), theta);
        let (point, visible_pdf) = measured.visible_normals().invert(&view.nodes, facet);
        // The density of the warp from the square to h, and of the reflection at h
        let jacobian = (2.0 * PI * PI * facet[0] * h.truncate().length()).max(JACOBIAN_MIN) * 4.0 * view.wo.dot(h);
        let pdf = visible_pdf * measured.luminance().density(&view.nodes, point) / jacobian;
        let factor = measured.mirroring(facet, view.point) / wi.z;
        let value = measured.reflection(&view.nodes, point) * factor;
        if value.is_finite() && pdf.is_finite() { (value, pdf) } else { nothing }
    }

    fn sample(&self, wo: Vec3, _u_lobe: f32, u: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        let measured = self.0;
        let view = View::new(measured, wo);
        let (point, _) = measured.luminance().sample(&view.nodes, u);
        let (facet, _) = measured.visible_normals().sample(&view.nodes, point);
        let (sin, cos) = math::sin_cos(facet[0] * facet[0] * FRAC_PI_2);
        let (sin_phi, cos_phi) = math::sin_cos((facet[1] - 0.5) * TAU + view.zero(measured));
        let h = Vec3::new(sin * cos_phi, sin * sin_phi, cos);
        let wi = turned(fresnel::reflect(view.wo, h), view.signs).normalize();
        self.spread(wo, wi, mode, LobeFlags::REFLECTION.union(LobeFlags::GLOSSY), 1.0)
    }

    fn albedo(&self, wo: Vec3) -> Spectrum {
        self.0.albedo(&View::new(self.0, wo).nodes)
    }

    fn lobes(&self) -> Lobes {
        Lobes { has_non_delta: true, is_transmissive: false, roughness: self.0.roughness() }
    }
}
