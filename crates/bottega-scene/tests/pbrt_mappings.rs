//! Textures of pbrt-v4 that are laid by a place in the world.

use bottega_scene::{LoadOptions, Loaded, MappingKind, SURFACE_UV_SETS, Scene, SceneError, Surface, TextureMap, load};
use glam::{Vec2, Vec3};

const TRIANGLE: &str = r#"Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ]"#;

/// A world with that text, beside which lies a picture of 2 x 2 texels.
fn world(text: &str) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let texels: Vec<u8> = [0.0, 0.25, 0.5, 1.0].iter().flat_map(|texel: &f32| texel.to_le_bytes()).collect();
    std::fs::write(folder.path().join("a.pfm"), [b"Pf\n2 2\n-1.0\n".to_vec(), texels].concat()).unwrap();
    let path = folder.path().join("scene.pbrt");
    std::fs::write(&path, format!("WorldBegin\n{text}")).unwrap();
    load(&path, &LoadOptions::default())
}

/// The warnings about unsupported features.
fn warnings(loaded: &Loaded) -> Vec<String> {
    let warnings = loaded.warnings.iter().map(ToString::to_string);
    warnings.filter(|warning| !warning.contains("no light")).collect()
}

/// A triangle whose matte colour is a picture with these parameters; what stands before it in `before`.
fn textured(before: &str, params: &str) -> Scene {
    let loaded = world(&format!(
        r#"{before} Texture "t" "spectrum" "imagemap" "string filename" "a.pfm" {params}
        Material "diffuse" "texture reflectance" "t" {TRIANGLE}"#
    ));
    let loaded = loaded.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(warnings(&loaded), [""; 0]);
    loaded.scene
}

fn map_of(scene: &Scene) -> TextureMap {
    let Surface::Diffuse(diffuse) = &scene.materials[0].surface else { panic!() };
    diffuse.reflectance.texture.unwrap()
}

/// s and t of a place by a planar mapping, counted as pbrt does.
fn planar(scene: &Scene, p: Vec3) -> Vec2 {
    let map = map_of(scene);
    let mapping = map.mapping(scene).unwrap();
    assert_eq!(mapping.kind, MappingKind::Planar);
    let q = mapping.mapping_from_world.transform_point3(p);
    let uv = map.picture_from_uv.transform_point2(Vec2::new(q.x, 1.0 - q.y));
    Vec2::new(uv.x, 1.0 - uv.y)
}

