use bottega_image::Rect;

use super::*;
use crate::Foreknowledge;

const PLAIN: TaskFeatures =
    TaskFeatures { glass: 0.0, texture: 0.0, media: 0.0, shadow: 0.3, material: 0.1, bounces: 3.0 };
const GLASS: TaskFeatures = TaskFeatures { glass: 0.9, ..PLAIN };
const MIXED: TaskFeatures = TaskFeatures { glass: 0.45, ..PLAIN };
const FRAME: Rect = Rect { x0: 0, y0: 0, x1: 320, y1: 240 };
const DENSITY: f64 = 1e-6;

/// The zone in a column and row of 8 × 6; every other one is of glass.
fn zone(place: u32, density: f64) -> TaskOutlook {
    let (column, row) = (place % 8, place / 8);
    let rect = Rect::new(40 * column, 40 * row, 40 * column + 40, 40 * row + 40);
    let features = if (column + row) % 2 == 0 { GLASS } else { PLAIN };
    TaskOutlook { rect, sample_time: density * rect.area() as f64, features }
}

fn outlook() -> PictureOutlook {
    let cells = (crate::OUTLOOK_COLUMNS * crate::OUTLOOK_ROWS) as usize;
    PictureOutlook {
        frame: FRAME,
        zones: (0..48).map(|place| zone(place, DENSITY)).collect(),
        grid: vec![DENSITY; cells],
    }
}

/// A job in which the times of zones are multiples of the survey's prediction, by place.
fn job(technique: &str, scene: &str, ratio: impl Fn(u32, &TaskOutlook) -> f64) -> JobLesson {
    let outlook = outlook();
    let painted = |(place, outlook): (u32, &TaskOutlook)| {
        let time = Duration::from_secs_f64(64.0 * outlook.sample_time * ratio(place, outlook));
        PaintedZone { outlook: *outlook, samples: 64, time }
    };
    JobLesson {
        technique: technique.into(),
        subject: Subject { scene: scene.into(), view: "front".into() },
        features: MIXED,
        zones: (0..).zip(&outlook.zones).map(painted).collect(),
        outlook: Arc::new(outlook),
        power: Some(RelativePower::new(0.5)),
        to_reference: RelativePower::new(0.5),
    }
}

/// Zones of glass take `glass` times what the survey predicts, and others `plain` times.
fn by_glass(glass: f64, plain: f64) -> impl Fn(u32, &TaskOutlook) -> f64 {
    move |_, zone| if zone.features.glass > 0.5 { glass } else { plain }
}

fn knowing(experience: &Experience, technique: &str, scene: &str) -> Foreknowledge {
    Foreknowledge {
        experience: Arc::new(experience.clone()),
        technique: technique.into(),
        subject: Subject { scene: scene.into(), view: "front".into() },
        benchmark: RelativePower::new(2.0),
        ..Foreknowledge::default()
    }
}

/// The predicted own time of a zone over what the survey says, for a machine with V_cp 0.5.
fn ratio(known: &Foreknowledge, zone: &TaskOutlook) -> f64 {
    let time = known.forecast(&MIXED, &outlook(), zone, 64).time.as_secs_f64();
    0.5 * time / (64.0 * zone.sample_time)
}

#[test]
fn a_new_picture_is_predicted_by_its_features_and_another_technique_by_the_survey() {
    let mut experience = Experience::default();
    for scene in ["a", "b", "c"] {
        experience.learn(&job("builtin path", scene, by_glass(3.0, 1.5)), None);
    }
    let known = knowing(&experience, "builtin path", "unseen");
    for (place, wanted) in [(0, 3.0), (1, 1.5)] {
        let found = ratio(&known, &zone(place, DENSITY));
        assert!((found / wanted - 1.0).abs() < 0.1, "{found} for {wanted}");
    }
    assert!((known.power(&MIXED).get() - 0.5).abs() < 0.05);
    let other = knowing(&experience, "builtin photon", "a");
    let found = other.forecast(&MIXED, &outlook(), &zone(0, DENSITY), 64);
    assert_eq!((found.time, found.deviation), (Duration::from_secs_f64(64.0 * zone(0, DENSITY).sample_time), None));
    assert_eq!(other.power(&MIXED).get(), 2.0);
}

#[test]
fn a_picture_painted_before_is_known_by_place_and_trusted() {
    let mut experience = Experience::default();
    // No feature says why the left half is expensive
    let by_side = |place: u32, _: &TaskOutlook| if place % 8 < 4 { 4.0 } else { 1.0 };
    for _ in 0..2 {
        experience.learn(&job("p", "a", by_side), None);
    }
    let (known, new) = (knowing(&experience, "p", "a"), knowing(&experience, "p", "b"));
    let (left, right) = (zone(1, DENSITY), zone(6, DENSITY));
    assert!(ratio(&known, &left) > 2.0 * ratio(&known, &right));
    assert!((ratio(&new, &left) / ratio(&new, &right) - 1.0).abs() < 0.2);
    let steady = |_: u32, _: &TaskOutlook| 2.0;
    let mut experience = Experience::default();
    experience.learn(&job("p", "a", steady), None);
    let is_trusted = |scene| knowing(&experience, "p", scene).forecast(&MIXED, &outlook(), &left, 64).is_trusted();
    assert!(is_trusted("a") && !is_trusted("b"));
}

