//! Subdivision of meshes by the attributes of UsdGeomMesh.

use std::collections::HashMap;
use std::rc::Rc;

use glam::{DVec2, DVec3, Vec2, Vec3};
use openusd::usd::Prim;

use super::primvar::{Interpolation, Primvar};
use super::source::StageSource;
use super::values;
use crate::error::SceneError;
use crate::options::SUBDIVISION_MAX;
use crate::subdivision::{
    BoundaryRule, ControlMesh, FACES_MAX, LinearValue, Scheme, SeamRule, Subdivision, face_count, memory_bytes,
};

/// Number of refinements of a mesh that names its scheme, if the request names none.
const LEVEL_USUAL: u32 = 2;

/// The `subdivisionScheme` of a mesh; `None`: its polygons are the surface.
pub(super) fn scheme(source: &StageSource<'_>, prim: &Prim, time: f64) -> Option<Scheme> {
    match source.text(prim, "subdivisionScheme", time).as_deref() {
        None | Some("catmullClark") => Some(Scheme::CatmullClark),
        Some("loop") => Some(Scheme::Loop),
        Some("bilinear") => Some(Scheme::Bilinear),
        Some(_) => None,
    }
}

/// Returns the refinement of a mesh; `None`: its polygons are rendered. The same connectivity at another time gets the same
/// refinement.
///
/// - `corner_points`: point of each corner, below `point_count`.
pub(super) fn read(
    source: &StageSource<'_>,
    prim: &Prim,
    time: f64,
    point_count: usize,
    face_sizes: &[usize],
    corner_points: &[u32],
) -> Result<Option<Rc<Subdivision>>, SceneError> {
    let Some(scheme) = scheme(source, prim, time) else { return Ok(None) };
    // Many exporters leave the scheme out and mean polygons, as Arnold renders them
    let usual = if source.text(prim, "subdivisionScheme", time).is_some() { LEVEL_USUAL } else { 0 };
    let wanted = source.request.options.subdivision.map_or(usual, |level| u32::from(level.min(SUBDIVISION_MAX)));
    if wanted == 0 || face_sizes.is_empty() {
        return Ok(None);
    }
    let path = prim.path().as_str();
    if scheme == Scheme::Loop && face_sizes.iter().any(|&size| size != 3) {
        source.unsupported(path, "Loop subdivision needs triangles; the mesh is rendered as its polygons");
        return Ok(None);
    }
    let control = control_mesh(source, prim, time, scheme, point_count, face_sizes, corner_points);
    let is_moving = source.request.options.open_shutter().is_some_and(|shutter| !shutter.is_instant());
    let key = digest(&control);
    if let Some(known) = source.subdivisions.borrow().get(path).filter(|known| known.0 == key) {
        return Ok(Some(known.1.clone()));
    }
    // Refine as far as faces and memory allow
    let memory = source.request.resources.budget().left();
    let fits = |level: &u32| {
        let faces = face_count(scheme, face_sizes, *level);
        faces <= FACES_MAX && memory_bytes(faces) <= memory
    };
    let level = (1..=wanted).rev().find(fits).unwrap_or(0);
    if level < wanted {
        let message = format!(
            "the mesh is subdivided {level} times instead of {wanted}: it would have more than {FACES_MAX} faces, or take \
             more memory than is left"
        );
        source.warn(path, message);
    }
    if level == 0 {
        return Ok(None);
    }
    let held = source
        .request
        .resources
        .budget()
        .hold(source.request.path, memory_bytes(face_count(scheme, face_sizes, level)))?;
    let (subdivision, problems) = Subdivision::new(&control, level);
    drop(held);
    problems.into_iter().for_each(|problem| source.warn(path, problem));
    let Some(subdivision) = subdivision else { return Ok(None) };
    let subdivision = Rc::new(subdivision);
    if is_moving {
        source.take(path, subdivision.bytes())?;
        source.subdivisions.borrow_mut().insert(path.to_owned(), (key, subdivision.clone()));
    }
    Ok(Some(subdivision))
}

