//! A board behind a cable: its gain for a picture, and boards that are slow, gone or wrong.

use std::{
    io::{Read, Write},
    net::{TcpListener, TcpStream},
    path::Path,
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use bottega::{
    Picture, Request, Session, SessionOptions, StopSwitch, Watcher,
    events::{Event, ResourceUse},
    identity::identity,
};
use bottega_board::{BoardOptions, BoardServer};

use crate::support::processors;

#[derive(Default)]
struct Notes(Mutex<Vec<Event>>);

impl Watcher for Notes {
    fn event(&self, event: Event) {
        self.0.lock().unwrap().push(event);
    }
}

/// Starts a board. Returns its name as a device.
fn board(bandwidth: Option<f64>, build: &str) -> String {
    let options = BoardOptions { threads: 1, bandwidth, memory: 64 << 20, build: build.to_owned() };
    let board = BoardServer::listen("127.0.0.1:0".parse().unwrap(), options).unwrap();
    let address = board.address().unwrap();
    thread::spawn(move || board.serve());
    format!("tcp://{address}")
}

fn request(devices: &[&str]) -> Request {
    let mut request = Request::new(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/cornell-box.glb"));
    request.film.size = Some([96, 96]);
    request.goal.samples = Some(16);
    request.devices.threads = Some(1);
    request.devices.names = devices.iter().map(|&name| name.to_owned()).collect();
    // Use the board even if its cable seems slow, as on a busy machine.
    request.integrator.wavefront = true;
    request
}

/// Returns the picture, and the number of units of the board.
fn paint(request: &Request) -> (Picture, u64) {
    let (picture, used) = paint_with(request);
    (picture, used.map_or(0, |used| used.units))
}

/// Returns the picture, and the report of the board.
fn paint_with(request: &Request) -> (Picture, Option<ResourceUse>) {
    let (picture, used, _) = paint_and_listen(request);
    (picture, used)
}

/// The same, with the warnings to the user.
fn paint_and_listen(request: &Request) -> (Picture, Option<ResourceUse>, Vec<String>) {
    let notes = Arc::new(Notes::default());
    let session = Session::open_with(request, SessionOptions::default()).unwrap();
    let picture = session.render(Arc::clone(&notes) as _, &StopSwitch::new()).unwrap();
    let events = notes.0.lock().unwrap();
    let used = events.iter().find_map(|event| match event {
        Event::Resources { resources, .. } => resources.iter().find(|it| it.name.starts_with("tcp://")).cloned(),
        _ => None,
    });
    let warnings = events.iter().filter_map(|event| match event {
        Event::Warning { message } => Some(message.clone()),
        _ => None,
    });
    let warnings = warnings.collect();
    drop(events);
    (picture, used, warnings)
}

fn bits(picture: &Picture) -> Vec<[u32; 4]> {
    let film = &picture.report().film;
    film.rect().pixels().map(|(x, y)| film.color(x, y).map(f32::to_bits)).collect()
}

#[test]
fn a_board_follows_rays_and_the_picture_has_the_same_bits() {
    let _processors = processors();
    let (alone, _) = paint(&request(&["cpu"]));
    let (both, units) = paint(&request(&["cpu", &board(None, identity())]));
    assert!(units > 0, "the board did nothing");
    assert!(bits(&alone) == bits(&both));
}

#[test]
fn traffic_and_bandwidth_of_the_cable_are_reported() {
    let _processors = processors();
    let (_, used) = paint_with(&request(&["cpu", &board(Some(10e6), identity())]));
    let cable = used.and_then(|used| used.cable).expect("a board has a cable");
    assert!(cable.packets > 0 && cable.sent_bytes > 10_000 && cable.received_bytes > 0, "{cable:?}");
    let bandwidth = cable.bandwidth_there.expect("it is slow");
    assert!((0.5..1.5).contains(&(bandwidth / 10e6)), "{cable:?}");
}

#[test]
fn a_board_behind_a_slow_cable_is_left_alone() {
    let _processors = processors();
    let (_, fast) = paint(&request(&["cpu", &board(None, identity())]));
    // Rays of a wave take half a minute there: the board is tried, and then its cost is known.
    let (alone, _) = paint(&request(&["cpu"]));
    let (both, slow) = paint(&request(&["cpu", &board(Some(20e3), identity())]));
    assert!(bits(&alone) == bits(&both));
    assert!(slow * 4 < fast.max(4), "{slow} units where one with a fast cable has {fast}");
}

/// Waves cost processors more than blocks: they are used where boards save more than that, or on request.
#[test]
fn where_a_board_saves_nothing_the_picture_is_painted_in_blocks() {
    let _processors = processors();
    let automatic = |name: &str| {
        let mut request = request(&["cpu", name]);
        request.integrator.wavefront = false;
        let (picture, used, warnings) = paint_and_listen(&request);
        let is_warned = warnings.iter().any(|warning| warning.contains("not used"));
        (bits(&picture), used.map_or(0, |used| used.units), is_warned)
    };
    let (alone, _) = paint(&request(&["cpu"]));
    // Over 5 MB/s its rays take longer than on the processor.
    let (slow, units, is_warned) = automatic(&board(Some(5e6), identity()));
    assert!(units == 0 && is_warned, "{units} units, warned: {is_warned}");
    let (fast, units, is_warned) = automatic(&board(None, identity()));
    assert!((units > 0) != is_warned, "{units} units, warned: {is_warned}");
    assert!(slow == bits(&alone) && fast == bits(&alone));
}

#[test]
fn a_board_of_another_build_or_none_at_all_is_refused() {
    let _processors = processors();
    let open = |name: &str| Session::open(&request(&["cpu", name])).err().map(|error| error.error_chain()).unwrap();
    let refused = open(&board(None, "0.0.0+other"));
    assert!(refused.contains("another build") && refused.contains("0.0.0+other"), "{refused}");
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let refused = open(&format!("tcp://{nobody}"));
    assert!(refused.contains("cannot be reached"), "{refused}");
    let stranger = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = stranger.local_addr().unwrap();
    thread::spawn(move || {
        let (mut stream, _) = stranger.accept().unwrap();
        _ = stream.write_all(&[0; 100]);
        // Closing while the other side writes breaks its connection before it has read this.
        _ = stream.read_to_end(&mut Vec::new());
    });
    let refused = open(&format!("tcp://{address}"));
    assert!(refused.contains("an invalid frame"), "{refused}");
}

#[test]
fn an_invalid_message_to_a_board_ends_only_the_connection() {
    let _processors = processors();
    let name = board(None, identity());
    let address = name.strip_prefix("tcp://").unwrap();
    let magic = u64::from_le_bytes(*b"BTGBRD02");
    let header = |kind: u32, number: u64, scene: u64, bytes: u64| {
        let words = [magic, u64::from(kind), number, scene, bytes];
        words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>()
    };
    let hello = || [header(1, 0, 0, identity().len() as u64), identity().as_bytes().to_vec()].concat();
    let wrong = [
        vec![0xff; 64],                                                                         // No frame.
        header(1, 0, 0, u64::MAX),                             // A greeting without end.
        [hello(), header(77, 0, 0, 0)].concat(),               // No kind.
        [hello(), header(2, 1, 0, 1 << 60)].concat(),          // A scene without end.
        [hello(), header(2, 1, 0, 4), vec![0xff; 4]].concat(), // Shapes that are cut off.
        [hello(), header(4, 1, 9, 32), vec![0; 32]].concat(),  // Rays in a scene that is not there.
        [hello(), header(2, 1, 0, 12), vec![0; 12], header(4, 1, 1, 31), vec![0; 31]].concat(), // A ray that is cut off.
    ];
    for bytes in wrong {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
        _ = stream.write_all(&bytes);
        _ = stream.shutdown(std::net::Shutdown::Write);
        let mut answer = Vec::new();
        // It may be reset where something was not read.
        _ = stream.read_to_end(&mut answer);
    }
    let (_, units) = paint(&request(&["cpu", &name]));
    assert!(units > 0, "the board serves others as before");
}

/// The faults of a cable.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    /// The cable is cut after this many bytes to the board.
    Cut(u64),
    /// The cable stays and can be plugged in again, but carries no answers after this many bytes.
    Silence(u64),
}

/// Makes a cable to a board with a fault. Returns its name as a device.
fn cable(board: &str, fault: Fault) -> String {
    let far = board.strip_prefix("tcp://").unwrap().to_owned();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let near = listener.local_addr().unwrap();
    thread::spawn(move || {
        for (number, stream) in listener.incoming().flatten().enumerate() {
            let Ok(board) = TcpStream::connect(&far) else { return };
            let (mut to, mut from) = (board.try_clone().unwrap(), stream.try_clone().unwrap());
            let (there, back) = match fault {
                Fault::Cut(bytes) => (bytes, u64::MAX),
                Fault::Silence(bytes) => (u64::MAX, if number == 0 { bytes } else { 0 }),
            };
            thread::spawn(move || {
                _ = std::io::copy(&mut (&stream).take(there), &mut to);
                _ = to.shutdown(std::net::Shutdown::Both);
                _ = stream.shutdown(std::net::Shutdown::Both);
            });
            thread::spawn(move || {
                _ = std::io::copy(&mut (&board).take(back), &mut from);
                if matches!(fault, Fault::Silence(_)) {
                    _ = std::io::copy(&mut &board, &mut std::io::sink());
                }
                _ = from.shutdown(std::net::Shutdown::Both);
            });
        }
    });
    format!("tcp://{near}")
}

#[test]
fn a_board_that_goes_while_it_paints_costs_no_pixel() {
    let _processors = processors();
    let (alone, _) = paint(&request(&["cpu"]));
    let (both, _) = paint(&request(&["cpu", &cable(&board(None, identity()), Fault::Cut(600_000))]));
    assert!(bits(&alone) == bits(&both));
}

/// Its first packets are doubted after two seconds; other resources do its work, and the complete picture does not wait for it.
#[test]
fn a_board_that_does_not_answer_any_more_is_not_waited_for() {
    let _processors = processors();
    let begun = Instant::now();
    let (alone, _) = paint(&request(&["cpu"]));
    let usual = begun.elapsed();
    let begun = Instant::now();
    let (both, _) = paint(&request(&["cpu", &cable(&board(None, identity()), Fault::Silence(400_000))]));
    let took = begun.elapsed();
    assert!(bits(&alone) == bits(&both));
    assert!(took < 3 * usual + Duration::from_secs(60), "{took:?}, {usual:?} alone");
}
