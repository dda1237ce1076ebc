//! Profiles of IES LM-63: known answers, versions and types of the format, and damaged files.

use std::path::{Path, PathBuf};

use bottega_scene::{IesInterpolation, IesProfile, SceneError};

use crate::mutation::{damage, survive};

fn read(text: &str) -> Result<IesProfile, SceneError> {
    IesProfile::of_bytes(text.as_bytes(), Path::new("lamp.ies"))
}

/// The line and the problem of a file that is refused.
fn fault(text: &str) -> (usize, String) {
    match read(text) {
        Err(SceneError::Text { line, problem, .. }) => (line, problem),
        other => panic!("{other:?}"),
    }
}

/// A file of these angles and candelas.
fn file(head: &str, kind: u32, vertical: &str, horizontal: &str, candela: &str) -> String {
    let count = |list: &str| list.split_whitespace().count();
    format!(
        "{head}TILT=NONE\n1 1000 1 {} {} {kind} 2 0.1 0.1 0\n1 1 50\n{vertical}\n{horizontal}\n{candela}\n",
        count(vertical),
        count(horizontal)
    )
}

/// The real files of a folder of scenes.
fn real() -> Vec<PathBuf> {
    let Some(folder) = std::env::var_os("BOTTEGA_SCENES") else {
        eprintln!("SKIPPED: BOTTEGA_SCENES names no folder of scenes");
        return Vec::new();
    };
    let names = ["lights/12.IES", "usd/arnold/test_2477.2/data/profile.ies", "usd/arnold/test_0140/data/file.ies"];
    names.iter().map(|name| Path::new(&folder).join(name)).filter(|path| path.is_file()).collect()
}

#[test]
fn an_even_lamp_has_four_pi_lumens_per_candela() {
    let profile = read(&file("", 1, "0 90 180", "0", "50 50 50")).unwrap();
    assert!((profile.lumens() / (200.0 * std::f64::consts::PI) - 1.0).abs() < 1e-12);
    assert_eq!((profile.peak(), profile.lamp_lumens(), profile.is_round()), (50.0, Some(1000.0), true));
    assert_eq!((profile.candela(33.0, 400.0), profile.candela(180.0, 0.0)), (50.0, 50.0));
    let picture = profile.picture(IesInterpolation::Linear);
    assert_eq!((picture.width, picture.height), (1, 181));
    assert!(picture.values.iter().all(|&value| value == 1.0));
}

#[test]
fn factors_and_line_breaks_are_those_of_the_format() {
    let body = |tilt: &str, factors: &str| {
        format!("TILT={tilt}\r\n2,500\r\n2.5 2\r\n1 1 2 0 0 0 {factors} 10\r\n0,90\r\n0 4\r\n6")
    };
    let plain = read(&body("NONE", "1 1")).unwrap();
    assert_eq!((plain.candela(0.0, 0.0), plain.candela(45.0, 77.0), plain.candela(90.5, 0.0)), (10.0, 12.5, 0.0));
    assert_eq!(plain.lamp_lumens(), Some(1000.0));
    let dimmed = read(&format!("IESNA:LM-63-1995\n[TEST] a\n{}", body("NONE", "0.5 0.8"))).unwrap();
    assert!((dimmed.peak() - 6.0).abs() < 1e-12);
    // Since 2019 the second number says how the file was made
    let new = read(&format!("IES:LM-63-2019\n{}", body("NONE", "0.5 1.11000"))).unwrap();
    assert!((new.peak() - 7.5).abs() < 1e-12);
    let tilted = read(&body("INCLUDE\r\n1\r\n3\r\n0 45 90\r\n1 0.95 0.9", "1 1")).unwrap();
    assert_eq!(tilted, plain, "the lamp is not tilted");
    assert_eq!(read(&body("lamp.tlt", "1 1")).unwrap(), plain);
}

#[test]
fn parts_of_the_circle_are_mirrored() {
    let quarter = read(&file("", 1, "0 90", "0 45 90", "1 1  1 2  1 3")).unwrap();
    for (horizontal, expected) in
        [(0.0, 1.0), (45.0, 2.0), (90.0, 3.0), (135.0, 2.0), (180.0, 1.0), (270.0, 3.0), (337.5, 1.5)]
    {
        assert!((quarter.candela(90.0, horizontal) - expected).abs() < 1e-12, "{horizontal}");
    }
    let half = read(&file("", 1, "0 90", "0 90 180", "1 1  1 2  1 3")).unwrap();
    assert!((half.candela(90.0, 270.0) - 2.0).abs() < 1e-12 && (half.candela(90.0, 180.0) - 3.0).abs() < 1e-12);
    assert!(!half.is_round());
    let picture = half.picture(IesInterpolation::Linear);
    let row = &picture.values[(90 * picture.width) as usize..][..picture.width as usize];
    assert!((row[row.len() / 2] - 1.0).abs() < 0.05 && (row[0] - 1.0 / 3.0).abs() < 0.05, "{row:?}");
}

#[test]
fn types_a_and_b_turn_around_their_own_axes() {
    // Bright 30° to the side of the axis, at all elevations
    let table = "0 1 0  0 1 0  0 1 0  5 5 5  0 1 0";
    let side = |kind: u32| read(&file("", kind, "-90 0 90", "-90 -30 0 30 90", table)).unwrap();
    for kind in [2, 3] {
        assert!((side(kind).candela(30.0, 0.0) - 5.0).abs() < 0.05, "to the side: {}", side(kind).candela(30.0, 0.0));
        assert!((side(kind).candela(30.0, 180.0) - 1.0).abs() < 0.05 && side(kind).candela(120.0, 0.0) == 0.0);
    }
    // One half of the angles: the other is its image
    let half = read(&file("", 2, "0 90", "0 90", "4 0  0 0")).unwrap();
    assert!((half.candela(45.0, 45.0) - half.candela(45.0, 225.0)).abs() < 1e-9 && half.candela(0.0, 0.0) == 4.0);
}

