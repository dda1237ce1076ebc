//! Cameras, films and maximum path depths.

use bottega_scene::{Camera, Clip, FilmFilter, FovAxis, PhotonHints, Projection, TransportPaths};
use glam::{Vec2, Vec3};

use crate::mitsuba::support::{read, read_old, refuse, silent, warnings};

/// The direction in which a camera looks at a point of the picture, (0, 0) in its upper left corner; world space.
fn direction(camera: &Camera, at: Vec2) -> Vec3 {
    let Projection::Perspective { vertical_fov } = camera.projection else { panic!() };
    let tan = (0.5 * vertical_fov).tan();
    let ndc = Vec2::new(2.0 * at.x - 1.0, 1.0 - 2.0 * at.y) - camera.lens_shift;
    let local = Vec3::new(ndc.x * tan * camera.aspect.unwrap(), ndc.y * tan, -1.0);
    camera.world_from_camera.transform_vector3(local)
}

/// Rays of Mitsuba 3.9 for a film of 200 × 100 and a field of view of 90°, divided by their z.
#[test]
fn rays_are_those_of_mitsuba() {
    let film = "<film type='hdrfilm'><integer name='width' value='200'/><integer name='height' value='100'/></film>";
    let cases = [
        ("<float name='fov' value='90'/>", Vec2::ZERO, Vec2::new(1.0, 0.5)),
        ("<float name='fov' value='90'/>", Vec2::X, Vec2::new(-1.0, 0.5)),
        ("<float name='fov' value='90'/><string name='fov_axis' value='y'/>", Vec2::ONE, Vec2::new(-2.0, -1.0)),
        (
            "<float name='fov' value='90'/><string name='fov_axis' value='diagonal'/>",
            Vec2::ZERO,
            Vec2::new(0.8944, 0.4472),
        ),
        ("<string name='focal_length' value='50mm'/>", Vec2::ZERO, Vec2::new(0.387, 0.1935)),
        ("", Vec2::ONE, Vec2::new(-0.387, -0.1935)),
        (
            "<float name='fov' value='90'/><float name='principal_point_offset_x' value='0.1'/>",
            Vec2::ZERO,
            Vec2::new(0.8, 0.5),
        ),
        (
            "<float name='fov' value='90'/><float name='principal_point_offset_y' value='0.1'/>",
            Vec2::ONE,
            Vec2::new(-1.0, -0.6),
        ),
    ];
    for (properties, at, expected) in cases {
        let loaded = silent(&format!("<sensor type='perspective'>{properties}{film}</sensor>"));
        let camera = &loaded.scene.cameras[0];
        let axis = match properties {
            _ if properties.contains("'y'") => FovAxis::Y,
            _ if properties.contains("diagonal") || !properties.contains("'fov'") => FovAxis::Diagonal,
            _ => FovAxis::X,
        };
        assert_eq!(camera.fov_axis, axis, "{properties}");
        let d = direction(camera, at);
        assert!((d.truncate() / d.z - expected).length() < 1e-3 && d.z > 0.0, "{properties} {at}: {d}");
    }
}

#[test]
fn cameras_stand_where_they_look_from() {
    let loaded = silent(
        "<sensor type='thinlens'><float name='fov' value='40'/><float name='aperture_radius' value='0.25'/><float name='focus_distance' value='3'/><transform name='to_world'><lookat origin='0 0 5' target='0 0 0' up='0 1 0'/></transform></sensor>",
    );
    let camera = &loaded.scene.cameras[0];
    assert_eq!(camera.world_from_camera.transform_point3(Vec3::ZERO), Vec3::Z * 5.0);
    assert!(camera.world_from_camera.transform_vector3(Vec3::NEG_Z).abs_diff_eq(Vec3::NEG_Z, 1e-6));
    assert!(camera.world_from_camera.transform_vector3(Vec3::X).abs_diff_eq(Vec3::X, 1e-6));
    assert_eq!((camera.lens_radius, camera.focus_distance), (0.25, 3.0));
    let loaded = silent(
        "<sensor type='orthographic'><transform name='to_world'><scale x='3' y='2'/></transform><film type='hdrfilm'><integer name='width' value='200'/><integer name='height' value='100'/></film></sensor>",
    );
    let camera = &loaded.scene.cameras[0];
    assert_eq!(camera.projection, Projection::Orthographic { height: 2.0 });
    assert_eq!((camera.aspect, camera.pixel_aspect, camera.fov_axis), (Some(2.0), 1.5, FovAxis::X));
}

