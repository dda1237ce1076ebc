//! Poses of meshes: blend shapes, and skins of skeletons (UsdSkel).

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DMat4, DQuat, Vec3};
use openusd::sdf::Path;
use openusd::usd::Prim;

use super::source::{STILL, StageSource};
use super::{values, xform};

/// Most joints of a skeleton.
const JOINTS_MAX: usize = 1 << 16;

/// Moves the points of a mesh by its blend shapes and its skeleton. Returns the change of each point's normal; empty: there is
/// none.
pub(super) fn pose(source: &StageSource<'_>, prim: &Prim, time: f64, points: &mut [Vec3]) -> Vec<DMat3> {
    let Some(skeleton) = inherited_target(source, prim, "skel:skeleton") else {
        return Vec::new();
    };
    let skeleton = source.stage.prim(skeleton);
    let animation = target(source, &skeleton, "skel:animationSource")
        .or_else(|| inherited_target(source, prim, "skel:animationSource"))
        .map(|path| source.stage.prim(path));
    if let Some(animation) = &animation {
        add_blend_shapes(source, prim, animation, time, points);
    }
    skin(source, prim, &skeleton, animation.as_ref(), time, points)
}

fn target(source: &StageSource<'_>, prim: &Prim, name: &str) -> Option<Path> {
    source.targets(prim, name).into_iter().next().map(|path| path.prim_path())
}

/// Returns the target of a relationship of a prim, or of its nearest ancestor that has it.
fn inherited_target(source: &StageSource<'_>, prim: &Prim, name: &str) -> Option<Path> {
    prim.path().ancestors_below_root().find_map(|path| target(source, &source.stage.prim(path), name))
}

/// Adds the offsets of blend shapes by the weights of an animation.
fn add_blend_shapes(source: &StageSource<'_>, prim: &Prim, animation: &Prim, time: f64, points: &mut [Vec3]) {
    let names = source.read(prim, "skel:blendShapes", STILL, values::texts).unwrap_or_default();
    let order = source.read(animation, "blendShapes", STILL, values::texts).unwrap_or_default();
    let weights = source.read(animation, "blendShapeWeights", time, values::numbers).unwrap_or_default();
    let weight_of: BTreeMap<&String, f32> = order.iter().zip(weights).collect();
    for (name, shape) in names.iter().zip(source.targets(prim, "skel:blendShapeTargets")) {
        let weight = weight_of.get(name).copied().unwrap_or(0.0);
        if weight == 0.0 || !weight.is_finite() {
            continue;
        }
        let shape = source.stage.prim(shape);
        let names = source.or_warn(shape.path().as_str(), shape.property_names());
        if names.iter().any(|name| name.as_str().starts_with("inbetweens:")) {
            source.unsupported(shape.path().as_str(), "in-between shapes are left out: the blend is linear");
        }
        let offsets = source.read(&shape, "offsets", STILL, values::vectors).unwrap_or_default();
        let indices = source.read(&shape, "pointIndices", STILL, values::integers).filter(|list| !list.is_empty());
        for (row, offset) in offsets.iter().enumerate() {
            let index = match &indices {
                Some(indices) => indices.get(row).and_then(|&index| usize::try_from(index).ok()),
                None => Some(row),
            };
            if let Some(point) = index.and_then(|index| points.get_mut(index)) {
                *point += *offset * weight;
            }
        }
    }
}

/// Skins points by the joints of a skeleton: linear blending.
fn skin(
    source: &StageSource<'_>,
    prim: &Prim,
    skeleton: &Prim,
    animation: Option<&Prim>,
    time: f64,
    points: &mut [Vec3],
) -> Vec<DMat3> {
    let path = prim.path().as_str();
    let (indices, weights) = ("primvars:skel:jointIndices", "primvars:skel:jointWeights");
    let joints = source.read(prim, indices, time, values::integers).unwrap_or_default();
    let weights_of = source.read(prim, weights, time, values::numbers).unwrap_or_default();
    if joints.is_empty() || joints.len() != weights_of.len() {
        return Vec::new();
    }
    let Some(skinning) = joint_transforms(source, skeleton, animation, time) else {
        return Vec::new();
    };
    if source.text(prim, "primvars:skel:skinningMethod", STILL).as_deref() == Some("dualQuaternion") {
        source.unsupported(path, "joints are blended linearly, not as dual quaternions");
    }
    // A mesh may number the joints in its own order
    let own = source.read(prim, "skel:joints", STILL, values::texts).filter(|names| !names.is_empty());
    let number_of: BTreeMap<&str, usize> =
        skinning.names.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect();
    let joint = |index: i32| {
        let index = usize::try_from(index).ok()?;
        match &own {
            Some(names) => number_of.get(names.get(index)?.as_str()).copied(),
            None => (index < skinning.names.len()).then_some(index),
        }
    };
    let is_constant =
        source.metadata(prim.attribute(indices.to_owned()).path(), "interpolation").as_deref() == Some("constant");
    let width = if is_constant { joints.len() } else { joints.len() / points.len().max(1) };
    if width == 0 {
        return Vec::new();
    }
    let bind = source.read(prim, "primvars:skel:geomBindTransform", STILL, values::matrix).unwrap_or(DMat4::IDENTITY);
    // From the space of the skeleton to that of the mesh
    let mesh_from_skeleton = world(source, prim.path(), time).inverse() * world(source, skeleton.path(), time);
    let mesh_from_skeleton = DMat4::from(mesh_from_skeleton);
    let mut changes = Vec::with_capacity(points.len());
    for (row, point) in points.iter_mut().enumerate() {
        let first = if is_constant { 0 } else { row * width };
        let (mut blend, mut sum) = (DMat4::ZERO, 0.0);
        for influence in first..first + width {
            let weight = f64::from(weights_of[influence]);
            if let Some(joint) = joint(joints[influence]).filter(|_| weight.is_finite()) {
                blend += skinning.transforms[joint] * weight;
                sum += weight;
            }
        }
        let blend = if sum == 0.0 { DMat4::IDENTITY } else { blend * (1.0 / sum) };
        let whole = mesh_from_skeleton * blend * bind;
        *point = whole.transform_point3(point.as_dvec3()).as_vec3();
        changes.push(DMat3::from_mat4(whole).inverse().transpose());
    }
    changes
}

