//! The files of a stage: layers, packages and pictures, and their names.
//!
//! A file has the name that [`Resources`] gives it; a member of a package that of the package with its own in brackets, as in
//! `room.usdz[textures/wood.png]`. The library asks for layers through [`Client`], which must live as long as the stage and
//! therefore sends its questions to the thread that has the resources.

use std::collections::BTreeMap;
use std::io;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use openusd::ar::{Asset, ResolvedPath, Resolver};

use super::package::Package;
use super::{crate_file, layer_text};
use crate::error::SceneError;
use crate::import::request::ImportRequest;
use crate::resource::Location;
use crate::text::{decode_utf8, shortened};

/// The name of the layer that selects variants, which is not a file.
pub(super) const SESSION: &str = "selected-variants.usda";

/// The first bytes of a binary layer.
const CRATE: &[u8] = b"PXR-USDC";

/// Most layers of a stage.
const LAYERS_MAX: usize = 100_000;

/// The files of a stage. Several threads may use it.
pub(super) struct Files<'a> {
    request: &'a ImportRequest<'a>,
    /// Name of the scene file.
    root: String,
    known: Mutex<KnownNames>,
}

#[derive(Default)]
struct KnownNames {
    /// Names by anchor and reference.
    names: BTreeMap<(String, String), String>,
    locations: BTreeMap<String, Location>,
    packages: BTreeMap<String, Arc<Package>>,
    /// Layers, ready for the library.
    layers: BTreeMap<String, Arc<Vec<u8>>>,
    session: Option<Arc<Vec<u8>>>,
}

/// Returns the package and the member of a name.
pub(super) fn member_of(name: &str) -> Option<(&str, &str)> {
    name.strip_suffix(']')?.split_once('[')
}

impl<'a> Files<'a> {
    /// Makes the files of a request; nothing is read.
    pub(super) fn new(request: &'a ImportRequest<'a>) -> Self {
        let root = request.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self { request, root, known: Mutex::default() }
    }

    fn known(&self) -> MutexGuard<'_, KnownNames> {
        self.known.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the name of the root layer.
    pub(super) fn root(&self) -> &str {
        &self.root
    }

    /// Sets the layer that is stronger than the root layer.
    pub(super) fn set_session(&self, text: String) {
        self.known().session = Some(Arc::new(text.into_bytes()));
    }

    /// Checks the root layer, so that its faults are errors with their place.
    pub(super) fn check_root(&self) -> Result<(), SceneError> {
        let name = self.named("", &self.root)?;
        self.layer(&name).map(drop)
    }

    /// Returns the name of a file; it need not exist.
    ///
    /// - `anchor`: name of the layer with the reference; empty: the root's folder.
    pub(super) fn named(&self, anchor: &str, reference: &str) -> Result<String, SceneError> {
        let key = (anchor.to_owned(), reference.to_owned());
        if let Some(name) = self.known().names.get(&key) {
            return Ok(name.clone());
        }
        let name = self.find(anchor, reference)?;
        self.known().names.insert(key, name.clone());
        Ok(name)
    }

    fn find(&self, anchor: &str, reference: &str) -> Result<String, SceneError> {
        // A reference within a package stays there
        if let Some((package, layer)) = member_of(anchor) {
            let folder = layer.rsplit_once('/').map_or("", |(folder, _)| folder);
            return Ok(format!("{package}[{}]", joined(folder, reference)));
        }
        let (file, member) = match member_of(reference) {
            Some((file, member)) => (file, Some(member)),
            None => (reference, None),
        };
        let folder = anchor.rsplit_once('/').map_or("", |(folder, _)| folder);
        let place = if anchor.is_empty() { &self.root } else { anchor };
        let location = self.request.resources.locate_in(&[folder], file, place)?;
        let name = location.name.clone();
        self.known().locations.insert(name.clone(), location);
        match member {
            Some(member) => Ok(format!("{name}[{member}]")),
            None if is_package(&name) => {
                // A package stands for its first layer. One that cannot be read keeps its name, and fails when it is opened.
                let first = self.package(&name).ok().and_then(|package| Some(package.first_layer().ok()?.to_owned()));
                Ok(first.map_or(name.clone(), |first| format!("{name}[{first}]")))
            }
            None => Ok(name),
        }
    }

