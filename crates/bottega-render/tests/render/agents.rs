//! Pictures by agents have the same mean as pictures without agents, for less work.

use std::{
    collections::BTreeMap,
    sync::{Arc, Condvar, Mutex, OnceLock},
    thread,
};

use bottega_image::{Aov, AovSet, Layout, Rect, Tile};
use bottega_render::{
    AgentUse, Filter, PathSettings, PrepareOptions, PreparedScene, RenderError, Sharing, integrator::learn_together,
};
use bottega_scene::{Environment, Material, Scene};
use glam::Vec3;

use crate::render::scenes::{Subject, add_quad, add_room, add_sphere, camera, cornell, matte, prepare};
use crate::render::strategies::{assert_same_mean, moments};

/// Large enough that there is something to learn from.
const SIDE: u32 = 128;
const SIZE: (u32, u32) = (SIDE, SIDE);

/// Factor on the samples of the reference picture.
const MORE: u32 = 4;

const NOTHING: AgentUse = AgentUse { shadows: false, lights: false, roulette: false };
const ALL: AgentUse = AgentUse { shadows: true, lights: true, roulette: true };

fn settings(agents: AgentUse, seed: u64, planned_samples: u32) -> PathSettings {
    PathSettings { seed, filter: Filter::PIXEL, guiding: false, agents, planned_samples, ..PathSettings::default() }
}

/// Renders a part of the picture, and returns it with its cost.
fn paint(scene: &Subject, settings: &PathSettings, rect: Rect, cuts: &[u32]) -> Tile {
    let mut tile = Tile::new(rect, Layout::new([Aov::Cost].into_iter().collect::<AovSet>()));
    for samples in cuts.windows(2) {
        tile =
            scene.block(&scene.view(SIZE), *settings, tile, samples[0]..samples[1]).perform().expect("a picture").tile;
    }
    tile
}

fn whole(scene: &Subject, settings: &PathSettings, spp: u32) -> Tile {
    paint(scene, settings, Rect::of_size(SIDE, SIDE), &[0, spp])
}

/// Mean over blocks of pixels of their variance, relative to the mean of both pictures there, which counts as at least a twentieth of the
/// mean of all.
fn noises(a: &Tile, b: &Tile) -> [f64; 2] {
    let all = moments(a, &a.rect()).0;
    let blocks: Vec<Rect> = a.rect().blocks(4).collect();
    let relative = |tile: &Tile, block: &Rect| {
        let shown = (0.5 * (moments(a, block).0 + moments(b, block).0)).max(0.05 * all);
        moments(tile, block).1 / (shown * shown)
    };
    [a, b].map(|tile| blocks.iter().map(|block| relative(tile, block)).sum::<f64>() / blocks.len() as f64)
}

/// Steps of a sample through the scene, and the cost of its rays towards lights.
fn work(tile: &Tile) -> f64 {
    let offset = tile.layout().offset(Aov::Cost).expect("the cost layer");
    tile.rect().pixels().map(|(x, y)| f64::from(tile.pixel(x, y)[offset])).sum()
}

/// Renders a picture with agents and one without, see [`held_to`].
fn compared(what: &str, scene: Scene, agents: AgentUse, spp: u32) -> (f64, f64) {
    let scene = prepare(scene);
    let helped = whole(&scene, &settings(agents, 1, spp), spp);
    held_to(what, &helped, &plain(&scene, spp))
}

/// The picture without agents, with more samples: where light is rare, few samples underestimate their own variance.
fn plain(scene: &Subject, spp: u32) -> Tile {
    whole(scene, &settings(NOTHING, 2, spp), MORE * spp)
}

/// Two pictures have the same mean everywhere. Returns noise and work of the one with agents over those of the other.
fn held_to(what: &str, helped: &Tile, plain: &Tile) -> (f64, f64) {
    assert_same_mean(what, helped, plain);
    let [with, without] = noises(helped, plain);
    let more = f64::from(MORE);
    let (noise, work) = (with / (more * without), work(helped) * more / work(plain));
    eprintln!("{what}: noise {noise:.3}, work {work:.3}");
    (noise, work)
}

/// A room with small lamps all over its ceiling, most of them above a sheet that blocks their light, and a sky that is not
/// visible.
pub(crate) fn lamps(along: [u32; 2]) -> Scene {
    let mut scene =
        Scene { cameras: vec![camera(Vec3::new(-1.6, 0.0, 1.8), Vec3::new(0.0, -0.6, -1.0), 1.0)], ..Scene::default() };
    let white = matte(Vec3::splat(0.4));
    add_room(&mut scene, Vec3::new(2.0, 1.0, 2.0), &white);
    add_quad(&mut scene, Vec3::new(-1.2, 0.9, -2.0), Vec3::X * 3.2, Vec3::Z * 4.0, white.clone());
    add_quad(&mut scene, Vec3::new(-0.9, -0.2, -1.2), Vec3::X * 0.5, Vec3::Z * 0.5, white);
    let [columns, rows] = along;
    for i in 0..columns * rows {
        let at = |i: u32, count: u32| 3.6 * (i as f32 + 0.5) / count as f32 - 1.8;
        let corner = Vec3::new(at(i % columns, columns), 0.98, at(i / columns, rows));
        let lamp = Material::emitter(Vec3::splat(2000.0 / (columns * rows) as f32));
        add_quad(&mut scene, corner, Vec3::X * 0.05, Vec3::Z * 0.05, lamp);
    }
    scene.environment = Some(Environment::uniform(Vec3::splat(0.5)));
    scene
}

