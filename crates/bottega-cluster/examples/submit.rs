//! Submits a picture to a farm, without any command line: `cargo run --release -p bottega-cluster --example submit -- SCENE
//! PICTURE [bottega://WORD@HOST:PORT]`. Without an address, it goes to the farm that `bottega up` runs on this machine.

use std::sync::Arc;

use bottega::{Event, Request, SessionOptions, StopSwitch};
use bottega_cluster::{Credentials, FarmAddress, client};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(scene), Some(picture)) = (arguments.next(), arguments.next()) else { return Err("SCENE PICTURE".into()) };
    let farm = arguments.next().map(|address| address.parse::<FarmAddress>()).transpose()?;
    let mut request = Request::new(scene);
    request.film.size = Some([160, 120]);
    request.goal.samples = Some(256);
    request.output.file = Some(picture.into());
    let watcher = |event: Event| {
        if let Event::Submitted { job, .. } = event {
            eprintln!("job {job}");
        }
    };
    let (credentials, options) = (Credentials::default(), SessionOptions::default());
    client::render(farm.as_ref(), &credentials, &request, options, Arc::new(watcher), &StopSwitch::new())?;
    Ok(())
}
