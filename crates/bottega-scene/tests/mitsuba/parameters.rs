//! Parameters, inclusion, references, names of the 0.6 format.

use bottega_scene::{LoadOptions, Surface};
use glam::Vec3;

use crate::mitsuba::support::{Folder, bare, read, read_old, refuse, silent, warnings};

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
    assert_eq!(warnings(&loaded), ["no parameter of the scene is called `unknown`"]);
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
    assert_eq!(warnings(&loaded), Vec::<String>::new());
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
fn unknown_parameters_are_reported_with_their_place_and_refused_when_strict() {
    let text = "<shape type='sphere'>\n<float name='wobble' value='1'/>\n<bsdf type='velvet'><rgb name='a' value='1'/></bsdf></shape>\n<shape type='teapot'/><shape type='teapot'/>";
    let loaded = read(text);
    let expected = [
        "scene.xml:4:1: the bsdf `velvet` is not supported; gray diffuse replaces it",
        "scene.xml:5:1: the shape `teapot` is not supported and left out (and at another place)",
        "scene.xml:3:1: `wobble` of the shape `sphere` is left out",
    ];
    assert_eq!(warnings(&loaded), expected);
    let error = Folder::new().scene(text).load(&LoadOptions { strict: true, ..bare() }).unwrap_err().to_string();
    assert!(expected.iter().all(|line| error.contains(line)), "{error}");
    assert!(Folder::new().scene("<shape type='sphere'/>").load(&LoadOptions { strict: true, ..bare() }).is_ok());
}

#[test]
fn known_but_unsupported_parameters_are_refused_when_strict() {
    let sensor = |within: &str| format!("<sensor type='perspective'>{within}</sensor>");
    let film = |within: &str| sensor(&format!("<film type='hdrfilm'>{within}</film>"));
    let cases = [
        film("<string name='pixel_format' value='luminance'/>"),
        film("<string name='pixel_format' value='xyza'/>"),
        film("<float name='gamma' value='2.2'/>"),
        sensor("<float name='kc' value='0.1, 0.2'/>").replace("float name='kc'", "string name='kc'"),
        "<integrator type='moment'><integrator type='path'/></integrator>".into(),
        "<integrator type='direct'><integer name='emitter_samples' value='0'/></integrator>".into(),
        "<emitter type='sunsky'><boolean name='complex_sun' value='true'/></emitter>".into(),
        "<shape type='sphere' color='red'/>".into(),
        "<shape type='sphere'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'>
            <string name='filename' value='none.png'/></texture></bsdf></shape>"
            .into(),
        "<shape type='sphere'><bsdf type='normalmap'><texture type='bitmap' name='normalmap'><boolean name='raw' value='true'/>
            <string name='filename' value='none.png'/></texture><bsdf type='diffuse'/></bsdf></shape>"
            .into(),
    ];
    for text in cases {
        let strict = Folder::new().scene(&text).load(&LoadOptions { strict: true, ..bare() });
        assert!(matches!(strict, Err(bottega_scene::SceneError::Unsupported { .. })), "{text}: {strict:?}");
        assert!(!warnings(&read(&text)).is_empty(), "{text}");
    }
}

#[test]
fn parameters_without_effect_are_not_reported() {
    silent(
        "<integrator type='direct'><integer name='emitter_samples' value='4'/><integer name='bsdf_samples' value='2'/>
            <integer name='samples_per_pass' value='4'/></integrator>
         <sensor type='perspective'><float name='shutter_open' value='0'/><float name='aperture_radius' value='1'/>
            <sampler type='stratified'><integer name='seed' value='3'/><boolean name='jitter' value='true'/></sampler>
            <film type='hdrfilm'><string name='file_format' value='openexr'/><string name='component_format' value='float32'/>
            <boolean name='sample_border' value='true'/></film></sensor>
         <emitter type='point'><float name='sampling_weight' value='2'/></emitter>
         <shape type='sphere'><bsdf type='roughconductor'><boolean name='sample_visible' value='false'/></bsdf></shape>",
    );
}

#[test]
fn lamps_that_are_never_sampled_are_out() {
    let lamp =
        |weight: &str| format!("<emitter type='point'><float name='sampling_weight' value='{weight}'/></emitter>");
    assert_eq!(silent(&lamp("0.5")).scene.lights.len(), 1);
    let loaded = read(&lamp("0"));
    assert!(loaded.scene.lights.is_empty());
    assert!(warnings(&loaded)[0].contains("sampling_weight"), "{:?}", warnings(&loaded));
}

#[test]
fn rotations_about_long_axes_scale_but_for_the_old_line() {
    let shape = |axis: &str| {
        format!("<shape type='rectangle'><transform name='to_world'><rotate {axis} angle='40'/></transform></shape>")
    };
    let axis = "x='0' y='1' z='1'";
    let loaded = read(&shape(axis));
    let corners = |loaded: &bottega_scene::Loaded| loaded.scene.meshes[0].positions.clone();
    // The transformed corner (1, 1, 0) by Mitsuba 3.9.1.
    let expected = Vec3::new(0.123_256_84, 1.642_787_6, -0.408_832_04);
    assert!(corners(&loaded).iter().any(|p| (*p - expected).length() < 1e-5), "{:?}", corners(&loaded));
    assert!(warnings(&loaded)[0].contains("unit length"), "{:?}", warnings(&loaded));
    let old = read_old(&shape(axis));
    assert!(corners(&old).iter().all(|p| (p.length_squared() - 2.0).abs() < 1e-5), "{:?}", corners(&old));
    for unit in ["y='1'", "x='0.6' z='-0.8'"] {
        silent(&shape(unit));
    }
}
