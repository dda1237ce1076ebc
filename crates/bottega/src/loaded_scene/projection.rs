//! Lens and projection of a request, put into a camera.

use bottega_scene::{Camera, FisheyeMapping, FovAxis, Panorama, Projection, Stereo, StereoLayout};

use crate::{
    error::Error,
    request::{ProjectionChoice, StereoChoice, ViewOptions},
};

/// Changes the lens and the projection of a camera to those of a request.
///
/// # Errors
/// The request asks for a lens, and the camera has lenses of its own or a projection without one.
pub(super) fn put_lens(view: &ViewOptions, camera: &mut Camera) -> Result<(), Error> {
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
    check_lens(view, camera)?;
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
    Ok(())
}

/// Refuses fields of a lens that the camera does not have.
fn check_lens(view: &ViewOptions, camera: &Camera) -> Result<(), Error> {
    let why = match camera.projection {
        Projection::Perspective { .. } if camera.lenses.is_some() => "the camera has lenses of its own",
        Projection::Perspective { .. } | Projection::Orthographic { .. } => return Ok(()),
        Projection::Fisheye { .. } | Projection::Panorama(_) => "its projection has no lens",
    };
    let fields = [
        ("view.lens_radius", view.lens_radius.is_some_and(|radius| radius > 0.0)),
        ("view.blades", view.blades.is_some_and(|blades| blades > 0)),
        ("view.aperture_ratio", view.aperture_ratio.is_some()),
    ];
    match fields.into_iter().find(|(_, is_given)| *is_given) {
        Some((field, _)) => Err(Error::usage(format!("`{field}` has no effect: {why}"), "leave it out")),
        None => Ok(()),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_of_a_lens_that_the_camera_lacks_are_refused() {
        let put = |view: &ViewOptions| put_lens(view, &mut Camera::default()).map_err(|error| error.to_string());
        let bladed = ViewOptions { blades: Some(5), aperture_ratio: Some(2.0), ..ViewOptions::default() };
        assert_eq!(put(&bladed), Ok(()));
        let around = ViewOptions { projection: Some(ProjectionChoice::Fisheye), ..ViewOptions::default() };
        assert_eq!(put(&around), Ok(()));
        let error = put(&ViewOptions { projection: around.projection, ..bladed }).unwrap_err();
        assert!(error.contains("view.blades"), "{error}");
        let sharp = ViewOptions { lens_radius: Some(0.0), focus_distance: Some(1.0), ..around };
        assert_eq!(put(&sharp), Ok(()));
    }
}
