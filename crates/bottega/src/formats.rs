//! Scene formats that the built-in engine does not read, and the format to export instead.

use std::path::Path;

/// Extensions of the scene files that the built-in engine reads.
pub(crate) const READ: [&str; 13] =
    ["gltf", "glb", "usd", "usda", "usdc", "usdz", "xml", "pbrt", "obj", "ply", "serialized", "vdb", "nvdb"];

/// Extensions of the scene files of other programs, with the name of the format or program.
const OTHERS: &[(&[&str], &str)] = &[
    (&["fbx"], "FBX"),
    (&["abc"], "Alembic"),
    (&["dae"], "COLLADA"),
    (&["stl"], "STL"),
    (&["3ds", "max"], "3ds Max"),
    (&["ma", "mb"], "Maya"),
    (&["c4d"], "Cinema 4D"),
    (&["hip", "hipnc", "hiplc", "bgeo"], "Houdini"),
    (&["lwo", "lws"], "LightWave"),
    (&["skp"], "SketchUp"),
    (&["x3d", "wrl"], "X3D"),
    (&["step", "stp", "iges", "igs"], "CAD"),
    (&["blend"], "Blender"),
    (&["vrscene"], "V-Ray"),
    (&["ass"], "Arnold"),
    (&["rib"], "RenderMan"),
];

/// Returns the extension of a file in lower case, without the dot; `None`: it has none, or one that is not Unicode.
pub(crate) fn end_of(scene: &Path) -> Option<String> {
    Some(scene.extension()?.to_str()?.to_ascii_lowercase())
}

/// Returns advice for a scene file that the built-in engine does not read; `None`: its format is unknown.
pub(crate) fn remedy(scene: &Path) -> Option<String> {
    let end = end_of(scene)?;
    let (_, program) = OTHERS.iter().find(|(ends, _)| ends.contains(&end.as_str()))?;
    Some(if *program == "Blender" {
        "render it with --engine cycles if Blender is installed, or export glTF (.glb): File > Export > glTF 2.0"
            .to_owned()
    } else {
        format!(
            "export glTF (.glb) from the program that made it, or from Blender: File > Import of the {program} file, then \
             File > Export > glTF 2.0"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_of_other_programs_are_to_be_exported() {
        for (file, words) in
            [("a.fbx", "FBX"), ("a.abc", "Alembic"), ("a.DAE", "COLLADA"), ("a.blend", "--engine cycles")]
        {
            let remedy_text = remedy(Path::new(file)).unwrap();
            assert!(remedy_text.contains(words) && remedy_text.contains("glTF (.glb)"), "{file}: {remedy_text}");
        }
        assert_eq!(remedy(Path::new("a.txt")), None);
    }
}
