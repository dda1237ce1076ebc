//! `auto`: paths or photons by zone.

use std::{path::Path, sync::Arc};

use bottega::{
    Picture, Request, Session, SessionOptions, StopSwitch,
    events::Event,
    request::{IntegratorChoice, OptimizationChoice},
};

use crate::support::{Notes, processors};

fn request(optimization: OptimizationChoice, method: IntegratorChoice) -> Request {
    let mut request =
        Request::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../bottega-cli/tests/scenes/diffuse-box.glb"));
    request.film.size = Some([96, 96]);
    request.goal.samples = Some(256);
    request.devices.names = vec!["cpu".to_owned()];
    request.integrator.method = Some(method);
    request.work.optimization = optimization;
    request
}

fn rendered(request: &Request) -> (Picture, Arc<Notes>) {
    let notes = Arc::new(Notes::default());
    let session = Session::open_with(request, SessionOptions::default()).unwrap();
    (session.render(Arc::clone(&notes) as _, &StopSwitch::new()).unwrap(), notes)
}

fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    let film = &picture.report().film;
    film.rect().pixels().map(|(x, y)| film.color(x, y).map(f32::to_bits)).collect()
}

#[test]
fn photons_are_tried_where_an_optimization_allows_them_and_zones_have_the_same_bits() {
    let _processors = processors();
    // Light that bounces between walls is the best case of photons
    let mut optimized = request(OptimizationChoice::Vs, IntegratorChoice::Auto);
    let (first, notes) = rendered(&optimized);
    let said = notes.0.lock().unwrap().iter().any(
        |event| matches!(event, Event::Note { message } if message.contains("auto: photons rendered") && !message.contains("rendered 0 of")),
    );
    assert!(said, "{:?}", notes.0.lock().unwrap());
    optimized.work.agents = Some(3);
    let (second, _) = rendered(&optimized);
    assert!(bits(&first) == bits(&second));
    // Both techniques find the same light
    let mean = |picture: &Picture| {
        let film = &picture.report().film;
        film.rect().pixels().map(|(x, y)| f64::from(film.color(x, y)[1])).sum::<f64>() / film.rect().area() as f64
    };
    let unbiased = request(OptimizationChoice::Off, IntegratorChoice::Auto);
    let (paths, notes) = rendered(&unbiased);
    assert!(notes.warnings().iter().any(|it| it.contains("auto uses paths alone")), "{:?}", notes.warnings());
    let (plain, _) = rendered(&request(OptimizationChoice::Off, IntegratorChoice::Path));
    assert!(bits(&paths) == bits(&plain) && bits(&paths) != bits(&first));
    assert!((mean(&first) / mean(&plain) - 1.0).abs() < 0.02, "{} {}", mean(&first), mean(&plain));
}
