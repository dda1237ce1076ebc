//! Textures of the type `mesh_attribute`: values per vertex or per face.
//!
//! They become pictures: each triangle has four texels, and bilinear interpolation of those equals interpolation over
//! the triangle. So they can be used like any picture.

use glam::{Affine2, Vec2, Vec3};

use super::context::ImportContext;
use super::document::Object;
use crate::color::LUMINANCE;
use crate::image::Image;
use crate::image::pictures::Pictures;
use crate::import::text_place::ImportResult;
use crate::mesh_file::ply::{self, Attribute};
use crate::model::Mesh;
use crate::resource::Location;
use crate::text::shortened;
use crate::texture::{ImageId, TextureMap, Wrap};

/// Ratio of the texture coordinates to the picture: lookup footprints, sized for other pictures, become negligible, and
/// no lookup leaves its triangle.
const UNITS: f32 = 1_048_576.0;

/// The positions of a triangle's corners between its four texels: far enough from the edges that rounding crosses none.
const CORNERS: [Vec2; 3] = [Vec2::new(0.125, 0.125), Vec2::new(0.875, 0.125), Vec2::new(0.125, 0.875)];

/// Data of a mesh that the textures of a material use.
#[derive(Clone, Debug, Default)]
pub(super) struct MeshData {
    /// `true`: a texture shows the vertex colours.
    pub(super) vertex_colors: bool,
    /// `true`: a texture shows the face colours.
    pub(super) face_colors: bool,
    /// Textures of other attributes, whose pictures are made once the mesh is read.
    pub(super) textures: Vec<AwaitedTexture>,
}

/// A texture that needs its mesh.
#[derive(Clone, Debug)]
pub(super) struct AwaitedTexture {
    /// Name of the mesh attribute.
    pub(super) name: String,
    /// The image of the texture, which is 0.5 until the mesh is read.
    pub(super) image: ImageId,
    /// `true`: the texture's luminance is used.
    pub(super) is_number: bool,
}

/// Returns the picture of an attribute until the mesh is read.
pub(super) fn placeholder(name: &str) -> Image {
    Image::from_linear_rgb(shortened(name), 1, 1, vec![[0.5; 3]])
}

/// Returns the map of an attribute's picture.
pub(super) fn map(name: &str, image: ImageId) -> TextureMap {
    TextureMap {
        uv_set: 1,
        picture_from_uv: Affine2::from_scale(Vec2::splat(UNITS.recip())),
        wrap_u: Wrap::Clamp,
        wrap_v: Wrap::Clamp,
        smooth: !name.starts_with("face_"),
        ..TextureMap::new(image)
    }
}

/// Makes the pictures that the material of a mesh needs, and adds texture coordinates for them.
pub(super) fn with_attributes(
    context: &mut ImportContext<'_>,
    pictures: &mut Pictures<'_>,
    object: &Object,
    mut mesh: Mesh,
    awaited: &[AwaitedTexture],
) -> ImportResult<Mesh> {
    let mut file = None;
    if object.plugin == "ply" {
        let location = context.filename(object)?;
        file = Some((context.resources.read(&location)?, location));
    }
    let mut found = Vec::new();
    for awaited in awaited {
        let mut attribute = None;
        if awaited.name == "vertex_color" && !mesh.colors.is_empty() {
            let values = mesh.colors.iter().map(|color| color.truncate().to_array()).collect();
            attribute = Some(Attribute { channels: 3, values });
        } else if let Some((bytes, location)) = &file {
            attribute = read(context, location, bytes, &awaited.name)?;
        }
        let is_of_faces = awaited.name.starts_with("face_");
        let count = if is_of_faces { mesh.triangles.len() } else { mesh.positions.len() };
        match attribute.filter(|attribute| attribute.values.len() == count) {
            Some(attribute) => found.push((awaited, attribute)),
            None => {
                let name = shortened(&awaited.name);
                let message = format!("the {} has no attribute `{name}`; 0.5 replaces it", object.describe());
                context.warn(object.at, message);
            }
        }
    }
    if found.is_empty() {
        return Ok(mesh);
    }
    let tiles = Tiles::new(mesh.triangles.len());
    // Four texels with mip levels per attribute, and three vertices per triangle.
    let texels = found.len().saturating_mul(mesh.triangles.len()).saturating_mul(6 * size_of::<[f32; 3]>());
    context.take(object.at, texels.saturating_add(mesh.memory_bytes().saturating_mul(3)))?;
    for (awaited, Attribute { channels, mut values }) in found {
        if awaited.is_number && channels == 3 {
            let luminance = |[r, g, b]: [f32; 3]| Vec3::new(r, g, b).dot(LUMINANCE.as_vec3());
            values.iter_mut().for_each(|value| *value = [luminance(*value); 3]);
        }
        let name = shortened(&awaited.name);
        let image = if awaited.name.starts_with("face_") {
            tiles.face_image(&name, &values)
        } else {
            tiles.vertex_image(&name, &values, &mesh.triangles)
        };
        pictures.replace(awaited.image, image);
    }
    // Unshared vertices cannot have smooth normals: compute these first.
    if mesh.normals.is_empty() {
        mesh.smooth_normals();
    }
    let mut mesh = mesh.unshared();
    mesh.uvs[1] = (0..mesh.triangles.len()).flat_map(|triangle| tiles.corners(triangle)).collect();
    Ok(mesh)
}

