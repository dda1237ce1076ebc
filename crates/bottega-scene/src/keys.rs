//! Checks of the keys of what moves.

use glam::Vec3;

use crate::error::Violation;
use crate::model::{COORDINATE_MAX, Mesh, is_placeable};
use crate::motion::TransformKey;

/// The most keys of one part.
pub(crate) const KEYS_MAX: usize = 1 << 12;

/// Checks the times of keys: finite and ascending.
pub(crate) fn check_times(times: impl ExactSizeIterator<Item = f64> + Clone) -> Result<(), Violation> {
    let check = |holds: bool, problem: &'static str| if holds { Ok(()) } else { Err(Violation(problem.into())) };
    check(times.len() <= KEYS_MAX, "it has more than 4096 keys")?;
    check(times.clone().all(f64::is_finite), "the time of a key is not finite")?;
    check(times.clone().zip(times.skip(1)).all(|(before, after)| before < after), "the times of its keys do not ascend")
}

/// Checks the keys of an instance.
///
/// - `bounds`: of its mesh.
pub(crate) fn check_instance_keys(bounds: (Vec3, Vec3), keys: &[TransformKey]) -> Result<(), Violation> {
    check_times(keys.iter().map(|key| key.time))?;
    if keys.iter().all(|key| is_placeable(bounds, &key.transform)) {
        return Ok(());
    }
    Err(Violation("the transformation of a key is singular, mirrors, or moves the mesh out of reach".into()))
}

/// Checks the keys of a camera or light, which may mirror, but then all of them.
pub(crate) fn check_transform_keys(keys: &[TransformKey]) -> Result<(), Violation> {
    check_times(keys.iter().map(|key| key.time))?;
    let determinant = |key: &TransformKey| key.transform.matrix3.determinant();
    let is_sound = |key: &TransformKey| {
        key.transform.is_finite()
            && determinant(key).is_normal()
            && determinant(key) * determinant(&keys[0]) > 0.0
            && key.transform.translation.abs().max_element() <= COORDINATE_MAX
    };
    if keys.iter().all(is_sound) {
        return Ok(());
    }
    Err(Violation("the transformation of a key is singular, out of reach, or mirrors as others do not".into()))
}

impl Mesh {
    /// Checks the keys of the vertices.
    pub(crate) fn check_keys(&self) -> Result<(), Violation> {
        let check = |holds: bool, problem: &'static str| if holds { Ok(()) } else { Err(Violation(problem.into())) };
        if self.motion.is_empty() {
            return Ok(());
        }
        check(self.curves.is_none(), "it has curves, whose points cannot move by keys")?;
        check_times(self.motion.iter().map(|key| key.time))?;
        for key in &self.motion {
            let is_complete = key.positions.len() == self.positions.len() && key.normals.len() == self.normals.len();
            check(is_complete, "a key has another number of vertices or normals than the mesh")?;
            let is_in_reach = |p: &Vec3| p.is_finite() && p.abs().max_element() <= COORDINATE_MAX;
            check(key.positions.iter().all(is_in_reach), "a position of a key is not finite, or out of reach")?;
            let is_unit = |n: &Vec3| (n.length_squared() - 1.0).abs() < 1e-3;
            check(key.normals.iter().all(is_unit), "a normal of a key is not of unit length")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_must_ascend() {
        assert!(check_times([0.0, 1.0, 2.5].into_iter()).is_ok());
        for bad in [[0.0, 0.0], [1.0, 0.5], [0.0, f64::NAN]] {
            assert!(check_times(bad.into_iter()).is_err());
        }
    }
}