/// The joints of a skeleton, and their transformations from the bound pose, in the space of the skeleton.
struct Skinning {
    names: Vec<String>,
    transforms: Vec<DMat4>,
}

/// Returns the transformations of joints at a time; `None`: the skeleton is incomplete.
fn joint_transforms(
    source: &StageSource<'_>,
    skeleton: &Prim,
    animation: Option<&Prim>,
    time: f64,
) -> Option<Skinning> {
    let path = skeleton.path().as_str();
    let names = source.read(skeleton, "joints", STILL, values::texts).unwrap_or_default();
    let binds = source.read(skeleton, "bindTransforms", STILL, values::matrices).unwrap_or_default();
    let rests = source.read(skeleton, "restTransforms", STILL, values::matrices).unwrap_or_default();
    if names.is_empty() || binds.len() != names.len() || names.len() > JOINTS_MAX {
        source.unsupported(path, "a skeleton whose joints have no bound pose has no effect");
        return None;
    }
    let moved = animation.map(|animation| animated_joints(source, animation, time)).unwrap_or_default();
    let number_of: BTreeMap<&str, usize> = names.iter().enumerate().map(|(i, name)| (name.as_str(), i)).collect();
    // Parents come first in a sound skeleton
    let mut places: Vec<DMat4> = Vec::with_capacity(names.len());
    for (index, name) in names.iter().enumerate() {
        let parent = name.rsplit_once('/').and_then(|(parent, _)| number_of.get(parent).copied());
        let parent = parent.filter(|&parent| parent < index);
        let local = moved.get(name).or_else(|| rests.get(index)).copied();
        places.push(match (local, parent) {
            (Some(local), Some(parent)) => places[parent] * local,
            (Some(local), None) => local,
            (None, _) => binds[index],
        });
    }
    let transforms = places.iter().zip(&binds).map(|(place, bind)| *place * bind.inverse());
    let transforms: Vec<DMat4> = transforms.map(|it| if it.is_finite() { it } else { DMat4::IDENTITY }).collect();
    Some(Skinning { names, transforms })
}

/// Returns the transformations of the joints that an animation moves, each within its parent.
fn animated_joints(source: &StageSource<'_>, animation: &Prim, time: f64) -> BTreeMap<String, DMat4> {
    let names = source.read(animation, "joints", STILL, values::texts).unwrap_or_default();
    let translations = source.read(animation, "translations", time, values::vectors).unwrap_or_default();
    let rotations = source.read(animation, "rotations", time, values::quaternions).unwrap_or_default();
    let scales = source.read(animation, "scales", time, values::vectors).unwrap_or_default();
    if [translations.len(), rotations.len(), scales.len()] != [names.len(); 3] {
        if !names.is_empty() {
            source.unsupported(
                animation.path().as_str(),
                "an animation without a transformation for each joint has no effect",
            );
        }
        return BTreeMap::new();
    }
    let joint = |index: usize| {
        let turn = if rotations[index].length_squared() > 0.0 { rotations[index].normalize() } else { DQuat::IDENTITY };
        let (scale, place) = (scales[index].as_dvec3(), translations[index].as_dvec3());
        DMat4::from_scale_rotation_translation(scale, turn, place)
    };
    names.into_iter().enumerate().map(|(index, name)| (name, joint(index))).collect()
}

/// Returns the transformation of a prim to world space, without that of the up axis.
fn world(source: &StageSource<'_>, path: &Path, time: f64) -> DAffine3 {
    let mut world = DAffine3::IDENTITY;
    for path in path.ancestors_below_root() {
        let local = xform::read(source, &source.stage.prim(path), time);
        world = local.parent_from_prim * world;
        if local.resets {
            break;
        }
    }
    world
}
