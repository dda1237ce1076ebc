//! Parts of the HTTP client of a farm that are not in Python: the files of a scene, digests, and previews as arrays.

use std::{
    fs::File,
    io::{self, Read},
    path::{Component, Path, PathBuf},
};

use bottega::{Error, Session, request::EnvironmentLight};
use bottega_cluster::uploads::PIECE_BYTES;
use numpy::{IntoPyArray, PyArray3};
use pyo3::{exceptions::PyValueError, prelude::*};

use crate::{
    errors, image_file::decoded, process::refuse_forked, request::request_of, values::path_of, waiting::Caller,
};

/// The folders around a scene whose files lie outside its own folder.
const INNER: &str = "in";

/// Returns a request with the names under which the files of its scene are uploaded, and these files by name.
///
/// Raises the errors of the request and its scene.
#[pyfunction]
pub(crate) fn submission(py: Python<'_>, request: &str) -> PyResult<(String, Vec<(String, PathBuf)>)> {
    refuse_forked()?;
    let mut request = request_of(request)?.by_engine_of_scene();
    let examined = request.clone();
    let files = Caller::new(py).wait_for(move |_, _| Session::examine_for_elsewhere(&examined))?.whole()?;
    let files = files.map_err(|error| errors::raised(&error))?.files;
    // Nest the scene as deep as its references leave its folder
    let depth = files.iter().map(|file| leading_out(&file.name)).max().unwrap_or(0);
    let folder: PathBuf = std::iter::repeat_n(INNER, depth).collect();
    let mut named = vec![(named_in(&folder, &file_name(&request.scene.file))?, request.scene.file.clone())];
    for file in files {
        named.push((named_in(&folder, Path::new(&file.name))?, file.path));
    }
    request.scene.file = PathBuf::from(&named[0].0);
    if let Some(EnvironmentLight::File(path)) = &mut request.environment.light {
        let name = named_in(&folder, &file_name(path))?;
        named.push((name.clone(), std::mem::replace(path, PathBuf::from(name))));
    }
    if let Some(output) = &mut request.output.file {
        *output = file_name(output);
    }
    Ok((request.to_json().map_err(|error| errors::raised_by_request(&error))?, named))
}

/// Returns size and BLAKE3 digests of a file: of all of it, and of its pieces of 4 MiB.
#[pyfunction]
pub(crate) fn digests(py: Python<'_>, path: &Bound<'_, PyAny>) -> PyResult<(u64, String, Vec<String>)> {
    let path = path_of(path)?;
    py.detach(|| digests_of(&path)).map_err(|source| errors::raised(&Error::Read { path: path.clone(), source }))
}

fn digests_of(path: &Path) -> io::Result<(u64, String, Vec<String>)> {
    let (mut file, mut whole, mut size, mut pieces) = (File::open(path)?, blake3::Hasher::new(), 0, Vec::new());
    loop {
        let mut piece = Vec::new();
        Read::by_ref(&mut file).take(PIECE_BYTES as u64).read_to_end(&mut piece)?;
        if piece.is_empty() {
            return Ok((size, whole.finalize().to_hex().to_string(), pieces));
        }
        size += piece.len() as u64;
        whole.update(&piece);
        pieces.push(blake3::hash(&piece).to_hex().to_string());
    }
}

/// Returns a preview, the bytes of a PNG file, as an array: uint8, (height, width, 3), sRGB.
#[pyfunction]
pub(crate) fn preview_array<'py>(py: Python<'py>, png: &[u8]) -> PyResult<Bound<'py, PyArray3<u8>>> {
    Ok(py.detach(|| decoded(png)).map_err(PyValueError::new_err)?.into_pyarray(py))
}

fn leading_out(name: &str) -> usize {
    Path::new(name).components().take_while(|part| *part == Component::ParentDir).count()
}

fn file_name(path: &Path) -> PathBuf {
    path.file_name().map(PathBuf::from).unwrap_or_default()
}

/// Returns the name of a file that is given relative to a folder, with `/` between folders.
fn named_in(folder: &Path, name: &Path) -> PyResult<String> {
    let mut parts: Vec<String> = folder.iter().map(|part| part.to_string_lossy().into_owned()).collect();
    for part in name.components() {
        match part {
            Component::Normal(part) => parts.push(part.to_string_lossy().into_owned()),
            Component::ParentDir => _ = parts.pop(),
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => {
                let problem = format!("the scene refers to `{}` by an absolute path", name.display());
                return Err(errors::farm(
                    problem,
                    Some("copy it beside the scene, and refer to it by a relative path".into()),
                ));
            }
        }
    }
    Ok(parts.join("/"))
}
