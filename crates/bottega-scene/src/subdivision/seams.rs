//! Connectivity of values by corner: corners of a vertex with the same value share a vertex of it; where values differ there is a
//! seam.

use super::control::SeamRule;
use super::sharpness::{INFINITE, is_infinite};
use super::topology::HalfEdges;

/// Makes the connectivity of values on a control mesh. Returns also a corner of each of its vertices.
///
/// - `ids`: the value of each corner, by number.
pub(super) fn topology(mesh: &HalfEdges, starts: Vec<u32>, ids: &[u32], rule: SeamRule) -> (HalfEdges, Vec<u32>) {
    // Number the values at each vertex
    let mut keys: Vec<(u32, u32, u32)> =
        ids.iter().zip(0..).map(|(&id, corner)| (mesh.tails[corner as usize], id, corner)).collect();
    keys.sort_unstable();
    let mut tails = vec![0; ids.len()];
    let (mut corners, mut values_at) = (Vec::new(), vec![0u32; mesh.vertex_count]);
    for same in keys.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        same.iter().for_each(|&(_, _, corner)| tails[corner as usize] = corners.len() as u32);
        values_at[same[0].0 as usize] += 1;
        corners.push(same[0].2);
    }
    let (mut topology, _) = HalfEdges::new(corners.len(), starts, tails);
    topology.has_linear_boundaries = rule >= SeamRule::Linear;
    for (edge, sharpness) in topology.edge_sharpness.iter_mut().enumerate() {
        let of_mesh = mesh.edge_of[topology.edges[edge][0] as usize];
        *sharpness = sharpness.max(mesh.edge_sharpness[of_mesh as usize]);
    }
    sharpen(&mut topology, mesh, &corners, &values_at, rule);
    (topology, corners)
}

/// Sharpens the vertices of values by the rule.
fn sharpen(topology: &mut HalfEdges, mesh: &HalfEdges, corners: &[u32], values_at: &[u32], rule: SeamRule) {
    // Faces, seams and boundaries at each vertex of values; seams are boundaries that the mesh does not have
    let (mut faces, mut seams, mut boundaries) =
        (vec![0u32; corners.len()], vec![0u32; corners.len()], vec![0u32; corners.len()]);
    topology.tails.iter().for_each(|&vertex| faces[vertex as usize] += 1);
    let mut is_at_boundary = vec![false; mesh.vertex_count];
    for edge in (0..topology.edges.len()).filter(|&edge| topology.is_boundary(edge)) {
        let half = topology.edges[edge][0];
        let is_seam = !mesh.is_boundary(mesh.edge_of[half as usize] as usize);
        for end in topology.ends(half) {
            boundaries[end as usize] += 1;
            seams[end as usize] += u32::from(is_seam);
            is_at_boundary[mesh.tails[corners[end as usize] as usize] as usize] |= !is_seam;
        }
    }
    // Vertices of the mesh where one of the regions has one face
    let mut has_corner = vec![false; mesh.vertex_count];
    for (vertex, &corner) in corners.iter().enumerate() {
        has_corner[mesh.tails[corner as usize] as usize] |= faces[vertex] == 1 && boundaries[vertex] > 0;
    }
    for (vertex, sharpness) in topology.vertex_sharpness.iter_mut().enumerate() {
        let of_mesh = mesh.tails[corners[vertex] as usize] as usize;
        *sharpness = mesh.vertex_sharpness[of_mesh];
        if is_infinite(*sharpness) || boundaries[vertex] == 0 {
            continue;
        }
        let is_end = seams[vertex] > 0 && values_at[of_mesh] == 1 && !is_at_boundary[of_mesh];
        let is_sharp = match rule {
            SeamRule::Smooth => false,
            SeamRule::Corners => faces[vertex] == 1,
            SeamRule::Junctions => faces[vertex] == 1 || values_at[of_mesh] > 2,
            SeamRule::Ends => {
                faces[vertex] == 1 || values_at[of_mesh] > 2 || is_end || values_at[of_mesh] == 2 && has_corner[of_mesh]
            }
            SeamRule::Linear | SeamRule::AllLinear => true,
        };
        if is_sharp {
            *sharpness = INFINITE;
        }
    }
}
