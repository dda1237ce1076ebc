//! The extent of the visible part of a scene, the unit of lengths for photons and agents.
//!
//! A room on a terrain, or a ball on a plain, is small compared with the scene. Where the visible part is a quarter of
//! the scene or more, the scene itself is the unit.

use glam::Vec3;

use super::lookouts::places_seen;
use crate::{extent::Extent, prepare::PreparedScene, settings::View};

/// Camera rays along a side of the picture.
const SIDE: u32 = 32;
/// The radius, relative to the median distance from the center.
const MARGIN: f32 = 2.0;
/// Least ratio of the scene's radius to the visible radius for the latter to count.
const WIDE: f32 = 4.0;

impl Extent {
    /// Returns the extent of the region that a view shows.
    pub(crate) fn of_view(prepared: &PreparedScene, view: &View) -> Self {
        let whole = Self::whole(prepared);
        let Some((center, median)) =
            middle(&places_seen(prepared, view, SIDE).iter().map(|it| it.p).collect::<Vec<_>>())
        else {
            return whole;
        };
        let radius = MARGIN * median;
        if radius > 0.0 && WIDE * radius < whole.radius { Self { center, radius, whole: whole.radius } } else { whole }
    }
}

/// Returns the component-wise median of some points, and the median distance from it.
fn middle(places: &[Vec3]) -> Option<(Vec3, f32)> {
    let median = |mut values: Vec<f32>| {
        values.sort_by(f32::total_cmp);
        values.get(values.len() / 2).copied()
    };
    let along = |axis: usize| median(places.iter().map(|p| p[axis]).collect());
    let center = Vec3::new(along(0)?, along(1)?, along(2)?);
    Some((center, median(places.iter().map(|p| p.distance(center)).collect())?))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bottega_scene::{Camera, Light, LightKind, Material, Mesh, Projection, Scene};
    use glam::Affine3A;

    use super::*;
    use crate::{
        photon::{PhotonMaps, lookouts::Lookout},
        prepare::PrepareOptions,
        prepass::Prepass,
        settings::PhotonSettings,
    };

    fn view(prepared: &PreparedScene) -> View {
        View::of_scene(prepared.scene(), 0, 48, 48).unwrap()
    }

    fn of(prepared: &PreparedScene) -> Extent {
        Extent::of_view(prepared, &view(prepared))
    }

    fn prepared(scene: Scene) -> PreparedScene {
        PreparedScene::new(Arc::new(scene), &PrepareOptions::default()).unwrap()
    }

    fn camera(at: Vec3, down: f32) -> Camera {
        let world_from_camera = Affine3A::from_translation(at) * Affine3A::from_rotation_x(-down);
        Camera { world_from_camera, projection: Projection::Perspective { vertical_fov: 1.0 }, ..Camera::default() }
    }

    fn add(scene: &mut Scene, mut mesh: Mesh) {
        mesh.material = scene.push_material(Material::matte(Vec3::splat(0.7)));
        scene.push_surface(mesh);
    }

    /// A room with a light, alone or on a ground that reaches far.
    fn room(ground: Option<f32>) -> PreparedScene {
        let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 0.0, 2.9), 0.0)], ..Scene::default() };
        add(&mut scene, Mesh::cuboid(Vec3::splat(-3.0), Vec3::splat(3.0)));
        if let Some(half) = ground {
            let corner = Vec3::new(-half, -3.01, half);
            add(&mut scene, Mesh::quad(corner, Vec3::X * 2.0 * half, Vec3::NEG_Z * 2.0 * half));
        }
        let kind = LightKind::Point { position: Vec3::Y * 2.0, intensity: Vec3::splat(40.0) };
        scene.lights.push(Light::new("", kind));
        prepared(scene)
    }

    #[test]
    fn the_extent_is_that_of_visible_surfaces() {
        let alone = of(&room(None));
        assert!(alone.is_whole() && alone == Extent::whole(&room(None)));
        assert_eq!(alone.length_at(Vec3::X * 99.0), alone.whole);
        for half in [50.0, 500.0, 5000.0] {
            let extent = of(&room(Some(half)));
            assert!(!extent.is_whole() && extent.radius < 2.0 * alone.radius && extent.radius > 0.5 * alone.radius);
            assert!(extent.center.length() < 4.0, "{extent:?}");
            assert_eq!(extent.length_at(extent.center), 0.5 * extent.radius);
            assert!(
                (extent.length_at(Vec3::X * 40.0) - 20.0).abs() < 3.0 && extent.length_at(Vec3::X * 1e6) > 0.5 * half
            );
        }
        // The view reaches to the horizon, but most of the picture shows near surfaces.
        let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 2.0, 6.0), 0.3)], ..Scene::default() };
        add(&mut scene, Mesh::quad(Vec3::new(-5e3, 0.0, 5e3), Vec3::X * 1e4, Vec3::NEG_Z * 1e4));
        let extent = of(&prepared(scene));
        assert!((2.0..30.0).contains(&extent.radius) && extent.center.length() < 15.0, "{extent:?}");
        // An empty view.
        let mut scene = Scene { cameras: vec![camera(Vec3::ZERO, 0.0)], ..Scene::default() };
        add(&mut scene, Mesh::quad(Vec3::Z * 5.0, Vec3::X, Vec3::Y));
        assert!(of(&prepared(scene)).is_whole());
    }

    #[test]
    fn a_room_costs_no_more_in_a_wide_world() {
        // Photons stored, and photons that lookups at visible points read.
        let work = |scene: &PreparedScene| {
            let settings = PhotonSettings { progressive: true, count: 20_000, ..PhotonSettings::default() };
            let plan = Prepass::default().photon_plan(scene, &view(scene));
            let maps = PhotonMaps::new(scene, &plan, &settings, 0, 0);
            let mut lookups = 0_u64;
            for Lookout { p, .. } in places_seen(scene, &view(scene), SIDE) {
                maps.seen.within(p, maps.reach_at(p).powi(2), |_, _| lookups += 1);
            }
            (maps.seen.len() as f64, lookups as f64)
        };
        let alone = work(&room(None));
        for half in [50.0, 500.0, 5000.0] {
            let wide = work(&room(Some(half)));
            assert!(wide.0 < 2.0 * alone.0 && wide.1 < 2.0 * alone.1, "{half}: {wide:?} {alone:?}");
            assert!(wide.1 > 0.1 * alone.1, "{half}: {wide:?} {alone:?}");
        }
    }

    #[test]
    fn photons_of_a_sun_reach_visible_surfaces() {
        let arrived = |half: f32| {
            let mut scene = Scene { cameras: vec![camera(Vec3::new(0.0, 2.0, 6.0), 0.3)], ..Scene::default() };
            add(&mut scene, Mesh::quad(Vec3::new(-half, 0.0, half), Vec3::X * 2.0 * half, Vec3::NEG_Z * 2.0 * half));
            let kind = LightKind::Directional { direction: Vec3::NEG_Y, irradiance: Vec3::ONE, angle: 0.0 };
            scene.lights.push(Light::new("", kind));
            let scene = prepared(scene);
            let (plan, settings) = (Prepass::default().photon_plan(&scene, &view(&scene)), PhotonSettings::default());
            let tracer = crate::photon::tracer(&scene, &plan, &settings, 0, 0);
            let direct = crate::photon::traced(tracer, 20_000).direct;
            let Extent { center, radius, .. } = *plan.extent();
            let near = direct.iter().filter(|photon| photon.p.distance(center) < radius);
            let (count, power) = near.fold((0.0, 0.0), |(n, sum), photon| (n + 1.0, sum + photon.mark().power().x));
            (count / 20_000.0, power / 20_000.0 / (std::f32::consts::PI * radius * radius))
        };
        for half in [50.0, 500.0, 5000.0] {
            let (share, irradiance) = arrived(half);
            assert!(share > 0.2, "{half}: {share}");
            assert!((irradiance - 1.0).abs() < 0.05, "{half}: {irradiance}");
        }
    }
}
