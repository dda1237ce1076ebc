//! A scene seen from elsewhere, without reading it again.

use std::{
    path::Path,
    sync::{
        Arc, Mutex,
        atomic::{AtomicUsize, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use bottega::{
    Event, Request, Session, StopSwitch, Watcher,
    request::{CameraPose, ViewOptions},
    viewport::{Viewport, ViewportFollower, ViewportFrame, ViewportLook, ViewportSampler},
};
use bottega_image::{ReadLimits, read_image_bytes};

use crate::support::processors;

fn request() -> Request {
    let mut request = Request::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-box.glb"));
    request.film.size = Some([48, 32]);
    request.goal.samples = Some(4);
    request
}

fn from_above() -> ViewOptions {
    let pose = CameraPose { eye: [0.4, 1.6, 2.0], target: [0.0, 0.8, 0.0], up: [0.0, 1.0, 0.0], fov: Some(45.0) };
    ViewOptions { pose: Some(pose), ..ViewOptions::default() }
}

fn bits(session: Session) -> Vec<u32> {
    let picture = session.render(Arc::new(()), &StopSwitch::new()).expect("it is painted");
    picture.film().values().iter().map(|value| value.to_bits()).collect()
}

#[test]
fn a_session_that_looks_from_elsewhere_paints_the_bits_of_one_that_was_opened_so() {
    let _alone = processors();
    let (request, view) = (request(), from_above());
    let there = Request { view: view.clone(), ..request.clone() };
    let wanted = bits(Session::open(&there).expect("it is opened"));
    let own = bits(Session::open(&request).expect("it is opened"));
    assert_ne!(own, wanted, "the view is another one");
    let looked = Session::open(&request).and_then(|session| session.look(&view)).expect("it looks");
    assert_eq!(looked.name().expect("a name"), Session::open(&there).expect("it is opened").name().expect("a name"));
    assert_eq!(bits(looked), wanted);
    let back = Session::open(&there).and_then(|session| session.look(&ViewOptions::default())).expect("it looks back");
    assert_eq!(bits(back), own);
    // By photons too, which are sent to what the camera sees.
    let photons =
        |request: &Request| request.with("integrator.method", "photon").unwrap().with("photons.count", "2000").unwrap();
    let wanted = bits(Session::open(&photons(&there)).expect("it is opened"));
    let looked = Session::open(&photons(&request)).and_then(|session| session.look(&view)).expect("it looks");
    assert_eq!(bits(looked), wanted);
}

#[test]
fn a_pose_that_looks_nowhere_is_refused_by_its_field() {
    for (field, pose) in [
        ("view.pose.target", r#"{"eye": [1, 2, 3], "target": [1, 2, 3]}"#),
        ("view.pose.target", r#"{"eye": [0, 2, 0], "target": [0, 1, 0]}"#),
        ("view.pose.eye", r#"{"eye": [1e30, 0, 0], "target": [1, 2, 3]}"#),
        ("view.pose.fov", r#"{"eye": [0, 0, 1], "target": [1, 2, 3], "fov": 180}"#),
    ] {
        let error = request().with("view.pose", pose).unwrap_err();
        let error = bottega::error::error_chain(&error);
        assert!(error.contains(field), "{error}");
    }
    let there = request().with("view.pose", r#"{"eye": [0, 0, 1], "target": [1, 2, 3]}"#).unwrap();
    assert!(there.validate().is_ok() && there.view.pose.is_some_and(|pose| pose.up == [0.0, 1.0, 0.0]));
}

/// Returns the first frame that meets a condition, and the time until it.
fn frame(viewport: &Viewport, wanted: impl Fn(&ViewportFrame) -> bool) -> (ViewportFrame, Duration) {
    let begun = Instant::now();
    let mut after = 0;
    while begun.elapsed() < Duration::from_secs(60) {
        if let Some(frame) = viewport.frame(after).expect("it is shown") {
            after = frame.number;
            if wanted(&frame) {
                return (frame, begun.elapsed());
            }
        }
        thread::sleep(Duration::from_millis(2));
    }
    panic!("nothing like that was shown in a minute");
}

#[test]
fn a_viewport_shows_the_scene_at_once_finer_and_finer_and_from_elsewhere() {
    let _alone = processors();
    let request =
        Request { goal: bottega::request::GoalOptions { samples: Some(8), ..Default::default() }, ..request() };
    let viewport = Viewport::open(&request).expect("it is opened");
    assert_eq!((viewport.size(), viewport.samples(), viewport.cameras().len()), ((48, 32), 8, 1));
    let calls = Arc::new(AtomicUsize::new(0));
    let tell = Arc::clone(&calls);
    viewport.watch(move || _ = tell.fetch_add(1, Ordering::Relaxed));
    let (first, took) = frame(&viewport, |_| true);
    eprintln!("first pixels after {} ms", took.as_millis());
    assert_eq!((first.look, first.samples <= 8), (0, true));
    let (last, _) = frame(&viewport, |frame| frame.samples == 8);
    let read =
        |frame: &ViewportFrame| read_image_bytes("frame.png", &frame.png, ReadLimits::default()).unwrap().picture;
    assert_eq!((read(&last).size(), last.is_denoised), ((48, 32), viewport.denoises()));
    assert_eq!(viewport.frame(last.number).unwrap(), None, "there is no new frame");
    assert_eq!(viewport.due(last.number), None);
    assert!(viewport.due(0).is_some_and(|due| due < Duration::from_secs(1)), "who has seen nothing is shown it");
    let calls_before = calls.load(Ordering::Relaxed);

    let look = viewport.look(&from_above()).expect("it looks");
    let (other, took) = frame(&viewport, |frame| frame.look == look);
    eprintln!("another view after {} ms", took.as_millis());
    assert!(other.number > last.number && calls.load(Ordering::Relaxed) > calls_before, "the watcher is called");
    let (there, _) = frame(&viewport, |frame| frame.look == look && frame.samples == 8);
    assert_ne!(read(&there).data, read(&last).data);
    // The pose of the file's camera gives the file's camera.
    let own = ViewOptions { pose: Some(viewport.cameras()[0].pose), ..ViewOptions::default() };
    let look = viewport.look(&own).expect("it looks");
    let (back, _) = frame(&viewport, |frame| frame.look == look && frame.samples == 8);
    let differ = read(&back).data.iter().zip(&read(&last).data).filter(|(a, b)| a != b).count();
    assert!(differ < 48 * 32 / 20, "{differ} pixels differ by the rounding of a pose");

    // An impossible request changes nothing.
    let error = viewport.look(&ViewOptions { camera: Some("9".to_owned()), ..from_above() }).unwrap_err();
    assert!(error.to_string().contains("no camera `9`"), "{error}");
    let (still, _) = frame(&viewport, |frame| frame.look == look);
    assert_eq!(still.number, back.number);
}

/// Sends what a viewport shows, and `None` when it rests.
struct Looks(Mutex<mpsc::Sender<Option<ViewportLook>>>);

impl ViewportFollower for Looks {
    fn ends_before(&self, _: u64) {}

    fn begins(&self, look: ViewportLook) {
        _ = self.0.lock().unwrap().send(Some(look));
    }

    fn rests(&self, _: u64) {
        _ = self.0.lock().unwrap().send(None);
    }
}

#[test]
fn another_process_renders_samples_of_what_a_viewport_shows() {
    const FIRST: u32 = 1 << 14;
    let _alone = processors();
    let request = request().with("goal.samples", "512").unwrap().with("devices.threads", "1").unwrap();
    let reference = Session::open(&request.with("goal.samples", "64").unwrap()).expect("it is opened");
    let reference = reference.render(Arc::new(()), &StopSwitch::new()).expect("it is rendered").film().to_picture();
    let viewport = Viewport::open(&request).expect("it is opened");
    let (tell, looks) = mpsc::channel();
    viewport.follow(Box::new(Looks(Mutex::new(tell))));
    let next = || looks.recv_timeout(Duration::from_secs(60)).expect("a look is reported");
    let look = next().expect("a look");
    let sampler = ViewportSampler::open(&look.request, Arc::clone(&look.scene), look.camera.clone()).expect("it opens");
    let end = sampler.end().expect("it has an engine");
    let samples = sampler.render(look.number, FIRST..FIRST + 64, &end).expect("it renders").expect("nobody ends it");
    // Samples of the same picture: not the same bits, but the same mean
    let mean = |values: &mut dyn Iterator<Item = f32>| values.map(f64::from).sum::<f64>();
    let (own, other) = (
        mean(&mut reference.data.iter().flatten().copied()),
        mean(&mut samples.means.iter().flat_map(|mean| mean[..3].iter().copied())),
    );
    assert!((own / other - 1.0).abs() < 0.02, "{own} and {other}");
    assert!(reference.data.iter().zip(&samples.means).any(|(a, b)| a[0].to_bits() != b[0].to_bits()));
    // They count: the viewport rests with fewer samples of its own
    for _ in 0..8 {
        assert!(viewport.add(&samples));
    }
    assert!(next().is_none(), "it rests");
    let (last, _) = frame(&viewport, |frame| frame.samples >= 512);
    assert_eq!(last.look, look.number);

    // Another look: the same scene, another camera
    let number = viewport.look(&from_above()).expect("it looks");
    let there = next().expect("a look");
    assert!(there.number == number && Arc::ptr_eq(&there.scene, &look.scene) && there.camera != look.camera);
    assert!(!viewport.add(&samples), "samples of a look that is over");
    let sampler = sampler.look(&there.request, there.camera.clone()).expect("it looks");
    let end = sampler.end().expect("it has an engine");
    end.end();
    assert!(sampler.render(number, 0..1 << 14, &end).expect("it ends").is_none(), "it was ended");
}

#[derive(Default)]
struct Notes(Mutex<Vec<Event>>);

impl Watcher for Notes {
    fn event(&self, event: Event) {
        self.0.lock().unwrap().push(event);
    }
}

#[test]
fn a_viewport_beside_a_picture_goes_first_and_reports_expired_work() {
    let _alone = processors();
    let long = request().with("goal.samples", "100000").unwrap().with("devices.threads", "1").unwrap();
    let (notes, stop) = (Arc::new(Notes::default()), StopSwitch::new());
    let session = Session::open(&long).expect("it is opened");
    let painting = {
        let (notes, stop) = (Arc::clone(&notes), stop.clone());
        thread::spawn(move || session.render(notes, &stop))
    };
    thread::sleep(Duration::from_millis(300));
    // It asks for other threads, but shares those that render; otherwise priorities have no effect.
    let wanted = request().with("goal.samples", "1024").unwrap().with("devices.threads", "2").unwrap();
    let viewport = Viewport::open(&wanted).expect("it is opened");
    // At some of these moments work of the view waits until the picture's block ends; at others noise is being removed, or its
    // next step is being requested.
    for moment in 0..12 {
        let look = viewport.look(&from_above()).expect("it looks");
        let (_, took) = frame(&viewport, |frame| frame.look == look && frame.samples >= 4);
        eprintln!("four samples of another view after {} ms", took.as_millis());
        thread::sleep(Duration::from_millis(8 * moment));
    }
    drop(viewport);
    stop.request();
    drop(painting.join().expect("no panic"));
    let events = notes.0.lock().unwrap();
    let expired = events.iter().find_map(|event| match event {
        Event::Resources { expired, .. } => Some(*expired),
        _ => None,
    });
    assert!(expired.is_some_and(|expired| expired > 0), "{expired:?} units past their life time");
}
