//! Scenes of Mitsuba against the means of its own pictures: Mitsuba 3.9.1, `scalar_rgb`, 1,500 samples per pixel.

use std::{fs, path::Path};

use bottega_render::{PathSettings, PhotonSettings};
use bottega_scene::{LoadOptions, Loaded, load};
use glam::Vec3;

use crate::render::scenes::{mean_color, paint, prepare};

/// A ground of 12 × 12, seen from the front and above.
const GROUND: &str =
    "<shape type='rectangle'><transform name='to_world'><scale value='6'/><rotate x='1' angle='-90'/></transform>
    <bsdf type='diffuse'><rgb name='reflectance' value='0.6 0.5 0.4'/></bsdf></shape>";
const CEILING_LAMP: &str =
    "<shape type='rectangle'><transform name='to_world'><scale value='0.8'/><rotate x='1' angle='90'/>
    <translate y='4'/></transform><emitter type='area'><rgb name='radiance' value='9 8 7'/></emitter></shape>";
const POINT: &str =
    "<emitter type='point'><point name='position' x='0' y='3.2' z='0'/><rgb name='intensity' value='12'/></emitter>";
const SKY: &str = "<emitter type='constant'><rgb name='radiance' value='1 0.9 0.8'/></emitter>";
const THIN: &str = "<bsdf type='thindielectric'><string name='int_ior' value='water'/></bsdf>";
const NULL: &str = "<bsdf type='null'/>";

/// A scene with a ground.
fn scene(integrator: &str, depth: u32, more: &str) -> String {
    format!(
        "<scene version='3.0.0'><integrator type='{integrator}'><integer name='max_depth' value='{depth}'/></integrator>
        <sensor type='perspective'><float name='fov' value='40'/>
        <transform name='to_world'><lookat origin='0, 2.2, 7' target='0, 1.2, 0' up='0, 1, 0'/></transform>
        <film type='hdrfilm'><integer name='width' value='32'/><integer name='height' value='32'/><rfilter type='box'/></film>
        <sampler type='independent'><integer name='sample_count' value='64'/></sampler></sensor>{GROUND}{more}</scene>"
    )
}

/// A cube of this half side around (0, 1.2, 0).
fn cube(half: f32, within: &str) -> String {
    format!(
        "<shape type='cube'><transform name='to_world'><scale value='{half}'/><translate y='1.2'/></transform>{within}</shape>"
    )
}

/// A ball around (0, 1.2, 0).
fn ball(radius: f32, within: &str) -> String {
    format!(
        "<shape type='sphere'><point name='center' x='0' y='1.2' z='0'/><float name='radius' value='{radius}'/>{within}</shape>"
    )
}

fn fog(scale: f32) -> String {
    format!(
        "<medium type='homogeneous' name='interior'><float name='scale' value='{scale}'/><rgb name='sigma_t' value='1 1 1'/>
        <rgb name='albedo' value='0.95 0.9 0.8'/><phase type='isotropic'/></medium>"
    )
}

fn read(text: &str) -> Loaded {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.xml");
    fs::write(&path, text).expect("a scene");
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/render/files");
    for file in ["ring.vol", "strands.txt"] {
        fs::copy(own.join(file), folder.path().join(file)).expect("a file");
    }
    load(&path, &LoadOptions { strict: true, ..LoadOptions::default() })
        .unwrap_or_else(|error| panic!("{error}\n{text}"))
}

pub(crate) fn mean(text: &str, photons: Option<PhotonSettings>) -> Vec3 {
    let Loaded { scene, hints, .. } = read(text);
    let [width, height] = hints.resolution.expect("a size");
    let settings = PathSettings {
        max_depth: hints.max_depth.expect("a depth").min(64),
        filter: hints.filter.expect("a filter"),
        photons,
        ..PathSettings::default()
    };
    mean_color(&paint(&prepare(scene), (width, height), hints.samples.expect("samples"), settings))
}

/// Checks that the mean of a picture is Mitsuba's, within a relative tolerance for noise.
pub(crate) fn check(what: &str, text: &str, expected: [f32; 3], share: f32) {
    let found = mean(text, None);
    let off = (found / Vec3::from_array(expected) - 1.0).abs().max_element();
    assert!(off < share, "{what}: {found} instead of {expected:?}, {:.1} % off", 100.0 * off);
}

