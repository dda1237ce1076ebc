//! Materials, textures and pictures.

use bottega_scene::{
    AlphaMode, Channel, Layered, LoadOptions, Material, ReliefSource, Scene, Sides, Surface, Wrap, load,
};
use glam::{Vec2, Vec3};
use serde_json::{Value, json};

use crate::gltf::support::{File, png, warns, write};

fn material(description: &Value) -> Material {
    File::textured(description).load().scene.materials.remove(0)
}

fn with_extension(name: &str, extension: &Value) -> Material {
    material(&json!({"extensions": {name: extension}}))
}

fn layers(material: &Material) -> &Layered {
    material.layered().expect("a layered surface")
}

#[test]
fn the_default_material_is_that_of_the_specification() {
    for material in [&material(&json!({})), &File::triangle().load().scene.materials.remove(0)] {
        assert_eq!((layers(material).base_color.factor, material.opacity.factor), (Vec3::ONE, 1.0));
        assert_eq!((layers(material).metallic.factor, layers(material).roughness.factor), (1.0, 1.0));
        assert_eq!(
            (layers(material).ior, layers(material).specular.factor, layers(material).transmission.factor),
            (1.5, 1.0, 0.0)
        );
        assert_eq!(
            (material.alpha_mode, material.emission_sides, layers(material).thin),
            (AlphaMode::Opaque, Sides::Front, false)
        );
        assert_eq!((material.emission.factor, layers(material).coat.factor), (Vec3::ZERO, 0.0));
    }
}

#[test]
fn factors_and_channels_are_those_of_the_specification() {
    let mut file = File::textured(&json!({
        "name": "everything",
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.1, 0.2, 0.3, 0.4], "baseColorTexture": {"index": 0},
            "metallicFactor": 0.5, "roughnessFactor": 0.6, "metallicRoughnessTexture": {"index": 0},
        },
        "normalTexture": {"index": 0, "scale": 0.7},
        "emissiveFactor": [0.5, 0.25, 0], "emissiveTexture": {"index": 0, "texCoord": 1},
        "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": true,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 8},
            "KHR_materials_transmission": {"transmissionFactor": 0.9, "transmissionTexture": {"index": 0}},
            "KHR_materials_clearcoat": {
                "clearcoatFactor": 0.8, "clearcoatTexture": {"index": 0},
                "clearcoatRoughnessFactor": 0.3, "clearcoatRoughnessTexture": {"index": 0},
                "clearcoatNormalTexture": {"index": 0, "scale": 2},
            },
            "KHR_materials_sheen": {
                "sheenColorFactor": [0.9, 0.8, 0.7], "sheenColorTexture": {"index": 0},
                "sheenRoughnessFactor": 0.2, "sheenRoughnessTexture": {"index": 0},
            },
            "KHR_materials_specular": {
                "specularFactor": 0.35, "specularTexture": {"index": 0},
                "specularColorFactor": [2, 1, 0.5], "specularColorTexture": {"index": 0},
            },
            "KHR_materials_ior": {"ior": 1.33},
        },
    }));
    // sRGB 188 is half as bright as white.
    file.texture(&png(1, 1, &[[255, 188, 51, 102]]));
    let scene = file.load().scene;
    let material = &scene.materials[0];
    assert_eq!(scene.images.len(), 2, "the picture is used for colours and for numbers");
    let uvs = [Vec2::ZERO; 2];
    let color = |param: &bottega_scene::ColorParam| param.eval(&scene, uvs, 0.0);
    let scalar = |param: &bottega_scene::ScalarParam| param.eval(&scene, uvs, 0.0);
    let half = 0.502886;
    let close = |a: Vec3, b: Vec3| (a - b).length() < 1e-4;
    assert!(close(color(&layers(material).base_color), Vec3::new(0.1, 0.2 * half, 0.3 * 0.0331)));
    assert!(close(color(&material.emission), Vec3::new(4.0, 2.0 * half, 0.0)));
    assert!(close(color(&layers(material).sheen_color), Vec3::new(0.9, 0.8 * half, 0.7 * 0.0331)));
    assert!(close(color(&layers(material).specular_color), Vec3::new(2.0, half, 0.5 * 0.0331)));
    let scalars = [
        (&layers(material).metallic, 0.5 * 0.2),
        (&layers(material).roughness, 0.6 * 188.0 / 255.0),
        (&layers(material).transmission, 0.9),
        (&layers(material).coat, 0.8),
        (&layers(material).coat_roughness, 0.3 * 188.0 / 255.0),
        (&layers(material).sheen_roughness, 0.2 * 0.4),
        (&layers(material).specular, 0.35 * 0.4),
    ];
    for (param, expected) in scalars {
        assert!((scalar(param) - expected).abs() < 1e-5, "{param:?}");
    }
    assert_eq!((material.alpha_mode, material.opacity.factor), (AlphaMode::Mask { cutoff: 0.25 }, 0.4));
    // 0.4 × 0.4 is below the cutoff; twice that is not.
    assert_eq!(material.opacity_at(&scene, uvs, 0.0, 1.0), 0.0);
    assert_eq!(material.opacity_at(&scene, uvs, 0.0, 2.0), 1.0);
    assert_eq!(material.emission.texture.as_ref().map(|map| map.uv_set), Some(1));
    assert_eq!(
        material.relief.as_ref().map(|relief| matches!(relief.source, ReliefSource::Normals(_, 0.7))),
        Some(true)
    );
    assert_eq!(layers(material).coat_normal.as_ref().map(|normal| normal.1), Some(2.0));
    assert_eq!((layers(material).ior, material.emission_sides, layers(material).thin), (1.33, Sides::Both, true));
    assert_eq!(material.name, "everything");
}

