//! The journal beside a picture: it keeps finished zones through an interruption, for `--resume`.

use std::{
    fs::{File, OpenOptions},
    io::{BufReader, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use bottega_farm::{Journal, JournalContents, JournalWriter, ZoneStore};

use crate::{error::Error, request::Request};

/// The journal of a picture, opened for writing, with the zones it already holds.
pub struct PictureJournal {
    /// The path of the journal.
    pub path: PathBuf,
    /// The writer of the journal.
    pub store: Box<dyn ZoneStore>,
    /// The contents that were read on resuming; `None`: a new journal.
    pub kept: Option<JournalContents>,
}

/// Returns the path of a picture's journal; the file exists while the picture is unfinished.
pub fn journal_of(output: &Path) -> PathBuf {
    let mut path = output.as_os_str().to_owned();
    path.push(".bottega-journal");
    PathBuf::from(path)
}

/// Returns true if the file is a readable journal of the picture with this name; see [`Session::name`](crate::Session::name).
pub fn is_journal_of(path: &Path, name: &str) -> bool {
    let journal = File::open(path).ok().and_then(|file| Journal::read(BufReader::new(file)).ok());
    journal.is_some_and(|journal| journal.name == name)
}

impl PictureJournal {
    /// Opens and returns the journal beside the output of a request; `None`: the request has no output file, or the picture no
    /// name.
    ///
    /// - `name`: a text with everything that determines the pixels; see [`Session::name`](crate::Session::name).
    ///
    /// # Errors
    /// The journal cannot be written; with `resume`, also if it is missing, damaged or of another picture.
    pub fn of_request(request: &Request, name: Option<&str>, resume: bool) -> Result<Option<Self>, Error> {
        let named = request.output.file.as_deref().zip(name);
        named.map(|(file, name)| Self::begin(file, name, resume)).transpose()
    }

    /// Creates the journal of `output`, or with `resume` opens the existing one. Returns it.
    ///
    /// - `name`: a text with everything that determines the pixels.
    ///
    /// # Errors
    /// The journal cannot be written; with `resume`, also if it is missing, damaged or of another picture.
    pub fn begin(output: &Path, name: &str, resume: bool) -> Result<Self, Error> {
        let path = journal_of(output);
        if resume { Self::resume(path, name) } else { Self::create(path, name) }
    }

    fn create(path: PathBuf, name: &str) -> Result<Self, Error> {
        let write = |source| Error::Write { path: path.clone(), source };
        let file = File::create(&path).map_err(write)?;
        let store = Box::new(JournalWriter::create(file, name).map_err(write)?);
        Ok(Self { path, store, kept: None })
    }

    fn resume(path: PathBuf, name: &str) -> Result<Self, Error> {
        let file = match OpenOptions::new().read(true).write(true).open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Err(Error::failed(
                    format!("there is nothing to resume: no `{}`", path.display()),
                    "leave out --resume to start again; the journal is beside the picture until it is finished",
                ));
            }
            Err(source) => return Err(Error::Read { path, source }),
        };
        let journal =
            Journal::read(BufReader::new(&file)).map_err(|source| Error::Journal { path: path.clone(), source })?;
        if journal.name != name {
            return Err(Error::failed(
                format!("`{}` is of another picture: {}", path.display(), difference(&journal.name, name)),
                "give the same scene and options as before, or leave out --resume to start again",
            ));
        }
        let write = |source| Error::Write { path: path.clone(), source };
        // Cut off what an interrupted write has left at the end
        file.set_len(journal.sound_bytes).map_err(write)?;
        let mut file = file;
        file.seek(SeekFrom::End(0)).map_err(write)?;
        Ok(Self { path, store: Box::new(JournalWriter::append(file)), kept: journal.kept })
    }
}

/// Returns the first difference of two names, as a clause.
fn difference(kept: &str, wanted: &str) -> String {
    let differing = kept.split("; ").zip(wanted.split("; ")).find(|(kept, wanted)| kept != wanted);
    differing.map_or_else(|| "it differs".to_owned(), |(kept, wanted)| format!("it has {kept}, not {wanted}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_journal_of_another_picture_is_refused_by_what_differs() {
        let folder = tempfile::tempdir().expect("a folder");
        let output = folder.path().join("picture.exr");
        drop(PictureJournal::begin(&output, "scene=a; spp=4", false).map_err(drop).expect("a new journal"));
        assert!(PictureJournal::begin(&output, "scene=a; spp=4", true).is_ok());
        let error = PictureJournal::begin(&output, "scene=a; spp=8", true).map(|_| ()).expect_err("another picture");
        assert!(error.to_string().contains("it has spp=4, not spp=8"), "{error}");
        assert!(is_journal_of(&journal_of(&output), "scene=a; spp=4"));
        assert!(!is_journal_of(&journal_of(&output), "scene=a; spp=8") && !is_journal_of(&output, "scene=a; spp=4"));
    }

    #[test]
    fn without_a_journal_there_is_nothing_to_go_on_with() {
        let folder = tempfile::tempdir().expect("a folder");
        let error =
            PictureJournal::begin(&folder.path().join("picture.exr"), "", true).map(|_| ()).expect_err("no journal");
        assert!(error.to_string().contains("nothing to resume"), "{error}");
    }

    #[test]
    fn something_else_in_the_journals_place_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let output = folder.path().join("picture.png");
        std::fs::write(folder.path().join("picture.png.bottega-journal"), b"not a journal at all").expect("written");
        assert!(matches!(PictureJournal::begin(&output, "", true), Err(Error::Journal { .. })));
    }
}
