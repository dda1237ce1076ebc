//! Measured materials. `data/make.py` writes the files and evaluates them by Mitsuba; bottega-render's tests compare values.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use bottega_scene::{
    LoadOptions, Loaded, Material, Measured, RenderHints, Scene, SceneError, Surface, Symmetry, load, save_scene,
};
use glam::Vec3;

use crate::mutation::{Random, damage, survive};

const LIMIT: usize = 1 << 20;

/// A change of a file.
type Change<'a> = &'a dyn Fn(&mut Vec<u8>);

/// Isotropic by RGB; by wavelengths; absolute.
const FILES: [&str; 3] = ["measured.bsdf", "brushed.bsdf", "velvet.bsdf"];

fn data(name: &str) -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    if name == "measured.bsdf" { here.join("../../scenes/models") } else { here.join("tests/measured/data") }.join(name)
}

fn read(name: &str) -> Measured {
    Measured::read(&data(name), LIMIT).unwrap()
}

/// Loads a scene of two spheres with the files in its folder.
fn scene(extension: &str, text: &str) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    for name in FILES {
        std::fs::copy(data(name), folder.path().join(name)).unwrap();
    }
    let path = folder.path().join("scene").with_extension(extension);
    std::fs::write(&path, text).unwrap();
    load(&path, &LoadOptions { strict: true, ..LoadOptions::default() })
}

fn tables(material: &Material) -> &Arc<Measured> {
    let Surface::Measured(measured) = &material.surface else { panic!("{material:?}") };
    measured
}

#[test]
fn files_have_their_tables() {
    let [copper, brushed, velvet] = FILES.map(read);
    let symmetries = [&copper, &brushed, &velvet].map(Measured::symmetry);
    assert_eq!(symmetries, [Symmetry::Isotropic, Symmetry::HalfTurn, Symmetry::TwoPlanes]);
    assert_eq!(copper.name, "measured.bsdf");
    assert_eq!(format!("{copper:?}"), "Measured(\"measured.bsdf\", 5 tables of 8 × 8)");
    // α of the facets, as a perceptual roughness
    assert!((copper.roughness() - 0.3_f32.sqrt()).abs() < 1e-3, "{}", copper.roughness());
    // Copper seen from above; its coarse table loses some light at the horizon
    let albedo = copper.albedo(&copper.nodes(0.0, 0.0));
    assert!((albedo - Vec3::new(0.95, 0.64, 0.54)).abs().max_element() < 0.12, "{albedo}");
}

#[test]
fn pbrt_and_mitsuba_refer_to_them() {
    let material = "Material \"measured\" \"string filename\" \"brushed.bsdf\" Shape \"sphere\"";
    let pbrt =
        scene("pbrt", &format!("WorldBegin LightSource \"point\" {material} Translate 3 0 0 {material}")).unwrap();
    let bsdf = "<bsdf type=\"measured\"><string name=\"filename\" value=\"brushed.bsdf\"/></bsdf>";
    let sphere = format!("<shape type=\"sphere\">{bsdf}</shape>");
    let xml = format!("<scene version=\"3.0.0\">{sphere}{sphere}<emitter type=\"constant\"/></scene>");
    let mitsuba = scene("xml", &xml).unwrap();
    for loaded in [&pbrt, &mitsuba] {
        let materials = &loaded.scene.materials;
        assert_eq!(**tables(&materials[0]), read("brushed.bsdf"));
        // Surfaces share the tables
        assert!(Arc::ptr_eq(tables(&materials[0]), tables(materials.last().unwrap())));
        assert!(loaded.scene.memory_bytes() > read("brushed.bsdf").memory_bytes());
        assert!(loaded.files.iter().any(|file| file.name == "brushed.bsdf"));
        assert!(materials[0].needs_tangents() && !materials[0].transmits());
    }
    // In Mitsuba the back is black
    assert!(pbrt.scene.materials[0].surface_of(false).is_some());
    assert!(mitsuba.scene.materials[0].surface_of(false).is_none());
}

#[test]
fn saved_scenes_have_the_same_tables() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bottega");
    for name in FILES {
        let blend = Surface::blend(0.3.into(), [Surface::Measured(read(name).into()), Surface::matte(Vec3::ONE)]);
        let mut scene = Scene::default();
        let material = scene.push_material(blend.into());
        scene.push_sphere(Vec3::ZERO, 1.0, material);
        save_scene(&path, &scene, &RenderHints::default()).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        let loaded = load(&path, &LoadOptions::default()).unwrap();
        assert_eq!(loaded.scene.materials, scene.materials, "{name}");
        // A table of another size is refused
        let mut other = bytes.clone();
        let numbers = find(&other, b"\"visible\":{\"size\":[").unwrap();
        other[numbers + 19] = b'3';
        std::fs::write(&path, &other).unwrap();
        let error = load(&path, &LoadOptions::default()).unwrap_err().to_string();
        assert!(error.contains("`vndf`"), "{name}: {error}");
    }
}

