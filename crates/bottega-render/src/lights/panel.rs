//! The panels of an emitting mesh, triangles and rectangles, and their parts.
//!
//! Two triangles that form a rectangle are one panel. A panel with a textured emission is cut into the cells of a grid.

use bottega_scene::Scene;
use glam::Vec3;

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
pub(crate) struct Panel {
    /// Index of the instance.
    pub(crate) instance: u32,
    /// Index of the first triangle; the second one of a rectangle follows it.
    pub(crate) triangle: u32,
    /// Corner in world space, from which the sides `x` and `y` start. The front is where `x` × `y` points.
    pub(crate) corner: Vec3,
    pub(crate) x: Vec3,
    pub(crate) y: Vec3,
    /// Shape that the sides span.
    pub(crate) shape: PanelShape,
    /// `true`: it moves while the shutter is open; corner and sides are those when it opens.
    pub(crate) moves: bool,
}

/// The shape that `x` and `y` span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PanelShape {
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

/// A cell of the grid of a panel, or half of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PanelPart {
    /// Position of the corner along the panel's sides, in their lengths.
    pub(crate) s: f32,
    pub(crate) t: f32,
    /// Length of the part's sides, in those of the panel; negative for a triangle rotated by half a turn.
    pub(crate) size: f32,
}

/// The division of a panel into parts: a grid with this many cells per side. Rectangles have one part per cell, triangles
/// two, except one in the last cell of each row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Grid(u32);

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

    /// Returns this triangle with other corners.
    pub(super) fn with_corners(self, [a, b, c]: [Vec3; 3]) -> Self {
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
    pub(super) fn triangle_at(&self, s: f32, t: f32) -> (u32, (f32, f32)) {
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

    /// Returns the square root of the double area of its first triangle, in texture coordinates.
    pub(super) fn uv_size(&self, scene: &Scene) -> f32 {
        let instance = &scene.instances[self.instance as usize];
        let mesh = &scene.meshes[instance.mesh as usize];
        let emission = &scene.materials[scene.material_of(instance) as usize].emission;
        let uv_set = emission.texture.as_ref().map_or(0, |map| usize::from(map.uv_set & 1));
        let [a, b, c] = mesh.triangles[self.triangle as usize]
            .map(|vertex| mesh.uvs[uv_set].get(vertex as usize).copied().unwrap_or_default());
        (b - a).perp_dot(c - a).abs().sqrt()
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
}

impl Grid {
    /// Returns the grid that a part belongs to.
    pub(super) fn of_part(part: PanelPart) -> Self {
        Self((1.0 / part.size.abs()).round() as u32)
    }

    /// Returns the number of cells per side.
    pub(crate) fn side(self) -> u32 {
        self.0
    }

    /// Returns all parts of a panel with that shape.
    pub(super) fn parts(self, shape: PanelShape) -> Vec<PanelPart> {
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

    /// Returns the index, in the order of [`Self::parts`], of the part at barycentric coordinates (of the second and
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
