//! A scene file in, a picture out: `cargo run --release -p bottega --example ten_lines -- scenes/cornell.glb cornell.png`.

use bottega::{Request, Session, StopSwitch};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let [scene, picture] = std::env::args().skip(1).collect::<Vec<_>>().try_into().map_err(|_| "SCENE PICTURE")?;
    let mut request = Request::new(scene);
    request.film.size = Some([320, 240]);
    request.goal.samples = Some(16);
    Session::open(&request)?.render(std::sync::Arc::new(()), &StopSwitch::new())?.save(picture)?;
    Ok(())
}
