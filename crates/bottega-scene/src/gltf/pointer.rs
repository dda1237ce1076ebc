//! KHR_animation_pointer: document values animated by JSON pointers (RFC 6901).
//!
//! Values are put into the JSON, which is then parsed again. So everything that the importer supports can be animated,
//! except node transformations, which [`animation`](super::animation) evaluates.

use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use serde_json::Value;

use super::document::Document;
use crate::budget::MemoryBudget;
use crate::error::{SceneError, Warnings};
use crate::objects_only::ObjectsOnly;
use crate::text::shortened;

/// The properties that can be animated. `{}` is a number, `*` any name; a texture's transformation may follow each
/// texture name.
const KNOWN: &[&str] = &[
    "nodes/{}/extensions/KHR_node_visibility/visible",
    "meshes/{}/weights",
    "meshes/{}/weights/{}",
    "cameras/{}/perspective/*",
    "cameras/{}/orthographic/*",
    "extensions/KHR_lights_punctual/lights/{}/color",
    "extensions/KHR_lights_punctual/lights/{}/intensity",
    "extensions/KHR_lights_punctual/lights/{}/spot/innerConeAngle",
    "extensions/KHR_lights_punctual/lights/{}/spot/outerConeAngle",
    "materials/{}/alphaCutoff",
    "materials/{}/emissiveFactor",
    "materials/{}/normalTexture/scale",
    "materials/{}/pbrMetallicRoughness/baseColorFactor",
    "materials/{}/pbrMetallicRoughness/metallicFactor",
    "materials/{}/pbrMetallicRoughness/roughnessFactor",
    "materials/{}/extensions/KHR_materials_anisotropy/anisotropyRotation",
    "materials/{}/extensions/KHR_materials_anisotropy/anisotropyStrength",
    "materials/{}/extensions/KHR_materials_clearcoat/clearcoatFactor",
    "materials/{}/extensions/KHR_materials_clearcoat/clearcoatRoughnessFactor",
    "materials/{}/extensions/KHR_materials_clearcoat/clearcoatNormalTexture/scale",
    "materials/{}/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionFactor",
    "materials/{}/extensions/KHR_materials_diffuse_transmission/diffuseTransmissionColorFactor",
    "materials/{}/extensions/KHR_materials_dispersion/dispersion",
    "materials/{}/extensions/KHR_materials_emissive_strength/emissiveStrength",
    "materials/{}/extensions/KHR_materials_ior/ior",
    "materials/{}/extensions/KHR_materials_iridescence/iridescenceFactor",
    "materials/{}/extensions/KHR_materials_iridescence/iridescenceIor",
    "materials/{}/extensions/KHR_materials_iridescence/iridescenceThicknessMinimum",
    "materials/{}/extensions/KHR_materials_iridescence/iridescenceThicknessMaximum",
    "materials/{}/extensions/KHR_materials_sheen/sheenColorFactor",
    "materials/{}/extensions/KHR_materials_sheen/sheenRoughnessFactor",
    "materials/{}/extensions/KHR_materials_specular/specularFactor",
    "materials/{}/extensions/KHR_materials_specular/specularColorFactor",
    "materials/{}/extensions/KHR_materials_transmission/transmissionFactor",
    "materials/{}/extensions/KHR_materials_volume/thicknessFactor",
    "materials/{}/extensions/KHR_materials_volume/attenuationDistance",
    "materials/{}/extensions/KHR_materials_volume/attenuationColor",
    "materials/{}/extensions/KHR_materials_pbrSpecularGlossiness/diffuseFactor",
    "materials/{}/extensions/KHR_materials_pbrSpecularGlossiness/specularFactor",
    "materials/{}/extensions/KHR_materials_pbrSpecularGlossiness/glossinessFactor",
    "materials/{}/*",
    "materials/{}/pbrMetallicRoughness/*",
    "materials/{}/extensions/*/*",
];

/// The part of a pointer that precedes a texture's transformation properties.
const TRANSFORM: &str = "/extensions/KHR_texture_transform/";

/// Returns true if the pointer's property can be animated.
pub(super) fn is_known(pointer: &str) -> bool {
    let Some(path) = pointer.strip_prefix('/') else { return false };
    let (path, is_transform) = match path.rsplit_once(TRANSFORM) {
        Some((texture, "offset" | "rotation" | "scale")) if texture.ends_with("Texture") => (texture, true),
        Some(_) => return false,
        None => (path, false),
    };
    KNOWN.iter().any(|pattern| {
        // Texture names are recognized only by their suffix.
        let is_of_texture = pattern.starts_with("materials") && pattern.ends_with('*');
        is_of_texture == is_transform && fits(pattern, path)
    })
}

