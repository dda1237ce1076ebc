//! Textures of pbrt-v4 that are made of noise, and those of dots and slopes.

use bottega_scene::{
    ColorParam, DisplacementSource, DisplacementSpace, LoadOptions, Loaded, MappingKind, Noise, Octaves, ReliefSource,
    Scene, Surface, TextureMap, load,
};
use glam::{Vec2, Vec3};

const TRIANGLE: &str = r#"Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ]"#;

/// A matte triangle; its colour is the texture `t`.
fn world(text: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let texels: Vec<u8> = [0.0, 0.25, 0.5, 1.0].iter().flat_map(|texel: &f32| texel.to_le_bytes()).collect();
    std::fs::write(folder.path().join("a.pfm"), [b"Pf\n2 2\n-1.0\n".to_vec(), texels].concat()).unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    std::fs::write(folder.path().join("a.ply"), ply).unwrap();
    let path = folder.path().join("scene.pbrt");
    let scene = format!("WorldBegin\n{text}\nMaterial \"diffuse\" \"texture reflectance\" \"t\" {TRIANGLE}");
    std::fs::write(&path, scene).unwrap();
    load(&path, &LoadOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn warnings(loaded: &Loaded) -> Vec<String> {
    let warnings = loaded.warnings.iter().map(ToString::to_string);
    warnings.filter(|warning| !warning.contains("no light")).collect()
}

fn silent(text: &str) -> Scene {
    let loaded = world(text);
    assert_eq!(warnings(&loaded), [""; 0], "{text}");
    loaded.scene.validate().unwrap();
    loaded.scene
}

fn color_of(scene: &Scene) -> ColorParam {
    let Surface::Diffuse(diffuse) = &scene.materials[0].surface else { panic!() };
    diffuse.reflectance.clone()
}

/// The colour where the variable of a ramp has a value.
fn on_ramp(scene: &Scene, at: f32) -> Vec3 {
    let color = color_of(scene);
    let map = color.texture.expect("a texture");
    color.factor * scene.images[map.image.0 as usize].eval(&map, Vec2::new(at, 0.5), 0.0).truncate()
}

fn kind_of(scene: &Scene, map: &TextureMap) -> MappingKind {
    map.mapping(scene).expect("a mapping").kind
}

#[test]
fn noise_mixes_colours_by_its_value() {
    let scene = silent(
        r#"Scale 0.5 0.5 0.5 Texture "n" "float" "fbm" "integer octaves" 4 "float roughness" 0.6
        Texture "t" "spectrum" "mix" "rgb tex1" [ 0.1 0.2 0.3 ] "rgb tex2" [ 0.5 0.6 0.7 ] "texture amount" "n""#,
    );
    let map = color_of(&scene).texture.unwrap();
    let octaves = Octaves { count: 4, roughness: 0.6 };
    assert_eq!(kind_of(&scene, &map), MappingKind::Noise(Noise::Fbm(octaves)));
    // The texture's space is twice as fine as the world
    let place = map.mapping(&scene).unwrap().mapping_from_world;
    assert!((place.transform_point3(Vec3::ONE) - Vec3::splat(2.0)).length() < 1e-6);
    for value in [-1.0, 0.0, 0.25, 1.3_f32] {
        let expected = Vec3::new(0.1, 0.2, 0.3) + 0.4 * value;
        let found = on_ramp(&scene, value);
        assert!((found - expected).length() < 1e-5, "{value}: {found}");
    }
    assert_eq!(scene.images[map.image.0 as usize].size(), (2, 1));
}

#[test]
fn functions_of_noise_that_bend_have_more_texels() {
    let scene = silent(
        r#"Texture "n" "float" "wrinkled"
        Texture "a" "spectrum" "mix" "rgb tex1" [ 0 0 0 ] "rgb tex2" [ 1 0.5 0 ] "texture amount" "n"
        Texture "t" "spectrum" "scale" "texture tex" "a" "texture scale" "n""#,
    );
    let kind = kind_of(&scene, &color_of(&scene).texture.unwrap());
    assert_eq!(kind, MappingKind::Noise(Noise::Turbulence(Octaves { count: 8, roughness: 0.5 })));
    for value in [0.0, 0.3, 0.8, 1.4_f32] {
        let found = on_ramp(&scene, value);
        assert!((found - value * value * Vec3::new(1.0, 0.5, 0.0)).length() < 1e-5, "{value}: {found}");
    }
}

#[test]
fn marble_has_its_scale_and_colours() {
    let scene = silent(r#"Texture "t" "spectrum" "marble" "float scale" 3 "float variation" 0.5 "integer octaves" 2"#);
    let map = color_of(&scene).texture.unwrap();
    let octaves = Octaves { count: 2, roughness: 0.5 };
    assert_eq!(kind_of(&scene, &map), MappingKind::Veins { octaves, variation: 0.5 });
    let place = map.mapping(&scene).unwrap().mapping_from_world;
    assert!((place.transform_point3(Vec3::X) - 3.0 * Vec3::X).length() < 1e-6);
    let found = on_ramp(&scene, 0.75 - 1e-3);
    assert!((found - Vec3::new(0.76, 0.76, 0.8)).length() < 0.1, "{found}");
}

#[test]
fn dots_lie_where_pbrt_has_them() {
    let text = |mapping: &str| {
        format!(r#"Texture "t" "spectrum" "dots" "rgb inside" [ 1 0 0 ] "rgb outside" [ 0 0 1 ] {mapping}"#)
    };
    let scene = silent(&text(r#""float uscale" 10 "float vscale" 5 "float udelta" 0.25"#));
    let map = color_of(&scene).texture.unwrap();
    assert_eq!(kind_of(&scene, &map), MappingKind::Dots { on_surface: true });
    assert!((on_ramp(&scene, 0.0) - Vec3::Z).length() + (on_ramp(&scene, 1.0) - Vec3::X).length() < 1e-6);
    // Our v runs downwards: s = 10 u + 0.25 and t = 5 (1 − v)
    let place = map.mapping(&scene).unwrap().mapping_from_world;
    let st = place.transform_point3(Vec3::new(0.5, 0.2, 0.0));
    assert!((st.truncate() - Vec2::new(5.25, 4.0)).length() < 1e-5, "{st}");
    let scene = silent(&text(r#""string mapping" "planar" "vector3 v1" [ 0 0 1 ] "float vdelta" 2"#));
    let map = color_of(&scene).texture.unwrap();
    assert_eq!(kind_of(&scene, &map), MappingKind::Dots { on_surface: false });
    let st = map.mapping(&scene).unwrap().mapping_from_world.transform_point3(Vec3::new(3.0, 5.0, 7.0));
    assert!((st.truncate() - Vec2::new(7.0, 7.0)).length() < 1e-5, "{st}");
    let loaded = world(&text(r#""string mapping" "spherical""#));
    assert!(warnings(&loaded)[0].contains("dots on a sphere"), "{:?}", warnings(&loaded));
    assert!((color_of(&loaded.scene).factor - Vec3::new(0.19, 0.0, 0.81)).length() < 1e-5);
}

#[test]
fn directionmix_goes_by_the_normal() {
    let scene = silent(
        r#"Rotate 90 1 0 0 Scale 3 3 3
        Texture "t" "spectrum" "directionmix" "rgb tex1" [ 1 0 0 ] "rgb tex2" [ 0 0 1 ]"#,
    );
    let map = color_of(&scene).texture.unwrap();
    assert_eq!(kind_of(&scene, &map), MappingKind::Facing);
    // The rotation takes the default direction, +y, to +z
    let place = map.mapping(&scene).unwrap().mapping_from_world;
    assert!((place.transform_vector3(Vec3::new(0.6, 0.0, 0.8)).z - 0.8).abs() < 1e-6);
    for amount in [0.0, 0.25, 1.0_f32] {
        let found = on_ramp(&scene, amount);
        assert!((found - Vec3::new(amount, 0.0, 1.0 - amount)).length() < 1e-5, "{amount}: {found}");
    }
}

#[test]
fn heights_are_noise() {
    let loaded = world(
        r#"Texture "t" "spectrum" "constant" "rgb value" [ 0.5 0.5 0.5 ]
        Texture "w" "float" "windy" Texture "h" "float" "scale" "texture tex" "w" "float scale" 0.02
        Material "diffuse" "texture displacement" "h" Shape "sphere""#,
    );
    assert_eq!(warnings(&loaded), [""; 0]);
    let scene = loaded.scene;
    let Some(ReliefSource::Heights(height)) = scene.materials[0].relief.as_ref().map(|relief| &relief.source) else {
        panic!("{:?}", scene.materials)
    };
    assert_eq!(kind_of(&scene, &height.texture.unwrap().0), MappingKind::Noise(Noise::Waves));
    assert!((height.factor - 0.02).abs() < 1e-6);
}

#[test]
fn noise_joined_with_pictures_is_replaced_by_its_mean_with_a_warning() {
    let loaded = world(
        r#"Texture "n" "float" "wrinkled" Texture "a" "spectrum" "imagemap" "string filename" "a.pfm"
        Texture "t" "spectrum" "mix" "texture tex1" "a" "rgb tex2" [ 1 0 0 ] "texture amount" "n""#,
    );
    let warnings = warnings(&loaded);
    assert!(warnings.len() == 1 && warnings[0].contains("mean replaces them"), "{warnings:?}");
    assert!(loaded.scene.mappings.is_empty() || color_of(&loaded.scene).texture.unwrap().uv_set == 0);
    loaded.scene.validate().unwrap();
}

#[test]
fn a_mesh_file_is_displaced_by_its_texture() {
    let loaded = world(
        r#"Texture "t" "spectrum" "constant" "rgb value" [ 0.5 0.5 0.5 ]
        Texture "n" "float" "fbm" Texture "h" "float" "scale" "texture tex" "n" "float scale" 0.3
        Shape "plymesh" "string filename" "a.ply" "texture displacement" "h" "float edgelength" 0.05
        Shape "plymesh" "string filename" "a.ply""#,
    );
    assert_eq!(warnings(&loaded), [""; 0]);
    let scene = loaded.scene;
    scene.validate().unwrap();
    let of_mesh = |mesh: usize| scene.materials[scene.meshes[mesh].material as usize].displacement.as_ref();
    let displacement = of_mesh(0).expect("a displacement");
    assert_eq!((displacement.edge, displacement.space), (Some(0.05), DisplacementSpace::World));
    let DisplacementSource::Heights(height) = &displacement.source else { panic!() };
    assert!((height.factor - 0.3).abs() < 1e-6 && height.texture.is_some());
    assert!(of_mesh(1).is_none());
}
