//! UsdPreviewSurface, its textures, and bindings.

use bottega_scene::{AlphaMode, Channel, DisplacementSource, DisplacementSpace, Material, ReliefSource, Scene, Wrap};
use glam::{Vec2, Vec3};

use super::support::{Folder, TRIANGLE, clean, warnings, warns};

/// A material with a preview surface.
fn material(name: &str, inputs: &str) -> String {
    format!(
        "def Material \"{name}\" {{ token outputs:surface.connect = </{name}/s.outputs:surface>\n\
         def Shader \"s\" {{ uniform token info:id = \"UsdPreviewSurface\"\n{inputs}\ntoken outputs:surface }} }}\n"
    )
}

fn bound(inputs: &str) -> Material {
    let text = material("M", inputs);
    let scene = clean(&format!("{text}def Mesh \"m\" {{ rel material:binding = </M>\n{TRIANGLE} }}"));
    scene.materials[scene.meshes[0].material as usize].clone()
}

#[test]
fn a_preview_surface_has_its_parameters() {
    let metal = bound(
        "color3f inputs:diffuseColor = (0.1, 0.2, 0.3)\nfloat inputs:metallic = 1\nfloat inputs:roughness = 0.25\n\
         float inputs:ior = 1.8\nfloat inputs:clearcoat = 0.5\nfloat inputs:clearcoatRoughness = 0.1\n\
         color3f inputs:emissiveColor = (3, 0, 0)",
    );
    let layered = metal.layered().unwrap();
    assert!((layered.base_color.factor - Vec3::new(0.1, 0.2, 0.3)).length() < 1e-6);
    assert_eq!((layered.metallic.factor, layered.roughness.factor, layered.ior), (1.0, 0.25, 1.8));
    assert_eq!((layered.coat.factor, layered.coat_roughness.factor), (0.5, 0.1));
    assert_eq!((metal.emission.factor, metal.alpha_mode), (Vec3::X * 3.0, AlphaMode::Opaque));
    let specular = bound("int inputs:useSpecularWorkflow = 1\ncolor3f inputs:specularColor = (0.5, 0.6, 0.7)");
    let layered = specular.layered().unwrap();
    assert!((layered.specular_color.factor - Vec3::new(0.5, 0.6, 0.7)).length() < 1e-6);
    assert_eq!((layered.ior, layered.metallic.factor, layered.base_color.factor), (0.0, 0.0, Vec3::splat(0.18)));
    let clear = bound("float inputs:opacity = 0.25");
    assert_eq!((clear.alpha_mode, clear.opacity.factor), (AlphaMode::Blend, 0.25));
    let cut = bound("float inputs:opacity = 0.25\nfloat inputs:opacityThreshold = 0.4");
    assert_eq!(cut.alpha_mode, AlphaMode::Mask { cutoff: 0.4 });
}

#[test]
fn a_displacement_has_the_texture_with_scale_and_bias() {
    let surface = shader(
        "s",
        "UsdPreviewSurface",
        "float inputs:displacement.connect = </M/d.outputs:r>\ntoken outputs:surface\ntoken outputs:displacement",
    );
    let texture = shader(
        "d",
        "UsdUVTexture",
        "asset inputs:file = @./maps/two.png@\ntoken inputs:sourceColorSpace = \"raw\"\nfloat4 inputs:scale = (0.2, 1, 1, 1)\n\
         float4 inputs:bias = (-0.1, 0, 0, 0)\nfloat outputs:r",
    );
    let stage = |outputs: &str| {
        format!(
            "def Material \"M\" {{ token outputs:surface.connect = </M/s.outputs:surface>\n{outputs}\n{texture}{surface} }}\n\
             def Mesh \"m\" {{ rel material:binding = </M>\n{TRIANGLE}\ntexCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1)] (interpolation = \"vertex\") }}"
        )
    };
    let loaded =
        textured(&stage("token outputs:displacement.connect = </M/s.outputs:displacement>")).load("scene.usda");
    let loaded = loaded.unwrap();
    assert!(!warns(&loaded, "/M", ""), "{:?}", warnings(&loaded));
    let scene = &loaded.scene;
    let displacement = scene.materials[scene.meshes[0].material as usize].displacement.clone().unwrap();
    assert_eq!((displacement.scale, displacement.bias, displacement.space), (0.2, -0.1, DisplacementSpace::World));
    let DisplacementSource::Heights(height) = displacement.source else { panic!() };
    let (map, channel) = height.texture.unwrap();
    assert_eq!(channel, Channel::R);
    assert!((scene.images[map.image.0 as usize].texel(0, 0).x - 188.0 / 255.0).abs() < 1e-5, "raw, without its bias");
    // A material that does not name its displacement has none
    let loaded = textured(&stage("")).load("scene.usda").unwrap();
    assert!(loaded.scene.materials.iter().all(|material| material.displacement.is_none()));
}