#[test]
fn a_mapping_goes_by_the_transformation_at_its_texture() {
    let p = Vec3::new(3.0, 5.0, 7.0);
    let scene = textured("", r#""string mapping" "planar""#);
    assert_eq!(planar(&scene, p), Vec2::new(3.0, 5.0));
    // pbrt: s = udelta + v1 · p and t = vdelta + v2 · p, with p in the space of the texture.
    let params = r#""string mapping" "planar" "vector3 v1" [ 0 0 0.5 ] "vector3 v2" [ 1 1 0 ] "float udelta" 0.25 "float vdelta" -2"#;
    assert_eq!(planar(&textured("", params), p), Vec2::new(3.75, 6.0));
    let scene = textured("Translate 1 0 3 Scale 2 2 2", params);
    assert!((planar(&scene, p) - Vec2::new(1.25, 1.5)).length() < 1e-5, "{}", planar(&scene, p));
    // What comes after it changes nothing.
    let scene = textured("AttributeBegin", &format!("{params} AttributeEnd Rotate 30 1 2 3"));
    assert_eq!(planar(&scene, p), Vec2::new(3.75, 6.0));
    for (name, kind) in [("spherical", MappingKind::Spherical), ("cylindrical", MappingKind::Cylindrical)] {
        let scene = textured("Rotate 90 1 0 0", &format!(r#""string mapping" "{name}""#));
        let mapping = map_of(&scene).mapping(&scene).copied().unwrap();
        assert_eq!(mapping.kind, kind);
        // The rotation takes +y to +z, its inverse +z to +y.
        assert!((mapping.mapping_from_world.transform_point3(Vec3::Z) - Vec3::Y).length() < 1e-6);
    }
}

#[test]
fn a_checkerboard_of_three_dimensions_is_one_of_space() {
    let loaded = world(&format!(
        r#"Translate 0.1 0.2 0.3 Scale 2 2 2
        Texture "t" "spectrum" "checkerboard" "integer dimension" 3 "rgb tex1" [ 1 0 0 ] "rgb tex2" [ 0 0 1 ]
        Material "diffuse" "texture reflectance" "t" {TRIANGLE}"#
    ));
    let loaded = loaded.unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(warnings(&loaded), [""; 0]);
    let map = map_of(&loaded.scene);
    let mapping = map.mapping(&loaded.scene).unwrap();
    assert_eq!(mapping.kind, MappingKind::Cells);
    let image = &loaded.scene.images[map.image.0 as usize];
    for index in 0..216 {
        // The middles of cells of edge 2.
        let cell = Vec3::new((index % 6) as f32, (index / 6 % 6) as f32, (index / 36) as f32) - 3.0;
        let p = Vec3::new(0.1, 0.2, 0.3) + (cell + Vec3::new(0.5, 0.4, 0.6)) * 2.0;
        let q = mapping.mapping_from_world.transform_point3(p);
        let color = image.eval(&map, Vec2::new(q.x, 1.0 - q.y - q.z.floor()), 0.0);
        let expected = if cell.element_sum().rem_euclid(2.0) == 0.0 { Vec3::X } else { Vec3::Z };
        assert!((color.truncate() - expected).length() < 1e-3, "{cell}: {color}");
    }
    let wrong = world(r#"Texture "t" "float" "checkerboard" "integer dimension" 4"#);
    assert!(wrong.is_ok(), "what nothing asks for is not looked at");
    let wrong = world(&format!(
        r#"Texture "t" "spectrum" "checkerboard" "integer dimension" 4
        Material "diffuse" "texture reflectance" "t" {TRIANGLE}"#
    ));
    assert!(wrong.unwrap_err().to_string().contains("dimensions"));
}

#[test]
fn combined_textures_keep_the_mapping_of_their_parts() {
    let spherical = r#""string mapping" "spherical""#;
    let text = |second: &str| {
        format!(
            r#"Texture "a" "spectrum" "imagemap" "string filename" "a.pfm" {spherical}
            Texture "b" "spectrum" "checkerboard" "rgb tex1" [ 1 0 0 ] "rgb tex2" [ 0 0 1 ] {second}
            Texture "c" "spectrum" "mix" "texture tex1" "a" "texture tex2" "b"
            Texture "d" "float" "checkerboard" {spherical}
            Texture "e" "spectrum" "bilerp" "rgb v00" [ 1 0 0 ] {spherical}
            Material "diffuse" "texture reflectance" "c" "texture displacement" "d"
            Shape "sphere" "texture alpha" "d"
            Material "diffuse" "texture reflectance" "b" Shape "sphere"
            Material "diffuse" "texture reflectance" "e" Shape "sphere""#
        )
    };
    let loaded = world(&text(spherical)).unwrap();
    assert_eq!(warnings(&loaded), [""; 0]);
    let scene = loaded.scene;
    assert_eq!(scene.mappings.len(), 1);
    let maps: Vec<&TextureMap> = scene.materials.iter().flat_map(|material| material.textures()).collect();
    assert_eq!(maps.len(), 5);
    assert!(maps.iter().all(|map| map.uv_set == SURFACE_UV_SETS));
    // Two cells of a checkerboard are one period of its picture.
    let Surface::Diffuse(checkerboard) = &scene.materials[1].surface else { panic!() };
    assert_eq!(checkerboard.reflectance.texture.unwrap().picture_from_uv.matrix2.x_axis.x, 0.5);
    // Both parts of a mixture lie on one picture, so one is laid as the other, with a warning.
    let loaded = world(&text(r#""string mapping" "planar""#)).unwrap();
    let warnings = warnings(&loaded);
    assert!(
        warnings.len() == 1 && warnings[0].contains("different mappings") && warnings[0].contains(":7:"),
        "{warnings:?}"
    );
}

#[test]
fn checkerboards_of_textures_in_space_repeat() {
    let loaded = world(&format!(
        r#"Texture "a" "spectrum" "imagemap" "string filename" "a.pfm" "string mapping" "planar"
        Texture "b" "spectrum" "checkerboard" "texture tex1" "a" "rgb tex2" [ 0 0 1 ] "string mapping" "planar"
        Material "diffuse" "texture reflectance" "b" {TRIANGLE}"#
    ))
    .unwrap();
    assert_eq!(warnings(&loaded), [""; 0]);
    let scene = loaded.scene;
    let map = map_of(&scene);
    let color = |s: f32, t: f32| scene.images[map.image.0 as usize].eval(&map, Vec2::new(s, 1.0 - t), 0.0).truncate();
    for cell in [-4.0, 0.0, 2.0] {
        assert!((color(cell + 0.5, 1.5) - Vec3::Z).length() < 1e-3);
        assert!((color(cell + 1.5, 0.5) - Vec3::Z).length() < 1e-3);
        // Rows of this format go upwards.
        assert!((color(cell + 0.75, 0.75) - Vec3::ONE).length() < 6e-2, "{}", color(cell + 0.75, 0.75));
        assert!((color(cell + 1.75, 1.25) - Vec3::splat(0.25)).length() < 6e-2, "{}", color(cell + 1.75, 1.25));
    }
}

#[test]
fn unknown_mappings_are_reported_with_their_line() {
    let texture = |before: &str, params: &str| {
        world(&format!(
            "{before}\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \"a.pfm\"\n{params}\n\
            Material \"diffuse\" \"texture reflectance\" \"t\" {TRIANGLE}"
        ))
    };
    for (before, params, problem) in [
        ("Scale 0 1 1", r#""string mapping" "planar""#, "singular"),
        ("Scale 1 0 1", r#""string mapping" "spherical""#, "singular"),
        ("", r#""string mapping" "planar" "vector3 v1" [ 1e39 0 0 ]"#, "bounds"),
        ("", r#""string mapping" "planar" "float udelta" 1e39"#, "bounds"),
        ("", r#""string mapping" "planar" "vector3 v1" [ nan 0 0 ]"#, ""),
        ("", r#""string mapping" "planar" "vector3 v1" [ 1 0 ]"#, ""),
        ("", r#""string mapping" "planar" "vector3 v1" [ 1 0 0 1 0 0 ]"#, ""),
        ("Scale 1e-25 1e-25 1e-25 Scale 1e-25 1e-25 1e-25", r#""string mapping" "cylindrical""#, "bounds"),
    ] {
        let error = texture(before, params).err().unwrap_or_else(|| panic!("{before} {params}")).to_string();
        assert!(error.contains("line 4, ") && error.contains(problem), "{before} {params}: {error}");
    }
    // Vectors of no length are a colour everywhere, as in pbrt.
    let scene =
        texture("", r#""string mapping" "planar" "vector3 v1" [ 0 0 0 ] "vector3 v2" [ 0 0 0 ]"#).unwrap().scene;
    assert_eq!(planar(&scene, Vec3::splat(9.0)), Vec2::ZERO);
    let unknown = warnings(&texture("", r#""string mapping" "conical""#).unwrap());
    assert!(unknown.len() == 1 && unknown[0].starts_with("scene.pbrt:4:") && unknown[0].contains("conical"));
    // pbrt asks a sphere for no scale.
    let scaled = warnings(&texture("", r#""string mapping" "spherical" "float uscale" 2"#).unwrap());
    assert!(scaled.len() == 1 && scaled[0].starts_with("scene.pbrt:4:") && scaled[0].contains("uscale"), "{scaled:?}");
}

#[test]
fn endless_mappings_are_reported() {
    let mut text = String::new();
    for i in 0..300 {
        text += &format!(
            r#"Texture "t{i}" "spectrum" "imagemap" "string filename" "a.pfm" "string mapping" "planar" "vector3 v1" [ {i} 1 0 ]
            Material "diffuse" "texture reflectance" "t{i}" {TRIANGLE}
            "#
        );
    }
    let loaded = world(&text).unwrap();
    assert_eq!(loaded.scene.mappings.len(), 254);
    assert!(warnings(&loaded).iter().any(|warning| warning.contains("too many mappings")));
    loaded.scene.validate().unwrap();
}

/// pbrt (`RemapPixelCoords`): beyond a side edge the picture is mirrored across it and upside down, beyond an upper or lower
/// one the same with rows and columns changed.
#[test]
fn octahedral_pictures_go_on_beyond_their_edges() {
    let scene = textured("", r#""string wrap" "octahedralsphere" "string filter" "point""#);
    let map = map_of(&scene);
    let image = &scene.images[map.image.0 as usize];
    let color = |u: f32, v: f32| image.eval(&map, Vec2::new(u, v), 0.0).x;
    for (u, v) in [(0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)] {
        let inside = color(u, v);
        assert_eq!(inside, image.texel((2.0 * u) as u32, (2.0 * v) as u32).x);
        for beyond in [(-u, 1.0 - v), (2.0 - u, 1.0 - v), (1.0 - u, -v), (1.0 - u, 2.0 - v), (u + 2.0, v)] {
            assert_eq!(color(beyond.0, beyond.1), inside, "{u} {v} {beyond:?}");
        }
    }
    // Interpolated, the edge is between the texels that meet there on the sphere: those of one column.
    let scene = textured("", r#""string wrap" "octahedralsphere""#);
    let map = map_of(&scene);
    let image = &scene.images[map.image.0 as usize];
    let edge = image.eval(&map, Vec2::new(0.0, 0.25), 0.0).x;
    assert!((edge - 0.5 * (image.texel(0, 0).x + image.texel(0, 1).x)).abs() < 1e-3, "{edge}");
}
