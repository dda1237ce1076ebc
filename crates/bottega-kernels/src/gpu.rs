//! A tree for graphics processors: two children a node, 64 bytes, over all triangles in world space.
//!
//! Simple and, for coherent rays, the fastest form there (Aila and Laine 2009, "Understanding the Efficiency of Ray
//! Traversal on GPUs"): one fetch brings both boxes. Instances are copied out and spheres left to the caller. Watertight
//! box tests are the shader's business; the boxes are exact.

use crate::{BuildError, BuildOptions, InstanceGeometry, MeshGeometry, build};
use bytemuck::{Pod, Zeroable};

/// Two boxes and what is in them.
///
/// A child with `count` 0 is the node `index`; otherwise it is a leaf with the triangles from `index` on. A child that is
/// not there has a box that is inside out (+∞, −∞), and a count of 1 with index 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GpuNode {
    /// Lower corner of the first child's box.
    pub left_min: [f32; 3],
    /// Node or first triangle of the first child.
    pub left_index: u32,
    /// Upper corner of the first child's box.
    pub left_max: [f32; 3],
    /// Triangles of the first child, at most 4; 0 for a node.
    pub left_count: u32,
    /// Lower corner of the second child's box.
    pub right_min: [f32; 3],
    /// Node or first triangle of the second child.
    pub right_index: u32,
    /// Upper corner of the second child's box.
    pub right_max: [f32; 3],
    /// Triangles of the second child, at most 4; 0 for a node.
    pub right_count: u32,
}

/// A triangle in world space, 48 bytes: three vectors of four for the shader.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct GpuTriangle {
    /// First vertex.
    pub p0: [f32; 3],
    /// Instance, as in [`crate::Hit`].
    pub instance: u32,
    /// Second vertex.
    pub p1: [f32; 3],
    /// Triangle of the instance's mesh, as in [`crate::Hit`].
    pub primitive: u32,
    /// Third vertex.
    pub p2: [f32; 3],
    /// Not used.
    pub padding: u32,
}

/// The tree: the root is node 0, which is always there.
#[derive(Clone, Debug, PartialEq)]
pub struct GpuBvh {
    /// Nodes in preorder.
    pub nodes: Vec<GpuNode>,
    /// Triangles by leaf; those without area are left out.
    pub triangles: Vec<GpuTriangle>,
    /// Nodes on the longest path from the root: a stack of so many entries is never exceeded. Below 72.
    pub depth: u32,
}

/// Builds the tree. The result does not depend on `options.threads`.
pub fn build_bvh2(
    meshes: &[MeshGeometry<'_>],
    instances: &[InstanceGeometry],
    options: &BuildOptions,
) -> Result<GpuBvh, BuildError> {
    let (binary, triangles) = build::build_binary(meshes, instances, options)?;
    let empty = GpuNode {
        left_min: [f32::INFINITY; 3],
        left_index: 0,
        left_max: [f32::NEG_INFINITY; 3],
        left_count: 1,
        right_min: [f32::INFINITY; 3],
        right_index: 0,
        right_max: [f32::NEG_INFINITY; 3],
        right_count: 1,
    };
    // Only inner nodes are kept: their numbers are their ranks among the inner nodes.
    let mut rank = 0;
    let ranks: Vec<u32> = binary
        .iter()
        .map(|node| {
            rank += u32::from(node.second != 0);
            rank - u32::from(node.second != 0)
        })
        .collect();
    let child = |index: usize| {
        let node = &binary[index];
        let (target, count) = if node.second == 0 { (node.first, node.count) } else { (ranks[index], 0) };
        (node.bounds.min.to_array(), node.bounds.max.to_array(), target, count)
    };
    let mut nodes = Vec::with_capacity(rank as usize + 1);
    let mut depth = 1;
    let mut depths = vec![1u32; binary.len()];
    for (index, node) in binary.iter().enumerate() {
        if node.second == 0 {
            continue;
        }
        let second = index + node.second as usize;
        depth = depth.max(depths[index]);
        (depths[index + 1], depths[second]) = (depths[index] + 1, depths[index] + 1);
        let ((left_min, left_max, left_index, left_count), (right_min, right_max, right_index, right_count)) =
            (child(index + 1), child(second));
        nodes.push(GpuNode {
            left_min,
            left_index,
            left_max,
            left_count,
            right_min,
            right_index,
            right_max,
            right_count,
        });
    }
    if nodes.is_empty() {
        let root = if binary.is_empty() {
            empty
        } else {
            let (left_min, left_max, left_index, left_count) = child(0);
            GpuNode { left_min, left_index, left_max, left_count, ..empty }
        };
        nodes.push(root);
    }
    Ok(GpuBvh { nodes, triangles, depth })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::noisy_sphere;
    use glam::{Affine3A, Vec3};

    fn visit(bvh: &GpuBvh, node: usize, depth: u32, seen: &mut [u32]) {
        assert!(depth <= bvh.depth);
        let n = &bvh.nodes[node];
        for (min, max, index, count) in [
            (n.left_min, n.left_max, n.left_index, n.left_count),
            (n.right_min, n.right_max, n.right_index, n.right_count),
        ] {
            if min[0] > max[0] {
                continue;
            }
            if count == 0 {
                assert!(index as usize > node, "children follow their parents");
                visit(bvh, index as usize, depth + 1, seen);
            }
            let leaf = index as usize..(index + count) as usize;
            for (seen, t) in seen[leaf.clone()].iter_mut().zip(&bvh.triangles[leaf]) {
                *seen += 1;
                for p in [t.p0, t.p1, t.p2] {
                    assert!((0..3).all(|k| min[k] <= p[k] && p[k] <= max[k]), "a box holds its triangles");
                }
            }
        }
    }

    #[test]
    fn every_triangle_is_in_one_leaf_inside_its_box() {
        assert_eq!((size_of::<GpuNode>(), size_of::<GpuTriangle>()), (64, 48));
        let scene = noisy_sphere();
        let place =
            |mesh, x: f32| InstanceGeometry { mesh, world_from_object: Affine3A::from_translation(Vec3::X * x) };
        for instances in [vec![], vec![place(1, 0.0)], vec![place(0, 0.0), place(1, 3.0), place(0, 5.0)]] {
            let single = MeshGeometry { positions: &scene.positions, triangles: &scene.triangles[..3] };
            let options = BuildOptions::default();
            let bvh = build_bvh2(&[scene.geometry(), single], &instances, &options).unwrap();
            let mut seen = vec![0; bvh.triangles.len()];
            visit(&bvh, 0, 1, &mut seen);
            assert!(seen.iter().all(|&n| n == 1));
            let expected: usize = instances.iter().map(|i| [scene.triangles.len(), 3][i.mesh as usize]).sum();
            assert_eq!(seen.len(), expected);
            let serial = BuildOptions { threads: 1, ..options };
            assert!(build_bvh2(&[scene.geometry(), single], &instances, &serial).unwrap() == bvh);
        }
    }
}