    /// Returns true if a named file exists, whether or not the scene may read it.
    pub(super) fn exists(&self, name: &str) -> bool {
        if let Some((package, member)) = member_of(name) {
            return self.package(package).is_ok_and(|package| package.member(member).is_some());
        }
        name == self.root || self.known().locations.get(name).is_some_and(|location| location.path().is_file())
    }

    /// Reads a named file.
    pub(super) fn read(&self, name: &str) -> Result<Vec<u8>, SceneError> {
        if let Some((package, member)) = member_of(name) {
            let package = self.package(package)?;
            let bytes = package.member(member).ok_or_else(|| self.missing(name))?;
            return Ok(bytes.to_vec());
        }
        if name == self.root {
            return Ok(self.request.file.to_vec());
        }
        let location = self.known().locations.get(name).cloned();
        self.request.resources.read(&location.ok_or_else(|| self.missing(name))?)
    }

    fn missing(&self, name: &str) -> SceneError {
        let source = io::ErrorKind::NotFound.into();
        SceneError::Read { path: PathBuf::from(name), by: self.root.clone(), source }
    }

    fn package(&self, name: &str) -> Result<Arc<Package>, SceneError> {
        if let Some(package) = self.known().packages.get(name) {
            return Ok(package.clone());
        }
        let bytes = self.read(name)?;
        self.request.resources.budget().take(self.request.path, name, bytes.len())?;
        let package = Package::new(bytes)
            .map_err(|fault| SceneError::Damaged { path: self.path_of(name), problem: fault.to_string() })?;
        let package = Arc::new(package);
        self.known().packages.insert(name.to_owned(), package.clone());
        Ok(package)
    }

    /// Returns the path of a named file, for messages.
    fn path_of(&self, name: &str) -> PathBuf {
        if name == self.root {
            return self.request.path.into();
        }
        match self.known().locations.get(name) {
            Some(location) => location.path().into(),
            None => PathBuf::from(name),
        }
    }

    /// Returns the bytes of a layer as the library can read them.
    fn layer(&self, name: &str) -> Result<Arc<Vec<u8>>, SceneError> {
        let (ready, count) = {
            let known = self.known();
            let session = known.session.as_ref().filter(|_| name == SESSION);
            (session.or_else(|| known.layers.get(name)).cloned(), known.layers.len())
        };
        if let Some(ready) = ready {
            return Ok(ready);
        }
        if count >= LAYERS_MAX {
            return Err(SceneError::Limit {
                path: self.request.path.into(),
                place: name.into(),
                problem: format!("the stage has more than {LAYERS_MAX} layers"),
                remedy: "flatten it",
            });
        }
        if let Some((package, _)) = member_of(name).filter(|(_, member)| is_package(member)) {
            let problem = format!("`{}` is a package within a package, which is not read", shortened(name));
            return Err(SceneError::Damaged { path: self.path_of(package), problem });
        }
        if is_package(name) {
            // There is no first layer
            let problem = self.package(name)?.first_layer().map_or_else(|fault| fault.to_string(), str::to_owned);
            return Err(SceneError::Damaged { path: self.path_of(name), problem });
        }
        let bytes = self.read(name)?;
        let path = self.path_of(member_of(name).map_or(name, |(package, _)| package));
        let budget = self.request.resources.budget();
        // The library keeps the values in some other form
        budget.take(self.request.path, name, bytes.len().saturating_mul(2))?;
        let layer = if bytes.starts_with(CRATE) {
            crate_file::check(&bytes, budget.limit())
                .map_err(|fault| SceneError::Damaged { path, problem: fault.to_string() })?;
            bytes
        } else {
            let text = decode_utf8(&path, &bytes, budget)?;
            let mended = layer_text::mended(&text).map_err(|fault| SceneError::Text {
                path: path.clone(),
                line: fault.line,
                column: 1,
                problem: fault.problem,
            })?;
            mended.into_bytes()
        };
        let layer = Arc::new(layer);
        self.known().layers.insert(name.to_owned(), layer.clone());
        Ok(layer)
    }

