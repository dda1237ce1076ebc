//! Import of Mitsuba's lights.

use bottega_scene::{EnvironmentMapping, LightKind, Sides, SpotFalloff, Wrap};
use glam::{Vec2, Vec3};

use crate::mitsuba::support::{Folder, bare, read, read_old, silent, warnings};

#[test]
fn area_lights_shine_from_their_front_and_are_black_by_default() {
    let loaded =
        silent("<shape type='rectangle'><emitter type='area'><rgb name='radiance' value='1 2 3'/></emitter></shape>");
    let material = &loaded.scene.materials[0];
    assert_eq!((material.emission.factor, material.emission_sides), (Vec3::new(1.0, 2.0, 3.0), Sides::Front));
    assert_eq!(material.surface, bottega_scene::Surface::matte(Vec3::ZERO));
}

#[test]
fn lights_without_extent_keep_place_direction_and_strength() {
    let loaded = silent(
        "<emitter type='point'><point name='position' value='1 2 3'/><rgb name='intensity' value='4'/></emitter>
         <emitter type='spot'><transform name='to_world'><lookat origin='0 5 0' target='0 0 0' up='1 0 0'/></transform>
            <float name='cutoff_angle' value='60'/></emitter>
         <emitter type='directional'><vector name='direction' value='0 -2 0'/><rgb name='irradiance' value='3'/></emitter>",
    );
    let kinds: Vec<LightKind> = loaded.scene.lights.iter().map(|light| light.kind).collect();
    assert_eq!(kinds[0], LightKind::Point { position: Vec3::new(1.0, 2.0, 3.0), intensity: Vec3::splat(4.0) });
    let LightKind::Spot { position, direction, cos_inner, cos_outer, falloff, .. } = kinds[1] else { panic!() };
    assert_eq!((position, falloff), (Vec3::Y * 5.0, SpotFalloff::LinearAngle));
    assert!((direction - Vec3::NEG_Y).length() < 1e-6);
    assert!((cos_outer - 0.5).abs() < 1e-6 && (cos_inner - 45f32.to_radians().cos()).abs() < 1e-6);
    assert_eq!(kinds[2], LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::splat(3.0), angle: 0.0 });
}

#[test]
fn a_spot_throws_its_texture() {
    // Rows of a PFM run upwards: 1 and 2 are above 3 and 4.
    let numbers = [3.0f32, 4.0, 1.0, 2.0].map(f32::to_le_bytes).concat();
    let folder = Folder::new().with("a.pfm", [&b"Pf\n2 2\n-1\n"[..], &numbers].concat()).scene(
        "<emitter type='spot'><float name='cutoff_angle' value='40'/><float name='beam_width' value='20'/>
            <texture type='bitmap' name='texture'><string name='filename' value='a.pfm'/><boolean name='raw' value='true'/>
            <string name='filter_type' value='nearest'/></texture></emitter>",
    );
    let loaded = folder.load(&bare()).unwrap();
    assert_eq!(warnings(&loaded), Vec::<String>::new());
    let LightKind::Projector { world_from_light, picture, intensity, vertical_fov, aspect } =
        loaded.scene.lights[0].kind
    else {
        panic!("{:?}", loaded.scene.lights)
    };
    assert_eq!((intensity, aspect), (Vec3::splat(1.0), 1.0));
    // Irradiance at these points by Mitsuba 3.9.1 (`scalar_rgb`), times the square of the distance.
    for (p, expected) in [
        (Vec3::new(0.1, 0.05, 1.0), 4.0),
        (Vec3::new(-0.1, 0.05, 1.0), 3.0),
        (Vec3::new(0.1, -0.05, 1.0), 2.0),
        (Vec3::new(-0.1, -0.05, 1.0), 1.0),
        (Vec3::new(0.5, 0.1, 1.0), 2.596_575),
        (Vec3::new(0.6, 0.4, 1.0), 0.840_847),
        (Vec3::new(0.7, 0.5, 1.0), 0.0),
    ] {
        let local = world_from_light.inverse().transform_vector3(p.normalize());
        let place = Vec2::new(local.x, -local.y) / (-local.z * (0.5 * vertical_fov).tan());
        let texel = loaded.scene.images[picture.image.0 as usize].eval(&picture, place * 0.5 + 0.5, 0.0).x;
        let strength = texel / (-local.z).powi(3);
        assert!((strength - expected).abs() < 0.01 * expected.max(1.0), "{p}: {strength}");
    }
}

