//! Emitting triangles and rectangles.
//!
//! Parameters: radiance in W/(sr m²) per channel, a texture, one or both sides, a spread. With a spread, light leaves within a
//! cone of half angle α around the normal: the radiance at an angle θ is the stated one times (tan α − tan θ) / (tan α − α),
//! which keeps the power, as of Blender's area lights.
//!
//! Two triangles that form a rectangle are one light, since importers turn quadrilaterals into such pairs. Textured lights
//! are cut into parts; each part is a light with its own power. Large ones are sampled uniformly in solid angle, small ones
//! by area.
//!
//! Sources: Arvo 1995, *Stratified Sampling of Spherical Triangles*; Ureña, Fajardo and King 2013, *An Area-Preserving
//! Parametrization for Spherical Rectangles*.

use bottega_kernels::Aabb;
use bottega_scene::{AlphaMode, EmissionProfile, Scene, Sides, Spectrum, Visibility};
use glam::Vec3;

use super::{
    LightSample, NO_LIGHT, Profile,
    bounds::{Cone, LightBounds},
    panel::{Grid, Panel, PanelPart, PanelShape},
    rectangle::{Rectangle, SphericalRectangle},
    triangle::SphericalTriangle,
};
use crate::{
    color::luminance,
    density::{AreaPdf, SolidAnglePdf},
    interaction::{emitted, opacity_at},
    sampling::uniform_triangle,
    surfaces::Surfaces,
};

/// Solid angle in sr above which a light is sampled by solid angle. Below, area sampling is as good, cheaper and more
/// precise.
pub const SOLID_ANGLE_MIN: f32 = 0.25;

/// A panel or a part of one, as a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceLight {
    panel: Panel,
    material: u32,
    /// Corner of the part along the panel's sides, and its size; negative for a triangle rotated by half a turn.
    part: PanelPart,
    /// Corner and sides of the part.
    extent: (Vec3, Vec3, Vec3),
    /// Centre of the part.
    middle: Vec3,
    /// Cross product of the sides, and its length.
    normal: Vec3,
    double_area: f32,
    /// The part as a rectangle; `None`: it is a triangle.
    rectangle: Option<Rectangle>,
}

/// The sampling strategy for a point: a pure function of light and point, so that `sample` and `pdf` agree.
enum Strategy {
    Triangle(SphericalTriangle),
    Rectangle(SphericalRectangle),
    /// Uniform by area.
    Area,
}

impl SurfaceLight {
    /// Returns the parts of a panel as lights with their bounds: one per part of `grid`, including dark ones.
    pub(super) fn of_panel(panel: &Panel, scene: &Scene, grid: Grid) -> Vec<(Self, LightBounds)> {
        let material = scene.material_of(&scene.instances[panel.instance as usize]);
        let parts = grid.parts(panel.shape).into_iter().map(|part| Self::new(*panel, material, part));
        parts.map(|light| (light, light.bounds(scene, grid))).collect()
    }

    fn new(panel: Panel, material: u32, part: PanelPart) -> Self {
        let extent @ (corner, x, y) = if part.size == 1.0 {
            (panel.corner, panel.x, panel.y)
        } else {
            (panel.corner + panel.x * part.s + panel.y * part.t, panel.x * part.size, panel.y * part.size)
        };
        let is_rectangle = panel.shape != PanelShape::Triangle;
        let normal = x.cross(y);
        Self {
            panel,
            material,
            part,
            extent,
            middle: corner + (x + y) * if is_rectangle { 0.5 } else { 1.0 / 3.0 },
            normal,
            double_area: normal.length(),
            rectangle: is_rectangle.then(|| Rectangle::new(corner, x, y)),
        }
    }

    /// Returns the panel.
    pub(crate) fn panel(&self) -> &Panel {
        &self.panel
    }

    /// Returns the part of the panel that is the light.
    pub(crate) fn part(&self) -> PanelPart {
        self.part
    }

    /// Returns the index of the instance.
    pub(super) fn instance(&self) -> u32 {
        self.panel.instance
    }

    /// Returns true if the light moves while the shutter is open.
    #[inline(always)]
    pub(super) fn moves(&self) -> bool {
        self.panel.moves
    }