fn find(bytes: &[u8], part: &[u8]) -> Option<usize> {
    bytes.windows(part.len()).position(|window| window == part)
}

#[test]
fn errors_name_the_file_and_the_field() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bsdf");
    let copper = std::fs::read(data("measured.bsdf")).unwrap();
    let refused = |change: Change<'_>| {
        let mut bytes = copper.clone();
        change(&mut bytes);
        std::fs::write(&path, bytes).unwrap();
        let error = Measured::read(&path, LIMIT).unwrap_err().to_string();
        assert!(error.contains("a.bsdf"), "{error}");
        error
    };
    let field = |bytes: &[u8], name: &str| find(bytes, name.as_bytes()).unwrap() + name.len();
    /// Places after a field's name: its axes, kind, offset and shape.
    const KIND: usize = 2;
    const OFFSET: usize = 3;
    const SHAPE: usize = 11;
    let number = |bytes: &mut Vec<u8>, name: &str, value: f32| {
        let offset = field(bytes, name) + OFFSET;
        let at = u64::from_le_bytes(bytes[offset..offset + 8].try_into().unwrap()) as usize;
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    };
    let cases: &[(&str, Change<'_>)] = &[
        ("does not begin with `tensor_file`", &|bytes| bytes[0] = b'T'),
        ("version 2.0", &|bytes| bytes[12] = 2),
        ("the number of its fields at byte 14 is 16777225", &|bytes| bytes[17] = 1),
        ("ends at byte 40", &|bytes| bytes.truncate(40)),
        ("`jacobian` reaches beyond the end", &|bytes| bytes.truncate(bytes.len() - 1)),
        ("no field `vndf`", &|bytes| {
            let at = field(bytes, "vndf");
            bytes[at - 1] = b'x';
        }),
        ("no field `rgb`", &|bytes| {
            let at = field(bytes, "rgb");
            bytes[at - 1] = b'x';
        }),
        ("`sigma` has numbers of kind 11", &|bytes| {
            let at = field(bytes, "sigma") + KIND;
            bytes[at] = 11;
            bytes.resize(2 * bytes.len(), 0);
        }),
        ("`ndf` has the shape 1 × 32", &|bytes| {
            let at = field(bytes, "ndf") + SHAPE;
            bytes[at] = 1;
        }),
        ("`luminance` has the shape 1 × 5 × 8 × 7", &|bytes| {
            let at = field(bytes, "luminance") + SHAPE + 24;
            bytes[at] = 7;
        }),
        ("value 0 of its field `rgb` is NaN", &|bytes| number(bytes, "rgb", f32::NAN)),
        ("the theta_i of its directions", &|bytes| number(bytes, "theta_i", 1.0)),
    ];
    for (expected, change) in cases {
        let error = refused(change);
        assert!(error.contains(expected), "{expected}: {error}");
    }
    let tight = Measured::read(&data("measured.bsdf"), copper.len()).unwrap_err().to_string();
    assert!(tight.contains("memory") && tight.contains("its tables"), "{tight}");
    let missing = scene("pbrt", "WorldBegin Material \"measured\" Shape \"sphere\"").unwrap_err().to_string();
    assert!(missing.contains("needs a `filename`"), "{missing}");
    let absent = "WorldBegin Material \"measured\" \"string filename\" \"no.bsdf\" Shape \"sphere\"";
    let absent = scene("pbrt", absent).unwrap_err().to_string();
    assert!(absent.contains("no.bsdf") && absent.contains("scene.pbrt:1"), "{absent}");
}

#[test]
fn no_damaged_material_is_too_much() {
    let folder = tempfile::tempdir().unwrap();
    for name in FILES {
        let bytes = std::fs::read(data(name)).unwrap();
        let path = folder.path().join(name);
        survive(
            name,
            150,
            |random| mutated(&bytes, random),
            |bytes| {
                std::fs::write(&path, bytes).unwrap();
                let Ok(measured) = Measured::read(&path, LIMIT) else { return false };
                let nodes = measured.nodes(-2.0, 0.7);
                let (point, _) = measured.luminance().sample(&nodes, [0.3, 0.8]);
                let (facet, density) = measured.visible_normals().sample(&nodes, point);
                assert!(facet.iter().all(|x| (0.0..=1.0).contains(x)) && density >= 0.0, "{facet:?} {density}");
                measured.reflection(&nodes, point).min_element() >= 0.0
            },
        );
    }
}

/// Changes up to three places of a file, most of them in its first bytes.
fn mutated(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(3) {
        let reach = if random.below(4) > 0 { 420 } else { usize::MAX };
        let at = random.below(bytes.len().min(reach));
        damage(&mut bytes, at, random);
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}