#[test]
fn film_and_integrator_become_hints() {
    let loaded = silent(
        "<integrator type='path'><integer name='max_depth' value='6'/><integer name='rr_depth' value='5'/></integrator>
         <sensor type='perspective'><sampler type='multijitter'><integer name='sample_count' value='36'/></sampler>
         <film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='32'/>
            <integer name='crop_offset_x' value='1'/><integer name='crop_offset_y' value='2'/>
            <integer name='crop_width' value='3'/><integer name='crop_height' value='4'/><rfilter type='box'/></film></sensor>",
    );
    let hints = &loaded.hints;
    assert_eq!((hints.resolution, hints.crop), (Some([64, 32]), Some([1, 2, 3, 4])));
    assert_eq!((hints.samples, hints.max_depth), (Some(36), Some(5)));
    assert_eq!(hints.filter, Some(FilmFilter::Box { radius: 0.5 }));
    assert_eq!(silent("<integrator type='volpath'/>").hints.max_depth, Some(u32::MAX));
    assert_eq!(silent("<integrator type='direct'/>").hints.max_depth, Some(1));
    let filter = silent("<sensor type='perspective'><film type='hdrfilm'/></sensor>").hints.filter;
    assert_eq!(filter, Some(FilmFilter::Gaussian { radius: 2.0, sigma: 0.5 }));
    for (format, alpha) in [("rgba", true), ("luminance_alpha", true), ("rgb", false), ("luminance", false)] {
        let film = format!("<film type='hdrfilm'><string name='pixel_format' value='{format}'/></film>");
        let loaded = read(&format!("<sensor type='perspective'>{film}</sensor>"));
        assert_eq!(
            (loaded.hints.alpha, warnings(&loaded).len()),
            (alpha, usize::from(format.contains("lum"))),
            "{format}"
        );
    }
    let loaded = read(
        "<integrator type='bdpt'/><sensor type='perspective'><film type='hdrfilm'><rfilter type='lanczos'/></film></sensor>",
    );
    assert_eq!(warnings(&loaded).len(), 1, "{:?}", warnings(&loaded));
}

#[test]
fn integrators_say_from_where_they_follow_light() {
    let paths = TransportPaths::Paths { is_ours: true };
    let cases = [
        ("path", paths),
        ("volpath", paths),
        ("direct", paths),
        ("prb", TransportPaths::Paths { is_ours: false }),
        ("bdpt", TransportPaths::BothEnds),
        ("mlt", TransportPaths::BothEnds),
        ("ptracer", TransportPaths::BothEnds),
        ("ppm", TransportPaths::Photons(PhotonHints::default())),
    ];
    for (name, follows) in cases {
        let hint = silent(&format!("<integrator type='{name}'/>")).hints.integrator.expect(name);
        assert_eq!((hint.name.as_str(), hint.place.as_str(), hint.follows), (name, "scene.xml:2:1", follows));
    }
    assert_eq!(silent("").hints.integrator, None);
    assert_eq!(warnings(&read("<integrator type='depth'/>")).len(), 1);
    let old = read_old(
        "<integrator type='sppm'><integer name='maxDepth' value='5'/><integer name='photonCount' value='7000'/>
         <float name='initialRadius' value='0.25'/><integer name='maxPasses' value='12'/></integrator>",
    );
    let hints = PhotonHints { count: Some(7000), radius: Some(0.25), ..PhotonHints::default() };
    assert_eq!(warnings(&old), Vec::<String>::new());
    assert_eq!(old.hints.integrator.map(|hint| hint.follows), Some(TransportPaths::Photons(hints)));
    assert_eq!((old.hints.samples, old.hints.max_depth), (Some(12), Some(4)));
    let old = read_old(
        "<integrator type='photonmapper'><integer name='globalPhotons' value='9000'/><integer name='lookupSize' value='80'/>
         <float name='globalLookupRadius' value='0.03'/></integrator>",
    );
    let hints = PhotonHints { radius_share: Some(0.03), gather: Some(80), ..PhotonHints::default() };
    assert_eq!(warnings(&old), Vec::<String>::new());
    assert_eq!(old.hints.integrator.map(|hint| hint.follows), Some(TransportPaths::Photons(hints)));
}

#[test]
fn projective_sensors_have_clip_planes() {
    for sensor in ["perspective", "thinlens", "orthographic"] {
        let clip =
            |properties: &str| silent(&format!("<sensor type='{sensor}'>{properties}</sensor>")).scene.cameras[0].clip;
        assert_eq!(clip(""), Clip { near: 0.01, far: 10_000.0 });
        let planes = "<float name='near_clip' value='2.5'/><float name='far_clip' value='100'/>";
        assert_eq!(clip(planes), Clip { near: 2.5, far: 100.0 });
        let loaded = read_old(&format!("<sensor type='{sensor}'><float name='nearClip' value='2.5'/></sensor>"));
        assert_eq!(loaded.scene.cameras[0].clip.near, 2.5);
        for planes in ["<float name='near_clip' value='0'/>", "<float name='far_clip' value='0.005'/>"] {
            assert!(refuse(&format!("<sensor type='{sensor}'>{planes}</sensor>")).contains("clip"), "{planes}");
        }
    }
}

#[test]
fn emitters_can_be_hidden_from_all_sensors() {
    let text =
        "<sensor type='perspective'/><integrator type='path'><boolean name='hide_emitters' value='true'/></integrator>
        <sensor type='orthographic'/>";
    assert!(silent(text).scene.cameras.iter().all(|camera| camera.hides_emitters));
    assert!(!silent("<sensor type='perspective'/><integrator type='path'/>").scene.cameras[0].hides_emitters);
}