    /// Returns the light as it is at a time.
    pub(super) fn at(&self, surfaces: &Surfaces, time: f32) -> Self {
        let world_from_object = surfaces.world_from_object(self.panel.instance, time);
        let corners = surfaces.corners(self.panel.instance, self.panel.triangle, time);
        let corners = corners.map(|corner| world_from_object.transform_point3(corner));
        Self::new(self.panel.with_corners(corners), self.material, self.part)
    }

    /// Returns the index of the material.
    pub(crate) fn material(&self) -> u32 {
        self.material
    }

    /// Returns area times mean emitted luminance.
    pub(super) fn flux(&self, scene: &Scene) -> f32 {
        let (_, x, y) = self.extent();
        let grid = Grid::of_part(self.part);
        self.area(x.cross(y).length()) * luminance(self.mean_emission(scene, grid)).max(0.0)
    }

    /// Returns true if the light is a rectangle, false if it is a triangle.
    pub(super) fn is_rectangle(&self) -> bool {
        self.panel.shape != PanelShape::Triangle
    }

    /// Returns corner and sides of the part.
    #[inline(always)]
    pub(super) fn extent(&self) -> (Vec3, Vec3, Vec3) {
        self.extent
    }

    /// Converts coordinates in [0, 1]² of the part to coordinates along the panel's sides.
    #[inline(always)]
    fn on_panel(&self, [s, t]: [f32; 2]) -> (f32, f32) {
        (self.part.s + s * self.part.size, self.part.t + t * self.part.size)
    }

    /// Returns the centre and the squared radius of a bounding ball.
    pub(super) fn ball(&self) -> (Vec3, f32) {
        let (corner, x, y) = self.extent();
        let part = if self.is_rectangle() { 0.5 } else { 1.0 / 3.0 };
        (corner + (x + y) * part, 0.25 * (x.length_squared() + y.length_squared()))
    }

    fn bounds(&self, scene: &Scene, grid: Grid) -> LightBounds {
        let (corner, x, y) = self.extent();
        let cross = x.cross(y);
        let material = &scene.materials[self.material as usize];
        let mut bounds = Aabb::EMPTY.with(corner).with(corner + x).with(corner + y);
        if self.is_rectangle() {
            bounds = bounds.with(corner + x + y);
        }
        let area = if self.is_rectangle() { cross.length() } else { 0.5 * cross.length() };
        let normal = cross.normalize_or(Vec3::Z);
        let two_sided = material.emission_sides == Sides::Both;
        let axis = if material.emission_sides == Sides::Back { -normal } else { normal };
        Profile::new(&material.emission_profile).bounds(
            scene,
            LightBounds {
                bounds,
                cone: Cone::of(axis),
                emission_angle: std::f32::consts::FRAC_PI_2,
                two_sided,
                intensity: area * luminance(self.mean_emission(scene, grid)).max(0.0),
            },
        )
    }

    fn mean_emission(&self, scene: &Scene, grid: Grid) -> Spectrum {
        /// Number of lookups along a side.
        const SIDE: u32 = 2;
        let emission = &scene.materials[self.material as usize].emission;
        if emission.texture.is_none() {
            return emission.factor;
        }
        // Filter a little wider than the distance of lookups, so that no bright texel is missed
        let panel = &self.panel;
        let footprint = 1.5 * panel.uv_size(scene) / (SIDE * grid.side()) as f32;
        let places = (0..SIDE * SIDE).map(|i| [i % SIDE, i / SIDE].map(|j| (j as f32 + 0.5) / SIDE as f32));
        let sum: Spectrum = places
            .map(|u| {
                let place = if self.is_rectangle() { u } else { uniform_triangle(u).into() };
                let (s, t) = self.on_panel(place);
                let (triangle, barycentric) = panel.triangle_at(s, t);
                emitted(scene, panel.instance, triangle, barycentric, footprint)
            })
            .sum();
        sum / (SIDE * SIDE) as f32
    }

    #[inline(always)]
    fn strategy(&self, from: Vec3) -> Strategy {
        // Compare an upper bound of the solid angle, tight from afar
        let limit = SOLID_ANGLE_MIN * (self.middle - from).length_squared();
        if let Some(rectangle) = &self.rectangle {
            if self.double_area > limit
                && let Some(spherical) = SphericalRectangle::new(rectangle, from)
            {
                return Strategy::Rectangle(spherical);
            }
        } else if 0.5 * self.double_area > limit {
            let (corner, x, y) = self.extent;
            if let Some(spherical) = SphericalTriangle::new(&[corner, corner + x, corner + y], from) {
                return Strategy::Triangle(spherical);
            }
        }
        Strategy::Area
    }

