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
    rectangle::{Rectangle, SphericalRectangle},
    triangle::SphericalTriangle,
};
use crate::{
    color::luminance,
    density::{AreaPdf, SolidAnglePdf},
    flat::{SurfaceLightRecord, code},
    interaction::{emitted, opacity_at},
    sampling::uniform_triangle,
    surfaces::Surfaces,
};

/// Solid angle in sr above which a light is sampled by solid angle. Below, area sampling is as good, cheaper and more
/// precise.
pub const SOLID_ANGLE_MIN: f32 = 0.25;
/// Tolerance of a rectangle's right angle and of the position of its fourth corner, relative to its sides.
const RECTANGLE_TOLERANCE: f32 = 1e-4;
/// Largest number of parts along a side of a textured light.
const PARTS_MAX: u32 = 16;
/// Number of texels along a side of a part.
const TEXELS_PER_PART: f32 = 4.0;
/// Largest number of parts of all textured lights of a mesh.
const PARTS_PER_MESH: u32 = 1 << 16;

/// A triangle, or two that form a rectangle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Panel {
    instance: u32,
    /// Index of the first triangle; the second one of a rectangle follows it.
    pub(super) triangle: u32,
    /// Corner in world space, from which the sides `x` and `y` start. The front is where `x` × `y` points.
    corner: Vec3,
    x: Vec3,
    y: Vec3,
    /// Shape that the sides span.
    pub(super) shape: PanelShape,
    /// `true`: it moves while the shutter is open; corner and sides are those when it opens.
    pub(super) moves: bool,
}

/// The shape that `x` and `y` span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum PanelShape {
    /// A triangle; the corner is its vertex 0.
    Triangle,
    /// A rectangle of two triangles. `corner`: vertex of the first triangle that the second one lacks; `opposite`: vertex
    /// of the second one that the first one lacks.
    Rectangle { corner: u8, opposite: u8 },
}

impl PanelShape {
    /// Converts barycentric coordinates (of the second and third vertex) of one of its triangles to coordinates along the
    /// sides.
    fn place_of(self, is_second: bool, (u, v): (f32, f32)) -> (f32, f32) {
        let Self::Rectangle { corner, opposite } = self else { return (u, v) };
        let weights = [1.0 - u - v, u, v];
        let weight = |from: u8, i: usize| weights[(usize::from(from) + i) % 3];
        if is_second {
            (1.0 - weight(opposite, 1), 1.0 - weight(opposite, 2))
        } else {
            (weight(corner, 1), weight(corner, 2))
        }
    }
}

/// A panel or a part of one, as a light.
#[derive(Clone, Copy, Debug)]
pub(super) struct SurfaceLight {
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

#[derive(Clone, Copy, Debug, PartialEq)]
struct PanelPart {
    s: f32,
    t: f32,
    size: f32,
}

/// The division of a panel into parts: a grid with this many cells per side. Rectangles have one part per cell, triangles
/// two, except one in the last cell of each row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grid(u32);

impl Panel {
    /// Returns the panels of an instance's mesh, in the order of its triangles. What moves has triangles only, as a
    /// rectangle may not stay one.
    pub(super) fn of_instance(scene: &Scene, instance: u32, moves: bool) -> Vec<Self> {
        let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
        let mut panels = Vec::with_capacity(mesh.triangles.len());
        let mut triangle = 0;
        while triangle < mesh.triangles.len() as u32 {
            let panel = if moves { None } else { Self::rectangle(scene, instance, triangle) };
            let panel = panel.unwrap_or_else(|| Self { moves, ..Self::triangle(scene, instance, triangle) });
            triangle += panel.triangle_count();
            panels.push(panel);
        }
        panels
    }

    fn triangle(scene: &Scene, instance: u32, triangle: u32) -> Self {
        let [a, b, c] = corners(scene, instance, triangle);
        Self { instance, triangle, corner: a, x: b - a, y: c - a, shape: PanelShape::Triangle, moves: false }
    }

    /// Returns the index of the instance.
    pub(super) fn instance(&self) -> u32 {
        self.instance
    }

    /// Returns this triangle with other corners.
    fn with_corners(self, [a, b, c]: [Vec3; 3]) -> Self {
        Self { corner: a, x: b - a, y: c - a, ..self }
    }

