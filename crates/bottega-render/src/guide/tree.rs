//! Regions of surfaces: a binary tree over space for each of six ways that a surface may face.

use glam::Vec3;

use super::directions::Directions;

/// Ways that a surface may face.
pub(super) const FACES: usize = 6;

/// Which of the six axes a normal is nearest to.
#[inline]
pub(super) fn face_of(normal: Vec3) -> usize {
    let size = normal.abs();
    let axis = if size.x >= size.y && size.x >= size.z {
        0
    } else if size.y >= size.z {
        1
    } else {
        2
    };
    2 * axis + usize::from(normal[axis] < 0.0)
}

/// Where to go on in a [`Tree`].
#[derive(Clone, Copy, Debug)]
pub(super) enum Node {
    /// Before and after a plane; the second child follows the first.
    Split { axis: u8, plane: f32, first: u32 },
    /// The index of a region.
    Region(u32),
    /// A region where the BSDF is as good a guide.
    Unguided,
}

/// All surfaces that face one way.
#[derive(Clone, Debug, Default)]
pub(super) struct Tree {
    /// The root first; none where nothing was learnt.
    pub(super) nodes: Vec<Node>,
    pub(super) regions: Vec<Region>,
}

/// The directions of one region.
#[derive(Clone, Debug)]
pub(crate) struct Region {
    /// With which probability the guide is followed, not the BSDF.
    pub(super) share: f32,
    pub(super) directions: Directions,
}

impl Region {
    /// With which probability the guide is to be followed.
    #[inline]
    pub(crate) fn share(&self) -> f32 {
        self.share
    }

    /// Density per solid angle with which a direction in world space is drawn by the guide.
    #[inline]
    pub(crate) fn pdf(&self, w: Vec3) -> f32 {
        self.directions.pdf(w)
    }

    /// Draws a direction, with its density.
    #[inline]
    pub(crate) fn sample(&self, u: [f32; 2]) -> (Vec3, f32) {
        self.directions.sample(u)
    }
}

/// What has been learnt about a view of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Guide {
    pub(super) trees: [Tree; FACES],
}

impl Guide {
    /// The region of a point on a surface whose normal, on the side from which it is seen, is `normal`. `None`: follow the
    /// BSDF.
    #[inline]
    pub(crate) fn at(&self, p: Vec3, normal: Vec3) -> Option<&Region> {
        let tree = &self.trees[face_of(normal)];
        let mut at = 0;
        loop {
            match *tree.nodes.get(at)? {
                Node::Split { axis, plane, first } => {
                    at = first as usize + usize::from(p[usize::from(axis)] >= plane);
                }
                Node::Region(region) => return tree.regions.get(region as usize),
                Node::Unguided => return None,
            }
        }
    }

    /// Bytes held.
    pub(crate) fn memory_bytes(&self) -> usize {
        self.trees.iter().map(|tree| size_of_val(&*tree.nodes) + size_of_val(&*tree.regions)).sum()
    }
}
