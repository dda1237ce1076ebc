//! Layers, references, variants, packages, and what is said of files that are missing or damaged.

use bottega_scene::{LoadOptions, SceneError, load};
use glam::Vec3;

use super::support::{Folder, TRIANGLE, bounds, corners, stage_with, warnings, warns};

#[test]
fn references_payloads_and_sublayers_are_followed_and_sent() {
    let model = format!("#usda 1.0\n(\n defaultPrim = \"A\"\n)\ndef Xform \"A\" {{ def Mesh \"m\" {{ {TRIANGLE} }} }}");
    let folder = Folder::new(&[
        (
            "scene.usda",
            "#usda 1.0\n(\n subLayers = [@./layers/more.usda@]\n)\ndef \"r\" ( references = @models/a.usda@ ) {}\n\
             def \"p\" ( payload = @models/a.usda@ ) { double3 xformOp:translate = (5, 0, 0)\nuniform token[] xformOpOrder = [\"xformOp:translate\"] }",
        ),
        ("layers/more.usda", "def \"s\" ( references = @../models/b.usd@</B> ) {}"),
        ("models/a.usda", &model),
        ("models/b.usd", &format!("#usda 1.0\ndef Mesh \"B\" {{ {TRIANGLE} }}")),
    ]);
    let loaded = folder.load("scene.usda").unwrap();
    assert_eq!(loaded.scene.instances.len(), 3, "{:?}", warnings(&loaded));
    let names: Vec<&str> = loaded.files.iter().map(|file| file.name.as_str()).collect();
    assert_eq!(names, ["layers/more.usda", "models/a.usda", "models/b.usd"]);
    // Another byte of a layer is another scene
    std::fs::write(folder.path("models/b.usd"), format!("#usda 1.0\n\ndef Mesh \"B\" {{ {TRIANGLE} }}")).unwrap();
    assert_ne!(folder.load("scene.usda").unwrap().scene.digest, loaded.scene.digest);
}

#[test]
fn missing_and_forbidden_layers_are_named() {
    let outer = Folder::new(&[
        ("secret.usda", &format!("def Mesh \"m\" {{ {TRIANGLE} }}")),
        (
            "inner/scene.usda",
            "def \"a\" ( references = @gone.usda@ ) {}\ndef \"b\" ( references = @../secret.usda@</m> ) {}\n\
             def \"c\" ( references = @broken.usda@</m> ) {}",
        ),
        ("inner/broken.usda", "def Mesh \"m\" {{{"),
    ]);
    let loaded = outer.load("inner/scene.usda").unwrap();
    assert!(loaded.scene.instances.is_empty());
    assert!(warns(&loaded, "/a", "gone.usda"), "{:?}", warnings(&loaded));
    assert!(warns(&loaded, "/b", "outside the folder"));
    assert!(warns(&loaded, "/c", "broken.usda"));
    let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
    assert_eq!(load(&outer.path("inner/scene.usda"), &options).unwrap().scene.instances.len(), 1);
    let strict = LoadOptions { strict: true, ..LoadOptions::default() };
    let error = load(&outer.path("inner/scene.usda"), &strict).unwrap_err();
    assert!(matches!(error, SceneError::Unsupported { .. }) && error.to_string().contains("gone.usda"));
}

#[test]
fn circles_of_references_end() {
    let folder = Folder::new(&[
        ("scene.usda", "def \"a\" ( references = @other.usda@</b> ) {}"),
        ("other.usda", &format!("def \"b\" ( references = @scene.usda@</a> ) {{ def Mesh \"m\" {{ {TRIANGLE} }} }}")),
    ]);
    let loaded = folder.load("scene.usda").unwrap();
    assert!(warns(&loaded, "", "cycle"), "{:?}", warnings(&loaded));
    assert_eq!(loaded.scene.instances.len(), 1);
}

#[test]
fn variants_are_selected() {
    let text = format!(
        "def Xform \"a\" ( variants = {{ string size = \"small\" }}\n prepend variantSets = \"size\" ) {{ variantSet \"size\" = {{\n\
         \"small\" {{ def Mesh \"m\" {{ {TRIANGLE} }} }}\n\
         \"large\" {{ float3 xformOp:scale = (3, 3, 3)\nuniform token[] xformOpOrder = [\"xformOp:scale\"]\ndef Mesh \"m\" {{ {TRIANGLE} }} }} }} }}"
    );
    let with = |variant: Option<&str>| {
        let variant = variant.map(str::to_owned);
        stage_with(&text, &LoadOptions { variant, ..LoadOptions::default() })
    };
    assert_eq!(bounds(&with(None).unwrap().scene).1, Vec3::new(1.0, 1.0, 0.0));
    assert_eq!(bounds(&with(Some("/a{size=large}")).unwrap().scene).1, Vec3::new(3.0, 3.0, 0.0));
    for wrong in ["large", "/a{size=huge}", "/b{size=large}"] {
        let error = with(Some(wrong)).map(drop).unwrap_err();
        assert!(matches!(error, SceneError::NoSuch { .. }), "{error}");
    }
}

