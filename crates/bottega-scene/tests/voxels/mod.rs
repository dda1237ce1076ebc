//! Files of sparse voxels. `fire.vdb` and `kinds.vdb` are written by OpenVDB (`data/make.py`), `torus.nvdb` by NanoVDB (from
//! NVIDIA's Warp, Apache-2.0).

use std::path::{Path, PathBuf};

use bottega_scene::{LoadOptions, Loaded, Medium, Scene, SceneError, Spectrum, Voxels, load};
use glam::{DVec3, Vec3};

use crate::mutation::{Random, damage, survive};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/voxels/data").join(name)
}

fn read(path: &Path) -> Result<Loaded, SceneError> {
    load(path, &LoadOptions::default())
}

/// Loads a pbrt scene with a sphere of a `nanovdb` medium.
fn pbrt(file: &str, params: &str) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(data(file), folder.path().join(file)).unwrap();
    let path = folder.path().join("scene.pbrt");
    let medium =
        format!("MakeNamedMedium \"smoke\" \"string type\" \"nanovdb\" \"string filename\" \"{file}\" {params}");
    let sphere = "MediumInterface \"smoke\" \"\" Material \"interface\" Shape \"sphere\"";
    std::fs::write(&path, format!("WorldBegin Translate 10 0 0 {medium} {sphere}")).unwrap();
    read(&path)
}

fn messages(loaded: &Loaded) -> String {
    loaded.warnings.iter().map(|warning| format!("{warning}\n")).collect()
}

/// Returns scattering and emission at a point of the world.
fn at(scene: &Scene, p: Vec3) -> (f32, Spectrum) {
    let medium: &Medium = &scene.media[0];
    let variation = medium.variation.as_ref().unwrap();
    let there = medium.coefficients(variation, variation.grid_from_world.transform_point3(p));
    (there.scattering.x, there.emission)
}

/// The density of `fire.vdb` at a voxel.
fn fire_density(voxel: DVec3) -> f64 {
    let r = (voxel - 8.0).length();
    let is_stored = voxel.min_element() >= 0.0 && voxel.max_element() <= 16.0;
    if is_stored { ((8.0 * (1.0 - r / 8.5)).floor() / 8.0).max(0.0) } else { 0.0 }
}

#[test]
fn voxels_have_the_values_that_openvdb_wrote() {
    let loaded = pbrt("fire.vdb", "\"float scale\" 4 \"rgb sigma_s\" [ 0.5 0.5 0.5 ]").unwrap();
    let world = |voxel: DVec3| (DVec3::new(11.0, 2.0, 3.0) + 0.1 * voxel).as_vec3();
    for x in -2..=18 {
        for y in [-1, 0, 3, 8, 9, 15, 17] {
            for z in 0..=17 {
                let voxel = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                let found = f64::from(at(&loaded.scene, world(voxel)).0);
                assert!((found - 2.0 * fire_density(voxel)).abs() < 1e-3, "{voxel}: {found}");
            }
        }
    }
    // Between voxels linearly, also from brick to brick
    for (a, b) in
        [([7.0, 8.0, 8.0], [8.0, 8.0, 8.0]), ([8.0, 4.0, 7.0], [8.0, 4.0, 8.0]), ([3.0, 3.0, 3.0], [4.0, 4.0, 4.0])]
    {
        let (a, b) = (DVec3::from_array(a), DVec3::from_array(b));
        let corners = (0..8).map(|corner| {
            let part = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
            fire_density(a + part * (b - a))
        });
        let middle = corners.sum::<f64>() / 8.0;
        let found = f64::from(at(&loaded.scene, world(0.5 * (a + b))).0);
        assert!((found - 2.0 * middle).abs() < 2e-3, "{a}: {found} {middle}");
    }
}