    /// Returns the text of the root layer as the library reads it; `None`: it is binary.
    pub(super) fn root_text(&self) -> Option<String> {
        let name = self.named("", &self.root).ok()?;
        let layer = self.layer(&name).ok()?;
        String::from_utf8(layer.to_vec()).ok().filter(|text| !text.as_bytes().starts_with(CRATE))
    }
}

fn is_package(name: &str) -> bool {
    name.to_ascii_lowercase().ends_with(".usdz")
}

/// Joins a folder within a package and a reference; `..` does not leave the package.
fn joined(folder: &str, reference: &str) -> String {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in reference.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." => _ = parts.pop(),
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// A request of the library, and the channel for its answer.
enum FileRequest {
    Name { anchor: String, reference: String, answer: Sender<String> },
    Exists { name: String, answer: Sender<bool> },
    Layer { name: String, answer: Sender<Result<Arc<Vec<u8>>, String>> },
}

/// Asks for files on behalf of the library.
pub(super) struct Client {
    requests: Sender<FileRequest>,
}

/// Answers the questions of a [`Client`].
pub(super) struct Server {
    requests: Receiver<FileRequest>,
}

/// Makes a client and its server.
pub(super) fn connect() -> (Client, Server) {
    let (sender, receiver) = channel();
    (Client { requests: sender }, Server { requests: receiver })
}

impl Server {
    /// Answers requests until the client has ended.
    pub(super) fn serve(self, files: &Files<'_>) {
        for request in self.requests {
            // A client that has ended needs no answer
            match request {
                FileRequest::Name { anchor, reference, answer } => {
                    // A reference that cannot be followed keeps its name, and is not found
                    _ = answer.send(files.named(&anchor, &reference).unwrap_or(reference));
                }
                FileRequest::Exists { name, answer } => _ = answer.send(name == SESSION || files.exists(&name)),
                FileRequest::Layer { name, answer } => {
                    _ = answer.send(files.layer(&name).map_err(|error| error.to_string()));
                }
            }
        }
    }
}

impl Client {
    /// Sends a request and waits for its answer; `None`: the server has ended.
    fn ask<T>(&self, request: impl FnOnce(Sender<T>) -> FileRequest) -> Option<T> {
        let (sender, receiver) = channel();
        self.requests.send(request(sender)).ok()?;
        receiver.recv().ok()
    }
}

impl Resolver for Client {
    fn create_identifier(&self, reference: &str, anchor: Option<&ResolvedPath>) -> String {
        if reference.is_empty() || reference == SESSION {
            return reference.into();
        }
        let anchor = anchor.map(|anchor| anchor.to_string_lossy().into_owned()).filter(|anchor| anchor != SESSION);
        let ask =
            |answer| FileRequest::Name { anchor: anchor.unwrap_or_default(), reference: reference.into(), answer };
        self.ask(ask).unwrap_or_else(|| reference.into())
    }

    fn resolve(&self, name: &str) -> Option<ResolvedPath> {
        let exists = !name.is_empty() && self.ask(|answer| FileRequest::Exists { name: name.into(), answer })?;
        exists.then(|| ResolvedPath::new(name))
    }

    fn resolve_for_new_asset(&self, _: &str) -> Option<ResolvedPath> {
        None
    }

    fn open_asset(&self, resolved: &ResolvedPath) -> io::Result<Box<dyn Asset>> {
        let name = resolved.to_string_lossy().into_owned();
        let layer = self.ask(|answer| FileRequest::Layer { name, answer });
        let layer = layer.ok_or_else(|| io::Error::other("the files of the scene are closed"))?;
        let layer = layer.map_err(io::Error::other)?;
        Ok(Box::new(io::Cursor::new(layer.to_vec())))
    }

    fn get_modification_timestamp(&self, _: &str, _: &ResolvedPath) -> Option<std::time::SystemTime> {
        None
    }

    fn identity(&self) -> String {
        "bottega".into()
    }
}