#[test]
fn a_package_holds_its_layers_and_pictures() {
    let surface = "def Material \"M\" { token outputs:surface.connect = </M/s.outputs:surface>\n\
        def Shader \"t\" { uniform token info:id = \"UsdUVTexture\"\nasset inputs:file = @textures/two.png@\nfloat3 outputs:rgb }\n\
        def Shader \"s\" { uniform token info:id = \"UsdPreviewSurface\"\ncolor3f inputs:diffuseColor.connect = </M/t.outputs:rgb>\ntoken outputs:surface } }";
    let root = format!(
        "#usda 1.0\n{surface}\ndef Mesh \"m\" {{ rel material:binding = </M>\n{TRIANGLE}\ntexCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1)] (interpolation = \"vertex\") }}\n\
         def \"r\" ( references = @./more/b.usda@</b> ) {{}}"
    );
    let more = format!("#usda 1.0\ndef Mesh \"b\" {{ {TRIANGLE} }}");
    let picture = crate::gltf::support::png(1, 1, &[[255, 0, 0, 255]]);
    let package =
        zip(&[("root.usda", root.as_bytes()), ("more/b.usda", more.as_bytes()), ("textures/two.png", &picture)]);
    let folder = Folder::new(&[("scene.usda", "def \"x\" ( references = @box.usdz@</m> ) {}")]);
    std::fs::write(folder.path("box.usdz"), package).unwrap();
    let loaded = folder.load("box.usdz").unwrap();
    assert_eq!(loaded.scene.instances.len(), 2, "{:?}", warnings(&loaded));
    assert_eq!(loaded.scene.images[0].texel(0, 0).truncate(), Vec3::X);
    assert!(loaded.files.is_empty(), "all is in the scene file");
    let referring = folder.load("scene.usda").unwrap();
    assert_eq!(referring.files.iter().map(|file| file.name.as_str()).collect::<Vec<_>>(), ["box.usdz"]);
    assert_eq!(corners(&referring.scene).len(), 3, "{:?}", warnings(&referring));
}

/// An archive of stored members.
pub(super) fn zip(members: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut file, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in members {
        let local = (file.len() as u32).to_le_bytes();
        let sizes = [0, bytes.len() as u32, bytes.len() as u32].map(u32::to_le_bytes).concat();
        let lengths = [name.len() as u16, 0].map(u16::to_le_bytes).concat();
        file.extend([&b"PK\x03\x04"[..], &[0_u8; 10][..], &sizes[..], &lengths, name.as_bytes(), bytes].concat());
        directory.extend(
            [&b"PK\x01\x02"[..], &[0_u8; 12][..], &sizes[..], &lengths, &[0_u8; 10][..], &local, name.as_bytes()]
                .concat(),
        );
    }
    let count = (members.len() as u16).to_le_bytes();
    let places = [directory.len() as u32, file.len() as u32].map(u32::to_le_bytes).concat();
    file.extend(directory);
    file.extend([&b"PK\x05\x06"[..], &[0_u8; 4][..], &count[..], &count, &places, &[0_u8; 2][..]].concat());
    file
}

#[test]
fn faults_of_text_are_named_with_their_place() {
    let folder = Folder::new(&[("scene.usda", "#usda 1.0\ndef Xform \"a\"\n{\n  float x = = 1\n}\n")]);
    let error = folder.load("scene.usda").unwrap_err();
    let SceneError::Text { line, .. } = &error else { panic!("{error}") };
    assert_eq!(*line, 4, "{error}");
    let folder = Folder::new(&[("scene.usda", &format!("#usda 1.0\n{}", "def \"a\" {".repeat(1000)))]);
    assert!(folder.load("scene.usda").unwrap_err().to_string().contains("nested"));
    let folder = Folder::new(&[("scene.usda", "#usda 1.0\n")]);
    std::fs::write(folder.path("scene.usdz"), "no archive").unwrap();
    assert!(folder.load("scene.usdz").unwrap_err().to_string().contains("not a ZIP archive"));
}
