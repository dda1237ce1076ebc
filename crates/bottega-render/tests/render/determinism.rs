//! A pixel depends on scene, settings and seed, and on nothing else.

use std::sync::Arc;

use bottega_hra::{Hra, HraConfig, VirtualCpu, WorkUnit};
use bottega_image::{Aov, Layout, Rect, Tile};
use bottega_render::{BlockWork, PathSettings, RenderOutput, RenderWork, View};
use bottega_scene::{AlphaMode, Material, Scene};
use glam::Vec3;
use proptest::prelude::*;

use crate::render::scenes::{Subject, add_quad, camera, cornell, matte, prepare};

const SIZE: (u32, u32) = (20, 15);

fn scene() -> Subject {
    let mut scene = cornell();
    let veil = Material { alpha_mode: AlphaMode::Blend, opacity: 0.4.into(), ..matte(Vec3::splat(0.5)) };
    add_quad(&mut scene, Vec3::new(-0.5, -0.5, 0.8), Vec3::X, Vec3::Y, veil);
    prepare(scene)
}

fn block(scene: &Subject, tile: Tile, samples: std::ops::Range<u32>, seed: u64) -> BlockWork {
    scene.block(&scene.view(SIZE), PathSettings { seed, light_samples: 2, ..PathSettings::default() }, tile, samples)
}

fn empty(rect: Rect) -> Tile {
    Tile::new(rect, Layout::new(Aov::ALL.into_iter().collect()))
}

fn whole(scene: &Subject, spp: u32, seed: u64) -> Tile {
    block(scene, empty(Rect::of_size(SIZE.0, SIZE.1)), 0..spp, seed).perform().unwrap().tile
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]
    #[test]
    fn any_cut_into_passes_and_rectangles_ends_with_the_same_bits(
        x0 in 0_u32..20, y0 in 0_u32..15, width in 1_u32..20, height in 1_u32..15, cuts in prop::collection::vec(0_u32..12, 0..4),
    ) {
        let scene = scene();
        let expected = whole(&scene, 12, 7);
        let rect = Rect::new(x0, y0, (x0 + width).min(20), (y0 + height).min(15));
        let mut cuts = cuts;
        cuts.extend([0, 12]);
        cuts.sort_unstable();
        let mut tile = empty(rect);
        for range in cuts.windows(2) {
            tile = block(&scene, tile, range[0]..range[1], 7).perform().unwrap().tile;
        }
        for (x, y) in rect.pixels() {
            prop_assert_eq!(tile.pixel(x, y), expected.pixel(x, y));
        }
    }
}

#[test]
fn another_camera_needs_no_other_preparation() {
    let scene = scene();
    let own = whole(&scene, 2, 5);
    let other = camera(Vec3::new(0.4, 0.3, 2.5), Vec3::new(0.1, -0.2, 0.0), 0.8);
    let view = View { camera: Arc::new(other.clone()), width: SIZE.0, height: SIZE.1 };
    let seen = |scene: &Subject, view: &View| {
        let work = BlockWork { view: view.clone(), ..block(scene, empty(own.rect()), 0..2, 5) };
        work.perform().unwrap().tile
    };
    let prepared_for_it = prepare(Scene { cameras: vec![other], ..(**scene.scene.scene()).clone() });
    let found = seen(&scene, &view);
    assert!(found.sums() != own.sums());
    assert_eq!(found.sums(), whole(&prepared_for_it, 2, 5).sums());
    // The scene shows its own camera as before
    assert_eq!(whole(&scene, 2, 5).sums(), own.sums());
}

#[test]
fn lanes_of_the_allocator_paint_the_same_bits() {
    let scene = scene();
    let expected = whole(&scene, 4, 3);
    for lanes in [1, 3] {
        let hra = Hra::new(HraConfig::default(), VirtualCpu::lanes(lanes, RenderWork::perform));
        let client = hra.client();
        for (ticket, rect) in Rect::of_size(SIZE.0, SIZE.1).blocks(8).enumerate() {
            let work = RenderWork::Block(block(&scene, empty(rect), 0..4, 3));
            client.submit(WorkUnit::new(work, ticket as u64)).unwrap();
        }
        while let Some(completed) = client.take() {
            let Ok(RenderOutput::Block(output)) = completed.output else { panic!("{:?}", completed.output) };
            for (x, y) in output.tile.rect().pixels() {
                assert_eq!(output.tile.pixel(x, y), expected.pixel(x, y));
            }
        }
    }
}

#[test]
fn another_seed_is_another_picture() {
    let scene = scene();
    let (a, b) = (whole(&scene, 2, 1), whole(&scene, 2, 2));
    // Black in both pictures: outside the room.
    let lit: Vec<_> = a.rect().pixels().filter(|&(x, y)| a.pixel(x, y)[0] + b.pixel(x, y)[0] > 0.0).collect();
    let different = lit.iter().filter(|&&(x, y)| a.pixel(x, y)[..3] != b.pixel(x, y)[..3]).count();
    assert!(different * 20 > lit.len() * 19 && lit.len() > 200, "{different} of {}", lit.len());
}
