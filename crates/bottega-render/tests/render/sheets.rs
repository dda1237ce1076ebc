//! Sheets that transmit light without deflection, all of it or a part, and lamps on them: against Mitsuba 3.9.1, `scalar_rgb`.

use bottega_render::PhotonSettings;
use glam::Vec3;

use crate::render::mitsuba::{check, mean};

const SKY: &str = "<emitter type='constant'/>";
const RED: &str = "<bsdf type='diffuse'><rgb name='reflectance' value='0.8,0.2,0.1'/></bsdf>";
const BLUE: &str = "<bsdf type='diffuse'><rgb name='reflectance' value='0.1,0.5,0.9'/></bsdf>";
const BLACK: &str = "<bsdf type='diffuse'><rgb name='reflectance' value='0'/></bsdf>";
const NULL: &str = "<bsdf type='null'/>";
const POLARIZER: &str = "<bsdf type='polarizer'/>";

/// A sheet across the view, seen from the front or, at a negative `z`, from behind.
fn sheet(integrator: &str, z: f32, sheet: &str, more: &str) -> String {
    format!(
        "<scene version='3.0.0'><integrator type='{integrator}'><integer name='max_depth' value='8'/></integrator>
        <sensor type='perspective'><float name='fov' value='40'/>
        <transform name='to_world'><lookat origin='0,0,{z}' target='0,0,0' up='0,1,0.001'/></transform>
        <film type='hdrfilm'><integer name='width' value='8'/><integer name='height' value='8'/><rfilter type='box'/></film>
        <sampler type='independent'><integer name='sample_count' value='128'/></sampler></sensor>
        <shape type='rectangle'><transform name='to_world'><scale value='5'/></transform>{sheet}</shape>{more}</scene>"
    )
}

fn blend(weight: f32, first: &str, second: &str) -> String {
    format!("<bsdf type='blendbsdf'><float name='weight' value='{weight}'/>{first}{second}</bsdf>")
}

fn mask(opacity: f32, within: &str) -> String {
    format!("<bsdf type='mask'><float name='opacity' value='{opacity}'/>{within}</bsdf>")
}

/// A two-sided material: one material for both sides, or one for each.
fn two(within: &str) -> String {
    format!("<bsdf type='twosided'><boolean name='allow_transmission' value='true'/>{within}</bsdf>")
}

/// Checks the radiance of a sheet in front of a sky, from both sides, by both integrators.
fn check_sheet(what: &str, bsdf: &str, before: [f32; 3], behind: [f32; 3]) {
    for integrator in ["path", "volpath"] {
        for (z, expected) in [(4.0, before), (-4.0, behind)] {
            check(&format!("{what}, {integrator}, z = {z}"), &sheet(integrator, z, bsdf, SKY), expected, 0.03);
        }
    }
}

#[test]
fn partly_transparent_sheets_transmit_in_part() {
    let plain = blend(0.6, NULL, RED);
    check_sheet("first", &plain, [0.88, 0.52, 0.46], [0.4; 3]);
    check_sheet("second", &blend(0.6, RED, NULL), [0.92, 0.68, 0.64], [0.6; 3]);
    let both = [0.88, 0.52, 0.46];
    check_sheet("matte on both sides", &blend(0.6, NULL, &format!("<bsdf type='twosided'>{RED}</bsdf>")), both, both);
    check_sheet("the blend on both sides", &two(&plain), both, both);
    let other = two(&(plain.clone() + &blend(0.3, NULL, BLUE)));
    check_sheet("another blend behind", &other, both, [0.73, 0.85, 0.97]);
    check_sheet("only behind", &two(&(RED.to_owned() + &blend(0.3, NULL, BLUE))), [0.8, 0.2, 0.1], [0.73, 0.85, 0.97]);
    let nested = blend(0.5, NULL, &blend(0.25, RED, NULL));
    check_sheet("nested", &nested, [0.925, 0.7, 0.6625], [0.625; 3]);
    let board = format!(
        "<bsdf type='blendbsdf'><texture type='checkerboard' name='weight'><float name='color0' value='1'/>
        <float name='color1' value='0.2'/><transform name='to_uv'><scale x='4' y='4'/></transform></texture>{NULL}{RED}</bsdf>"
    );
    check_sheet("by a picture", &board, [0.88, 0.52, 0.46], [0.4; 3]);
}

#[test]
fn masks_and_glass_may_be_parts_too() {
    check_sheet("mask", &blend(0.6, &mask(0.3, RED), RED), [0.856, 0.424, 0.352], [0.28; 3]);
    check_sheet("blend under a mask", &mask(0.5, &blend(0.6, NULL, RED)), [0.94, 0.76, 0.73], [0.7; 3]);
    check_sheet("mask on both sides", &two(&mask(0.3, RED)), [0.94, 0.76, 0.73], [0.94, 0.76, 0.73]);
    let glass = blend(0.6, "<bsdf type='thindielectric'/>", RED);
    check_sheet("thin glass", &glass, [0.88, 0.52, 0.46], [0.4; 3]);
}