/// Reads the attributes that control a subdivision.
fn control_mesh<'m>(
    source: &StageSource<'_>,
    prim: &Prim,
    time: f64,
    scheme: Scheme,
    point_count: usize,
    face_sizes: &'m [usize],
    corner_points: &'m [u32],
) -> ControlMesh<'m> {
    let path = prim.path().as_str();
    let unknown = |name: &str, value: &str| {
        source.unsupported(path, format!("`{name}` is `{value}`, which is not a value of it; its default counts"));
    };
    let boundary = match source.text(prim, "interpolateBoundary", time).as_deref() {
        Some("none") => BoundaryRule::None,
        Some("edgeOnly") => BoundaryRule::EdgeOnly,
        None | Some("edgeAndCorner") => BoundaryRule::EdgeAndCorner,
        Some(other) => {
            unknown("interpolateBoundary", other);
            BoundaryRule::EdgeAndCorner
        }
    };
    let seams = match source.text(prim, "faceVaryingLinearInterpolation", time).as_deref() {
        Some("none") => SeamRule::Smooth,
        Some("cornersOnly") => SeamRule::Corners,
        None | Some("cornersPlus1") => SeamRule::Junctions,
        Some("cornersPlus2") => SeamRule::Ends,
        Some("boundaries") => SeamRule::Linear,
        Some("all") => SeamRule::AllLinear,
        Some(other) => {
            unknown("faceVaryingLinearInterpolation", other);
            SeamRule::Junctions
        }
    };
    let has_smooth_triangles = source.text(prim, "triangleSubdivisionRule", time).as_deref() == Some("smooth");
    let integers = |name: &str| source.read(prim, name, time, values::integers).unwrap_or_default();
    let numbers = |name: &str| source.read(prim, name, time, values::numbers).unwrap_or_default();
    let mut is_hole = vec![false; face_sizes.len()];
    for hole in integers("holeIndices") {
        if let Some(is_hole) = usize::try_from(hole).ok().and_then(|hole| is_hole.get_mut(hole)) {
            *is_hole = true;
        }
    }
    let corners = integers("cornerIndices").into_iter().map(|point| point as u32).zip(numbers("cornerSharpnesses"));
    ControlMesh {
        point_count,
        face_sizes,
        corner_points,
        is_hole,
        creases: creases(
            source,
            path,
            &integers("creaseIndices"),
            &integers("creaseLengths"),
            &numbers("creaseSharpnesses"),
        ),
        corners: corners.collect(),
        scheme,
        boundary,
        seams,
        has_smooth_triangles,
    }
}

/// Returns the edges of creases: chains of points, each with one sharpness or one per edge.
fn creases(
    source: &StageSource<'_>,
    path: &str,
    points: &[i32],
    lengths: &[i32],
    sharpnesses: &[f32],
) -> Vec<([u32; 2], f32)> {
    if points.is_empty() {
        return Vec::new();
    }
    let sum: i64 = lengths.iter().map(|&length| i64::from(length.max(0))).sum();
    let edge_count: i64 = lengths.iter().map(|&length| i64::from(length.max(1)) - 1).sum();
    let is_by_edge = sharpnesses.len() != lengths.len();
    if sum != points.len() as i64 || is_by_edge && sharpnesses.len() as i64 != edge_count {
        source.warn(path, "the creases are left out: the numbers of their points, lengths and sharpnesses do not fit");
        return Vec::new();
    }
    let mut creases = Vec::new();
    let mut first = 0;
    for (chain, &length) in lengths.iter().enumerate() {
        let end = first + length.max(0) as usize;
        for edge in points[first..end].windows(2) {
            let sharpness = sharpnesses[if is_by_edge { creases.len() } else { chain }];
            creases.push(([edge[0] as u32, edge[1] as u32], sharpness));
        }
        first = end;
    }
    creases
}