    /// Returns the area of the light, given that of the parallelogram of both sides.
    #[inline(always)]
    pub(super) fn area(&self, double_area: f32) -> f32 {
        if self.is_rectangle() { double_area } else { 0.5 * double_area }
    }

    /// Samples a point on the light for the point `from`. `None`: no light arrives from there.
    #[inline(always)]
    pub(super) fn sample(&self, surfaces: &Surfaces, from: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let Self { extent: (corner, x, y), normal, double_area, .. } = *self;
        let (place, solid_angle_pdf) = match self.strategy(from) {
            Strategy::Rectangle(spherical) => (spherical.sample(u), Some(spherical.pdf())),
            Strategy::Triangle(spherical) => {
                (spherical.sample(&[corner, corner + x, corner + y], from, u)?.into(), Some(spherical.pdf()))
            }
            Strategy::Area if self.is_rectangle() => (u, None),
            Strategy::Area => (uniform_triangle(u).into(), None),
        };
        let to_light = corner + x * place[0] + y * place[1] - from;
        let distance_squared = to_light.length_squared();
        let distance = distance_squared.sqrt();
        // Projected area times distance; positive on the front side
        let facing = -normal.dot(to_light);
        let scene = &**surfaces.scene();
        let material = &scene.materials[self.material as usize];
        if !(distance > 0.0 && facing != 0.0 && material.emission_sides.has(facing > 0.0)) {
            return None;
        }
        let pdf = solid_angle_pdf.unwrap_or_else(|| {
            // Projected area and squared distance, both times the distance
            AreaPdf::uniform(self.projected(facing)).per_solid_angle(distance_squared * distance)
        });
        let mut radiance = self.radiance_at(scene, place);
        let wi = to_light / distance;
        if material.emission_profile != EmissionProfile::Diffuse {
            let profile = surfaces.material(self.material).1.profile;
            radiance *= profile.factor(scene, -wi, facing.abs() / (double_area * distance));
            if radiance == Spectrum::ZERO {
                return None;
            }
        }
        pdf.is_finite().then_some(LightSample {
            wi,
            distance,
            radiance,
            pdf,
            // Rays do not hit surfaces that are absent, so BSDF sampling cannot find this light
            is_delta: material.alpha_mode == AlphaMode::Absent,
            light: NO_LIGHT,
            sun: NO_LIGHT,
            pmf: 1.0,
            visibility: Visibility::ALL,
        })
    }

    /// Returns the radiance emitted at coordinates in [0, 1]² of the part, times the opacity there.
    #[inline(always)]
    pub(super) fn radiance_at(&self, scene: &Scene, place: [f32; 2]) -> Spectrum {
        let material = &scene.materials[self.material as usize];
        if material.emission.texture.is_none() && !material.dims_emission() {
            return material.emission.factor;
        }
        let (s, t) = self.on_panel(place);
        let (triangle, barycentric) = self.panel.triangle_at(s, t);
        let mut radiance = emitted(scene, self.panel.instance, triangle, barycentric, 0.0);
        if material.dims_emission() {
            radiance *= opacity_at(scene, self.panel.instance, triangle, barycentric);
        }
        radiance
    }

    /// Returns the projected area of the light times the distance of a point.
    ///
    /// - `facing`: normal · way to the point; the same for the parallelogram of both sides.
    #[inline(always)]
    fn projected(&self, facing: f32) -> f32 {
        facing.abs() * (self.area(self.double_area) / self.double_area)
    }

    /// Returns the density with which [`Self::sample`] draws the direction from `from` to the point `p`.
    #[inline(always)]
    pub(super) fn pdf(&self, from: Vec3, p: Vec3) -> SolidAnglePdf {
        match self.strategy(from) {
            Strategy::Rectangle(spherical) => spherical.pdf(),
            Strategy::Triangle(spherical) => spherical.pdf(),
            Strategy::Area => {
                let to_light = p - from;
                let distance_squared = to_light.length_squared();
                let projected = self.projected(self.normal.dot(to_light));
                if projected > 0.0 {
                    AreaPdf::uniform(projected).per_solid_angle(distance_squared * distance_squared.sqrt())
                } else {
                    SolidAnglePdf::ZERO
                }
            }
        }
    }
}
