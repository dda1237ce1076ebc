//! Looks of surfaces: the material that is bound, or the display colour.

use std::rc::Rc;

use glam::Vec3;
use openusd::sdf::Path;

use super::context::{VisitedPrim, Walk};
use super::material::Look;
use super::primvar::{self, Interpolation};

/// The look of a part of a surface, and the primvars that it takes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PartLook {
    pub(super) look: Rc<Look>,
    /// Name of the primvar of vertex colours; `None`: there are none.
    pub(super) color: Option<String>,
    /// Name of the primvar of the colours' opacity.
    pub(super) opacity: Option<String>,
}

/// Returns the look of a prim: that of its material, or of its display colour.
///
/// - `path`: the prim, or a subset of its faces.
pub(super) fn look_of(walk: &mut Walk<'_, '_, '_>, visited: &VisitedPrim<'_>, path: &Path) -> PartLook {
    let material = visited.inherited.bindings.material(path);
    if let Some(look) = material.and_then(|material| walk.materials.bound(&material)) {
        let (color, opacity) = (look.color.clone(), look.opacity.clone());
        return PartLook { look, color, opacity };
    }
    // Without values of its own a surface has the fallback of the schema's display colour
    const USUAL: Vec3 = Vec3::splat(0.5);
    let (source, prim, ancestors) = (walk.source, visited.prim, &visited.inherited.ancestors);
    let color = primvar::vectors(source, prim, ancestors, "displayColor", walk.time);
    let opacity = primvar::numbers(source, prim, ancestors, "displayOpacity", walk.time);
    let constant_color = match &color {
        Some(color) if color.interpolation == Interpolation::Constant => color.at(0).unwrap_or(USUAL),
        Some(_) => Vec3::ONE,
        None => USUAL,
    };
    let constant_opacity = match &opacity {
        Some(opacity) if opacity.interpolation == Interpolation::Constant => opacity.at(0).unwrap_or(1.0),
        _ => 1.0,
    };
    let varies = |interpolation: Option<Interpolation>| interpolation.is_some_and(|it| it != Interpolation::Constant);
    let (has_colors, has_opacities) =
        (varies(color.map(|it| it.interpolation)), varies(opacity.map(|it| it.interpolation)));
    // Opacities of points need a surface that is not opaque
    let alpha = if has_opacities { constant_opacity.min(1.0 - f32::EPSILON) } else { constant_opacity };
    let look = walk.materials.plain(constant_color.extend(alpha).to_array());
    let named = |is_there: bool, name: &str| is_there.then(|| name.to_owned());
    PartLook { look, color: named(has_colors, "displayColor"), opacity: named(has_opacities, "displayOpacity") }
}
