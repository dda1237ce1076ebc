//! Processors and devices at work for pictures: rays as units, scenes that stay on a device, reports to the user.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega::{Picture, Request, Session, SessionOptions, StopSwitch, events::Event};

use crate::support::{Notes, processors};

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes").join(name)
}

fn request(name: &str, side: u32, samples: u32) -> Request {
    let mut request = Request::new(scene(name));
    request.film.size = Some([side, side]);
    request.goal.samples = Some(samples);
    request.devices.names = vec!["cpu".to_owned()];
    request
}

fn paint(request: &Request, options: SessionOptions) -> (Picture, Arc<Notes>) {
    let notes = Arc::new(Notes::default());
    let session = Session::open_with(request, options).unwrap();
    (session.render(Arc::clone(&notes) as _, &StopSwitch::new()).unwrap(), notes)
}

fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    let film = &picture.report().film;
    film.rect().pixels().map(|(x, y)| film.color(x, y).map(f32::to_bits)).collect()
}

#[test]
fn a_picture_painted_in_waves_has_the_same_bits() {
    let _processors = processors();
    // The first is of enough samples for agents, who have paths go on as several.
    for (name, side, samples, lights) in [("cornell-box.glb", 128, 32, 1), ("goblets.glb", 48, 5, 2)] {
        let mut request = request(name, side, samples);
        request.integrator.light_samples = lights;
        let (blocks, _) = paint(&request, SessionOptions::default());
        request.integrator.wavefront = true;
        let (waves, notes) = paint(&request, SessionOptions::default());
        assert!(bits(&blocks) == bits(&waves), "{name}");
        assert!(!notes.warnings().iter().any(|warning| warning.contains("wavefront")), "{:?}", notes.warnings());
    }
}

#[test]
fn where_rays_cannot_be_left_to_others_that_is_said() {
    let _processors = processors();
    let mut request = request("cornell-box.glb", 32, 1);
    request.integrator.method = Some(bottega::request::IntegratorChoice::Photon);
    request.integrator.wavefront = true;
    let (_, notes) = paint(&request, SessionOptions::default());
    assert!(
        notes.warnings().iter().any(|it| it.contains("integrator.wavefront and boards have no effect here")),
        "{:?}",
        notes.warnings()
    );
}

#[test]
fn a_small_work_bin_is_full_and_changes_no_bit() {
    let _processors = processors();
    let usual = request("cornell-box.glb", 64, 8);
    let mut small = usual.clone();
    small.devices.bin = Some(1);
    let [(plain, notes), (other, small_notes)] =
        [usual, small].map(|request| paint(&request, SessionOptions::default()));
    assert!(bits(&plain) == bits(&other), "{:?}", small_notes.warnings());
    let bin = |notes: &Notes| {
        let events = notes.0.lock().unwrap();
        let found = events.iter().find_map(|event| match event {
            Event::Resources { resources, bin_capacity, bin_full, .. } => {
                assert!(resources.iter().all(|it| it.units == 0 || (it.packets > 0 && it.packet_largest > 0)));
                Some((*bin_capacity, *bin_full))
            }
            _ => None,
        });
        found.expect("the work of processors")
    };
    let ((room, _), (small_room, full)) = (bin(&notes), bin(&small_notes));
    assert!(room >= 64 && small_room == 1 && full > 0.0, "{room} {small_room} {full}");
}

#[test]
fn utilization_is_reported_and_drawn() {
    let _processors = processors();
    let folder = tempfile::tempdir().unwrap();
    for name in ["timeline.svg", "timeline.json"] {
        let file = folder.path().join(name);
        let options = SessionOptions { timeline: Some(file.clone()), ..SessionOptions::default() };
        let (_, notes) = paint(&request("cornell-box.glb", 64, 4), options);
        let events = notes.0.lock().unwrap();
        let used = events.iter().find_map(|event| match event {
            Event::Resources { resources, .. } => Some(resources),
            _ => None,
        });
        let units: u64 = used.unwrap().iter().map(|it| it.units).sum();
        assert!(units >= 16, "{used:?}");
        let text = std::fs::read_to_string(&file).unwrap();
        if name.ends_with("json") {
            let json: serde_json::Value = serde_json::from_str(&text).unwrap();
            assert_eq!(json["resources"].as_array().unwrap().len(), used.unwrap().len());
            assert!(json["resources"][0]["spans"].as_array().unwrap().iter().any(|span| span[2] == "working"));
            assert!(json["bin"]["steps"].as_array().is_some_and(|steps| !steps.is_empty()));
        } else {
            assert!(text.starts_with("<svg") && text.contains("cpu 0"), "{text}");
        }
    }
    let options = SessionOptions { timeline: Some(folder.path().join("timeline.png")), ..SessionOptions::default() };
    let refused = Session::open_with(&request("cornell-box.glb", 64, 4), options).err().unwrap();
    assert!(refused.to_string().contains("timeline.png"), "{refused}");
}

#[cfg(feature = "gpu")]
#[test]
fn the_next_picture_finds_its_scene_on_the_device() {
    let _processors = processors();
    let there = bottega_gpu::adapters();
    let Some(software) = there.iter().find(|adapter| adapter.name.contains("llvmpipe")) else {
        eprintln!("skipped: no llvmpipe; install Mesa's software Vulkan driver");
        return;
    };
    let sent = |notes: &Notes| {
        let events = notes.0.lock().unwrap();
        let used = events.iter().find_map(|event| match event {
            Event::Resources { resources, .. } => resources.iter().find(|it| it.name.contains("llvmpipe")).cloned(),
            _ => None,
        });
        used.and_then(|used| used.sent_bytes).unwrap()
    };
    let mut request = request("cornell-box.glb", 32, 2);
    request.devices.names = vec![software.name.clone()];
    let (first, notes) = paint(&request, SessionOptions::default());
    let once = sent(&notes);
    assert!(once > 0);
    // Another seed, the same scene: it is loaded again, and nothing of it is sent.
    request.seed += 1;
    let (second, notes) = paint(&request, SessionOptions::default());
    assert_eq!(sent(&notes), once);
    assert!(bits(&first) != bits(&second));
    let mut other = request.clone();
    other.scene.file = scene("goblets.glb");
    let (_, notes) = paint(&other, SessionOptions::default());
    assert!(sent(&notes) > once);
}