#[test]
fn thin_panes_are_boundaries_of_media() {
    let plastic = "<bsdf type='roughplastic'><rgb name='diffuse_reflectance' value='0.2 0.5 0.7'/></bsdf>";
    let lamp = "<bsdf type='diffuse'><rgb name='reflectance' value='0'/></bsdf><emitter type='area'><rgb name='radiance' value='6 5 4'/></emitter>";
    let around = |scale: f32, inner: String| cube(0.9, &format!("{THIN}{}", fog(scale))) + &inner;
    let lit = |depth: u32, more: String| scene("volpath", depth, &format!("{CEILING_LAMP}{more}"));
    check("depth 3", &lit(3, around(1.5, String::new())), [0.0583, 0.0445, 0.0317], 0.025);
    check("depth 8", &lit(8, around(1.5, String::new())), [0.0732, 0.0548, 0.0373], 0.025);
    check("ball in fog", &lit(8, around(1.5, ball(0.4, plastic))), [0.0701, 0.0534, 0.0370], 0.025);
    let inner = ball(0.5, &format!("{THIN}{}", fog(0.5)));
    check("nested", &lit(8, around(1.5, inner)), [0.0739, 0.0555, 0.0381], 0.025);
    let lamp = scene("volpath", 8, &around(1.5, ball(0.3, lamp)));
    check("lamp in fog", &lamp, [0.0700, 0.0521, 0.0348], 0.025);
}

#[test]
fn solids_without_media_keep_the_medium_around_them() {
    let around = cube(1.2, &format!("{NULL}{}", fog(1.0))) + &ball(0.7, "<bsdf type='dielectric'/>");
    let lit = scene("volpath", 16, &format!("{CEILING_LAMP}{around}"));
    check("glass in fog", &lit, [0.0788, 0.0597, 0.0406], 0.03);
    let lit = scene("path", 16, &format!("{CEILING_LAMP}{around}"));
    assert!(read(&lit).warnings.iter().any(|warning| warning.message.contains("does not support media")));
    check("the same without media", &lit, [0.0611, 0.0454, 0.0320], 0.03);
}

#[test]
fn lamps_shine_straight_through_panes_where_mitsubas_do() {
    let pane = |bsdf: &str| {
        format!(
            "{POINT}<shape type='rectangle'><transform name='to_world'><scale value='1.5'/><rotate x='1' angle='90'/>
            <translate y='2'/></transform>{bsdf}</shape>"
        )
    };
    let black = "<bsdf type='diffuse'><rgb name='reflectance' value='0'/></bsdf>";
    let half = format!("<bsdf type='blendbsdf'><float name='weight' value='0.5'/>{THIN}{black}</bsdf>");
    let mask = format!("<bsdf type='mask'><float name='opacity' value='0.5'/>{THIN}</bsdf>");
    let cases = [
        ("volpath", 3, THIN, [0.0523, 0.0436, 0.0349]),
        ("volpath", 8, THIN, [0.0526, 0.0438, 0.0350]),
        ("volpath", 8, NULL, [0.0547, 0.0456, 0.0365]),
        ("volpath", 8, &half, [0.0268, 0.0223, 0.0178]),
        ("volpath", 8, &mask, [0.0537, 0.0447, 0.0357]),
        ("path", 8, THIN, [0.0012, 0.0010, 0.0008]),
        ("path", 8, NULL, [0.0012, 0.0010, 0.0008]),
    ];
    for (integrator, depth, bsdf, expected) in cases {
        check(&format!("{integrator} {depth} {bsdf}"), &scene(integrator, depth, &pane(bsdf)), expected, 0.025);
    }
}

#[test]
fn photons_go_through_panes_too() {
    let text = scene("volpath", 8, &format!("{POINT}{}", ball(0.6, THIN)));
    let photons = PhotonSettings { progressive: true, count: 20_000, ..PhotonSettings::default() };
    let (by_paths, by_photons) = (mean(&text, None), mean(&text, Some(photons)));
    assert!((by_photons / by_paths - 1.0).abs().max_element() < 0.03, "{by_photons} instead of {by_paths}");
}

#[test]
fn media_on_grids_end_at_the_box_of_their_volume() {
    let medium = |place: &str| {
        cube(
            0.9,
            &format!(
                "{NULL}<medium type='heterogeneous' name='interior'><float name='scale' value='3'/><rgb name='albedo' value='0 0 0'/>
                <volume type='constvolume' name='sigma_t'><rgb name='value' value='0.2 0.35 0.5'/>{place}</volume>
                <phase type='isotropic'/></medium>"
            ),
        )
    };
    let lit = |place: &str| scene("volpath", 8, &format!("{SKY}{}", medium(place)));
    check("plain", &lit(""), [0.8037, 0.6792, 0.5666], 0.005);
    let moved = "<transform name='to_world'><translate x='-0.7' y='0.2' z='0.1'/></transform>";
    check("moved", &lit(moved), [0.8001, 0.6747, 0.5621], 0.005);
}