/// A folder with a picture of two texels, and a stage.
fn textured(stage: &str) -> Folder {
    let folder = Folder::new(&[("scene.usda", stage)]);
    let picture = image(&[[188, 0, 0, 255], [0, 0, 0, 128]]);
    std::fs::create_dir_all(folder.path("maps")).unwrap();
    std::fs::write(folder.path("maps/two.png"), picture).unwrap();
    folder
}

/// A PNG of one row.
fn image(texels: &[[u8; 4]]) -> Vec<u8> {
    crate::gltf::support::png(texels.len() as u32, 1, texels)
}

fn shader(name: &str, id: &str, inputs: &str) -> String {
    format!("def Shader \"{name}\" {{ uniform token info:id = \"{id}\"\n{inputs} }}\n")
}

#[test]
fn textures_have_their_coordinates_and_encoding() {
    let reader = shader("st", "UsdPrimvarReader_float2", "string inputs:varname = \"map1\"\nfloat2 outputs:result");
    let turn = shader(
        "t",
        "UsdTransform2d",
        "float2 inputs:in.connect = </M/st.outputs:result>\nfloat2 inputs:scale = (2, 3)\nfloat2 inputs:translation = (0.25, 0.5)\n\
         float2 outputs:result",
    );
    let texture = |name: &str, more: &str| {
        let text = format!(
            "asset inputs:file = @./maps/two.png@\nfloat2 inputs:st.connect = </M/t.outputs:result>\n{more}\n\
             token inputs:wrapS = \"clamp\"\ntoken inputs:wrapT = \"mirror\"\nfloat3 outputs:rgb\nfloat outputs:a\nfloat outputs:r"
        );
        shader(name, "UsdUVTexture", &text)
    };
    let surface = shader(
        "s",
        "UsdPreviewSurface",
        "color3f inputs:diffuseColor.connect = </M/c.outputs:rgb>\nfloat inputs:opacity.connect = </M/c.outputs:a>\n\
         float inputs:roughness.connect = </M/r.outputs:r>\nnormal3f inputs:normal.connect = </M/n.outputs:rgb>\ntoken outputs:surface",
    );
    let color = texture("c", "float4 inputs:scale = (0.5, 1, 1, 1)");
    let rough = texture("r", "token inputs:sourceColorSpace = \"raw\"\nfloat4 inputs:bias = (0.25, 0, 0, 0)");
    let normal = texture(
        "n",
        "token inputs:sourceColorSpace = \"raw\"\nfloat4 inputs:scale = (2, 2, 2, 1)\nfloat4 inputs:bias = (-1, -1, -1, 0)",
    );
    let folder = textured(&format!(
        "def Material \"M\" {{ token outputs:surface.connect = </M/s.outputs:surface>\n{reader}{turn}{color}{rough}{normal}{surface} }}\n\
         def Mesh \"m\" {{ rel material:binding = </M>\n{TRIANGLE}\ntexCoord2f[] primvars:map1 = [(0, 0), (1, 0), (0, 1)] (interpolation = \"vertex\") }}"
    ));
    let loaded = folder.load("scene.usda").unwrap();
    assert!(!warns(&loaded, "/M", ""), "{:?}", warnings(&loaded));
    let scene = &loaded.scene;
    let material = &scene.materials[scene.meshes[0].material as usize];
    let layered = material.layered().unwrap();
    let map = layered.base_color.texture.unwrap();
    assert_eq!((map.wrap_u, map.wrap_v, map.uv_set), (Wrap::Clamp, Wrap::Mirror, 0));
    assert_eq!(layered.base_color.factor, Vec3::new(0.5, 1.0, 1.0));
    // Our v points down: (s, t) = (0.5, 0.25) is (0.5, 0.75), and becomes (1.25, 1.25), which is (1.25, −0.25)
    assert!((map.picture_from_uv.transform_point2(Vec2::new(0.5, 0.75)) - Vec2::new(1.25, -0.25)).length() < 1e-6);
    assert_eq!(scene.meshes[0].uvs[0], [Vec2::Y, Vec2::ONE, Vec2::ZERO]);
    let texel = |map: bottega_scene::TextureMap, x: u32| scene.images[map.image.0 as usize].texel(x, 0);
    assert!((texel(map, 0).x - 0.5029).abs() < 1e-3, "sRGB");
    let (opacity, channel) = material.opacity.texture.unwrap();
    assert!(channel == Channel::A && (texel(opacity, 1).w - 128.0 / 255.0).abs() < 1e-6);
    let (rough, _) = layered.roughness.texture.unwrap();
    assert!((texel(rough, 0).x - (188.0 / 255.0 + 0.25)).abs() < 1e-5, "raw, with its bias");
    let Some(ReliefSource::Normals(map, 1.0)) = material.relief.as_ref().map(|relief| relief.source.clone()) else {
        panic!("no normals")
    };
    assert!((texel(map, 0).x - 188.0 / 255.0).abs() < 1e-6, "as stored");
    // The farm sends the picture
    assert!(loaded.files.iter().any(|file| file.name == "maps/two.png"));
}