#[test]
fn half_precision_and_other_voxels_are_read() {
    let voxels =
        |density, temperature| Voxels::read(&data("fire.vdb"), density, temperature, 1 << 30).unwrap().unwrap();
    // Eighths are exact in half precision
    assert_eq!(voxels("half", None).density, voxels("density", None).density);
    // Voxels twice as wide are sampled at those of the density
    let voxels = voxels("density", Some("coarse"));
    let temperatures = voxels.temperatures.unwrap();
    let kelvin = |voxel: f64| {
        let p = voxels.file_from_cube.inverse().transform_point3(DVec3::new(1.0, 2.0, 3.0) + 0.1 * voxel);
        temperatures.at(p.as_vec3()).x
    };
    assert_eq!([kelvin(16.0), kelvin(14.0), kelvin(8.0)].map(f32::round), [2000.0, 2000.0, 0.0]);
    assert!((kelvin(13.0) - 2000.0).abs() < 1.0, "{}", kelvin(13.0));
}

#[test]
fn temperatures_shine_as_black_bodies() {
    let loaded = pbrt("fire.vdb", "\"float Lescale\" 5 \"float temperaturescale\" 2").unwrap();
    assert!(!messages(&loaded).contains("left out"), "{}", messages(&loaded));
    // 6000 K in the middle, nearly white; 2250 K at 5 voxels from it, and 0 K at 8
    let (_, middle) = at(&loaded.scene, Vec3::new(11.8, 2.8, 3.8));
    let density = fire_density(DVec3::splat(8.0)) as f32;
    assert!((middle / (5.0 * density)).abs_diff_eq(Spectrum::new(1.04, 0.93, 0.9), 0.12), "{middle}");
    let (_, cooler) = at(&loaded.scene, Vec3::new(11.8, 2.8, 3.3));
    assert!(cooler.z / cooler.x < 0.6 * middle.z / middle.x, "{cooler} {middle}");
    let (_, outside) = at(&loaded.scene, Vec3::new(11.8, 2.8, 3.0));
    assert_eq!(outside, Spectrum::ZERO);
}

#[test]
fn a_file_alone_is_a_scene() {
    let loaded = read(&data("fire.vdb")).unwrap();
    assert_eq!(loaded.metadata.format, "OpenVDB");
    let text = messages(&loaded);
    assert!(text.contains("`half` (float_HalfFloat), `coarse` (float)"), "{text}");
    let (min, max) = loaded.scene.bounds();
    assert!(min.x <= 1.0 && max.x >= 2.6 && min.y <= 2.0 && max.z >= 4.6, "{min} {max}");
    assert!(loaded.scene.media[0].emission.x > 0.0);
    // A tile of 2 in a file whose axes are scaled apart
    let loaded = read(&data("kinds.vdb")).unwrap();
    assert!(messages(&loaded).contains("`color` (vec3s), `surface` (float), `mask` (bool)"), "{}", messages(&loaded));
    let inside = at(&loaded.scene, Vec3::new(6.0, 1.0, 2.0)).0;
    assert!(inside > 0.0 && at(&loaded.scene, Vec3::new(7.545, 2.535, 5.07)).0 == inside);
    assert_eq!(at(&loaded.scene, Vec3::new(7.57, 1.0, 2.0)).0, 0.0);
    // A level set is filled
    let torus = read(&data("torus.nvdb")).unwrap();
    assert_eq!(torus.metadata.format, "NanoVDB");
    let (ring, hole) = (at(&torus.scene, Vec3::new(1.7, 2.0, 3.0)).0, at(&torus.scene, Vec3::new(1.0, 2.0, 3.0)).0);
    assert!(ring > 0.0 && hole == 0.0, "{ring} {hole}");
    let turned = at(&torus.scene, Vec3::new(1.0, 2.7, 3.0)).0;
    assert!((turned - ring).abs() < 0.05 * ring, "{turned} {ring}");
}

#[test]
fn a_scene_of_voxels_is_saved_as_it_is() {
    let loaded = read(&data("fire.vdb")).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("fire.bottega");
    bottega_scene::save_scene(&path, &loaded.scene, &loaded.hints).unwrap();
    let again = read(&path).unwrap();
    assert!(again.scene.media == loaded.scene.media);
    let bytes = std::fs::read(&path).unwrap();
    survive(
        "fire.bottega",
        200,
        |random| mutated(&bytes, random),
        |bytes| {
            std::fs::write(&path, bytes).unwrap();
            read(&path).is_ok()
        },
    );
}