#[test]
fn grids_of_distances_have_surfaces() {
    let ring = "<shape type='sdfgrid'><string name='filename' value='ring.vol'/><string name='normals' value='smooth'/>
        <transform name='to_world'><translate x='-0.5' y='-0.5' z='-0.5'/><scale value='2.5'/><translate y='1.3'/></transform>
        <bsdf type='diffuse'><rgb name='reflectance' value='0.3 0.6 0.8'/></bsdf></shape>";
    check("ring", &scene("path", 3, &format!("{SKY}{ring}")), [0.7606, 0.6581, 0.5570], 0.005);
}

/// A room with a ball in it, seen from outside of its near wall.
fn room(sensor: &str, near: &str, far: &str, more: &str) -> String {
    format!(
        "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='6'/></integrator>
        <sensor type='{sensor}'{near}{far}<film type='hdrfilm'><integer name='width' value='32'/>
        <integer name='height' value='32'/><rfilter type='box'/></film>
        <sampler type='independent'><integer name='sample_count' value='64'/></sampler></sensor>
        <shape type='cube'><transform name='to_world'><scale value='3'/></transform><bsdf type='twosided'><bsdf type='diffuse'>
        <rgb name='reflectance' value='.7,.6,.5'/></bsdf></bsdf></shape>
        <shape type='sphere'><float name='radius' value='0.8'/><bsdf type='diffuse'><rgb name='reflectance' value='.2,.3,.8'/></bsdf></shape>
        <shape type='rectangle'><transform name='to_world'><rotate x='1' angle='90'/><translate y='2.9'/></transform>
        <emitter type='area'><rgb name='radiance' value='10'/></emitter></shape>{more}</scene>"
    )
}

#[test]
fn cameras_see_between_their_clip_planes() {
    let look = "><transform name='to_world'><lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform><float name='fov' value='40'/>";
    let lens = format!("{look}<float name='aperture_radius' value='0.3'/><float name='focus_distance' value='4'/>");
    let wide =
        "><transform name='to_world'><scale value='2'/><lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform>";
    let near = "<float name='near_clip' value='2.5'/>";
    let clipped = "<float name='near_clip' value='2.5'/><float name='far_clip' value='4.5'/>";
    let sky = "<emitter type='constant'><rgb name='radiance' value='0.5,1,2'/></emitter>";
    check("near", &room("perspective", look, near, ""), [0.2977, 0.2275, 0.2020], 0.02);
    check("far", &room("perspective", look, clipped, sky), [0.4533, 0.8988, 1.8010], 0.01);
    check("lens", &room("thinlens", &lens, clipped, sky), [0.4534, 0.8989, 1.8013], 0.01);
    check("parallel", &room("orthographic", wide, near, ""), [0.3476, 0.2625, 0.2004], 0.02);
    check("parallel, far", &room("orthographic", wide, clipped, sky), [0.4372, 0.8744, 1.7488], 0.01);
    // With the names of the 0.6 format.
    let old = room("perspective", look, "<float name='nearClip' value='2.5'/>", "").replace("3.0.0", "0.6.0");
    check("nearClip", &old, [0.2977, 0.2275, 0.2020], 0.02);
}

#[test]
fn photons_are_seen_between_clip_planes() {
    let look = "><transform name='to_world'><lookat origin='0,0,5' target='0,0,0' up='0,1,0'/></transform><float name='fov' value='40'/>";
    let text =
        room("perspective", look, "<float name='near_clip' value='2.5'/>", "").replace("value='6'", "value='-1'");
    let found = mean(&text, Some(PhotonSettings { count: 50_000, ..PhotonSettings::default() }));
    assert!((found / Vec3::new(0.3413, 0.2422, 0.2081) - 1.0).abs().max_element() < 0.03, "{found}");
}

