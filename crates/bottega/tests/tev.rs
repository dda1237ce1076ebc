//! A listener in tev's place rebuilds the picture, bit for bit.

use std::{
    collections::BTreeMap,
    io::{self, Read},
    net::{SocketAddr, TcpListener, TcpStream},
    path::Path,
    sync::Arc,
    thread,
};

use bottega::{Request, Session, SessionOptions, StopSwitch};

use crate::support::processors;

/// An image as a viewer has it: rows of values by channel.
#[derive(Default)]
struct ShownImage {
    width: usize,
    height: usize,
    channels: BTreeMap<String, Vec<f32>>,
    updates: usize,
}

/// The fields of a packet, read one after the other.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (field, rest) = self.0.split_first_chunk().expect("the packet is long enough");
        self.0 = rest;
        *field
    }

    fn number(&mut self) -> usize {
        u32::from_le_bytes(self.bytes()) as usize
    }

    fn text(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).expect("texts end with a 0");
        let text = String::from_utf8(self.0[..end].to_vec()).unwrap();
        self.0 = &self.0[end + 1..];
        text
    }

    fn texts(&mut self, count: usize) -> Vec<String> {
        (0..count).map(|_| self.text()).collect()
    }

    fn longs(&mut self, count: usize) -> Vec<usize> {
        (0..count).map(|_| u64::from_le_bytes(self.bytes()) as usize).collect()
    }
}

impl ShownImage {
    /// Executes a packet: the protocol of tev, as its README describes it.
    fn take(&mut self, packet: &[u8]) {
        let mut fields = Fields(packet);
        let [kind, _focus] = fields.bytes();
        assert!(fields.text().ends_with("goblets.glb"));
        match kind {
            4 => {
                (self.width, self.height) = (fields.number(), fields.number());
                let count = fields.number();
                let black = vec![f32::NAN; self.width * self.height];
                self.channels = fields.texts(count).into_iter().map(|name| (name, black.clone())).collect();
            }
            6 => {
                let count = fields.number();
                let names = fields.texts(count);
                let [x, y, width, height] = std::array::from_fn(|_| fields.number());
                let (offsets, strides) = (fields.longs(count), fields.longs(count));
                let data: Vec<f32> =
                    fields.0.chunks_exact(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect();
                for ((name, offset), stride) in names.iter().zip(offsets).zip(strides) {
                    let channel = self.channels.get_mut(name).expect("a channel that was announced");
                    for pixel in 0..width * height {
                        let place = (y + pixel / width) * self.width + x + pixel % width;
                        channel[place] = data[offset + pixel * stride];
                    }
                }
                self.updates += 1;
            }
            other => panic!("a packet of kind {other}"),
        }
    }
}

fn listen(mut stream: TcpStream) -> ShownImage {
    let mut image = ShownImage::default();
    let mut length = [0; 4];
    while stream.read_exact(&mut length).is_ok() {
        let mut packet = vec![0; u32::from_le_bytes(length) as usize - 4];
        stream.read_exact(&mut packet).unwrap();
        image.take(&packet);
    }
    image
}

fn request() -> Request {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/goblets.glb");
    let mut request = Request::new(scene);
    request.film.size = Some([40, 30]);
    request.film.layers = Some(vec!["albedo".to_owned(), "depth".to_owned()]);
    request.goal.samples = Some(4);
    request.work.zones = Some(6);
    request.devices.names = vec!["cpu".to_owned()];
    request
}

fn options(address: SocketAddr) -> SessionOptions {
    SessionOptions { tev: Some(address.to_string()), ..SessionOptions::default() }
}

#[test]
fn a_viewer_has_all_layers_of_the_picture_in_the_end() {
    let _processors = processors();
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let viewer = thread::spawn(move || listen(listener.accept().unwrap().0));
    let session = Session::open_with(&request(), options(address)).unwrap();
    let picture = session.render(Arc::new(()), &StopSwitch::new()).unwrap();
    let image = viewer.join().unwrap();
    let film = picture.film();
    let stride = film.layout().stride() + 1;
    let names: Vec<&String> = image.channels.keys().collect();
    assert_eq!(names, ["A", "B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "depth.Z"]);
    assert!(image.updates > 4, "{} updates: the picture was not shown while it was painted", image.updates);
    for (name, offset) in film.channels() {
        let expected = film.values().chunks_exact(stride).map(|pixel| pixel[offset].to_bits());
        let shown = image.channels[&name].iter().map(|value| value.to_bits());
        assert!(shown.eq(expected), "{name}");
    }
}

#[test]
fn a_missing_viewer_is_reported_and_one_that_quits_costs_no_picture() -> io::Result<()> {
    let _processors = processors();
    let listener = TcpListener::bind("127.0.0.1:0")?;
    let address = listener.local_addr()?;
    let gone = thread::spawn(move || drop(listener.accept().unwrap()));
    let picture = Session::open_with(&request(), options(address)).unwrap().render(Arc::new(()), &StopSwitch::new());
    assert!(picture.unwrap().is_whole());
    gone.join().unwrap();
    let session = Session::open_with(&request(), options(address)).unwrap();
    let error = session.render(Arc::new(()), &StopSwitch::new()).err().expect("nobody listens there");
    assert!(error.to_string().contains("tev does not answer"), "{error}");
    Ok(())
}