#[test]
fn a_volume_is_solid_when_it_is_thick() {
    let transmission = json!({"transmissionFactor": 1});
    let volume = |volume: Value| {
        let extensions = json!({"KHR_materials_transmission": transmission, "KHR_materials_volume": volume});
        File::textured(&json!({"extensions": extensions})).load().scene
    };
    let is_thin = |scene: &Scene| layers(&scene.materials[0]).thin;
    let color = json!([0.5, 0.25, 1.0]);
    let solid = volume(json!({"thicknessFactor": 0.1, "attenuationDistance": 3, "attenuationColor": color}));
    let medium = &solid.media[solid.materials[0].interior.unwrap().0 as usize];
    assert!(!is_thin(&solid) && medium.is_clear());
    let expected = Vec3::new(2f32.ln(), 4f32.ln(), 0.0) / 3.0;
    assert!((medium.absorption - expected).length() < 1e-6, "{}", medium.absorption);
    let sheet = volume(json!({"attenuationDistance": 3, "attenuationColor": color}));
    assert!(is_thin(&sheet) && sheet.materials[0].interior.is_none());
    assert_eq!(volume(json!({"thicknessFactor": 1})).materials[0].interior, None);
    assert!(layers(&with_extension("KHR_materials_transmission", &transmission)).thin);
}

#[test]
fn an_ior_of_zero_reflects_everything_and_others_below_one_do_not_exist() {
    assert_eq!(layers(&with_extension("KHR_materials_ior", &json!({"ior": 0}))).ior, 0.0);
    assert_eq!(layers(&with_extension("KHR_materials_ior", &json!({}))).ior, 1.5);
    let loaded = File::textured(&json!({"extensions": {"KHR_materials_ior": {"ior": 0.5}}})).load();
    assert_eq!(layers(&loaded.scene.materials[0]).ior, 1.0);
    assert!(warns(&loaded, &["materials[0].KHR_materials_ior.ior", "0.5"]));
}

#[test]
fn unlit_and_blend_are_read() {
    let unlit = with_extension("KHR_materials_unlit", &json!({}));
    assert!(matches!(unlit.surface, Surface::Unlit(_)) && unlit.is_emissive());
    assert_eq!(material(&json!({"alphaMode": "BLEND"})).alpha_mode, AlphaMode::Blend);
    assert_eq!(material(&json!({"alphaMode": "MASK"})).alpha_mode, AlphaMode::Mask { cutoff: 0.5 });
}

#[test]
fn factors_out_of_range_are_brought_back_with_a_warning() {
    let loaded = File::textured(&json!({"pbrMetallicRoughness": {"metallicFactor": 7, "roughnessFactor": -1}})).load();
    let material = &loaded.scene.materials[0];
    assert_eq!((layers(material).metallic.factor, layers(material).roughness.factor), (1.0, 0.0));
    assert!(warns(&loaded, &["materials[0].metallicFactor", "7"]));
    assert!(warns(&loaded, &["materials[0].roughnessFactor", "-1"]));
}

