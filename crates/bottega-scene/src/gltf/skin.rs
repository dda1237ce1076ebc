//! Skinning: vertices moved by joints. glTF 2.0, section 3.7.3.

use glam::{Affine3A, DAffine3, DMat4, Mat3A, Vec3A};
use rayon::prelude::*;

use super::accessor::{Accessor, find};
use super::hierarchy::Hierarchy;
use super::source::GltfSource;
use crate::error::{SceneError, Warnings};
use crate::model::Mesh;

/// Four joints of a skin, and their weights for a vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Influence {
    /// Indices into the joints of the skin.
    pub(super) joints: [u32; 4],
    pub(super) weights: [f32; 4],
}

/// Moves the vertices by the joints of the skin, to world space.
///
/// - `influences`: sets of four joints per vertex, each `[vertices]`; without any, the mesh stays as modelled.
pub(super) fn apply(
    source: &GltfSource<'_>,
    hierarchy: &Hierarchy,
    skin: usize,
    influences: &[Vec<Influence>],
    mesh: &mut Mesh,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let matrices = joint_matrices(source, hierarchy, skin)?;
    if influences.is_empty() || matrices.is_empty() {
        warnings.add(format!("skins[{skin}]"), "a mesh has no joints or weights for it and is shown as modelled");
        return Ok(());
    }
    let blend = |vertex: usize| blend(&matrices, influences.iter().map(|set| &set[vertex]));
    let blends: Vec<(Affine3A, u64)> = (0..mesh.positions.len()).into_par_iter().map(blend).collect();
    for (position, (blend, _)) in mesh.positions.iter_mut().zip(&blends) {
        *position = blend.transform_point3(*position);
    }
    for (normal, (blend, _)) in mesh.normals.iter_mut().zip(&blends) {
        *normal = (cofactors(&blend.matrix3) * Vec3A::from(*normal)).into();
    }
    for (tangent, (blend, _)) in mesh.tangents.iter_mut().zip(&blends) {
        *tangent = blend.transform_vector3(tangent.truncate()).extend(tangent.w);
    }
    let stray: u64 = blends.iter().map(|(_, stray)| stray).sum();
    if stray > 0 {
        warnings
            .add(format!("skins[{skin}]"), format!("{stray} influences of joints that it does not have are ignored"));
    }
    Ok(())
}

/// Returns the weighted mean of the joint matrices of a vertex, and the number of joints that the skin lacks.
fn blend<'a>(matrices: &[Affine3A], influences: impl Iterator<Item = &'a Influence>) -> (Affine3A, u64) {
    let mut blend = Affine3A::ZERO;
    let mut total = 0.0;
    let mut stray = 0;
    for influence in influences {
        for (&joint, &weight) in influence.joints.iter().zip(&influence.weights) {
            if weight == 0.0 || !weight.is_finite() {
                continue;
            }
            match matrices.get(joint as usize) {
                Some(matrix) => {
                    blend = sum(blend, matrix, weight);
                    total += weight;
                }
                None => stray += 1,
            }
        }
    }
    // Weights should add up to 1, but may not after quantization: normalize.
    let blend = if total > 0.0 { sum(Affine3A::ZERO, &blend, 1.0 / total) } else { Affine3A::IDENTITY };
    (blend, stray)
}

/// Returns for every joint the transformation from model space to world space.
fn joint_matrices(source: &GltfSource<'_>, hierarchy: &Hierarchy, index: usize) -> Result<Vec<Affine3A>, SceneError> {
    let skin = find("skin", &source.document.skins, index).map_err(|problem| source.invalid("nodes", problem))?;
    let place = |member: &str| format!("skins[{index}].{member}");
    let inverse_binds = match skin.inverse_bind_matrices {
        None => Vec::new(),
        Some(accessor) => {
            let member = || place("inverseBindMatrices");
            let accessor = Accessor::new(source.document, source.bytes, accessor);
            let accessor = accessor.map_err(|problem| source.invalid(member(), problem))?;
            if accessor.width != 16 || accessor.count < skin.joints.len() || accessor.is_unbacked() {
                return Err(source.invalid(member(), "does not hold a 4×4 matrix for each joint"));
            }
            accessor
                .read(None, |columns: [f32; 16]| DAffine3::from_mat4(DMat4::from_cols_array(&columns.map(f64::from))))
        }
    };
    let matrix = |(number, &joint): (usize, &usize)| {
        let world = find("node", &hierarchy.world_from_node, joint);
        let world = *world.map_err(|problem| source.invalid(place("joints"), problem))?;
        let Some(world) = world else {
            return Err(source.invalid(place("joints"), format!("node {joint} is not in the scene")));
        };
        let inverse_bind = inverse_binds.get(number).copied().unwrap_or(DAffine3::IDENTITY);
        Ok((world * inverse_bind).as_affine3a())
    };
    skin.joints.iter().enumerate().map(matrix).collect()
}

fn sum(a: Affine3A, b: &Affine3A, weight: f32) -> Affine3A {
    Affine3A { matrix3: a.matrix3 + b.matrix3 * weight, translation: a.translation + b.translation * weight }
}

/// Returns the matrix of cofactors, which transforms normals as `m` transforms surfaces, up to length.
fn cofactors(m: &Mat3A) -> Mat3A {
    Mat3A::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis))
}