/// Returns a digest of what determines a refinement.
fn digest(control: &ControlMesh<'_>) -> blake3::Hash {
    let mut digest = blake3::Hasher::new();
    digest.update(&(control.point_count as u64).to_le_bytes());
    control.face_sizes.iter().for_each(|&size| _ = digest.update(&(size as u64).to_le_bytes()));
    digest.update(bytemuck::cast_slice(control.corner_points));
    control.is_hole.iter().for_each(|&is_hole| _ = digest.update(&[u8::from(is_hole)]));
    for &([a, b], sharpness) in &control.creases {
        digest.update(&a.to_le_bytes()).update(&b.to_le_bytes()).update(&sharpness.to_le_bytes());
    }
    for &(point, sharpness) in &control.corners {
        digest.update(&point.to_le_bytes()).update(&sharpness.to_le_bytes());
    }
    let rules = (control.scheme, control.boundary, control.seams, control.has_smooth_triangles, control.creases.len());
    digest.update(format!("{rules:?}").as_bytes());
    digest.finalize()
}

/// Values of primvars, which are refined with more digits.
pub(super) trait RefinedValue: Copy {
    type Wide: LinearValue;
    fn wide(self) -> Self::Wide;
    fn narrow(wide: Self::Wide) -> Self;
    fn bits(self) -> [u32; 3];
    fn is_finite(self) -> bool;
}

impl RefinedValue for f32 {
    type Wide = f64;

    fn wide(self) -> f64 {
        f64::from(self)
    }

    fn narrow(wide: f64) -> Self {
        wide as Self
    }

    fn bits(self) -> [u32; 3] {
        [self.to_bits(), 0, 0]
    }

    fn is_finite(self) -> bool {
        Self::is_finite(self)
    }
}

impl RefinedValue for Vec2 {
    type Wide = DVec2;

    fn wide(self) -> DVec2 {
        self.as_dvec2()
    }

    fn narrow(wide: DVec2) -> Self {
        wide.as_vec2()
    }

    fn bits(self) -> [u32; 3] {
        [self.x.to_bits(), self.y.to_bits(), 0]
    }

    fn is_finite(self) -> bool {
        Self::is_finite(self)
    }
}

impl RefinedValue for Vec3 {
    type Wide = DVec3;

    fn wide(self) -> DVec3 {
        self.as_dvec3()
    }

    fn narrow(wide: DVec3) -> Self {
        wide.as_vec3()
    }

    fn bits(self) -> [u32; 3] {
        self.to_array().map(f32::to_bits)
    }

    fn is_finite(self) -> bool {
        Self::is_finite(self)
    }
}

/// Returns the value of a primvar at each corner of a refined mesh.
///
/// - `corner_points`: point of each corner of the control mesh.
/// - `usual`: stands for values that are missing or not finite.
pub(super) fn by_corner<T: RefinedValue>(
    subdivision: &Subdivision,
    corner_points: &[u32],
    primvar: &Primvar<T>,
    usual: T,
) -> Vec<T> {
    let sound = |value: Option<T>| value.filter(|value| value.is_finite()).unwrap_or(usual);
    let narrow = |values: Vec<T::Wide>| values.into_iter().map(T::narrow).collect();
    let at = |element: usize| sound(primvar.at(element)).wide();
    match primvar.interpolation {
        Interpolation::Constant => vec![sound(primvar.at(0)); subdivision.corner_points().len()],
        Interpolation::Uniform => {
            let of_face = |face: Option<usize>| face.map_or(usual, |face| sound(primvar.at(face)));
            let repeated = |face| std::iter::repeat_n(of_face(face), subdivision.sides());
            subdivision.face_sources().flat_map(repeated).collect()
        }
        Interpolation::Vertex => narrow(subdivision.by_point(at)),
        Interpolation::Varying => narrow(subdivision.linear(|corner| at(corner_points[corner] as usize))),
        Interpolation::FaceVarying => {
            // Values with indices meet where these are equal, others where they have the same bits
            let mut numbers = HashMap::new();
            let ids: Vec<u32> = (0..corner_points.len())
                .map(|corner| match primvar.index(corner) {
                    Some(index) => index as u32,
                    None => {
                        let next = numbers.len() as u32;
                        *numbers.entry(sound(primvar.at(corner)).bits()).or_insert(next)
                    }
                })
                .collect();
            narrow(subdivision.by_corner(at, |corner| ids[corner]))
        }
    }
}
