//! Options of photon mapping: directions of gathering rays, separate maps, and kinds of light.

use std::sync::Arc;

use bottega_hra::{Hra, HraConfig, VirtualCpu};
use bottega_render::{PathSettings, PhotonSettings, PrepareOptions, PreparedScene, RenderWork, photon::cast_photons};
use bottega_scene::{Material, Scene};
use glam::Vec3;

use crate::render::{
    agents::around_a_corner,
    photon_scenes::{SIZE, by_photons, closed_room, cornell_known, distance, few, many_things_known, mean_of_seeds},
    scenes::{Subject, add_room, camera, cornell, matte, mean_color, paint, prepare},
};

fn by_surfaces() -> PhotonSettings {
    PhotonSettings { gather_directions: false, ..few() }
}

#[test]
fn rays_sent_where_light_comes_from_leave_the_mean() {
    let corner = prepare(around_a_corner());
    for (name, scene) in
        [("many things", &many_things_known().scene), ("cornell", &cornell_known().scene), ("corner", &corner)]
    {
        let [expected, found] =
            [by_surfaces(), few()].map(|photons| mean_of_seeds(scene, 24, |seed| by_photons(photons, seed, 24)));
        let distance = distance(found, expected, 0.0);
        assert!(found != expected, "{name}: no ray is sent anywhere");
        assert!(distance < 4.0, "{name}: {found:?} {expected:?}, {distance}");
    }
}

#[test]
fn a_closed_room_that_shines_is_as_bright_as_its_albedo_says() {
    let mut scene = Scene { cameras: vec![camera(Vec3::ZERO, Vec3::NEG_Z, 1.2)], ..Scene::default() };
    let albedo = Vec3::new(0.5, 0.3, 0.1);
    let glowing = Material { emission: Vec3::ONE.into(), ..matte(albedo) };
    add_room(&mut scene, Vec3::ONE, &glowing);
    let scene = prepare(scene);
    let expected = Vec3::ONE / (Vec3::ONE - albedo);
    for photons in [
        few(),
        by_surfaces(),
        PhotonSettings { separate_maps: true, ..few() },
        PhotonSettings { separate_maps: true, irradiance_cache: 0.2, ..few() },
    ] {
        let photons = PhotonSettings { count: 60_000, ..photons };
        let (found, _) = mean_of_seeds(&scene, 4, |seed| by_photons(photons, seed, 4));
        let off = (found / expected - 1.0).abs().max_element();
        assert!(off < 0.01, "{photons:?}: {found} {expected}");
    }
}

#[test]
fn maps_that_are_kept_apart_show_the_same() {
    for (name, scene) in [("many things", &many_things_known().scene), ("cornell", &cornell_known().scene)] {
        let found = |photons| mean_of_seeds(scene, 16, |seed| by_photons(photons, seed, 16));
        let (expected, apart) = (found(few()), found(PhotonSettings { separate_maps: true, ..few() }));
        assert!(apart != expected, "{name}: the maps are not used");
        let distance = distance(apart, expected, 0.012);
        assert!(distance < 4.0, "{name}: {apart:?} {expected:?}, {distance}");
    }
}

#[test]
fn without_indirect_light_there_is_direct_light_and_caustics() {
    let direct = |seed| PathSettings { seed, max_depth: 1, guiding: false, ..PathSettings::default() };
    let alone = |seed| by_photons(PhotonSettings { indirect: false, ..few() }, seed, 32);
    // No mirror and no glass: no caustic.
    let room = prepare(closed_room(false));
    let (found, expected) = (mean_of_seeds(&room, 32, alone), mean_of_seeds(&room, 64, direct));
    assert!(distance(found, expected, 0.002) < 4.0, "{found:?} {expected:?}");
    let things = &many_things_known().scene;
    let whole = mean_of_seeds(things, 32, |seed| by_photons(few(), seed, 32)).0;
    let (found, expected) = (mean_of_seeds(things, 32, alone).0, mean_of_seeds(things, 32, direct).0);
    assert!(found.cmpgt(expected * 1.02).all() && found.cmplt(whole * 0.95).all(), "{found} {expected} {whole}");
}

#[test]
fn the_allocator_makes_the_same_maps() {
    let room = Arc::new(cornell());
    let settings = by_photons(PhotonSettings { separate_maps: true, shadow_photons: true, ..few() }, 5, 2);
    let painted = |cast: bool| {
        let scene = Subject::new(PreparedScene::new(Arc::clone(&room), &PrepareOptions::default()).unwrap());
        if cast {
            let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(2, RenderWork::perform));
            cast_photons(&scene.scene, &scene.prepass, &scene.view(SIZE), &settings, &hra.client(), None).unwrap();
        }
        let tile = paint(&scene, SIZE, 2, settings);
        (tile.sums().to_vec(), mean_color(&tile))
    };
    assert_eq!(painted(true), painted(false));
}