/// Alone, each use of agents may pay or not, as the trial decides. Together they pay, see below.
#[test]
fn neither_shadows_nor_roulette_alone_are_a_loss() {
    let shadows = AgentUse { shadows: true, ..NOTHING };
    let roulette = AgentUse { roulette: true, ..NOTHING };
    let of_shadows = compared("shadows", lamps([5, 2]), shadows, 32);
    let helped = whole(&prepare(around_a_corner()), &settings(roulette, 1, 32), 32);
    let of_roulette = held_to("roulette", &helped, plain_around_a_corner());
    for (what, (noise, work)) in [("shadows", of_shadows), ("roulette", of_roulette)] {
        assert!(noise * work < 1.05, "{what}: {noise} {work}");
    }
}

#[test]
fn of_many_lights_those_are_chosen_that_are_seen() {
    let agents = AgentUse { lights: true, ..NOTHING };
    let (noise, work) = compared("lights", lamps([20, 10]), agents, 64);
    assert!(noise < 0.6 && work < 1.1, "{noise} {work}");
}

/// A room that is lit through a gap beside a screen, with a ball of glass in it.
pub(crate) fn around_a_corner() -> Scene {
    let mut scene =
        Scene { cameras: vec![camera(Vec3::new(-1.6, 0.0, 1.8), Vec3::new(-1.0, 0.0, -2.0), 1.0)], ..Scene::default() };
    let white = matte(Vec3::splat(0.75));
    add_room(&mut scene, Vec3::new(2.0, 1.0, 2.0), &white);
    add_quad(&mut scene, Vec3::new(0.9, -1.0, -2.0), Vec3::Y * 2.0, Vec3::Z * 3.4, white);
    let lamp = Material::emitter(Vec3::splat(300.0));
    add_quad(&mut scene, Vec3::new(1.3, 0.99, -0.5), Vec3::X * 0.2, Vec3::Z * 0.2, lamp);
    add_sphere(&mut scene, Vec3::new(-1.0, -0.6, 0.0), 0.4, crate::render::scenes::glass());
    scene
}

/// The room is rendered once for all tests.
fn plain_around_a_corner() -> &'static Tile {
    static PLAIN: OnceLock<Tile> = OnceLock::new();
    PLAIN.get_or_init(|| plain(&prepare(around_a_corner()), 32))
}

/// Counted work instead of time, so the result is the same on every machine.
#[test]
fn a_picture_uses_the_guide_only_where_it_pays() {
    let of = |agents, seed| PathSettings { guiding: agents == ALL, ..settings(agents, seed, 32) };
    let calm = prepare(cornell());
    let part = Rect::new(20, 20, 84, 84);
    let [with_agents, plain] = [ALL, NOTHING].map(|agents| paint(&calm, &of(agents, 1), part, &[0, 4]));
    assert!(with_agents == plain, "where paths agree, the picture is that without a guide, bit for bit");
    let rare = prepare(around_a_corner());
    let helped = whole(&rare, &of(ALL, 1), 32);
    let (noise, work) = held_to("rare light", &helped, plain_around_a_corner());
    assert!(noise * work < 0.9, "{noise} {work}");
}

#[test]
fn all_of_it_in_a_room_with_glass() {
    let scene = prepare(cornell());
    let guided = PathSettings { guiding: true, ..settings(ALL, 1, 32) };
    let helped = whole(&scene, &guided, 32);
    assert_same_mean("all", &helped, &whole(&scene, &settings(NOTHING, 2, 32), 32));
}

#[test]
fn the_same_bits_however_the_work_is_cut_and_whoever_learnt() {
    let by = |threads| {
        let options = PrepareOptions { threads, compensate_environment: true };
        Subject::new(PreparedScene::new(Arc::new(around_a_corner()), &options).expect("a sound scene"))
    };
    let settings = PathSettings { guiding: true, ..settings(ALL, 3, 32) };
    let (one, three) = (by(1), by(3));
    let expected = whole(&one, &settings, 4);
    let learnt = one.prepass.learnt(&one.scene, &one.view(SIZE), &settings).expect("it was painted");
    let received = by(1);
    received.prepass.learn_from(&received.scene, &received.view(SIZE), &settings, &learnt).expect("what was learnt");
    assert!(received.prepass.learnt(&received.scene, &received.view(SIZE), &settings).as_ref() == Some(&learnt));
    assert!(whole(&one, &PathSettings { agents: NOTHING, ..settings }, 4) != expected);
    for scene in [&three, &received] {
        for (x0, y0, side) in [(0, 0, 37), (58, 61, 38), (40, 75, 5)] {
            let part = paint(scene, &settings, Rect::new(x0, y0, x0 + side, y0 + side.min(SIDE - y0)), &[0, 1, 3, 4]);
            for (x, y) in part.rect().pixels() {
                assert_eq!(part.pixel(x, y), expected.pixel(x, y));
            }
        }
    }
}