#[test]
fn a_machine_that_has_learnt_nothing_starts_from_its_farm() {
    let mut of_farm = Experience::default();
    of_farm.learn(&job("p", "a", by_glass(2.0, 2.0)).in_reference_time(), None);
    let known = Foreknowledge { of_farm: Arc::new(of_farm.clone()), ..knowing(&Experience::default(), "p", "b") };
    // V_cp is 2 by the benchmark; reference time is twice the time of the machine with V_cp 0.5
    let found = known.forecast(&MIXED, &outlook(), &zone(0, DENSITY), 64).time.as_secs_f64();
    assert!((found / (64.0 * zone(0, DENSITY).sample_time) / 4.0 - 1.0).abs() < 0.1, "{found}");
    // Its own first job moves it from there
    let mut own = Experience::default();
    own.learn(&job("p", "b", by_glass(2.2, 2.2)), Some(&of_farm));
    let found = ratio(&knowing(&own, "p", "c"), &zone(0, DENSITY));
    assert!((1.9..2.3).contains(&found), "{found}");
}

#[test]
fn what_is_new_counts_more_than_what_is_old() {
    let mut experience = Experience::default();
    for factor in [1.0; 10].into_iter().chain([4.0; 5]) {
        experience.learn(&job("p", "a", by_glass(factor, factor)), None);
    }
    let found = ratio(&knowing(&experience, "p", "a"), &zone(0, DENSITY));
    assert!((3.4..4.4).contains(&found), "{found}");
    assert_eq!(experience.jobs(), 15);
}

#[test]
fn a_text_comes_back_and_what_is_none_is_refused() {
    let mut experience = Experience::default();
    experience.learn(&job("builtin path", "a", by_glass(3.0, 1.5)), None);
    let text = experience.to_json();
    let read = Experience::from_json(&text).unwrap();
    assert_eq!(read.to_json(), text);
    assert_eq!(read.factors(), experience.factors());
    assert!(matches!(Experience::from_json("{\"format\":3"), Err(ExperienceError::Syntax(_))));
    assert!(matches!(Experience::from_json("[3]"), Err(ExperienceError::Syntax(_))));
    assert!(matches!(Experience::from_json(&text[..text.len() / 2]), Err(ExperienceError::Syntax(_))));
    let newer = text.replace("\"format\":3", "\"format\":9");
    assert!(matches!(Experience::from_json(&newer), Err(ExperienceError::Format { found: 9 })));
    let earlier = Experience::from_json("{\"format\":1,\"factors\":{}}");
    assert!(matches!(earlier, Err(ExperienceError::Earlier { found: 1 })));
    let long = " ".repeat(TEXT_MAX + 1);
    assert!(matches!(Experience::from_json(&long), Err(ExperienceError::TooLong(_))));
    let mut mad = serde_json::from_str::<serde_json::Value>(&text).unwrap();
    mad["techniques"]["builtin path"]["deviation"] = (-1.0).into();
    assert!(matches!(Experience::from_json(&mad.to_string()), Err(ExperienceError::Factor { .. })));
}

#[test]
fn it_stays_small_and_keeps_what_was_used_last() {
    let mut experience = Experience::default();
    let usual = || by_glass(2.0, 2.0);
    experience.learn(&job("kept", "kept", usual()), None);
    for i in 0..80 {
        experience.learn(&job(&format!("technique {i}"), &format!("scene {i}"), usual()), None);
        if i % 10 == 0 {
            experience.learn(&job("kept", "kept", usual()), None);
        }
    }
    assert!(experience.to_json().len() < TEXT_MAX / 2, "{}", experience.to_json().len());
    assert!(experience.techniques.contains_key("kept") && !experience.techniques.contains_key("technique 3"));
    assert!(experience.pictures.len() == PICTURES_MAX && experience.pictures.iter().any(|it| &*it.scene == "kept"));
}

#[test]
fn nonsense_teaches_nothing() {
    let mut experience = Experience::default();
    let good = job("p", "a", |_, _| 1.0);
    let nothing = PaintedZone { time: Duration::ZERO, ..good.zones[0] };
    let unknown = PaintedZone { outlook: TaskOutlook::default(), ..good.zones[0] };
    let features = TaskFeatures { glass: f64::NAN, ..PLAIN };
    let mad = PaintedZone { outlook: TaskOutlook { sample_time: f64::INFINITY, features, ..zone(0, 1.0) }, ..nothing };
    experience.learn(&JobLesson { zones: vec![nothing, unknown, mad], ..good.clone() }, None);
    assert!(experience.is_empty());
    experience.learn(&good, None);
    let known = knowing(&experience, "p", "a");
    let zone = TaskOutlook { sample_time: f64::NAN, features, ..zone(0, 1.0) };
    assert_eq!(known.forecast(&MIXED, &outlook(), &zone, 4).time, Duration::ZERO);
}

#[test]
fn hundreds_of_unlike_jobs_leave_what_is_learnt_plausible() {
    let mut state = 7_u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let mut experience = Experience::default();
    for _ in 0..400 {
        // Milliseconds to seconds of zones that are alike in some features, and not in others
        let features = TaskFeatures { glass: random(), texture: random(), material: random(), ..PLAIN };
        let (seconds, ratio) = (10_f64.powf(-5.0 * random()), (4.0 * random() - 2.0).exp());
        let mut lesson = job("path", "box", |_, _| ratio);
        lesson.zones.truncate(1 + (48.0 * random()) as usize);
        let each = seconds / lesson.zones.len() as f64;
        for zone in &mut lesson.zones {
            zone.outlook.features = TaskFeatures { shadow: random(), ..features };
            zone.outlook.sample_time = each / 64.0;
            zone.time = Duration::from_secs_f64(each * (1.0 + random()));
        }
        experience.learn(&lesson, None);
    }
    let read = Experience::from_json(&experience.to_json()).unwrap();
    assert_eq!(read.jobs, 400);
    assert_eq!(read.techniques.len(), 1, "what is learnt of the technique was not forgotten as implausible");
}
