//! Output files: formats, the check before rendering, and atomic writes.
//!
//! A symbolic link is kept and its target replaced. A path that is not a regular file, such as a FIFO, is written to.

use std::{
    fs::{self, OpenOptions},
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use tempfile::NamedTempFile;

use crate::ImageError;

/// A file format for pictures to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputFormat {
    /// OpenEXR: linear, with all AOVs.
    Exr,
    /// PNG: tone mapped.
    Png,
}

impl OutputFormat {
    /// Returns the format named by the extension of `path`; letter case is ignored.
    ///
    /// # Errors
    /// The extension is neither .exr nor .png, or there is none.
    pub fn of(path: &Path) -> Result<Self, ImageError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            Some(other) => Err(not_writable(path, format!("unknown extension `.{other}`; use .exr or .png"))),
            None => Err(not_writable(path, "it has no extension; use .exr or .png")),
        }
    }
}

fn not_writable(path: &Path, reason: impl Into<String>) -> ImageError {
    ImageError::NotWritable { path: path.to_owned(), reason: reason.into() }
}

/// Checks before rendering that a picture can be written to `path`: the extension, the folder, what exists there.
/// Leaves nothing behind. Returns the format of the file.
///
/// # Errors
/// The path names a directory, an unknown format, or a place where nothing can be written.
pub fn check_writable(path: impl AsRef<Path>) -> Result<OutputFormat, ImageError> {
    let path = path.as_ref();
    let format = OutputFormat::of(path)?;
    if path.is_dir() {
        return Err(not_writable(path, "it is a directory; name a file in it"));
    }
    let destination = Destination::of(path)?;
    let Destination::File(target) = &destination else { return Ok(format) };
    let folder = folder_of(target);
    match fs::metadata(folder) {
        Ok(found) if !found.is_dir() => {
            return Err(not_writable(path, format!("`{}` is not a directory", folder.display())));
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            return Err(not_writable(path, format!("the folder `{}` does not exist; create it", folder.display())));
        }
        Err(error) => return Err(ImageError::write(path, error)),
        Ok(_) => {}
    }
    if fs::metadata(path).is_ok_and(|found| found.permissions().readonly()) {
        return Err(not_writable(path, "the existing file is read-only"));
    }
    // Create a file to find out: permissions, quota and read-only file systems cannot be checked otherwise.
    AtomicFile::create(path).map(|_| format)
}

/// Writes `bytes` to `path` atomically: a concurrent reader sees the old file or the new one. Symbolic links are
/// followed; FIFOs and devices are written to.
///
/// # Errors
/// The file cannot be written; a regular file is then unchanged.
pub fn write_whole(path: impl AsRef<Path>, bytes: &[u8]) -> Result<(), ImageError> {
    write_whole_with(path, |out| out.write_all(bytes))
}

/// Writes a file like [`write_whole`], with a function that writes the bytes piece by piece.
///
/// # Errors
/// The file cannot be written, or `write` fails; a regular file is then unchanged.
pub fn write_whole_with(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), ImageError> {
    let path = path.as_ref();
    let mut file = AtomicFile::create(path)?;
    write(file.writer()).map_err(|source| ImageError::write(path, source))?;
    file.commit()
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Maximal number of symbolic links to follow, as in Linux.
const LINKS_MAX: usize = 40;

/// The destination of a write.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Destination {
    /// A regular file, which need not exist yet; not a symbolic link.
    File(PathBuf),
    /// A FIFO or device, which cannot be replaced.
    Stream(PathBuf),
}

impl Destination {
    /// Resolves symbolic links.
    fn of(path: &Path) -> Result<Self, ImageError> {
        let mut target = path.to_owned();
        for _ in 0..LINKS_MAX {
            let Ok(found) = fs::symlink_metadata(&target) else { return Ok(Self::File(target)) };
            if found.is_symlink() {
                let next = fs::read_link(&target).map_err(|error| ImageError::write(path, error))?;
                target = folder_of(&target).join(next);
            } else if found.is_file() || found.is_dir() {
                return Ok(Self::File(target));
            } else {
                return Ok(Self::Stream(target));
            }
        }
        Err(not_writable(path, "it is a symbolic link that leads back to itself"))
    }
}

/// A file that gets its name when it is complete. If dropped before [`commit`](Self::commit), it leaves nothing behind.
#[derive(Debug)]
pub(crate) struct AtomicFile {
    destination: Destination,
    writer: BufWriter<NamedTempFile>,
}