#[test]
fn cubic_curves_go_through_the_values() {
    let profile = read(&file("", 1, "0 10 20 30 40 90", "0 90", "9 8 5 2 1 0  9 7 4 2 1 0")).unwrap();
    let picture = profile.picture(IesInterpolation::Cubic);
    let at = |row: f64| f64::from(picture.values[((row * 4.0) as u32 * picture.width) as usize]) * 9.0;
    assert!((at(0.0) - 9.0).abs() < 1e-5 && (at(10.0) - 8.0).abs() < 0.02 && (at(20.0) - 5.0).abs() < 0.02);
    // Flat at the pole, where a line is not
    assert!(at(2.0) > profile.candela(2.0, 0.0));
}

#[test]
fn errors_name_the_line_and_the_remedy() {
    let good = file("", 1, "0 90", "0", "1 2");
    for (text, line, problem) in [
        ("<html>\n</html>\n".to_owned(), 1, "there is no line `TILT=`: this is not a file of IES LM-63"),
        (String::new(), 1, "TILT="),
        (good.replace("NONE", ""), 1, "write `TILT=NONE`"),
        (good.replace("1 2\n", "1"), 6, "ends before the candelas"),
        (good.replace("1 2\n", "1 x2"), 6, "`x2` is not a number; the candelas is expected here"),
        (good.replace("0 90", "90 0"), 4, "follows one of 90°; angles must ascend"),
        (good.replace("0 90", "0 190"), 6, "0° to 180°"),
        (good.replace("1 1000 1 2 1 1", "1 1000 1 2 1 7"), 2, "the photometric type is 7"),
        (good.replace("1 1000 1 2 1 1", "1 1000 1 2 1.5 1"), 2, "a whole number"),
        (good.replace("1 1000 1 2 1 1", "1 1000 -1 2 1 1"), 3, "must not be negative"),
        (good.replace("1 1000 1 2 1 1", "1 1000 1 20000 20000 1"), 3, "more than the file has"),
        (good.replace("1 1000 1 2 1 1", "1 1000 1e300 2 1 1"), 6, "more than can be computed with"),
        (file("", 1, "0 90", "0 30", "1 2 3 4"), 6, "they must end at 0°, 90°, 180° or 360°"),
        (
            file("", 1, "0 90", "20", "1 2").replace("\n20\n", "\n20 40\n").replace("2 1 1 2", "2 2 1 2"),
            5,
            "more than the file has",
        ),
        (file("", 2, "0 90", "10 20", "1 2 3 4"), 6, "of type B"),
    ] {
        let found = fault(&text);
        assert!(found.0 == line && found.1.contains(problem), "{text:?}: {found:?}, {problem}");
    }
}

#[test]
fn a_real_lamp_has_the_flux_that_its_maker_gives() {
    for path in real() {
        let profile = IesProfile::read(&path).unwrap();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let (flux, candela, vertical) = match name.as_str() {
            // 68 lm are those of the bare lamp; the reflector and the lens let through a part of them
            "12.IES" => (profile.lumens(), 166.0, 0.0),
            "profile.ies" => (4777.0, 2628.1, 0.0),
            _ => (profile.lumens(), 6526.0 * 4.8, 0.0),
        };
        assert!((profile.lumens() / flux - 1.0).abs() < 0.01, "{name}: {} lm", profile.lumens());
        assert!((profile.candela(vertical, 12.0) / candela - 1.0).abs() < 1e-6, "{name}");
        eprintln!("{name}: {:.2} lm, lamps {:?}", profile.lumens(), profile.lamp_lumens());
        if name == "12.IES" {
            assert_eq!(profile.lamp_lumens(), Some(68.0));
            assert!((profile.lumens() - 33.15).abs() < 0.01, "{}", profile.lumens());
        }
    }
}

#[test]
fn damaged_files_are_refused_or_read_and_never_panic() {
    let mut files: Vec<Vec<u8>> = real().iter().map(|path| std::fs::read(path).unwrap()).collect();
    files.push(file("IESNA91\n[LAMP] a\n", 1, "0 45 90", "0 90 180", "1 2 3  4 5 6  7 8 9").into_bytes());
    files.push(file("", 3, "-90 0 90", "-90 0 90", "1 2 3  4 5 6  7 8 9").into_bytes());
    for (number, file) in files.iter().enumerate() {
        survive(
            &format!("lamp-{number}.ies"),
            60,
            |random| {
                let mut bytes = file.clone();
                for _ in 0..=random.below(3) {
                    // Mostly after the labels
                    let start = if random.below(4) == 0 { 0 } else { bytes.len() / 3 };
                    let at = start + random.below(bytes.len() - start);
                    damage(&mut bytes, at, random);
                    if bytes.is_empty() {
                        break;
                    }
                }
                bytes
            },
            |bytes| {
                let profile = IesProfile::of_bytes(bytes, Path::new("lamp.ies"));
                let picture = profile.map(|profile| profile.picture(IesInterpolation::Cubic));
                picture.is_ok_and(|picture| picture.values.iter().all(|value| (0.0..=2.0).contains(value)))
            },
        );
    }
}