/// Returns an attribute of the file, or the colours of its faces.
fn read(context: &ImportContext<'_>, location: &Location, bytes: &[u8], name: &str) -> ImportResult<Option<Attribute>> {
    let (path, budget) = (location.path(), context.resources.budget());
    let colors = if name == "face_color" { ply::face_colors(path, bytes, budget)? } else { None };
    Ok(match colors {
        Some(colors) => {
            let values = colors.iter().map(|color| color.truncate().to_array()).collect();
            Some(Attribute { channels: 3, values })
        }
        None => ply::attribute(path, bytes, name, budget)?,
    })
}

/// The arrangement of triangles in a picture: two by two texels each, row by row.
#[derive(Clone, Copy, Debug)]
struct Tiles {
    columns: usize,
    rows: usize,
}

impl Tiles {
    fn new(count: usize) -> Self {
        let columns = count.isqrt().max(1);
        Self { columns, rows: count.div_ceil(columns).max(1) }
    }

    /// Returns the texture coordinates of a triangle's corners.
    fn corners(&self, triangle: usize) -> [Vec2; 3] {
        let tile = Vec2::new((triangle % self.columns) as f32, (triangle / self.columns) as f32);
        let size = Vec2::new(self.columns as f32, self.rows as f32);
        // Adjacent texel centres are half a tile apart.
        CORNERS.map(|corner| (tile + 0.25 + 0.5 * corner) / size * UNITS)
    }

    /// Makes a picture of one value per triangle.
    fn face_image(&self, name: &str, values: &[[f32; 3]]) -> Image {
        let mut texels = values.to_vec();
        texels.resize(self.columns * self.rows, [0.0; 3]);
        Image::from_linear_rgb(name, self.columns as u32, self.rows as u32, texels)
    }

    /// Makes a picture of one value per vertex.
    fn vertex_image(&self, name: &str, values: &[[f32; 3]], triangles: &[[u32; 3]]) -> Image {
        let width = 2 * self.columns;
        let mut texels = vec![[0.0; 3]; width * 2 * self.rows];
        let span = CORNERS[1].x - CORNERS[0].x;
        for (number, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|vertex| Vec3::from_array(values[vertex as usize]));
            // Add a margin, so that rounding makes no value negative.
            let above = a.max(b).max(c) * f32::EPSILON;
            let (along_x, along_y) = ((b - a) / span, (c - a) / span);
            let origin = a + above - (along_x + along_y) * CORNERS[0].x;
            let first = (number / self.columns) * 2 * width + (number % self.columns) * 2;
            for (row, column) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                let value = origin + along_x * column as f32 + along_y * row as f32;
                texels[first + row * width + column] = value.to_array();
            }
        }
        Image::from_numbers(name, width as u32, 2 * self.rows as u32, texels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::ImageId;

    #[test]
    fn pictures_interpolate_as_triangles_do() {
        // Seven triangles, with vertices of their own.
        let triangles: Vec<[u32; 3]> = (0..7).map(|number| [3 * number, 3 * number + 1, 3 * number + 2]).collect();
        let value = |vertex: u32, channel: u32| ((vertex * 7 + channel * 5) % 11) as f32 * 0.1;
        let values: Vec<[f32; 3]> = (0..21).map(|vertex| [0, 1, 2].map(|channel| value(vertex, channel))).collect();
        let tiles = Tiles::new(7);
        let image = tiles.vertex_image("a", &values, &triangles);
        let faces = tiles.face_image("b", &values[..7]);
        let map = TextureMap {
            picture_from_uv: Affine2::from_scale(Vec2::splat(UNITS.recip())),
            wrap_u: Wrap::Clamp,
            wrap_v: Wrap::Clamp,
            ..TextureMap::new(ImageId(0))
        };
        for (number, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = tiles.corners(number);
            let [x, y, z] = triangle.map(|vertex| Vec3::from_array(values[vertex as usize]));
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.6), (0.5, 0.5), (1.0 / 3.0, 1.0 / 3.0)] {
                let uv = a + (b - a) * u + (c - a) * v;
                let expected = x + (y - x) * u + (z - x) * v;
                // The footprint has no effect: it is in units of other coordinates.
                for footprint in [0.0, 1.0, 100.0] {
                    let found = image.eval(&map, uv, footprint).truncate();
                    assert!((found - expected).abs().max_element() < 2e-6, "{number}: {found} {expected}");
                    assert!(found.min_element() >= 0.0, "{found}");
                    let found = faces.eval(&TextureMap { smooth: false, ..map }, uv, footprint).truncate();
                    assert_eq!(found.to_array(), values[number]);
                }
            }
        }
    }
}