#[test]
fn missing_pictures_and_foreign_shaders_are_named() {
    let texture = shader(
        "c",
        "UsdUVTexture",
        "asset inputs:file = @gone.png@\nfloat4 inputs:fallback = (0, 1, 0, 1)\nfloat3 outputs:rgb",
    );
    let surface = shader(
        "s",
        "UsdPreviewSurface",
        "color3f inputs:diffuseColor.connect = </M/c.outputs:rgb>\ntoken outputs:surface",
    );
    let text = format!(
        "def Material \"M\" {{ token outputs:surface.connect = </M/s.outputs:surface>\n{texture}{surface} }}\n\
         def Material \"N\" {{ token outputs:surface.connect = </N/s.outputs:surface>\ndef Shader \"s\" {{ uniform token info:id = \"arnold:lambert\" }} }}\n\
         def Mesh \"a\" {{ rel material:binding = </M>\n{TRIANGLE} }}\ndef Mesh \"b\" {{ rel material:binding = </N>\n{TRIANGLE} }}"
    );
    let loaded = Folder::new(&[("scene.usda", &text)]).load("scene.usda").unwrap();
    assert!(warns(&loaded, "/M/c", "`gone.png`: there is no such file"), "{:?}", warnings(&loaded));
    assert!(warns(&loaded, "/N", "`arnold:lambert` is not supported"));
    assert_eq!(loaded.scene.images[0].texel(0, 0).truncate(), Vec3::Y);
}

/// The names of the materials of all instances, sorted.
fn names(scene: &Scene) -> Vec<String> {
    let name = |instance| scene.materials[scene.material_of(instance) as usize].layered().unwrap().base_color.factor;
    let mut names: Vec<String> = scene.instances.iter().map(|instance| format!("{:.1}", name(instance).x)).collect();
    names.sort();
    names
}

#[test]
fn the_nearest_binding_counts_unless_one_is_stronger() {
    let colors: String =
        (1..=4).map(|n| material(&format!("M{n}"), &format!("color3f inputs:diffuseColor = (0.{n}, 0, 0)"))).collect();
    let mesh = |name: &str, more: &str| format!("def Mesh \"{name}\" {{ {more}\n{TRIANGLE} }}\n");
    let scene = |outer: &str, inner: &str| {
        clean(&format!("{colors}def Xform \"x\" {{ {outer}\n{}{} }}", mesh("a", inner), mesh("b", "")))
    };
    assert_eq!(names(&scene("rel material:binding = </M1>", "rel material:binding = </M2>")), ["0.1", "0.2"]);
    let strong = "rel material:binding = </M1> ( bindMaterialAs = \"strongerThanDescendants\" )";
    assert_eq!(names(&scene(strong, "rel material:binding = </M2>")), ["0.1", "0.1"]);
    let full = "rel material:binding:full = </M3>\nrel material:binding:preview = </M4>\nrel material:binding = </M1>";
    assert_eq!(names(&scene(full, "")), ["0.3", "0.3"]);
    let collection = "rel collection:some:includes = </x/a>\nrel material:binding:collection:c = [</x.collection:some>, </M4>]\n\
        rel material:binding = </M1>";
    assert_eq!(names(&scene(collection, "")), ["0.1", "0.4"]);
}

#[test]
fn subsets_of_faces_have_their_materials() {
    let colors: String =
        (1..=2).map(|n| material(&format!("M{n}"), &format!("color3f inputs:diffuseColor = (0.{n}, 0, 0)"))).collect();
    let scene = clean(&format!(
        "{colors}def Mesh \"m\" {{ rel material:binding = </M1>\nuniform token subdivisionScheme = \"none\"\n\
         int[] faceVertexCounts = [3, 3, 3]\nint[] faceVertexIndices = [0, 1, 2, 0, 2, 3, 0, 3, 4]\n\
         point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (-1, 1, 0)]\n\
         def GeomSubset \"s\" {{ uniform token elementType = \"face\"\nuniform token familyName = \"materialBind\"\n\
         int[] indices = [1, 2]\nrel material:binding = </M2> }} }}"
    ));
    let counts: Vec<(f32, usize)> = (scene.instances.iter())
        .map(|instance| {
            let color = scene.materials[scene.material_of(instance) as usize].layered().unwrap().base_color.factor.x;
            (color, scene.meshes[instance.mesh as usize].triangles.len())
        })
        .collect();
    assert_eq!(counts, [(0.1, 1), (0.2, 2)]);
}
