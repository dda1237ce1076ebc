//! The half planes of type C: which column of the table each horizontal angle shows.

/// A half plane, and the column of the table that it shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HalfPlane {
    /// Horizontal angle in degrees.
    pub(super) angle: f64,
    pub(super) column: usize,
}

/// Returns the half planes of the whole circle, from 0° to 360°, of a file that may give a part of it: one plane for all
/// (0°), a quadrant (0° to 90°), a half (0° to 180°, or 90° to 270°), or everything.
pub(super) fn full_circle(horizontal: &[f64]) -> Result<Vec<HalfPlane>, String> {
    let mut planes: Vec<HalfPlane> =
        horizontal.iter().zip(0..).map(|(&angle, column)| HalfPlane { angle, column }).collect();
    let (first, last) = (horizontal[0], horizontal[horizontal.len() - 1]);
    let is = |angle: f64, other: f64| (angle - other).abs() < 1e-3;
    if planes.len() == 1 {
        return Ok(vec![HalfPlane { angle: 0.0, ..planes[0] }, HalfPlane { angle: 360.0, ..planes[0] }]);
    }
    if is(first, 90.0) && is(last, 270.0) {
        // Mirrored at the plane of 90° and 270°
        planes = mirrored(&planes, 270.0, 360.0);
        let lower = mirrored(&planes, 90.0, 0.0);
        planes.extend(lower.into_iter().filter(|plane| plane.angle < 90.0 - 1e-3));
        planes.sort_by(|a, b| a.angle.total_cmp(&b.angle));
        planes.dedup_by(|a, b| is(a.angle, b.angle));
        return Ok(closed(planes));
    }
    if !is(first, 0.0) {
        return Err(format!("the horizontal angles begin at {first}°; they must begin at 0°, or go from 90° to 270°"));
    }
    if is(last, 90.0) {
        planes = mirrored(&planes, 90.0, 180.0);
    }
    if is(planes[planes.len() - 1].angle, 180.0) {
        planes = mirrored(&planes, 180.0, 360.0);
    }
    let last = planes[planes.len() - 1].angle;
    if is(last, 360.0) {
        return Ok(planes);
    }
    // Some files leave out 360°, which is 0°
    let gap = 360.0 - last;
    let steps = [planes[1].angle - planes[0].angle, last - planes[planes.len() - 2].angle];
    if gap > 0.0 && steps.iter().any(|&step| is(step, gap)) {
        return Ok(closed(planes));
    }
    Err(format!("the horizontal angles end at {last}°; they must end at 0°, 90°, 180° or 360°"))
}

/// Appends the planes mirrored at an angle, up to another one.
fn mirrored(planes: &[HalfPlane], at: f64, end: f64) -> Vec<HalfPlane> {
    let mut all = planes.to_vec();
    let images = planes.iter().rev().map(|plane| HalfPlane { angle: 2.0 * at - plane.angle, ..*plane });
    all.extend(
        images.filter(|plane| (plane.angle - at).abs() > 1e-3 && (plane.angle - at).abs() <= (end - at).abs() + 1e-3),
    );
    all
}

/// Appends 360°, which is 0°.
fn closed(mut planes: Vec<HalfPlane>) -> Vec<HalfPlane> {
    if planes.last().is_some_and(|plane| plane.angle < 360.0 - 1e-3) {
        planes.push(HalfPlane { angle: 360.0, ..planes[0] });
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(horizontal: &[f64]) -> Vec<(f64, usize)> {
        full_circle(horizontal).unwrap().iter().map(|plane| (plane.angle, plane.column)).collect()
    }

    #[test]
    fn parts_of_the_circle_are_mirrored() {
        assert_eq!(shown(&[0.0]), [(0.0, 0), (360.0, 0)]);
        let quadrant =
            [(0.0, 0), (45.0, 1), (90.0, 2), (135.0, 1), (180.0, 0), (225.0, 1), (270.0, 2), (315.0, 1), (360.0, 0)];
        assert_eq!(shown(&[0.0, 45.0, 90.0]), quadrant);
        assert_eq!(shown(&[0.0, 90.0, 180.0]), [(0.0, 0), (90.0, 1), (180.0, 2), (270.0, 1), (360.0, 0)]);
        let side = [(0.0, 1), (45.0, 1), (90.0, 0), (135.0, 1), (180.0, 2), (225.0, 3), (270.0, 4)];
        let found = shown(&[90.0, 135.0, 180.0, 225.0, 270.0]);
        // 0° is opposite of 180°: the image of 180° at the plane of 90°
        assert_eq!(found[2..7], side[2..7]);
        assert_eq!(found[0], (0.0, 2));
        assert_eq!(found[1], (45.0, 1));
        assert_eq!(found[7..], [(315.0, 3), (360.0, 2)]);
        let open: Vec<f64> = (0..24).map(|step| f64::from(step) * 15.0).collect();
        assert_eq!(shown(&open)[24], (360.0, 0));
    }

    #[test]
    fn other_parts_are_refused() {
        for wrong in [&[0.0, 30.0][..], &[10.0, 20.0], &[0.0, 90.0, 270.0, 300.0]] {
            assert!(full_circle(wrong).unwrap_err().contains("must"), "{wrong:?}");
        }
    }
}
