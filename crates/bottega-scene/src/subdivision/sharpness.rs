//! Sharpness of edges and vertices: the uniform method of OpenSubdiv.
//!
//! Source: DeRose, Kass, Truong (1998), *Subdivision Surfaces in Character Animation*.

/// From this sharpness on an edge or vertex stays sharp at all levels.
pub(super) const INFINITE: f32 = 10.0;

/// Returns true if a sharpness has an effect at this level.
#[inline(always)]
pub(super) fn is_sharp(sharpness: f32) -> bool {
    sharpness > 0.0
}

/// Returns true if a sharpness never decays.
#[inline(always)]
pub(super) fn is_infinite(sharpness: f32) -> bool {
    sharpness >= INFINITE
}

/// Returns the sharpness at the next level.
#[inline(always)]
pub(super) fn decayed(sharpness: f32) -> f32 {
    if is_infinite(sharpness) { sharpness } else { (sharpness - 1.0).max(0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sharpness_decays_by_one_per_level() {
        assert_eq!([0.0, 0.4, 1.0, 2.5, 10.0, 12.0].map(decayed), [0.0, 0.0, 0.0, 1.5, 10.0, 12.0]);
    }
}