#[test]
fn polarizers_of_light_without_polarization_are_gray_sheets() {
    let tinted = |kind: &str| format!("<bsdf type='{kind}'><rgb name='transmittance' value='0.5,0.8,1'/></bsdf>");
    check_sheet("polarizer", POLARIZER, [0.5; 3], [0.5; 3]);
    check_sheet("circular", "<bsdf type='circular'/>", [0.5; 3], [0.5; 3]);
    check_sheet("retarder", "<bsdf type='retarder'/>", [1.0; 3], [1.0; 3]);
    check_sheet("tinted polarizer", &tinted("polarizer"), [0.25, 0.4, 0.5], [0.25, 0.4, 0.5]);
    check_sheet("tinted circular", &tinted("circular"), [0.25, 0.4, 0.5], [0.25, 0.4, 0.5]);
    check_sheet("tinted retarder", &tinted("retarder"), [0.5, 0.8, 1.0], [0.5, 0.8, 1.0]);
    check_sheet("in a blend", &blend(0.6, POLARIZER, RED), [0.68, 0.32, 0.26], [0.2; 3]);
}

/// A wall at z = 6, seen from the room in front of it, and lit by a lamp behind the sheet.
fn lit_wall(integrator: &str, bsdf: &str, lamp: &str) -> String {
    let wall = "<shape type='rectangle'><transform name='to_world'><scale value='5'/><rotate y='1' angle='180'/><translate z='6'/>
        </transform><bsdf type='diffuse'/></shape>";
    sheet(integrator, 4.0, bsdf, &format!("{wall}{lamp}"))
        .replace("origin='0,0,4' target='0,0,0'", "origin='0,0,0.5' target='0,0,6'")
}

#[test]
fn lamps_without_extent_shine_through_parts_where_mitsubas_do() {
    let lamp = "<emitter type='point'><point name='position' x='0' y='0' z='-2'/><rgb name='intensity' value='100'/></emitter>";
    let tinted = "<bsdf type='polarizer'><rgb name='transmittance' value='0.5,0.8,1'/></bsdf>";
    // Black, so that the sheet reflects no light back to the wall.
    let parts = blend(0.6, NULL, BLACK);
    check("parts", &lit_wall("volpath", &parts, lamp), [0.0936; 3], 0.03);
    check("polarizer", &lit_wall("volpath", tinted, lamp), [0.0585, 0.0936, 0.117], 0.03);
    for bsdf in [parts.as_str(), tinted] {
        assert_eq!(mean(&lit_wall("path", bsdf, lamp), None), Vec3::ZERO, "{bsdf}");
    }
}

/// A square lamp with this material, above a floor.
fn lamp_under(bsdf: &str) -> String {
    format!(
        "<scene version='3.0.0'><integrator type='path'><integer name='max_depth' value='8'/></integrator>
        <sensor type='perspective'><float name='fov' value='40'/>
        <transform name='to_world'><lookat origin='0,0,4' target='0,0,0' up='0,1,0.001'/></transform>
        <film type='hdrfilm'><integer name='width' value='32'/><integer name='height' value='32'/><rfilter type='box'/></film>
        <sampler type='independent'><integer name='sample_count' value='4'/></sampler></sensor>
        <shape type='rectangle'>{bsdf}<emitter type='area'><rgb name='radiance' value='1,2,3'/></emitter></shape>
        <shape type='rectangle'><transform name='to_world'><scale value='5'/><translate z='-2'/></transform><bsdf type='diffuse'/></shape>
        </scene>"
    )
}

#[test]
fn masks_do_not_dim_lamps() {
    let shades = format!(
        "<bsdf type='mask'><texture type='checkerboard' name='opacity'><float name='color0' value='0.9'/>
        <float name='color1' value='0.1'/></texture>{BLACK}</bsdf>"
    );
    let seen = [0.4718, 0.9435, 1.4153];
    for bsdf in [mask(0.3, BLACK), mask(0.0, BLACK), mask(1.0, BLACK), shades, NULL.into(), two(&mask(0.3, BLACK))] {
        check(&bsdf, &lamp_under(&bsdf), seen, 0.01);
    }
}

#[test]
fn lamps_under_masks_light_surfaces_before_them() {
    let lit = |bsdf: &str| {
        let lamp = format!(
            "<shape type='rectangle'><transform name='to_world'><translate z='1'/></transform>{bsdf}
            <emitter type='area'><rgb name='radiance' value='5'/></emitter></shape>"
        );
        // Outside the view.
        lit_wall("path", BLACK, &lamp).replace("origin='0,0,0.5'", "origin='0,0,1.5'")
    };
    let open = mean(&lit(BLACK), None);
    let photons = PhotonSettings { count: 20_000, ..PhotonSettings::default() };
    for bsdf in [mask(0.3, BLACK), mask(0.0, BLACK), NULL.into()] {
        let by_paths = mean(&lit(&bsdf), None);
        assert!((by_paths / open - 1.0).abs().max_element() < 0.01, "{bsdf}: {by_paths} instead of {open}");
        let by_photons = mean(&lit(&bsdf), Some(photons));
        assert!(
            (by_photons / open - 1.0).abs().max_element() < 0.02,
            "{bsdf}: {by_photons} by photons instead of {open}"
        );
    }
}