/// The result of each part of each stage.
type StageResults = (Mutex<BTreeMap<(u32, u32), Vec<u8>>>, Condvar);

/// One of two machines; each does every other part. The second one's answer for its first part is truncated.
struct AlternatingMachine<'a>(u32, &'a StageResults);

impl Sharing for AlternatingMachine<'_> {
    fn share(
        &self,
        stage: u32,
        parts: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Vec<u8>>, RenderError> {
        let Self(me, (found, changed)) = self;
        for part in (0..parts).filter(|part| part % 2 == *me) {
            let mut bytes = perform(part)?;
            bytes.truncate(bytes.len() - usize::from(part == 1));
            found.lock().expect("no panic").insert((stage, part), bytes);
            changed.notify_all();
        }
        let all = |found: &BTreeMap<(u32, u32), Vec<u8>>| (0..parts).all(|part| found.contains_key(&(stage, part)));
        let found = changed.wait_while(found.lock().expect("no panic"), |found| !all(found)).expect("no panic");
        Ok((0..parts).map(|part| found[&(stage, part)].clone()).collect())
    }
}

/// A machine that leaves: its sharing ends with [`RenderError::Left`].
struct LeavingMachine;

impl Sharing for LeavingMachine {
    fn share(
        &self,
        _: u32,
        _: u32,
        _: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Vec<u8>>, RenderError> {
        Err(RenderError::Left)
    }
}

#[test]
fn machines_that_learn_together_learn_the_same_as_one_alone() {
    let by = |threads| {
        let options = PrepareOptions { threads, compensate_environment: true };
        Subject::new(PreparedScene::new(Arc::new(around_a_corner()), &options).expect("a sound scene"))
    };
    // Enough samples that the trial is shared.
    let settings = PathSettings { guiding: true, ..settings(ALL, 3, 200) };
    let learnt = |it: &Subject| it.prepass.learnt(&it.scene, &it.view(SIZE), &settings);
    let alone = by(2);
    paint(&alone, &settings, Rect::of_size(4, 4), &[0, 1]);
    let machines = [by(1), by(2)];
    let found = StageResults::default();
    thread::scope(|scope| {
        for (number, machine) in (0..).zip(&machines) {
            let found = &found;
            scope.spawn(move || {
                let others = AlternatingMachine(number, found);
                learn_together(&machine.scene, &machine.prepass, &machine.view(SIZE), &settings, &others)
                    .expect("a guide");
            });
        }
    });
    let parts = found.0.lock().expect("no panic").len();
    assert!(parts > 0 && parts.is_multiple_of(16), "{parts}: whole stages");
    for machine in &machines {
        assert!(learnt(machine).is_some() && learnt(machine) == learnt(&alone));
    }
    // A machine that leaves has learnt nothing; a machine that has learnt everything does not ask.
    let late = by(1);
    let leave = |it: &Subject| learn_together(&it.scene, &it.prepass, &it.view(SIZE), &settings, &LeavingMachine);
    assert!(matches!(leave(&late), Err(RenderError::Left)) && learnt(&late).is_none());
    assert!(leave(&alone).is_ok());
}

#[test]
fn damaged_answers_are_refused_or_harmless() {
    let scene = prepare(lamps([5, 5]));
    let settings = settings(ALL, 3, 32);
    whole(&scene, &settings, 1);
    let learnt = scene.prepass.learnt(&scene.scene, &scene.view(SIZE), &settings).expect("it was painted");
    let (mut refused, mut taken) = (0, 0);
    for i in 0..60 {
        let mut bytes = learnt.clone();
        // Damage at places all over the data: header, nodes, agents, choices for the parts of the picture.
        let place = (i * bytes.len() / 60 + 7 * i) % bytes.len();
        bytes[place] ^= 1 << (i % 8);
        let other = Subject { scene: Arc::clone(&scene.scene), prepass: Arc::default() };
        if other.prepass.learn_from(&other.scene, &other.view(SIZE), &settings, &bytes).is_err() {
            refused += 1;
            continue;
        }
        taken += 1;
        let tile = paint(&other, &settings, Rect::new(40, 40, 60, 60), &[0, 1]);
        assert!(tile.rect().pixels().all(|(x, y)| tile.pixel(x, y).iter().all(|sum| sum.is_finite())));
    }
    assert!(taken > 0 && refused > 0, "{taken} {refused}");
}

#[test]
fn black_light_and_no_light_teach_nothing() {
    let mut dark = cornell();
    for material in &mut dark.materials {
        material.emission.factor = Vec3::ZERO;
    }
    let mut far = dark.clone();
    far.environment = Some(Environment::uniform(Vec3::ONE));
    for (scene, is_lit) in [(dark, false), (far, true)] {
        let tile = whole(&prepare(scene), &PathSettings { guiding: true, ..settings(ALL, 1, 32) }, 2);
        assert_eq!(moments(&tile, &tile.rect()).0 > 0.0, is_lit);
    }
}
