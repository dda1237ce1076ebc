//! Inputs of lights, and the cone of ShapingAPI.

use openusd::usd::Prim;

use super::source::StageSource;

/// The cone of ShapingAPI, in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cone {
    /// Half angle outside which the light is 0.
    pub(super) outer: f64,
    /// Half angle inside which it is full.
    pub(super) inner: f64,
}

/// Returns an input by its name of today, or the one from before the prefix `inputs:`.
pub(super) fn input(source: &StageSource<'_>, prim: &Prim, name: &str, time: f64) -> Option<f64> {
    source.number(prim, &format!("inputs:{name}"), time).or_else(|| source.number(prim, name, time))
}

/// Reads the cone of ShapingAPI; `None`: it cuts nothing off.
pub(super) fn cone(source: &StageSource<'_>, prim: &Prim, time: f64, is_flat: bool) -> Option<Cone> {
    let angle = input(source, prim, "shaping:cone:angle", time)?.clamp(0.0, 180.0);
    if angle >= if is_flat { 90.0 } else { 180.0 } {
        return None;
    }
    let softness = input(source, prim, "shaping:cone:softness", time).unwrap_or(0.0).clamp(0.0, 1.0);
    let outer = angle.to_radians().max(1e-3);
    // The margin that cones need
    Some(Cone { outer, inner: (outer * (1.0 - softness)).min(outer - 1e-4).max(0.0) })
}