    /// Returns the rectangle that a triangle and the next one form; `None` if they do not.
    fn rectangle(scene: &Scene, instance: u32, triangle: u32) -> Option<Self> {
        let mesh = &scene.meshes[scene.instances[instance as usize].mesh as usize];
        let [first, second] = [triangle, triangle + 1].map(|index| mesh.triangles.get(index as usize));
        let [first, second] = [*first?, *second?].map(|vertices| vertices.map(|v| mesh.positions[v as usize]));
        let ((corner, opposite), _) = (0..3)
            .flat_map(|corner| (0..3).map(move |opposite| (corner, opposite)))
            .map(|(k, m)| {
                ((k, m), (first[(k + 1) % 3], first[(k + 2) % 3]) == (second[(m + 2) % 3], second[(m + 1) % 3]))
            })
            .find(|&(_, share_an_edge)| share_an_edge)?;
        let world = corners(scene, instance, triangle);
        let (x, y) = (world[(corner + 1) % 3] - world[corner], world[(corner + 2) % 3] - world[corner]);
        let fourth = corners(scene, instance, triangle + 1)[opposite];
        let size = x.length().max(y.length());
        let is_rectangle = x.dot(y).abs() <= RECTANGLE_TOLERANCE * x.length() * y.length()
            && (world[corner] + x + y - fourth).length() <= RECTANGLE_TOLERANCE * size
            && x.cross(y) != Vec3::ZERO;
        let shape = PanelShape::Rectangle { corner: corner as u8, opposite: opposite as u8 };
        is_rectangle.then_some(Self { instance, triangle, corner: world[corner], x, y, shape, moves: false })
    }

    /// Returns the number of the panel's triangles: 1 or 2.
    pub(super) fn triangle_count(&self) -> u32 {
        if self.shape == PanelShape::Triangle { 1 } else { 2 }
    }

    /// Converts coordinates along the sides to a triangle and barycentric coordinates (of the second and third vertex).
    #[inline(always)]
    fn triangle_at(&self, s: f32, t: f32) -> (u32, (f32, f32)) {
        let PanelShape::Rectangle { corner, opposite } = self.shape else { return (self.triangle, (s, t)) };
        let mut weights = [0.0; 3];
        let (triangle, from, along) = if s + t <= 1.0 {
            (0, corner, [1.0 - s - t, s, t])
        } else {
            (1, opposite, [s + t - 1.0, 1.0 - s, 1.0 - t])
        };
        for (i, weight) in along.into_iter().enumerate() {
            weights[(usize::from(from) + i) % 3] = weight;
        }
        (self.triangle + triangle, (weights[1], weights[2]))
    }

    /// Returns the grid of the panel's parts: 1 without an emission texture, else by the number of texels.
    pub(super) fn grid(&self, scene: &Scene, panel_count: usize) -> Grid {
        let instance = &scene.instances[self.instance as usize];
        let mesh = &scene.meshes[instance.mesh as usize];
        let material = scene.material_of(instance) as usize;
        let Some(map) = &scene.materials[material].emission.texture else { return Grid(1) };
        let uvs = &mesh.uvs[usize::from(map.uv_set & 1)];
        if uvs.is_empty() {
            return Grid(1);
        }
        let (width, height) = scene.images[map.image.0 as usize].size();
        let [a, b, c] = mesh.triangles[self.triangle as usize].map(|vertex| uvs[vertex as usize]);
        let texels = [b - a, c - a].map(|side| {
            let side = map.picture_from_uv.matrix2 * side;
            (side.x * width as f32).abs().max((side.y * height as f32).abs())
        });
        let affordable = (PARTS_PER_MESH as usize / panel_count.max(1)).isqrt() as u32;
        let wanted = (texels[0].max(texels[1]) / TEXELS_PER_PART).min(PARTS_MAX as f32) as u32;
        Grid(wanted.min(affordable).max(1))
    }

    /// Returns the panel's parts as lights with their bounds: one per part of `grid`, including dark ones.
    pub(super) fn lights(&self, scene: &Scene, grid: Grid) -> Vec<(SurfaceLight, LightBounds)> {
        let material = scene.material_of(&scene.instances[self.instance as usize]);
        let parts = grid.parts(self.shape).into_iter().map(|part| SurfaceLight::new(*self, material, part));
        parts.map(|light| (light, light.bounds(scene, grid))).collect()
    }
}

impl PanelShape {
    /// Returns the shape's code, see [`code::PANEL_TRIANGLE`].
    pub(super) fn code(self) -> u32 {
        match self {
            Self::Triangle => code::PANEL_TRIANGLE,
            Self::Rectangle { corner, opposite } => {
                code::PANEL_RECTANGLE | u32::from(corner) | u32::from(opposite) << code::PANEL_OPPOSITE_SHIFT
            }
        }
    }
}

impl Grid {
    /// Returns the number of cells per side.
    pub(super) fn side(self) -> u32 {
        self.0
    }

