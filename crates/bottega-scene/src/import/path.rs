//! Transformations over time, in double precision, as importers compose them.

use glam::{Affine3A, DAffine3, DMat3, DQuat};

use crate::motion::TransformKey;

/// Steps between two keys where no single key can describe the motion, as that of a part beside the axis of a rotation.
const STEPS: u32 = 16;

/// A transformation at one or several times, ascending.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TransformPath(Vec<(f64, DAffine3)>);

impl TransformPath {
    /// Returns a path without motion.
    pub(crate) fn still(transform: DAffine3) -> Self {
        Self(vec![(0.0, transform)])
    }

    /// Returns the path through keys. `None`: there is none, or their times are not finite and ascending.
    pub(crate) fn new(keys: Vec<(f64, DAffine3)>) -> Option<Self> {
        let is_ordered = keys.windows(2).all(|pair| pair[0].0 < pair[1].0);
        let is_finite = keys.iter().all(|key| key.0.is_finite());
        (!keys.is_empty() && is_ordered && is_finite).then_some(Self(keys))
    }

    /// Returns the keys.
    pub(crate) fn keys(&self) -> &[(f64, DAffine3)] {
        &self.0
    }

    /// Returns the transformation of the first key.
    pub(crate) fn first(&self) -> DAffine3 {
        self.0[0].1
    }

    /// Returns true if the transformation is the same at all keys.
    pub(crate) fn is_still(&self) -> bool {
        self.0.iter().all(|key| key.1 == self.0[0].1)
    }

    /// Returns true if nothing but the translation changes.
    fn only_shifts(&self) -> bool {
        self.0.iter().all(|key| key.1.matrix3 == self.0[0].1.matrix3)
    }

    /// Returns the transformation at a time: between two keys, translation, rotation and stretch are interpolated separately.
    pub(crate) fn at(&self, time: f64) -> DAffine3 {
        let next = self.0.partition_point(|key| key.0 <= time);
        if next == 0 || next == self.0.len() {
            return self.0[next.saturating_sub(1)].1;
        }
        let ((start, from), (end, to)) = (self.0[next - 1], self.0[next]);
        between(&from, &to, (time - start) / (end - start))
    }

    /// Returns the path of `inner` within this one: each transformation of `inner` first.
    pub(crate) fn of(&self, inner: &Self) -> Self {
        if self.is_still() && inner.is_still() {
            return Self::still(self.first() * inner.first());
        }
        let mut times: Vec<f64> = Vec::new();
        times.extend([self, inner].iter().filter(|path| !path.is_still()).flat_map(|path| &path.0).map(|key| key.0));
        times.sort_by(f64::total_cmp);
        times.dedup();
        // The product of both is interpolated as each of them only if the other does nothing, or if nothing turns
        let is_nothing = |path: &Self| path.is_still() && path.first() == DAffine3::IDENTITY;
        let is_simple = is_nothing(self) || is_nothing(inner) || (self.only_shifts() && inner.only_shifts());
        if !is_simple {
            let step = |pair: &[f64]| {
                let (start, end) = (pair[0], pair[1]);
                (0..STEPS).map(move |i| start + (end - start) * f64::from(i) / f64::from(STEPS))
            };
            let last = times.last().copied();
            times = times.windows(2).flat_map(step).chain(last).collect();
        }
        Self(times.into_iter().map(|time| (time, self.at(time) * inner.at(time))).collect())
    }

    /// Returns the path with a transformation that is applied before.
    pub(crate) fn after(&self, first: &DAffine3) -> Self {
        self.of(&Self::still(*first))
    }

    /// Returns the path with a transformation of its result.
    pub(crate) fn then(&self, last: &DAffine3) -> Self {
        Self::still(*last).of(self)
    }

    /// Returns the keys of the motion, rounded; empty if nothing moves.
    pub(crate) fn motion(&self, rounded: impl Fn(&DAffine3) -> Affine3A) -> Vec<TransformKey> {
        if self.is_still() {
            return Vec::new();
        }
        self.0.iter().map(|(time, transform)| TransformKey { time: *time, transform: rounded(transform) }).collect()
    }
}

/// Returns the transformation at a share of the way between two.
fn between(from: &DAffine3, to: &DAffine3, share: f64) -> DAffine3 {
    let translation = from.translation * (1.0 - share) + to.translation * share;
    let mix = |a: DMat3, b: DMat3| a * (1.0 - share) + b * share;
    let matrix3 = match (polar(&from.matrix3), polar(&to.matrix3)) {
        _ if from.matrix3 == to.matrix3 => from.matrix3,
        (Some((r, s)), Some((q, t))) => {
            let turned = DQuat::from_mat3(&r).normalize().slerp(DQuat::from_mat3(&q).normalize(), share);
            DMat3::from_quat(turned) * mix(s, t)
        }
        _ => mix(from.matrix3, to.matrix3),
    };
    DAffine3 { matrix3, translation }
}

/// Splits a matrix into a rotation and a stretch, which is applied first and mirrors if the matrix does. `None`: it is
/// singular.
fn polar(matrix: &DMat3) -> Option<(DMat3, DMat3)> {
    let side = if matrix.determinant() < 0.0 { -1.0 } else { 1.0 };
    let mut rotation = *matrix * side;
    for _ in 0..200 {
        let next = (rotation + rotation.inverse().transpose()) * 0.5;
        if !next.is_finite() {
            return None;
        }
        let is_near = next.abs_diff_eq(rotation, 1e-13);
        rotation = next;
        if is_near {
            break;
        }
    }
    Some((rotation, rotation.transpose() * *matrix))
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn turned(angle: f64) -> DAffine3 {
        DAffine3::from_rotation_z(angle)
    }

    #[test]
    fn a_part_beside_the_axis_moves_on_an_arc() {
        let turn = TransformPath::new(vec![(1.0, turned(0.0)), (3.0, turned(2.0))]).unwrap();
        let beside = turn.after(&DAffine3::from_translation(DVec3::X));
        for i in 0..=20 {
            let time = 1.0 + 0.1 * f64::from(i);
            let p = beside.at(time).translation;
            assert!((p - DVec3::new((time - 1.0).cos(), (time - 1.0).sin(), 0.0)).length() < 3e-3, "{time}: {p}");
        }
        assert_eq!(beside.at(0.0), beside.first());
    }

    #[test]
    fn shifts_need_no_more_keys() {
        let at = |x: f64| DAffine3::from_translation(DVec3::X * x);
        let shift = TransformPath::new(vec![(0.0, at(0.0)), (1.0, at(1.0))]).unwrap();
        assert_eq!(shift.after(&turned(1.0)).keys().len(), 2);
        assert_eq!(shift.after(&DAffine3::IDENTITY), shift);
        assert!(TransformPath::still(at(2.0)).of(&TransformPath::still(at(1.0))).is_still());
        assert!(TransformPath::new(vec![(1.0, at(0.0)), (0.0, at(1.0))]).is_none());
    }
}