impl AtomicFile {
    /// Creates a temporary file in the destination's folder, or in the system's for a FIFO or device.
    ///
    /// # Errors
    /// The path names no file, or the temporary file cannot be created.
    pub(crate) fn create(path: &Path) -> Result<Self, ImageError> {
        let destination = Destination::of(path)?;
        let (place, folder) = match &destination {
            Destination::File(target) => (target.as_path(), folder_of(target).to_owned()),
            Destination::Stream(target) => (target.as_path(), std::env::temp_dir()),
        };
        let name = place.file_name().ok_or_else(|| not_writable(path, "it names no file"))?.to_string_lossy();
        // Use a short prefix, so that a file name near the maximal length still works.
        let prefix = format!(".{}.", name.chars().take(32).collect::<String>());
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".part");
        // Apply the user's umask: unlike temporary files, pictures are not private.
        if let Some(permissions) = bottega_platform::permissions::by_mask() {
            builder.permissions(permissions);
        }
        let file = builder.tempfile_in(folder).map_err(|error| ImageError::write(path, error))?;
        Ok(Self { destination, writer: BufWriter::new(file) })
    }

    /// Returns the buffered writer.
    pub(crate) fn writer(&mut self) -> &mut BufWriter<NamedTempFile> {
        &mut self.writer
    }

    /// Syncs the file to disk and renames it to its destination; or copies it into a FIFO or device, which waits for a
    /// reader of a FIFO.
    pub(crate) fn commit(self) -> Result<(), ImageError> {
        let (Destination::File(path) | Destination::Stream(path)) = &self.destination;
        let deliver = || -> std::io::Result<()> {
            let file = self.writer.into_inner().map_err(std::io::IntoInnerError::into_error)?;
            file.as_file().sync_all()?;
            match &self.destination {
                Destination::File(target) => file.persist(target).map(drop).map_err(|error| error.error),
                Destination::Stream(target) => {
                    let mut stream = OpenOptions::new().write(true).open(target)?;
                    std::io::copy(&mut file.reopen()?, &mut stream)?;
                    stream.flush()
                }
            }
        };
        deliver().map_err(|error| ImageError::write(path, error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reason(path: &Path) -> String {
        match check_writable(path) {
            Err(ImageError::NotWritable { reason, .. }) => reason,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn an_output_that_cannot_be_written_is_found_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        assert!(reason(&folder.path().join("a.jpg")).contains("`.jpg`"));
        assert!(reason(&folder.path().join("picture")).contains("no extension"));
        assert!(reason(&folder.path().join("missing/a.exr")).contains("does not exist"));
        fs::create_dir(folder.path().join("folder.exr")).unwrap();
        assert!(reason(&folder.path().join("folder.exr")).contains("directory"));
        fs::write(folder.path().join("file"), b"x").unwrap();
        let below_a_file = check_writable(folder.path().join("file/a.exr")).unwrap_err();
        assert!(below_a_file.to_string().contains("a.exr"), "{below_a_file}");
        let read_only = folder.path().join("kept.png");
        fs::write(&read_only, b"x").unwrap();
        let mut permissions = fs::metadata(&read_only).unwrap().permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&read_only, permissions).unwrap();
        assert!(reason(&read_only).contains("read-only"));
    }

    #[test]
    fn the_check_leaves_nothing_behind_and_changes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.EXR");
        fs::write(&path, b"old").unwrap();
        assert_eq!(check_writable(&path).unwrap(), OutputFormat::Exr);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_write_that_fails_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        fs::write(&path, b"old").unwrap();
        let mut failed = AtomicFile::create(&path).unwrap();
        failed.writer().write_all(b"half").unwrap();
        drop(failed);
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        let mut file = AtomicFile::create(&path).unwrap();
        file.writer().write_all(b"new").unwrap();
        file.commit().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_stays_one_and_what_it_leads_to_is_written() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("disk")).unwrap();
        fs::write(at("disk/real.png"), b"old").unwrap();
        symlink("disk/real.png", at("link.png")).unwrap();
        symlink("link.png", at("second.png")).unwrap();
        symlink("disk/new.png", at("dangling.png")).unwrap();
        for (link, target) in [("link.png", "real.png"), ("second.png", "real.png"), ("dangling.png", "new.png")] {
            assert_eq!(check_writable(at(link)).unwrap(), OutputFormat::Png);
            write_whole(at(link), link.as_bytes()).unwrap();
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
            assert_eq!(fs::read(at("disk").join(target)).unwrap(), link.as_bytes());
        }
        assert_eq!(fs::read_dir(at("disk")).unwrap().count(), 2);
        symlink("nowhere/a.png", at("lost.png")).unwrap();
        assert!(reason(&at("lost.png")).contains("does not exist"));
        symlink("circle.png", at("circle.png")).unwrap();
        assert!(reason(&at("circle.png")).contains("leads back to itself"));
    }

    #[cfg(unix)]
    #[test]
    fn a_fifo_is_written_into() {
        use std::os::unix::fs::FileTypeExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pipe.png");
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        if !made.is_ok_and(|status| status.success()) {
            eprintln!("skipped: there is no mkfifo");
            return;
        }
        // The check must not block until something reads the pipe.
        assert_eq!(check_writable(&path).unwrap(), OutputFormat::Png);
        let reader = {
            let path = path.clone();
            std::thread::spawn(move || fs::read(path).unwrap())
        };
        let bytes = vec![7; 100_000];
        write_whole(&path, &bytes).unwrap();
        assert_eq!(reader.join().unwrap(), bytes);
        assert!(fs::symlink_metadata(&path).unwrap().file_type().is_fifo());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