#[test]
fn a_projector_shows_its_texture_as_the_file_lays_it() {
    let folder = Folder::new().with("a.pfm", [&b"Pf\n1 1\n-1\n"[..], &1.0f32.to_le_bytes()].concat()).scene(
        "<emitter type='projector'><texture type='bitmap' name='irradiance'><string name='filename' value='a.pfm'/>
            <string name='filter_type' value='nearest'/><string name='wrap_mode' value='mirror'/>
            <transform name='to_uv'><scale x='2' y='3'/></transform></texture></emitter>
         <emitter type='projector'><texture type='bitmap' name='irradiance'><string name='filename' value='a.pfm'/></texture></emitter>",
    );
    let loaded = folder.load(&bare()).unwrap();
    let [one, other] = loaded.scene.lights.as_slice() else { panic!("{:?}", loaded.scene.lights) };
    let LightKind::Projector { picture, .. } = one.kind else { panic!("{one:?}") };
    assert_eq!((picture.smooth, picture.wrap_u, picture.wrap_v), (false, Wrap::Mirror, Wrap::Mirror));
    assert_eq!(picture.picture_from_uv.transform_point2(Vec2::ONE), Vec2::new(2.0, 3.0));
    // The outer half of the border texels is blended with the opposite side.
    let LightKind::Projector { picture, .. } = other.kind else { panic!("{other:?}") };
    assert_eq!((picture.smooth, picture.wrap_u), (true, Wrap::Repeat));
}

/// An OpenEXR file of one color.
fn exr_of(color: [f32; 3], chromaticities: [f32; 8]) -> Vec<u8> {
    use exr::prelude::*;
    let [r, g, b] = color;
    let mut image = Image::from_channels((4, 2), SpecificChannels::rgb(|_| (r, g, b)));
    let [rx, ry, gx, gy, bx, by, wx, wy] = chromaticities;
    image.attributes.chromaticities = Some(exr::meta::attribute::Chromaticities {
        red: Vec2(rx, ry),
        green: Vec2(gx, gy),
        blue: Vec2(bx, by),
        white: Vec2(wx, wy),
    });
    let mut file = std::io::Cursor::new(Vec::new());
    image.write().to_buffered(&mut file).unwrap();
    file.into_inner()
}

#[test]
fn colours_of_pictures_are_converted_by_their_chromaticities() {
    let rec2020 = [0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329];
    let aces_cg = [0.713, 0.293, 0.165, 0.83, 0.128, 0.044, 0.321_68, 0.337_67];
    // Values of Mitsuba 3.9.1, which does not change white.
    for (chromaticities, color, expected) in [
        (rec2020, [1.0, 0.2, 0.1], Vec3::new(1.5357, 0.1012, 0.0736)),
        (aces_cg, [1.0; 3], Vec3::new(1.047_103, 0.994_543, 0.915_319)),
    ] {
        let scene = "<emitter type='envmap'><string name='filename' value='a.exr'/></emitter>";
        let folder = Folder::new().with("a.exr", exr_of(color, chromaticities)).scene(scene);
        let loaded = folder.load(&bare()).unwrap();
        assert_eq!(warnings(&loaded), Vec::<String>::new());
        let texel = loaded.scene.images[0].texel(1, 1).truncate();
        assert!((texel - expected).abs().max_element() < 2e-3, "{texel} {expected}");
        // In a picture from the command line white stays white.
        let bare = Folder::new().with("a.exr", exr_of([1.0; 3], chromaticities)).scene("");
        let environment = Some(bare.path().with_file_name("a.exr"));
        let loaded = bare.load(&bottega_scene::LoadOptions { environment, ..crate::mitsuba::support::bare() }).unwrap();
        let texel = loaded.scene.images[0].texel(1, 1).truncate();
        assert!((texel - 1.0).abs().max_element() < 1e-4, "{texel}");
    }
}

#[test]
fn a_texture_that_reflects_more_than_it_receives_is_reported() {
    let numbers = [0.5f32, 0.5, 0.5, 1.5, 0.5, 0.5].map(f32::to_le_bytes).concat();
    let scene = "<shape type='rectangle'><bsdf type='diffuse'><texture type='bitmap' name='reflectance'>
        <string name='filename' value='a.pfm'/></texture></bsdf></shape><emitter type='constant'/>";
    let folder = Folder::new().with("a.pfm", [&b"PF\n2 1\n-1\n"[..], &numbers].concat()).scene(scene);
    let warnings = warnings(&folder.load(&bare()).unwrap());
    assert!(warnings.len() == 1 && warnings[0].contains("a.pfm") && warnings[0].contains("up to 1.5"), "{warnings:?}");
}

#[test]
fn a_sun_too_bright_for_its_file_is_reported_and_stays_bright() {
    let numbers = [5.0f32, 2.0, 1.0, f32::INFINITY, f32::NAN, 3.0].map(f32::to_le_bytes).concat();
    let scene = "<emitter type='envmap'><string name='filename' value='a.pfm'/></emitter>";
    let folder = Folder::new().with("a.pfm", [&b"PF\n2 1\n-1\n"[..], &numbers].concat()).scene(scene);
    let loaded = folder.load(&bare()).unwrap();
    let warnings = warnings(&loaded);
    assert!(warnings.len() == 1 && warnings[0].contains("a.pfm") && warnings[0].contains("infinite"), "{warnings:?}");
    assert_eq!(loaded.scene.images[0].texel(1, 0).truncate(), Vec3::new(5.0, 0.0, 3.0));
}