#[test]
fn hair_is_as_bright_as_mitsubas() {
    // 80 strands around a centre, below a sky that the camera does not see; 2,000 samples per pixel.
    let scene = |bsdf: &str| {
        format!(
            "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='64'/>
            <boolean name='hide_emitters' value='true'/></integrator>
            <sensor type='perspective'><float name='fov' value='30'/>
            <transform name='to_world'><lookat origin='0, 0.4, 5' target='0, -0.05, 0' up='0, 1, 0'/></transform>
            <film type='hdrfilm'><integer name='width' value='32'/><integer name='height' value='32'/><rfilter type='box'/></film>
            <sampler type='independent'><integer name='sample_count' value='256'/></sampler></sensor>{SKY}
            <shape type='bsplinecurve'><string name='filename' value='strands.txt'/><bsdf type='hair'>{bsdf}</bsdf></shape></scene>"
        )
    };
    let number = |name: &str, value: f32| format!("<float name='{name}' value='{value}'/>");
    let blond = number("eumelanin", 0.2) + &number("pheomelanin", 0.1);
    let dark = [("eumelanin", 2.0), ("longitudinal_roughness", 0.2), ("azimuthal_roughness", 0.4), ("scale_tilt", 4.0)];
    let dark: String = dark.map(|(name, value)| number(name, value)).concat();
    let dyed = "<rgb name='sigma_a' value='0 0.02 0.05'/>".to_owned() + &number("longitudinal_roughness", 0.4);
    check("blond", &scene(&blond), [0.07542, 0.05799, 0.03541], 0.01);
    check("dark", &scene(&dark), [0.02091, 0.01073, 0.00655], 0.01);
    check("dyed", &scene(&dyed), [0.09436, 0.08120, 0.06757], 0.01);
}

#[test]
fn cameras_do_not_see_emitters_that_are_hidden() {
    let hide =
        |text: String| text.replace("</integrator>", "<boolean name='hide_emitters' value='true'/></integrator>");
    let lamp = "<shape type='sphere'><point name='center' x='0.5' y='1.5' z='0'/><float name='radius' value='0.4'/>
        <emitter type='area'><rgb name='radiance' value='9 8 7'/></emitter></shape>";
    let pane =
        "<shape type='rectangle'><transform name='to_world'><scale value='1.5'/><translate y='2' z='2'/></transform>";
    let sky = "<emitter type='constant'><rgb name='radiance' value='0.4 0.5 0.6'/></emitter>";
    let lit = |integrator: &str, more: String| hide(scene(integrator, 8, &format!("{lamp}{sky}{more}")));
    check("path", &lit("path", String::new()), [0.1481, 0.1427, 0.1296], 0.02);
    check("volpath", &lit("volpath", String::new()), [0.1483, 0.1429, 0.1298], 0.02);
    check("through a pane", &lit("volpath", format!("{pane}{THIN}</shape>")), [0.1558, 0.1526, 0.1417], 0.02);
    let photons = PhotonSettings { count: 50_000, ..PhotonSettings::default() };
    let found = mean(&lit("path", String::new()), Some(photons));
    assert!((found / Vec3::new(0.1481, 0.1427, 0.1296) - 1.0).abs().max_element() < 0.06, "{found}");
}

#[test]
fn checkerboards_read_as_numbers_are_the_other_way_round() {
    let scene = |bsdf: &str| {
        format!(
            "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='2'/></integrator>
            <sensor type='perspective'><float name='fov' value='30'/>
            <transform name='to_world'><lookat origin='0, 0, 4.5' target='0, 0, 0' up='0, 1, 0'/></transform>
            <sampler type='independent'><integer name='sample_count' value='64'/></sampler>
            <film type='hdrfilm'><integer name='width' value='32'/><integer name='height' value='32'/><rfilter type='box'/></film></sensor>
            {SKY}<emitter type='point'><point name='position' x='-3' y='2' z='5'/><rgb name='intensity' value='80'/></emitter>
            <shape type='sphere'>{bsdf}</shape></scene>"
        )
    };
    let board = |name: &str, first: f32, second: f32| {
        format!(
            "<texture name='{name}' type='checkerboard'><transform name='to_uv'><scale x='4' y='4'/></transform>
            <float name='color0' value='{first}'/><float name='color1' value='{second}'/></texture>"
        )
    };
    let principled = format!(
        "<bsdf type='principled'><rgb name='base_color' value='0.3 0.7 0.2'/><float name='roughness' value='0.2'/>{}{}{}{}</bsdf>",
        board("metallic", 0.8, 0.1),
        board("anisotropic", 0.1, 0.8),
        board("clearcoat", 0.9, 0.1),
        board("sheen", 0.2, 0.9)
    );
    check("principled", &scene(&principled), [0.7199, 0.9491, 0.5232], 0.012);
}
