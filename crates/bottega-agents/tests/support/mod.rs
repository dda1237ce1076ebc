//! Another platform on a real socket: it accepts messages as JADE does, and answers with recorded messages of JADE.
#![allow(dead_code, reason = "each test file uses a part")]

use std::{
    io::{Read, Write},
    net::{SocketAddr, TcpListener, TcpStream},
    sync::mpsc,
    thread,
    time::Duration,
};

use bottega_agents::{
    AgentId, Performative,
    driver::node::{Node, NodeConfig},
    entry_store::EntryStore,
    gateway::FirstForms,
    store::MemoryStore,
    wire::{Envelope, WireMessage, XML_FORM, parse_envelope, parse_string, parse_xml},
};

/// Time that a test waits for something that must come.
pub(crate) const WAIT: Duration = Duration::from_secs(10);

/// A message as JADE put it on the wire.
pub(crate) fn recorded(number: u32) -> String {
    // Tests of other crates use these messages, too.
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../bottega-agents/tests/jade_data");
    std::fs::read_to_string(folder.join(format!("{number:02}.http"))).unwrap()
}

/// A message that came from our platform.
#[derive(Debug)]
pub(crate) struct Heard {
    pub(crate) head: String,
    pub(crate) envelope: Envelope,
    pub(crate) message: WireMessage,
    /// The same message as received.
    pub(crate) payload: String,
}

/// A platform that is as strict as JADE 4.6.5 was found to be.
pub(crate) struct Jade {
    pub(crate) port: u16,
    heard: mpsc::Receiver<Heard>,
}

impl Jade {
    pub(crate) fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let (tell, heard) = mpsc::channel();
        thread::spawn(move || {
            for stream in listener.incoming() {
                let heard = take(stream.unwrap());
                if tell.send(heard).is_err() {
                    return;
                }
            }
        });
        Self { port, heard }
    }

    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/acc", self.port)
    }

    pub(crate) fn agent(&self, local: &str) -> AgentId {
        AgentId { name: format!("{local}@jade").into(), addresses: vec![self.address()].into() }
    }

    /// Returns the next message.
    pub(crate) fn hear(&self) -> Heard {
        self.heard.recv_timeout(WAIT).expect("a message in time")
    }

    /// Returns true if no message arrives for a while.
    pub(crate) fn hears_nothing(&self) -> bool {
        self.heard.recv_timeout(Duration::from_millis(300)).is_err()
    }

    /// A recorded message with other sender and receiver.
    pub(crate) fn says(&self, number: u32, node: &Node) -> String {
        self.says_else(number, node, |text| text)
    }

    /// Returns the same message with another body.
    pub(crate) fn says_else(&self, number: u32, node: &Node, change: impl FnOnce(String) -> String) -> String {
        self.says_to(number, node.local_address(), change)
    }

    /// Sends the same message to a platform in another process.
    pub(crate) fn says_to(&self, number: u32, at: SocketAddr, change: impl FnOnce(String) -> String) -> String {
        let (ours, its) = (at.to_string(), format!("127.0.0.1:{}", self.port));
        let text = recorded(number)
            .replace("127.0.0.1:7779", &ours)
            .replace("127.0.0.1:19081", &ours)
            .replace("127.0.0.1:7778", &its)
            .replace("127.0.0.1:27778", &its);
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        let body = change(body.to_owned());
        let old = head.lines().find(|line| line.starts_with("Content-Length: ")).unwrap();
        let head = head.replace(old, &format!("Content-Length: {}", body.len()));
        format!("{head}\r\n\r\n{body}")
    }
}

