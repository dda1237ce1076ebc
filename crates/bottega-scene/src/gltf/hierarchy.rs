//! The tree of nodes: visibility and transformations.

use std::collections::BTreeSet;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};

use super::accessor::find;
use super::animation::{NodePose, Pose};
use super::document;
use super::source::GltfSource;
use crate::error::{SceneError, Warnings};

/// The nodes of the shown scene, with their transformations.
pub(super) struct Hierarchy {
    /// Nodes of the scene, parents before children, in file order.
    pub(super) nodes: Vec<usize>,
    /// Node space to world space, for every node of the document; `None` outside of the scene.
    pub(super) world_from_node: Vec<Option<DAffine3>>,
    /// Invisible nodes, including all below an invisible one (KHR_node_visibility).
    hidden: BTreeSet<usize>,
    /// Animated properties of the nodes.
    pub(super) pose: Pose,
}

impl Hierarchy {
    /// Traverses the default scene, or the first one, or all nodes if there is no scene.
    pub(super) fn new(source: &GltfSource<'_>, pose: Pose, warnings: &mut Warnings) -> Result<Self, SceneError> {
        let document = source.document;
        let has_parent = check_forest(source)?;
        let roots = match (document.scene, document.scenes.len()) {
            (None, 0) => (0..document.nodes.len()).filter(|&node| !has_parent[node]).collect(),
            (scene, count) => {
                if scene.is_none() && count > 1 {
                    warnings.add("scene", format!("none of the {count} scenes is the default; the first one is shown"));
                }
                let scene = find("scene", &document.scenes, scene.unwrap_or(0));
                scene.map_err(|problem| source.invalid("scene", problem))?.nodes.clone()
            }
        };
        let mut world_from_node = vec![None; document.nodes.len()];
        let mut nodes = Vec::new();
        let mut hidden = BTreeSet::new();
        let world = DAffine3::from_translation(-source.origin);
        let mut pending: Vec<(usize, DAffine3, bool)> =
            roots.into_iter().rev().map(|node| (node, world, true)).collect();
        while let Some((index, world_from_parent, is_visible)) = pending.pop() {
            let node = find("node", &document.nodes, index).map_err(|problem| source.invalid("scenes", problem))?;
            if world_from_node[index].is_some() {
                return Err(source.invalid(format!("nodes[{index}]"), "is in the scene twice"));
            }
            let world = world_from_parent * parent_from_node(node, pose.get(&index));
            world_from_node[index] = Some(world);
            nodes.push(index);
            let visibility = node.extensions.as_ref().and_then(|extensions| extensions.visibility.as_ref());
            let is_visible = is_visible && visibility.and_then(|visibility| visibility.visible).unwrap_or(true);
            if !is_visible {
                hidden.insert(index);
            }
            pending.extend(node.children.iter().rev().map(|&child| (child, world, is_visible)));
        }
        Ok(Self { nodes, world_from_node, hidden, pose })
    }

    /// Iterates over the visible nodes.
    pub(super) fn visible(&self) -> impl Iterator<Item = usize> {
        self.nodes.iter().copied().filter(|node| !self.hidden.contains(node))
    }
}

/// Checks that every node has at most one parent and is not its own ancestor. Returns for each node whether it has a
/// parent.
fn check_forest(source: &GltfSource<'_>) -> Result<Vec<bool>, SceneError> {
    let nodes = &source.document.nodes;
    let mut has_parent = vec![false; nodes.len()];
    for (index, node) in nodes.iter().enumerate() {
        for &child in &node.children {
            let place = || format!("nodes[{index}].children");
            find("node", nodes, child).map_err(|problem| source.invalid(place(), problem))?;
            if has_parent[child] {
                return Err(source.invalid(place(), format!("node {child} has two parents")));
            }
            has_parent[child] = true;
        }
    }
    // As each node has at most one parent, nodes that no root reaches form cycles.
    let mut reached = vec![false; nodes.len()];
    let mut pending: Vec<usize> = (0..nodes.len()).filter(|&node| !has_parent[node]).collect();
    while let Some(index) = pending.pop() {
        reached[index] = true;
        pending.extend(&nodes[index].children);
    }
    match reached.iter().position(|&reached| !reached) {
        None => Ok(has_parent),
        Some(index) => Err(source.invalid(format!("nodes[{index}]"), "is its own ancestor")),
    }
}

fn parent_from_node(node: &document::Node, pose: Option<&NodePose>) -> DAffine3 {
    let (mut scale, mut rotation, mut translation) = (node.scale, node.rotation, node.translation);
    let pose = pose.filter(|pose| pose.moves());
    if let Some(columns) = &node.matrix {
        let matrix = DAffine3::from_mat4(DMat4::from_cols_array(columns));
        if pose.is_none() {
            return matrix;
        }
        // Animated nodes should not have a matrix; decompose it if they do.
        let parts = matrix.to_scale_rotation_translation();
        (scale, rotation, translation) = (Some(parts.0.into()), Some(parts.1.into()), Some(parts.2.into()));
    }
    match pose {
        None => affine(scale, rotation, translation),
        Some(pose) => affine(pose.scale.or(scale), pose.rotation.or(rotation), pose.translation.or(translation)),
    }
}

/// Composes scale, rotation (a quaternion) and translation, in that order; `None`: the identity.
pub(super) fn affine(scale: Option<[f64; 3]>, rotation: Option<[f64; 4]>, translation: Option<[f64; 3]>) -> DAffine3 {
    let rotation = rotation.map_or(DQuat::IDENTITY, |q| {
        let q = DQuat::from_array(q);
        // A rotation of length 0 is invalid: make the matrix singular, which is detected later.
        if q.length_squared() > 0.0 && q.is_finite() {
            q / q.length()
        } else {
            DQuat::from_xyzw(0.0, 0.0, 0.0, f64::NAN)
        }
    });
    let matrix = DMat3::from_quat(rotation) * DMat3::from_diagonal(scale.map_or(DVec3::ONE, DVec3::from_array));
    DAffine3 { matrix3: matrix, translation: translation.map_or(DVec3::ZERO, DVec3::from_array) }
}