fn fits(pattern: &str, path: &str) -> bool {
    let mut parts = path.split('/');
    let fits = |pattern: &str| match (pattern, parts.next()) {
        ("{}", Some(part)) => part.parse::<usize>().is_ok(),
        ("*", Some(_)) => true,
        (name, part) => part == Some(name),
    };
    pattern.split('/').all(fits) && parts.next().is_none()
}

/// Returns true if the pointer's property is a boolean.
pub(super) fn is_flag(pointer: &str) -> bool {
    pointer.ends_with("/visible")
}

/// Returns the document with other values.
///
/// - `json`: its text, which has been parsed before.
pub(super) fn replaced(
    path: &Path,
    json: &[u8],
    values: BTreeMap<String, Value>,
    budget: &MemoryBudget,
    warnings: &mut Warnings,
) -> Result<Document, SceneError> {
    // Each value takes at least two bytes of text.
    let _held = budget.hold(path, (json.len() / 2).saturating_mul(size_of::<Value>()))?;
    let damaged = |error: serde_json::Error| SceneError::Damaged {
        path: path.into(),
        problem: format!("its animations make the document invalid ({error})"),
    };
    let mut document: Value = serde_json::from_slice(json).map_err(damaged)?;
    for (pointer, value) in values {
        if !set(&mut document, &pointer, value) {
            warnings.unsupported("animations", format!("`{}` does not exist and is not animated", shortened(&pointer)));
        }
    }
    Document::deserialize(ObjectsOnly(document)).map_err(damaged)
}

/// Sets the value at a pointer. Missing objects are created with their defaults.
fn set(document: &mut Value, pointer: &str, value: Value) -> bool {
    let mut place = document;
    for part in pointer.split('/').skip(1) {
        let name = part.replace("~1", "/").replace("~0", "~");
        let next = match place {
            Value::Array(list) => name.parse::<usize>().ok().and_then(|index| list.get_mut(index)),
            Value::Object(members) => Some(members.entry(name).or_insert_with(|| Value::Object(Default::default()))),
            _ => None,
        };
        let Some(next) = next else { return false };
        place = next;
    }
    *place = value;
    true
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn animated_properties_are_recognized() {
        for pointer in [
            "/materials/0/pbrMetallicRoughness/baseColorFactor",
            "/materials/12/emissiveFactor",
            "/materials/0/extensions/KHR_materials_sheen/sheenColorFactor",
            "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/offset",
            "/materials/0/normalTexture/extensions/KHR_texture_transform/scale",
            "/materials/0/extensions/KHR_materials_sheen/sheenColorTexture/extensions/KHR_texture_transform/rotation",
            "/extensions/KHR_lights_punctual/lights/3/intensity",
            "/cameras/0/perspective/yfov",
            "/nodes/5/extensions/KHR_node_visibility/visible",
            "/meshes/0/weights",
        ] {
            assert!(is_known(pointer), "{pointer}");
        }
        for pointer in [
            "",
            "/",
            "materials/0/emissiveFactor",
            "/materials/x/emissiveFactor",
            "/materials/0/doubleSided",
            "/materials/0/pbrMetallicRoughness",
            "/materials/0/pbrMetallicRoughness/baseColorFactor/0",
            "/materials/0/extensions/EXT_unknown/strength",
            "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions/KHR_texture_transform/texCoord",
            "/nodes/0/children",
            "/buffers/0/uri",
        ] {
            assert!(!is_known(pointer), "{pointer}");
        }
    }

    #[test]
    fn values_are_put_where_the_pointer_leads() {
        let mut document = json!({"materials": [{"emissiveFactor": [0, 0, 0]}]});
        assert!(set(&mut document, "/materials/0/emissiveFactor", json!([1, 0, 0])));
        assert!(set(&mut document, "/materials/0/pbrMetallicRoughness/metallicFactor", json!(0.5)));
        let expected = json!({"emissiveFactor": [1, 0, 0], "pbrMetallicRoughness": {"metallicFactor": 0.5}});
        assert_eq!(document, json!({"materials": [expected]}));
        for nowhere in ["/materials/1/emissiveFactor", "/materials/x", "/materials/0/emissiveFactor/7/x"] {
            assert!(!set(&mut document, nowhere, json!(1)), "{nowhere}");
        }
    }
}
