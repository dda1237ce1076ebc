//! Lens and projection of a request, put into a camera.

use bottega_scene::{Camera, FisheyeMapping, FovAxis, Panorama, Projection, Stereo, StereoLayout};

use crate::request::{ProjectionChoice, StereoChoice, ViewOptions};

/// Changes the lens and the projection of a camera to those of a request.
pub(super) fn put_lens(view: &ViewOptions, camera: &mut Camera) {
    camera.lens_radius = view.lens_radius.unwrap_or(camera.lens_radius);
    camera.focus_distance = view.focus_distance.unwrap_or(camera.focus_distance);
    if let Some(blades) = view.blades {
        camera.aperture.blades = blades;
        camera.aperture.rotation = view.blade_rotation.to_radians();
    }
    camera.aperture.ratio = view.aperture_ratio.unwrap_or(camera.aperture.ratio);
    camera.rolling_shutter = view.rolling_shutter.or(camera.rolling_shutter);
    if let Some(choice) = view.projection {
        put_projection(choice, view.fisheye_fov.to_radians(), camera);
    }
    if let Some(choice) = view.stereo {
        let layout = match choice {
            StereoChoice::SideBySide => StereoLayout::SideBySide,
            StereoChoice::TopBottom => StereoLayout::TopBottom,
            StereoChoice::Left => StereoLayout::Left,
            StereoChoice::Right => StereoLayout::Right,
        };
        let convergence = view.convergence.unwrap_or(f32::INFINITY);
        camera.stereo = Some(Stereo { layout, eye_distance: view.eye_distance, convergence });
    }
}

fn put_projection(choice: ProjectionChoice, field_of_view: f32, camera: &mut Camera) {
    let fisheye = |mapping| Projection::Fisheye { mapping, field_of_view, height: 1.0 };
    camera.projection = match choice {
        ProjectionChoice::Equirectangular => Projection::Panorama(Panorama::Equirectangular),
        ProjectionChoice::EqualArea => Projection::Panorama(Panorama::EqualArea),
        ProjectionChoice::Cube => Projection::Panorama(Panorama::Cube),
        ProjectionChoice::Fisheye => fisheye(FisheyeMapping::Equidistant),
        ProjectionChoice::EquisolidFisheye => fisheye(FisheyeMapping::Equisolid),
    };
    // What belongs to the projection of the file
    let usual = Camera::default();
    (camera.aspect, camera.pixel_aspect, camera.fov_axis) = (usual.aspect, usual.pixel_aspect, FovAxis::Smaller);
    (camera.lens_shift, camera.clip, camera.lenses) = (usual.lens_shift, usual.clip, None);
    // A whole circle fits into the smaller side
    if matches!(camera.projection, Projection::Fisheye { .. }) {
        camera.aspect = Some(1.0);
    }
}
