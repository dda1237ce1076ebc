//! Two pictures in one process, one of which is an urgent part.

use std::{
    path::Path,
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use bottega::{Request, Session, StopSwitch};

use crate::support::processors;

const SIZE: [u32; 2] = [64, 48];

fn request(samples: u32) -> Request {
    let mut request = Request::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-box.glb"));
    request.film.size = Some(SIZE);
    request.goal.samples = Some(samples);
    request.devices.threads = Some(1);
    request
}

/// The time of a picture that is rendered amid a longer one on the same thread.
fn time_beside_another(request: &Request) -> Duration {
    let long = Session::open(&self::request(800)).expect("it is opened");
    let stop = StopSwitch::new();
    let painting = {
        let stop = stop.clone();
        thread::spawn(move || long.render(Arc::new(()), &stop))
    };
    thread::sleep(Duration::from_millis(300));
    let session = Session::open(request).expect("it is opened");
    let begun = Instant::now();
    session.render(Arc::new(()), &StopSwitch::new()).expect("it is painted");
    let took = begun.elapsed();
    stop.request();
    drop(painting.join().expect("no panic"));
    took
}

#[test]
fn a_part_of_a_picture_goes_before_a_whole_one() {
    let _processors = processors();
    let whole = request(256);
    // The same number of pixels, requested as a part.
    let mut part = whole.clone();
    part.film.crop = Some([0, 0, SIZE[0], SIZE[1]]);
    let (part, whole) = (time_beside_another(&part), time_beside_another(&whole));
    eprintln!("the part took {part:?}, the whole {whole:?}");
    assert!(part * 4 < whole * 3, "{part:?} for a part, {whole:?} for a whole picture");
}