#[test]
fn an_environment_ends_at_the_poles() {
    let numbers = [1.0f32, 2.0].map(f32::to_le_bytes).concat();
    let folder = Folder::new().with("a.pfm", [&b"Pf\n1 2\n-1\n"[..], &numbers].concat()).scene(
        "<emitter type='envmap'><string name='filename' value='a.pfm'/><float name='scale' value='3'/></emitter>",
    );
    let loaded = folder.load(&bare()).unwrap();
    assert_eq!(warnings(&loaded), Vec::<String>::new());
    let environment = loaded.scene.environment.unwrap();
    assert_eq!(environment.mapping, EnvironmentMapping::LatitudeLongitudeToPoles);
    assert_eq!(environment.factor, Vec3::splat(3.0));
}

#[test]
fn spectra_of_emitters_have_the_color_of_their_line() {
    let radiance = |loaded: &bottega_scene::Loaded| loaded.scene.environment.as_ref().unwrap().factor;
    // Values of Mitsuba 3.9 in scalar_rgb: equal energy is not white.
    let text = "<emitter type='constant'><spectrum name='radiance' value='2'/></emitter>";
    assert!((radiance(&silent(text)) - Vec3::new(2.409_59, 1.896_58, 1.817_83)).length() < 2e-3);
    assert_eq!(radiance(&read_old(text)), Vec3::splat(2.0));
    let text = "<emitter type='constant'><spectrum name='radiance' value='400:1, 500:2, 600:8, 700:9'/></emitter>";
    assert!((radiance(&silent(text)) - Vec3::new(11.0355, 4.287_32, 0.887_223)).length() < 0.02);
    let text = "<emitter type='constant'><spectrum name='radiance' type='d65'><float name='scale' value='3'/></spectrum></emitter>";
    assert_eq!(radiance(&silent(text)), Vec3::splat(3.0));
}

#[test]
fn the_sun_stands_where_the_file_says() {
    // The direction is in world space whatever the sky's rotation, as the brightest direction in Mitsuba 3.9 shows.
    let turned = "<transform name='to_world'><rotate x='1' angle='-90'/></transform>";
    for (version_is_old, direction, more) in
        [(false, "0 0.6 0.8", ""), (false, "0 0.6 0.8", turned), (true, "0.6 0.8 0", "")]
    {
        let text = format!("<emitter type='sunsky'><vector name='sun_direction' value='{direction}'/>{more}</emitter>");
        let loaded = if version_is_old { read_old(&text) } else { read(&text) };
        assert_eq!(warnings(&loaded).len(), usize::from(version_is_old), "{:?}", warnings(&loaded));
        let environment = loaded.scene.environment.as_ref().unwrap();
        let image = &loaded.scene.images[environment.image.unwrap().0 as usize];
        let (width, height) = image.size();
        let mut brightest = (0.0, Vec3::ZERO);
        for y in 0..height {
            for x in 0..width {
                let (u, v) = ((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
                let (azimuth, polar) = ((u - 0.5) * std::f32::consts::TAU, v * std::f32::consts::PI);
                // The layout of environment pictures: −z in the middle, u towards +x.
                let local = Vec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos());
                let value = image.texel(x, y).y;
                if value > brightest.0 {
                    brightest = (value, environment.world_from_environment * local);
                }
            }
        }
        let expected = if version_is_old { Vec3::new(0.6, 0.8, 0.0) } else { Vec3::new(0.0, 0.6, 0.8) };
        assert!(brightest.1.dot(expected) > 0.9999, "{brightest:?}");
    }
}

#[test]
fn the_default_sun_is_that_of_mitsuba() {
    let loaded = read("<emitter type='sun'/>");
    let environment = loaded.scene.environment.as_ref().unwrap();
    let image = &loaded.scene.images[environment.image.unwrap().0 as usize];
    let (width, height) = image.size();
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let (x, y) = texels.max_by(|a, b| image.texel(a.0, a.1).y.total_cmp(&image.texel(b.0, b.1).y)).unwrap();
    let (azimuth, polar) = (
        ((x as f32 + 0.5) / width as f32 - 0.5) * std::f32::consts::TAU,
        (y as f32 + 0.5) / height as f32 * std::f32::consts::PI,
    );
    let local = Vec3::new(polar.sin() * azimuth.sin(), polar.cos(), -polar.sin() * azimuth.cos());
    // Mitsuba 3.9: Tokyo in July, at three in the afternoon.
    let expected = Vec3::new(0.051_385, 0.691_748, 0.720_308);
    let angle = (environment.world_from_environment * local).angle_between(expected).to_degrees();
    assert!(angle < 1.0, "{angle}°");
}

#[test]
fn a_second_environment_is_reported() {
    let loaded = read("<emitter type='constant'/><emitter type='constant'/>");
    assert!(warnings(&loaded)[0].contains("second environment"), "{:?}", warnings(&loaded));
}
