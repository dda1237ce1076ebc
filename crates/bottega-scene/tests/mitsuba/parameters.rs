//! Parameters, inclusion, references, names of the old line.

use bottega_scene::{LoadOptions, Surface};
use glam::Vec3;

use crate::mitsuba::support::{Folder, bare, read, read_old, refuse, silent, told};

fn reflectance(loaded: &bottega_scene::Loaded) -> Vec3 {
    match &loaded.scene.materials[0].surface {
        Surface::Diffuse(diffuse) => diffuse.reflectance.factor,
        other => panic!("{other:?}"),
    }
}

const SHAPE: &str =
    "<shape type='sphere'><bsdf type='diffuse'><rgb name='reflectance' value='$albedo'/></bsdf></shape>";

#[test]
fn parameters_have_defaults_that_the_user_overrides() {
    let text = format!("<default name='albedo' value='0.25'/><default name='albedo' value='0.5'/>{SHAPE}");
    assert_eq!(reflectance(&read(&text)), Vec3::splat(0.25));
    let folder = Folder::new().scene(&text);
    let defines = vec![("albedo".into(), "0.1 0.2 0.3".into()), ("unknown".into(), "1".into())];
    let loaded = folder.load(&LoadOptions { defines, ..bare() }).unwrap();
    assert_eq!(reflectance(&loaded), Vec3::new(0.1, 0.2, 0.3));
    assert_eq!(told(&loaded), ["no parameter of the scene is called `unknown`"]);
}

#[test]
fn the_longest_name_of_a_parameter_counts() {
    let text = "<default name='al' value='1'/><default name='albedo' value='0.5'/><default name='x' value='$albedo'/>";
    assert_eq!(reflectance(&silent(&format!("{text}{}", SHAPE.replace("$albedo", "$x")))), Vec3::splat(0.5));
    assert!(refuse(SHAPE).contains("line 2"), "{}", refuse(SHAPE));
    assert!(refuse(SHAPE).contains("-D albedo="));
}

#[test]
fn references_reach_forwards_and_by_an_alias() {
    let bsdf = "<bsdf type='diffuse' id='gray'><float name='reflectance' value='0.25'/></bsdf>";
    for text in [
        format!("{bsdf}<shape type='sphere'><ref id='gray'/></shape>"),
        format!("<shape type='sphere'><ref id='gray'/></shape>{bsdf}"),
        format!("{bsdf}<alias id='gray' as='other'/><shape type='sphere'><ref name='bsdf' id='other'/></shape>"),
    ] {
        assert_eq!(reflectance(&silent(&text)), Vec3::splat(0.25), "{text}");
    }
}

#[test]
fn included_files_see_the_parameters_and_give_their_ids() {
    let folder = Folder::new()
        .scene("<default name='albedo' value='0.25'/><include filename='parts/$part.xml'/><shape type='sphere'><ref id='m'/></shape>")
        .with("parts/materials.xml", "<scene version='3.0.0'><include filename='more.xml'/></scene>")
        .with("parts/more.xml", "<bsdf type='diffuse' id='m'><float name='reflectance' value='$albedo'/></bsdf>");
    let options = LoadOptions { defines: vec![("part".into(), "materials".into())], ..bare() };
    assert_eq!(reflectance(&folder.load(&options).unwrap()), Vec3::splat(0.25));
}

#[test]
fn the_digest_covers_included_files() {
    let digest = |value: &str| {
        let folder = Folder::new()
            .scene("<include filename='a.xml'/>")
            .with("a.xml", format!("<shape type='sphere'><float name='radius' value='{value}'/></shape>"));
        folder.load(&bare()).unwrap().scene.digest
    };
    assert_eq!(digest("1"), digest("1"));
    assert_ne!(digest("1"), digest("2"));
}

#[test]
fn names_of_the_old_line_are_understood() {
    let loaded = read_old(
        "<integrator type='path'><integer name='maxDepth' value='5'/></integrator>
         <sensor type='perspective'><string name='fovAxis' value='y'/><float name='fov' value='60'/>
            <transform name='toWorld'><lookAt origin='0,0,4' target='0,0,0' up='0,1,0'/></transform>
            <film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='32'/></film></sensor>
         <shape type='sphere'><transform name='toWorld'><scale value='2'/></transform>
            <bsdf type='dielectric'><string name='intIOR' value='water'/><float name='extIOR' value='1'/></bsdf></shape>
         <shape type='sphere'><bsdf type='diffuse'><srgb name='reflectance' value='#808080'/></bsdf></shape>",
    );
    assert_eq!(told(&loaded), Vec::<String>::new());
    assert_eq!(loaded.hints.max_depth, Some(4));
    assert_eq!(loaded.hints.resolution, Some([64, 32]));
    assert_eq!(loaded.scene.spheres[0].radius, 2.0);
    match &loaded.scene.materials[0].surface {
        Surface::Dielectric(dielectric) => assert!((dielectric.eta - 1.333).abs() < 1e-6),
        other => panic!("{other:?}"),
    }
    match &loaded.scene.materials[1].surface {
        Surface::Diffuse(diffuse) => assert!((diffuse.reflectance.factor.x - 0.215_86).abs() < 1e-4),
        other => panic!("{other:?}"),
    }
}

#[test]
fn what_is_not_known_is_told_with_its_place_and_refused_when_strict() {
    let text = "<shape type='sphere'>\n<float name='wobble' value='1'/>\n<bsdf type='velvet'><rgb name='a' value='1'/></bsdf></shape>\n<shape type='teapot'/><shape type='teapot'/>";
    let loaded = read(text);
    let expected = [
        "scene.xml:4:1: the bsdf `velvet` is not supported; gray diffuse stands for it",
        "scene.xml:5:1: the shape `teapot` is not supported and left out (and at another place)",
        "scene.xml:3:1: `wobble` of the shape `sphere` is left out",
    ];
    assert_eq!(told(&loaded), expected);
    let error = Folder::new().scene(text).load(&LoadOptions { strict: true, ..bare() }).unwrap_err().to_string();
    assert!(expected.iter().all(|line| error.contains(line)), "{error}");
    assert!(Folder::new().scene("<shape type='sphere'/>").load(&LoadOptions { strict: true, ..bare() }).is_ok());
}