#[test]
fn unreadable_grids_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.vdb");
    let refused = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        read(&path).unwrap_err().to_string()
    };
    let fire = std::fs::read(data("fire.vdb")).unwrap();
    let mut old = fire.clone();
    old[8] = 213;
    assert!(refused(&old).contains("version 213"), "{}", refused(&old));
    assert!(refused(&fire[..2000]).contains("is damaged"), "{}", refused(&fire[..2000]));
    let torus = std::fs::read(data("torus.nvdb")).unwrap();
    let mut newer = torus.clone();
    newer[11] = 0xff;
    assert!(refused(&newer).contains("version"), "{}", refused(&newer));
    assert!(refused(&torus[..5000]).contains("ends at byte 5000"), "{}", refused(&torus[..5000]));
    // A memory limit is named
    std::fs::write(&path, &fire).unwrap();
    let tight = LoadOptions { max_memory_bytes: fire.len(), ..LoadOptions::default() };
    let error = load(&path, &tight).unwrap_err().to_string();
    assert!(error.contains("memory") && error.contains("grid `"), "{error}");
    let missing = pbrt("torus.nvdb", "").unwrap();
    assert!(messages(&missing).contains("no grid `density`"), "{}", messages(&missing));
}

#[test]
fn no_damaged_file_is_too_much() {
    let folder = tempfile::tempdir().unwrap();
    for (name, count) in [("fire.vdb", 150), ("kinds.vdb", 150), ("torus.nvdb", 300)] {
        let bytes = std::fs::read(data(name)).unwrap();
        let path = folder.path().join(name);
        survive(
            name,
            count,
            |random| mutated(&bytes, random),
            |bytes| {
                std::fs::write(&path, bytes).unwrap();
                load(&path, &LoadOptions { max_memory_bytes: 64 << 20, ..LoadOptions::default() }).is_ok()
            },
        );
    }
}

/// Changes up to three places of a file, half of them in its first bytes.
fn mutated(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.below(3) {
        let reach = if random.below(2) == 0 { 1000 } else { usize::MAX };
        let at = random.below(bytes.len().min(reach));
        damage(&mut bytes, at, random);
        if bytes.is_empty() {
            break;
        }
    }
    bytes
}

/// Reads the files of the reference scenes that are named in `vdb`.
#[test]
fn files_of_other_programs_have_their_voxels() {
    let Some(folder) = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from) else {
        eprintln!("skipped: BOTTEGA_SCENES names no folder");
        return;
    };
    // Sums over all voxels by OpenVDB 12
    for (name, sum, voxel) in [
        ("vdb/openusd/smoke_000002.vdb", 26_291.570_476_7, 0.132_600_978 * 0.132_903_486 * 0.131_696_895),
        ("vdb/openusd/smoke_000003.vdb", 29_401.886_543_1, 0.132_600_978 * 0.132_903_486 * 0.131_696_895),
        ("vdb/openusd/densityAndHeat.vdb", 399.724_083_6, 0.703_376_591 * 0.703_376_591 * 0.716_455_102),
        ("vdb/sphere.vdb", 2_563.206_154_1, 1e-3),
    ] {
        let loaded = read(&folder.join(name)).unwrap();
        let medium = &loaded.scene.media[0];
        let variation = medium.variation.as_ref().unwrap();
        let grid = variation.grids().next().unwrap();
        let mean = f64::from(grid.mean().x);
        let volume = 1.0 / f64::from(variation.grid_from_world.matrix3.determinant());
        assert!((mean * volume / (sum * voxel) - 1.0).abs() < 1e-4, "{name}: {mean} {volume}");
    }
    let empty = read(&folder.join("vdb/openusd/smoke_000001.vdb")).unwrap();
    assert!(messages(&empty).contains("`density` has no voxels"), "{}", messages(&empty));
    let points = read(&folder.join("vdb/points.vdb")).unwrap_err().to_string();
    assert!(points.contains("`points` (ptdataidx32)"), "{points}");
    let filled = read(&folder.join("vdb/ls_sphere.vdb")).unwrap();
    assert!(at(&filled.scene, Vec3::ZERO).0 > 0.0);
}
