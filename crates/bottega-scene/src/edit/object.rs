//! Meshes placed in the world, and the checks of their matrices.

use glam::{Affine3A, Mat4, Vec3};
use rayon::prelude::*;

use super::error::EditError;
use crate::keys::check_times;
use crate::model::is_placeable;
use crate::visibility::Visibility;

/// A mesh placed in the world, once or many times.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedObject {
    /// The key of the object's mesh.
    pub mesh: String,
    /// Object space to world space of each instance; may mirror.
    pub transforms: Vec<Affine3A>,
    /// Keys of the motion, if the object moves: times, ascending, in the unit of the shutter's times, each with one
    /// transformation from object space to world space for each instance. `transforms` should be those at the time when
    /// the shutter opens.
    pub motion: Vec<(f64, Vec<Affine3A>)>,
    /// Keys of materials in place of the mesh's, by slot. A slot beyond them keeps the mesh's.
    pub materials: Vec<String>,
    /// The material of each instance, as an index into `materials`, for all its slots. Empty: materials go by slot.
    pub instance_materials: Vec<u32>,
    /// `true`: the object is not in the picture.
    pub hidden: bool,
    /// Kinds of ray for which the object exists.
    pub visibility: Visibility,
}

/// Matrices from object space to world space as rows of numbers, for column vectors.
#[derive(Clone, Copy, Debug)]
pub enum MatrixRows<'a> {
    /// Three rows per matrix.
    Three(&'a [[[f32; 4]; 3]]),
    /// Four rows per matrix; the last is 0, 0, 0, 1.
    Four(&'a [[[f32; 4]; 4]]),
}

impl MatrixRows<'_> {
    /// Returns the transformations, one per matrix, in the same order.
    ///
    /// # Errors
    /// The last row of a 4 × 4 matrix is not 0, 0, 0, 1.
    pub fn to_transforms(self) -> Result<Vec<Affine3A>, EditError> {
        match self {
            Self::Three(matrices) => Ok(matrices.par_iter().map(|&[x, y, z]| of_rows(x, y, z)).collect()),
            Self::Four(matrices) => {
                let is_wrong = |matrix: &[[f32; 4]; 4]| matrix[3] != [0.0, 0.0, 0.0, 1.0];
                if let Some(row) = matrices.par_iter().position_first(is_wrong) {
                    let problem = format!("its last row is {:?}", matrices[row][3]);
                    return Err(EditError::row(
                        "transforms",
                        row,
                        problem,
                        "0, 0, 0, 1 is needed: the matrix multiplies columns",
                    ));
                }
                Ok(matrices.par_iter().map(|&[x, y, z, _]| of_rows(x, y, z)).collect())
            }
        }
    }
}

fn of_rows(x: [f32; 4], y: [f32; 4], z: [f32; 4]) -> Affine3A {
    Affine3A::from_mat4(Mat4::from_cols_array_2d(&[x, y, z, [0.0, 0.0, 0.0, 1.0]]).transpose())
}

/// Returns true if a transformation mirrors.
pub(super) fn mirrors(transform: &Affine3A) -> bool {
    transform.matrix3.determinant() < 0.0
}

/// Returns the transformation without its mirroring in the plane x = 0 of object space.
pub(super) fn unmirrored(transform: &Affine3A) -> Affine3A {
    *transform * Affine3A::from_scale(Vec3::new(-1.0, 1.0, 1.0))
}

/// Checks that a mesh of these bounds can be placed by all transformations.
pub(super) fn check_transforms(transforms: &[Affine3A], bounds: (Vec3, Vec3)) -> Result<(), EditError> {
    // A mesh without triangles is nowhere; its matrices are checked all the same.
    let bounds = if bounds.0.cmple(bounds.1).all() { bounds } else { (Vec3::ZERO, Vec3::ZERO) };
    let mirrored = (Vec3::new(-bounds.1.x, bounds.0.y, bounds.0.z), Vec3::new(-bounds.0.x, bounds.1.y, bounds.1.z));
    let is_wrong = |transform: &Affine3A| {
        if mirrors(transform) {
            !is_placeable(mirrored, &unmirrored(transform))
        } else {
            !is_placeable(bounds, transform)
        }
    };
    let Some(row) = transforms.par_iter().with_min_len(1 << 10).position_first(is_wrong) else { return Ok(()) };
    let (problem, remedy) = if !transforms[row].is_finite() {
        ("the matrix has numbers that are not finite", "finite numbers are needed")
    } else if !transforms[row].matrix3.determinant().is_normal() {
        ("the matrix is singular", "its determinant must not be 0: scale by a small number instead, or hide the object")
    } else {
        ("the matrix moves the mesh too far away", "keep all coordinates below 1e18")
    };
    Err(EditError::row("transforms", row, problem, remedy))
}

impl PlacedObject {
    /// Checks the keys of the motion.
    ///
    /// - `bounds`: of the mesh.
    pub(super) fn check_motion(&self, bounds: (Vec3, Vec3)) -> Result<(), EditError> {
        let times = self.motion.iter().map(|key| key.0);
        check_times(times).map_err(|problem| {
            EditError::argument("motion", problem.to_string(), "give finite times that ascend, 4096 at most")
        })?;
        for (time, transforms) in &self.motion {
            if transforms.len() != self.transforms.len() {
                let (found, needed) = (transforms.len(), self.transforms.len());
                let problem = format!("the key at time {time} has {found} matrices, and there are {needed} instances");
                return Err(EditError::argument("motion", problem, "give one for each instance"));
            }
            check_transforms(transforms, bounds)?;
            let turns = transforms.iter().zip(&self.transforms).position(|(key, own)| mirrors(key) != mirrors(own));
            if let Some(row) = turns {
                let problem = format!("the matrix at time {time} mirrors where others do not");
                return Err(EditError::row("motion", row, problem, "all keys of an instance must mirror, or none"));
            }
        }
        Ok(())
    }

    /// Checks the choice of materials by instance.
    pub(super) fn check_choice(&self) -> Result<(), EditError> {
        let (rows, count) = (self.instance_materials.len(), self.transforms.len());
        if rows == 0 {
            return Ok(());
        }
        if rows != count {
            let problem = format!("it has {rows} rows, and there are {count} instances");
            return Err(EditError::argument("instance_materials", problem, "give one for each instance"));
        }
        let materials = self.materials.len();
        let wrong = self.instance_materials.iter().position(|&choice| choice as usize >= materials);
        let Some(row) = wrong else { return Ok(()) };
        let problem = format!("it is {}, and `materials` has {materials}", self.instance_materials[row] as i32);
        Err(EditError::row("instance_materials", row, problem, "choose one of `materials` by its index, from 0"))
    }
}
