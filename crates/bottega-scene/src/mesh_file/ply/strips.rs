//! Triangle strips, as some scanners write them instead of faces: each corner makes a triangle with the two before it,
//! every second one reversed, and −1 starts a new strip.

/// A corner of a strip that refers to no vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("refers to vertex {index}, but there are {vertex_count}")]
pub(super) struct NoSuchVertex {
    index: i64,
    vertex_count: usize,
}

/// The state of a strip: its last two corners and its length.
#[derive(Default)]
pub(super) struct Strip {
    before: [u32; 2],
    length: usize,
}

impl Strip {
    /// Takes the next corner; −1 ends the strip. Returns the triangle that it completes; `None`: it completes none, or
    /// two of its corners are equal.
    pub(super) fn next(&mut self, index: i64, vertex_count: usize) -> Result<Option<[u32; 3]>, NoSuchVertex> {
        if index == -1 {
            self.length = 0;
            return Ok(None);
        }
        let in_range = u32::try_from(index).ok().filter(|&index| (index as usize) < vertex_count);
        let index = in_range.ok_or(NoSuchVertex { index, vertex_count })?;
        let [a, b] = self.before;
        let triangle = if self.length.is_multiple_of(2) { [a, b, index] } else { [b, a, index] };
        let is_triangle = self.length >= 2 && a != b && a != index && b != index;
        self.before = [b, index];
        self.length += 1;
        Ok(is_triangle.then_some(triangle))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangles(corners: &[i64]) -> Result<Vec<[u32; 3]>, NoSuchVertex> {
        let mut strip = Strip::default();
        corners.iter().filter_map(|&corner| strip.next(corner, 9).transpose()).collect()
    }

    #[test]
    fn every_other_triangle_is_turned_and_minus_one_starts_a_strip() {
        assert_eq!(triangles(&[0, 1, 2, 3, 4]).unwrap(), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
        assert_eq!(triangles(&[0, 1, 2, -1, 3, 4, 5]).unwrap(), [[0, 1, 2], [3, 4, 5]]);
        // A repeated vertex keeps the orientation alternating.
        assert_eq!(triangles(&[0, 1, 2, 2, 3]).unwrap(), [[0, 1, 2]]);
        assert_eq!(triangles(&[0, 1, 2, 2, 3, 4]).unwrap(), [[0, 1, 2], [3, 2, 4]]);
        assert!(triangles(&[0, 1, 9]).is_err() && triangles(&[0, 1, -2]).is_err());
    }
}
