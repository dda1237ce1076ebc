//! Files that cannot be read: refused with file, line and column, without delay.

use std::time::{Duration, Instant};

use bottega_scene::LoadOptions;

use crate::mitsuba::support::{Folder, bare, refuse};

#[test]
fn light_beyond_all_that_can_be_computed_with_is_refused_by_file_and_part() {
    for (content, place) in [
        ("<emitter type='point'><rgb name='intensity' value='1e39'/></emitter>", "lights[0]"),
        ("<emitter type='constant'><rgb name='radiance' value='1e20'/></emitter>", "environment"),
        ("<emitter type='directional'><rgb name='irradiance' value='3e38'/></emitter>", "lights[0]"),
        (
            "<shape type='sphere'><emitter type='area'><rgb name='radiance' value='1e39'/></emitter></shape>",
            "materials[",
        ),
    ] {
        let error = refuse(content);
        assert!(error.contains("scene.xml") && error.contains(place), "{content}: {error}");
    }
}

#[test]
fn errors_name_line_and_column() {
    for (content, place, reason) in [
        ("<shape type='sphere'>", "line ", ""),
        ("<shape/>", "line 2, column 1", "type"),
        ("\n  <shape type='sphere'><float name='radius' value='wide'/></shape>", "line 3, column 24", "not a number"),
        ("<shape type='sphere'><float name='radius' value='-1'/></shape>", "line 2, column 22", "below 0"),
        ("<shape type='sphere'><ref id='nowhere'/></shape>", "line 2, column 22", "nowhere"),
        ("<bsdf type='null' id='a'/>\n<bsdf type='null' id='a'/>", "line 3, column 1", "already"),
        (
            "<shape type='sphere'><transform name='to_world'>\n<matrix value='1 2 3'/></transform></shape>",
            "line 3",
            "16",
        ),
        ("<shape type='obj'/>", "line 2, column 1", "filename"),
        ("<sensor type='perspective'><float name='fov' value='180'/></sensor>", "line 2", "field of view"),
        ("<shape type='sphere'><string name='radius' value='1'/></shape>", "line 2, column 22", "not a number"),
        ("<shape type='sphere'><float name='radius' value='nan'/></shape>", "line 2, column 22", "not a number"),
    ] {
        let error = refuse(content);
        assert!(error.contains("scene.xml") && error.contains(place) && error.contains(reason), "{content}: {error}");
    }
}

#[test]
fn files_that_contain_themselves_are_refused() {
    let error =
        refuse("<bsdf type='twosided' id='a'><ref id='b'/></bsdf><bsdf type='twosided' id='b'><ref id='a'/></bsdf>");
    assert!(error.contains("itself"), "{error}");
    let error = refuse("<bsdf type='twosided' id='a'><ref id='a'/></bsdf>");
    assert!(error.contains("itself"), "{error}");
    let folder = Folder::new()
        .scene("<include filename='a.xml'/>")
        .with("a.xml", "<scene version='3.0.0'><include filename='b.xml'/></scene>")
        .with("b.xml", "<scene version='3.0.0'><include filename='./a.xml'/></scene>");
    let error = folder.load(&bare()).unwrap_err().to_string();
    assert!(error.contains("includes itself") && error.contains("b.xml"), "{error}");
}

#[test]
fn files_outside_of_the_folder_are_refused_unless_allowed() {
    let folder = Folder::new().with("out.xml", "<shape type='sphere'/>");
    let inner = "<scene version='3.0.0'><include filename='../out.xml'/></scene>";
    let folder = folder.with("inner/scene.xml", inner);
    let path = folder.path().with_file_name("inner").join("scene.xml");
    let error = bottega_scene::load(&path, &bare()).unwrap_err().to_string();
    assert!(error.contains("outside"), "{error}");
    let allowed = LoadOptions { allow_outside: true, ..bare() };
    assert_eq!(bottega_scene::load(&path, &allowed).unwrap().scene.spheres.len(), 1);
}

#[test]
fn nothing_expands_without_limit() {
    let start = Instant::now();
    // Parameters of parameters.
    let mut doubling = String::from("<default name='a0' value='0123456789'/>");
    for level in 1..60 {
        doubling += &format!("<default name='a{level}' value='$a{0}$a{0}'/>\n", level - 1);
    }
    assert!(refuse(&doubling).contains("grow beyond"), "{}", refuse(&doubling));
    // Entities of entities.
    let laughs = "<!DOCTYPE s [<!ENTITY a 'ha'><!ENTITY b '&a;&a;&a;'>]><scene version='3.0.0'><string name='&b;' value=''/></scene>";
    assert!(Folder::new().with("scene.xml", laughs).load(&bare()).is_err());
    // References of references.
    let mut blends = String::from("<bsdf type='diffuse' id='b0'/>");
    for level in 1..50 {
        blends += &format!("<bsdf type='blendbsdf' id='b{level}'><ref id='b{0}'/><ref id='b{0}'/></bsdf>\n", level - 1);
    }
    let error = refuse(&format!("{blends}<shape type='sphere'><ref id='b49'/></shape>"));
    assert!(error.contains("multiply") || error.contains("memory"), "{error}");
    // Instances of instances.
    let mut groups = String::from("<shape type='shapegroup' id='g0'><shape type='rectangle'/></shape>");
    for level in 1..25 {
        let instance = format!("<shape type='instance'><ref id='g{}'/></shape>", level - 1);
        groups += &format!("<shape type='shapegroup' id='g{level}'>{instance}{instance}{instance}{instance}</shape>\n");
    }
    let folder = Folder::new().scene(&format!("{groups}<shape type='instance'><ref id='g24'/></shape>"));
    // The error comes before the instances fill the memory.
    for options in [LoadOptions { max_memory_bytes: 64 << 20, ..bare() }, bare()] {
        let error = folder.load(&options).unwrap_err().to_string();
        assert!(error.contains("memory") || error.contains("multiply"), "{error}");
        // A group within the groups, by its line: they start in the second.
        let line = error.split_once("scene.xml:").and_then(|(_, rest)| rest.split_once(':')).map(|(line, _)| line);
        let line: usize = line.and_then(|line| line.parse().ok()).unwrap_or_else(|| panic!("no line: {error}"));
        assert!((2..=27).contains(&line), "{error}");
    }
    // A chain of references.
    let mut chain = String::from("<bsdf type='diffuse' id='c0'/>");
    for link in 1..20_000 {
        chain += &format!("<bsdf type='twosided' id='c{link}'><ref id='c{}'/></bsdf>\n", link - 1);
    }
    assert!(refuse(&chain).contains("deep"));
    // Elements within elements.
    assert!(refuse(&"<bsdf type='twosided'>".repeat(100_000)).contains("nested"));
    assert!(start.elapsed() < Duration::from_secs(60), "{:?}", start.elapsed());
}

#[test]
fn a_missing_mesh_is_an_error_that_names_it() {
    let error = refuse("<shape type='ply'><string name='filename' value='nothing.ply'/></shape>");
    assert!(error.contains("nothing.ply"), "{error}");
}