#[test]
fn specular_glossiness_becomes_a_dielectric_with_that_reflectance() {
    let mut file = File::textured(&json!({"extensions": {"KHR_materials_pbrSpecularGlossiness": {
        "diffuseFactor": [0.1, 0.2, 0.3, 0.5], "specularFactor": [0.4, 0.5, 0.6], "glossinessFactor": 0.8,
        "specularGlossinessTexture": {"index": 0},
    }}}));
    file.texture(&png(1, 1, &[[255, 255, 255, 51]]));
    let scene = file.load().scene;
    let material = &scene.materials[0];
    assert_eq!((layers(material).base_color.factor, material.opacity.factor), (Vec3::new(0.1, 0.2, 0.3), 0.5));
    assert_eq!((layers(material).metallic.factor, layers(material).ior), (0.0, 0.0));
    let uvs = [Vec2::ZERO; 2];
    assert_eq!(layers(material).specular_color.eval(&scene, uvs, 0.0), Vec3::new(0.4, 0.5, 0.6));
    assert!((layers(material).roughness.eval(&scene, uvs, 0.0) - (1.0 - 0.8 * 0.2)).abs() < 0.003);
}

#[test]
fn samplers_and_texture_transforms_are_read() {
    let mut file = File::textured(&json!({"emissiveTexture": {"index": 0, "extensions": {"KHR_texture_transform": {
        "offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 4], "texCoord": 1,
    }}}}));
    file.texture(&png(1, 1, &[[1, 2, 3, 255]]));
    file.json["textures"][0]["sampler"] = json!(0);
    file.json["samplers"] = json!([{"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}]);
    let material = file.load().scene.materials.remove(0);
    let map = material.emission.texture.unwrap();
    assert_eq!((map.uv_set, map.wrap_u, map.wrap_v, map.smooth), (1, Wrap::Clamp, Wrap::Mirror, false));
    // Scaled to (2, 0), rotated to point up in the picture (−v), and moved.
    let at = map.picture_from_uv.transform_point2(Vec2::X);
    assert!((at - Vec2::new(0.5, 0.25 - 2.0)).length() < 1e-6, "{at}");
    let at = map.picture_from_uv.transform_point2(Vec2::Y);
    assert!((at - Vec2::new(0.5 + 4.0, 0.25)).length() < 1e-6, "{at}");
}

#[test]
fn pictures_are_shared_between_materials_and_loaded_only_when_used() {
    let mut file = File::textured(&json!({"emissiveTexture": {"index": 0}}));
    let texture = json!({"index": 0});
    file.json["materials"] = json!([
        {"emissiveTexture": texture}, {"normalTexture": {"index": 2}}, {"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}},
    ]);
    let picture = png(2, 1, &[[255; 4], [0; 4]]);
    file.texture(&picture);
    // The third image is the first one again.
    file.json["textures"] = json!([{"source": 0}, {"source": 2}, {"source": 1}]);
    file.json["images"] = json!([file.json["images"][0], {"uri": "this is missing.png"}, file.json["images"][0]]);
    let mut second = file.json["meshes"][0]["primitives"][0].clone();
    second["material"] = json!(2);
    file.primitive(second);
    let loaded = file.load();
    let scene = &loaded.scene;
    assert_eq!(scene.images.iter().filter(|image| image.name != "neutral sky").count(), 1);
    assert_eq!(scene.materials.len(), 2, "nothing has the second material");
    assert!(!warns(&loaded, &["missing.png"]));
}

#[test]
fn pictures_that_cannot_be_read_are_replaced() {
    let mut file = File::textured(&json!({
        "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 0}},
        "normalTexture": {"index": 0},
    }));
    let broken = png(4, 4, &[[7; 4]; 16]);
    file.texture(&broken[..broken.len() / 2]);
    for image in
        [file.json["images"][0].clone(), json!({"uri": "missing.png"}), json!({"uri": "data:,no picture"}), json!({})]
    {
        file.json["images"] = json!([image]);
        let loaded = file.load();
        let material = &loaded.scene.materials[0];
        let uvs = [Vec2::ZERO; 2];
        assert_eq!(layers(material).base_color.eval(&loaded.scene, uvs, 0.0), Vec3::new(1.0, 0.0, 1.0), "{image}");
        assert_eq!(layers(material).roughness.eval(&loaded.scene, uvs, 0.0), 1.0);
        assert!(material.relief.is_none());
        assert!(warns(&loaded, &["images[0]", "magenta"]), "{image}: {:?}", loaded.warnings);
    }
    // The file exists, but its picture format is unsupported.
    file.json["textures"] = json!([{"extensions": {"EXT_texture_avif": {"source": 0}}}]);
    assert!(warns(&file.load(), &["materials[0]", "texture 0", "magenta"]));
}

#[test]
fn anisotropy_iridescence_dispersion_and_diffuse_transmission_are_read() {
    let mut file = File::textured(&json!({"extensions": {
        "KHR_materials_anisotropy": {
            "anisotropyStrength": 0.6, "anisotropyRotation": 1.5, "anisotropyTexture": {"index": 0},
        },
        "KHR_materials_iridescence": {
            "iridescenceFactor": 0.7, "iridescenceTexture": {"index": 1}, "iridescenceIor": 1.8,
            "iridescenceThicknessMinimum": 200, "iridescenceThicknessMaximum": 500,
            "iridescenceThicknessTexture": {"index": 1},
        },
        "KHR_materials_dispersion": {"dispersion": 0.4},
        "KHR_materials_volume": {"thicknessFactor": 1},
        "KHR_materials_diffuse_transmission": {
            "diffuseTransmissionFactor": 0.25, "diffuseTransmissionTexture": {"index": 0},
            "diffuseTransmissionColorFactor": [0.1, 0.2, 0.3], "diffuseTransmissionColorTexture": {"index": 1},
        },
    }}));
    file.texture(&png(1, 1, &[[10, 20, 30, 40]]));
    file.texture(&png(1, 1, &[[50, 60, 70, 80]]));
    let scene = file.load().scene;
    let layers = layers(&scene.materials[0]);
    let anisotropy = layers.anisotropy.as_ref().unwrap();
    assert_eq!((anisotropy.strength, anisotropy.rotation), (0.6, 1.5));
    let texel = scene.images[anisotropy.texture.as_ref().unwrap().image.0 as usize].texel(0, 0) * 255.0;
    assert_eq!(texel.round().truncate(), Vec3::new(10.0, 20.0, 30.0), "numbers, not colours");
    let film = layers.iridescence.as_ref().unwrap();
    let uvs = [Vec2::ZERO; 2];
    assert!((film.factor.eval(&scene, uvs, 0.0) - 0.7 * 50.0 / 255.0).abs() < 1e-6);
    assert_eq!((film.ior, film.thickness), (1.8, [200.0, 500.0]));
    assert_eq!(film.thickness_texture.as_ref().unwrap().1, Channel::G);
    assert_eq!((layers.dispersion, layers.thin), (0.4, false));
    assert!((layers.diffuse_transmission.eval(&scene, uvs, 0.0) - 0.25 * 40.0 / 255.0).abs() < 1e-6);
    assert_eq!(layers.diffuse_transmission_color.factor, Vec3::new(0.1, 0.2, 0.3));
    assert!(layers.diffuse_transmission_color.texture.is_some());
}

#[test]
fn effects_of_no_strength_are_left_out_and_defaults_are_those_of_the_extensions() {
    let none = with_extension("KHR_materials_anisotropy", &json!({"anisotropyRotation": 1}));
    assert!(layers(&none).anisotropy.is_none());
    let none = with_extension("KHR_materials_iridescence", &json!({"iridescenceIor": 2}));
    assert!(layers(&none).iridescence.is_none());
    let film = with_extension("KHR_materials_iridescence", &json!({"iridescenceFactor": 1}));
    let film = layers(&film).iridescence.as_ref().unwrap();
    assert_eq!((film.ior, film.thickness), (1.3, [100.0, 400.0]));
    // Without a volume, a material that transmits diffuse light is a sheet.
    let leaf = with_extension("KHR_materials_diffuse_transmission", &json!({"diffuseTransmissionFactor": 0.5}));
    assert!(layers(&leaf).thin && layers(&leaf).diffuse_transmission_color.factor == Vec3::ONE);
}

#[test]
fn variants_of_materials_are_chosen_by_name_or_number() {
    let mut file = File::triangle();
    file.json["materials"] = json!([{"name": "plain"}, {"name": "red"}, {"name": "blue"}]);
    file.json["extensions"] = json!({"KHR_materials_variants": {"variants": [{"name": "warm"}, {"name": "cold"}]}});
    let primitive = &mut file.json["meshes"][0]["primitives"][0];
    primitive["material"] = json!(0);
    primitive["extensions"] = json!({"KHR_materials_variants": {"mappings": [
        {"material": 1, "variants": [0]}, {"material": 2, "variants": [1, 7]},
    ]}});
    let folder = tempfile::tempdir().unwrap();
    let path = write(folder.path(), "scene.glb", &file.glb());
    let shown = |variant: Option<&str>| {
        load(&path, &LoadOptions { variant: variant.map(Into::into), ..LoadOptions::default() })
    };
    let name = |variant: Option<&str>| shown(variant).unwrap().scene.materials[0].name.clone();
    assert_eq!([name(None), name(Some("warm")), name(Some("cold")), name(Some("1"))], ["plain", "red", "blue", "blue"]);
    let error = shown(Some("lukewarm")).unwrap_err().to_string();
    assert!(error.contains("no variant `lukewarm`") && error.contains("0 `warm`, 1 `cold`"), "{error}");
}
