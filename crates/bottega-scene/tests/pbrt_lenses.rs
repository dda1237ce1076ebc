//! The camera `realistic` of pbrt-v4, and its files of lenses.

use bottega_scene::{LoadOptions, Loaded, Projection, SceneError, load};

/// A lens of glass with a stop behind it, in millimetres.
const LENS: &str = "# radius thickness eta diameter\n40 6 1.5 24\n-50 2 1 24\n\n0 40 0 10 # the stop\n";

/// A scene with these parameters of its camera, beside a file `lens.dat`.
fn seen_through(lens: &str, params: &str) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lens.dat"), lens).unwrap();
    let path = folder.path().join("scene.pbrt");
    let film = r#"Film "rgb" "integer xresolution" 30 "integer yresolution" 20 "float diagonal" 10"#;
    let camera = format!("{film}\nCamera \"realistic\" {params}");
    let surface = r#"Shape "trianglemesh" "point3 P" [ 0 0 0 1 0 0 0 1 0 ]"#;
    std::fs::write(&path, format!("{camera}\nWorldBegin LightSource \"infinite\" {surface}")).unwrap();
    load(&path, &LoadOptions::default())
}

fn warnings(loaded: &Loaded) -> Vec<String> {
    loaded.warnings.iter().map(ToString::to_string).collect()
}

#[test]
fn the_lenses_of_a_realistic_camera_are_read() {
    let params = r#""string lensfile" "lens.dat" "float aperturediameter" 4 "float focusdistance" 2"#;
    let loaded = seen_through(LENS, params).unwrap();
    assert_eq!(warnings(&loaded), [""; 0]);
    let camera = &loaded.scene.cameras[0];
    let lenses = camera.lenses.as_ref().unwrap();
    let description = lenses.description();
    assert_eq!((description.film_diagonal, description.focus_distance), (0.01, Some(2.0)));
    let [front, back, stop] = &description.surfaces[..] else { panic!("{description:?}") };
    let close = |a: f32, b: f32| assert!((a - b).abs() < 1e-7, "{a} {b}");
    for (surface, [radius, thickness, eta, opening]) in [
        (front, [0.04, 0.006, 1.5, 0.012]),
        (back, [-0.05, 0.002, 1.0, 0.012]),
        // The camera closes the stop, which is surrounded by air
        (stop, [0.0, 0.04, 1.0, 0.002]),
    ] {
        close(surface.radius, radius);
        close(surface.thickness, thickness);
        close(surface.eta, eta);
        close(surface.aperture_radius, opening);
    }
    // The angle of a pinhole with the same image
    let Projection::Perspective { vertical_fov } = camera.projection else { panic!() };
    let half_height = 0.005 * 20.0 / 1300.0_f32.sqrt();
    close((0.5 * vertical_fov).tan(), half_height / lenses.image_distance());
}

#[test]
fn a_stop_that_cannot_be_wider_and_other_shapes_are_told() {
    let wide = seen_through(LENS, r#""string lensfile" "lens.dat" "float aperturediameter" 40"#).unwrap();
    assert!(warnings(&wide).iter().any(|text| text.contains("wide open")), "{:?}", warnings(&wide));
    assert_eq!(wide.scene.cameras[0].lenses.as_ref().unwrap().description().surfaces[2].aperture_radius, 0.005);
    let star = seen_through(LENS, r#""string lensfile" "lens.dat" "string aperture" "star""#).unwrap();
    assert!(warnings(&star).iter().any(|text| text.contains("\"star\"")), "{:?}", warnings(&star));
}

#[test]
fn lenses_that_cannot_be_read_are_refused_with_their_place() {
    let named = r#""string lensfile" "lens.dat""#;
    for (lens, params, expected) in [
        (LENS, "", "no `lensfile`"),
        (LENS, r#""string lensfile" "missing.dat""#, "missing.dat"),
        (LENS, r#""string lensfile" "../../etc/passwd""#, "passwd"),
        ("40 6 1.5\n", named, "four numbers"),
        ("40 6 1.5 24 3\n", named, "four numbers"),
        ("\n40 6 x 24\n", named, "line 2, "),
        ("40 6 inf 24\n", named, "`inf` is not a number"),
        ("", named, "0 surfaces"),
        ("40 -6 1.5 24\n", named, "surface 0"),
        ("40 6 1.5 0\n", named, "surface 0"),
        ("-40 6 1.5 24\n40 2 1 24\n", named, "do not collect light"),
        (LENS, r#""string lensfile" "lens.dat" "float focusdistance" 0.1"#, "cannot be in focus"),
        (LENS, r#""string lensfile" "lens.dat" "float aperturediameter" 0"#, "surface 2"),
    ] {
        let error = seen_through(lens, params).map(|_| ()).unwrap_err().to_string();
        assert!(error.contains(expected), "{lens:?} {params}: {error}");
    }
    let many = "40 6 1.5 24\n".repeat(300);
    let error = seen_through(&many, named).map(|_| ()).unwrap_err().to_string();
    assert!(error.contains("line 257, ") && error.contains("256 surfaces"), "{error}");
}

#[test]
fn damaged_files_of_lenses_never_end_the_program() {
    let mut state = 7_u64;
    let mut number = |limit: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % limit
    };
    let characters = b"0123456789.-e# \n";
    for _ in 0..300 {
        let mut damaged = LENS.as_bytes().to_vec();
        for _ in 0..1 + number(4) {
            let at = number(damaged.len());
            damaged[at] = characters[number(characters.len())];
        }
        // It is read, or refused
        _ = seen_through(&String::from_utf8(damaged).unwrap(), r#""string lensfile" "lens.dat""#);
    }
}