/// Takes one message as JADE does, and answers in its bytes.
fn take(mut stream: TcpStream) -> Heard {
    stream.set_read_timeout(Some(WAIT)).unwrap();
    let mut bytes = Vec::new();
    let mut buffer = [0; 4096];
    let (head, body) = loop {
        let count = stream.read(&mut buffer).unwrap();
        assert!(count > 0, "the connection ends in the middle of a message");
        bytes.extend(&buffer[..count]);
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let Some((head, body)) = text.split_once("\r\n\r\n") else { continue };
        let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: ")).expect("a length");
        let begin = bytes.len() - bytes[head.len() + 4..].len();
        if bytes.len() - begin >= length.parse::<usize>().unwrap() {
            break (head.to_owned(), body.to_owned());
        }
    };
    let boundary = head.split("boundary=\"").nth(1).expect("quotes around the boundary").split('"').next().unwrap();
    assert!(head.contains("multipart/mixed"));
    let parts: Vec<&str> = body.split(&format!("--{boundary}")).collect();
    let [preamble, envelope, payload, end] = &parts[..] else { panic!("{body}") };
    assert!(preamble.ends_with("\r\n") && end.starts_with("--"));
    let inner = |part: &str| {
        let (fields, rest) = part.trim_start_matches("\r\n").split_once("\r\n\r\n").unwrap();
        assert!(fields.starts_with("Content-Type: ") && !fields.contains('\n'), "one field and no other: {fields}");
        rest.strip_suffix("\r\n").unwrap().to_owned()
    };
    let (envelope, payload) = (inner(envelope), inner(payload));
    assert!(envelope.is_ascii(), "JADE takes the bytes of an envelope for Latin-1");
    let envelope = parse_envelope(&envelope).unwrap();
    assert!(!envelope.intended_receivers.is_empty(), "JADE drops it without");
    let message = if envelope.acl_representation == XML_FORM { parse_xml(&payload) } else { parse_string(&payload) };
    // JADE's own answer: no length, and the connection is left to the other side.
    stream.write_all(recorded(4).as_bytes()).unwrap();
    Heard { head, envelope, message: message.unwrap(), payload }
}

/// A platform of ours on a free port.
pub(crate) fn node(name: &str) -> Node {
    node_over(name, Box::new(MemoryStore::default()))
}

pub(crate) fn node_over(name: &str, store: Box<dyn EntryStore<String, usize> + Send>) -> Node {
    start(config(name, store))
}

pub(crate) fn start(config: NodeConfig) -> Node {
    Node::start(TcpListener::bind("127.0.0.1:0").unwrap(), config).unwrap()
}

pub(crate) fn config(name: &str, store: Box<dyn EntryStore<String, usize> + Send>) -> NodeConfig {
    NodeConfig {
        name: name.to_owned(),
        public: None,
        store,
        lease_max: None,
        federates: Vec::new(),
        administrators: vec![AgentId::new(format!("root@{name}"))],
        trusted: Vec::new(),
        permanent: Vec::new(),
        trace_line: |passage, _| format!("{} {}", passage.way.word(), passage.message.performative),
        first_forms: FirstForms::default(),
    }
}

/// A connection to one of our platforms.
pub(crate) struct Line(TcpStream);

impl Line {
    pub(crate) fn to(node: &Node) -> Self {
        Self::to_address(node.local_address())
    }

    pub(crate) fn to_address(at: SocketAddr) -> Self {
        let stream = TcpStream::connect(at).unwrap();
        stream.set_read_timeout(Some(WAIT)).unwrap();
        Self(stream)
    }

    pub(crate) fn write(&mut self, text: &str) {
        self.0.write_all(text.as_bytes()).unwrap();
    }

    /// Returns head and body of the next answer.
    pub(crate) fn read(&mut self) -> String {
        let mut bytes = Vec::new();
        let mut byte = [0];
        while !bytes.ends_with(b"\r\n\r\n") {
            if self.0.read(&mut byte).unwrap() == 0 {
                break;
            }
            bytes.push(byte[0]);
        }
        let head = String::from_utf8(bytes).unwrap();
        let length = head.lines().find_map(|line| line.strip_prefix("Content-Length: "));
        let mut body = vec![0; length.map_or(0, |length| length.parse().unwrap())];
        self.0.read_exact(&mut body).unwrap();
        head + std::str::from_utf8(&body).unwrap()
    }

    pub(crate) fn ask(&mut self, text: &str) -> String {
        self.write(text);
        self.read()
    }
}

/// The answer to JADE for a message that was taken.
pub(crate) const TAKEN: &str = "HTTP/1.1 200 OK\r\nContent-Type: text/plain\r\nCache-Control: no-cache\r\nContent-Length: \
                         0\r\nConnection: Keep-Alive\r\n\r\n";

pub(crate) fn is(message: &WireMessage, act: Performative) -> &str {
    assert_eq!(message.performative, act, "{message:?}");
    message.content.as_deref().unwrap_or_default()
}