    fn parts(self, shape: PanelShape) -> Vec<PanelPart> {
        let size = 1.0 / self.0 as f32;
        let mut parts = Vec::new();
        for row in 0..self.0 {
            let columns = if shape == PanelShape::Triangle { self.0 - row } else { self.0 };
            for column in 0..columns {
                let (s, t) = (column as f32 * size, row as f32 * size);
                parts.push(PanelPart { s, t, size });
                if shape == PanelShape::Triangle && column + 1 < columns {
                    parts.push(PanelPart { s: s + size, t: t + size, size: -size });
                }
            }
        }
        parts
    }

    /// Returns the index, in the order of [`Panel::lights`], of the part at barycentric coordinates (of the second and
    /// third vertex) of the first or second triangle.
    pub(super) fn part_at(self, shape: PanelShape, is_second: bool, barycentric: (f32, f32)) -> u32 {
        let (s, t) = shape.place_of(is_second, barycentric);
        let last = self.0 - 1;
        let cell = |x: f32| ((x * self.0 as f32) as u32).min(last);
        if shape != PanelShape::Triangle {
            return cell(t) * self.0 + cell(s);
        }
        let row = cell(t);
        let columns = self.0 - row;
        let column = cell(s).min(columns - 1);
        let (x, y) = (s * self.0 as f32 - column as f32, t * self.0 as f32 - row as f32);
        let is_turned = x + y > 1.0 && column + 1 < columns;
        // A row of n cells has 2n − 1 parts, and n decreases by one per row
        let above = self.0 * self.0 - columns * columns;
        above + 2 * column + u32::from(is_turned)
    }
}

/// Returns the corners of a triangle in world space.
fn corners(scene: &Scene, instance: u32, triangle: u32) -> [Vec3; 3] {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    mesh.triangles[triangle as usize]
        .map(|vertex| instance.world_from_object.transform_point3(mesh.positions[vertex as usize]))
}

/// Returns the square root of a triangle's double area in texture coordinates.
fn mesh_uv_size(scene: &Scene, instance: u32, triangle: u32) -> f32 {
    let instance = &scene.instances[instance as usize];
    let mesh = &scene.meshes[instance.mesh as usize];
    let emission = &scene.materials[scene.material_of(instance) as usize].emission;
    let uv_set = emission.texture.as_ref().map_or(0, |map| usize::from(map.uv_set & 1));
    let [a, b, c] = mesh.triangles[triangle as usize]
        .map(|vertex| mesh.uvs[uv_set].get(vertex as usize).copied().unwrap_or_default());
    (b - a).perp_dot(c - a).abs().sqrt()
}

/// The sampling strategy for a point: a pure function of light and point, so that `sample` and `pdf` agree.
enum Strategy {
    Triangle(SphericalTriangle),
    Rectangle(SphericalRectangle),
    /// Uniform by area.
    Area,
}

impl SurfaceLight {
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

    /// Returns the record of the light: instance, triangle, shape, corner and sides of the panel, position and size of
    /// the part, material.
    pub(super) fn record(&self) -> SurfaceLightRecord {
        let Panel { instance, triangle, corner, x, y, shape, .. } = self.panel;
        let (shape, part) = (shape.code(), Vec3::new(self.part.s, self.part.t, self.part.size));
        let material = self.material;
        SurfaceLightRecord { kind: code::LIGHT_SURFACE, instance, triangle, shape, corner, x, y, part, material }
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
    pub(super) fn material(&self) -> u32 {
        self.material
    }

    /// Returns area times mean emitted luminance.
    pub(super) fn flux(&self, scene: &Scene) -> f32 {
        let (_, x, y) = self.extent();
        let grid = Grid((1.0 / self.part.size.abs()).round() as u32);
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
        Profile::new(&material.emission_profile).bounds(LightBounds {
            bounds,
            cone: Cone::of(axis),
            emission_angle: std::f32::consts::FRAC_PI_2,
            two_sided,
            intensity: area * luminance(self.mean_emission(scene, grid)).max(0.0),
        })
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
        let uv_size = mesh_uv_size(scene, panel.instance, panel.triangle);
        let footprint = 1.5 * uv_size / (SIDE * grid.0) as f32;
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

    /// Samples a point on the light for the point `from`.
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
            radiance *= profile.factor(-wi, facing.abs() / (double_area * distance));
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
