//! The append-only log behind a [`FileStore`](super::FileStore).
//!
//! Format, little endian: eight bytes `BOTTEGA` and 4, a generation (u64), then [records](crate::framing) of a revision
//! (u64), the length of a key (u32), the key and a value. A record with an empty key only gives the last revision.

use std::{
    fs::{File, OpenOptions},
    io::{self, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use super::error::FileStoreError;
use crate::framing::{RECORD_HEAD_BYTES, read_record, record_head};

const MAGIC: [u8; 8] = *b"BOTTEGA\x04";
const HEAD_BYTES: u64 = 16;
/// Maximum length of a payload, in bytes.
const PAYLOAD_BYTES_MAX: u64 = 1 << 21;

/// A record: one write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct LogRecord {
    pub(super) revision: u64,
    pub(super) key: String,
    pub(super) value: String,
}

/// The records since the log was last read.
pub(super) struct LogUpdate {
    /// True if the log was rewritten: earlier records must be discarded first.
    pub(super) is_rewritten: bool,
    pub(super) records: Vec<LogRecord>,
}

#[derive(Debug)]
pub(super) struct RecordLog {
    path: PathBuf,
    file: File,
    generation: u64,
    /// Length of the part of the file that was read, all of it valid.
    sound_bytes: u64,
    lock: File,
}

impl RecordLog {
    /// Opens a log, or creates one.
    pub(super) fn open(path: &Path) -> Result<Self, FileStoreError> {
        let open = |path: &Path| OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path);
        let lock = open(&beside(path, "lock"))?;
        let file = open(path)?;
        let mut log = Self { path: path.to_owned(), file, generation: 0, sound_bytes: 0, lock };
        log.lock()?;
        let begun = log.begin();
        log.unlock()?;
        begun.map(|()| log)
    }

    /// Writes the header of a new log, or checks that of an existing one. Requires the lock.
    fn begin(&mut self) -> Result<(), FileStoreError> {
        // Another process may have replaced the log after it was opened
        self.file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&self.path)?;
        if self.file.metadata()?.len() < HEAD_BYTES {
            // New, or incomplete without any content
            self.file.set_len(0)?;
            self.file.write_all(&head(1))?;
            self.file.sync_all()?;
            sync_folder(&self.path)?;
        }
        self.generation = read_generation(&mut self.file)?;
        Ok(())
    }

    pub(super) fn bytes(&self) -> u64 {
        self.sound_bytes
    }

    /// Locks the file against writes by other processes.
    pub(super) fn lock(&self) -> io::Result<()> {
        self.lock.lock()
    }

    /// Unlocks the file.
    pub(super) fn unlock(&self) -> io::Result<()> {
        self.lock.unlock()
    }

    /// Reads new records. `alone`: an incomplete record was left by a crash and is cut off; otherwise it may be in
    /// progress.
    pub(super) fn read_new(&mut self, alone: bool) -> Result<LogUpdate, FileStoreError> {
        let mut now = File::open(&self.path)?;
        let generation = read_generation(&mut now)?;
        let is_rewritten = generation != self.generation || self.sound_bytes == 0;
        if is_rewritten {
            self.file = OpenOptions::new().read(true).write(true).open(&self.path)?;
            // If it was replaced again meanwhile, the next read detects that
            self.generation = read_generation(&mut self.file)?;
            self.sound_bytes = HEAD_BYTES;
        }
        let length = self.file.metadata()?.len();
        let mut records = Vec::new();
        if length > self.sound_bytes {
            self.file.seek(SeekFrom::Start(self.sound_bytes))?;
            let mut bytes = Vec::new();
            (&mut self.file).take(length - self.sound_bytes).read_to_end(&mut bytes)?;
            let mut rest = &bytes[..];
            loop {
                let mut after = rest;
                let payload = read_record(&mut after, PAYLOAD_BYTES_MAX)?;
                let Some(record) = payload.as_deref().and_then(parse) else { break };
                records.push(record);
                rest = after;
            }
            self.sound_bytes += (bytes.len() - rest.len()) as u64;
            if alone && !rest.is_empty() {
                self.file.set_len(self.sound_bytes)?;
            }
        }
        Ok(LogUpdate { is_rewritten, records })
    }

    /// Appends a record. Requires the lock, after [`Self::read_new`].
    pub(super) fn append(&mut self, record: &LogRecord) -> Result<(), FileStoreError> {
        let bytes = print_record(record);
        self.file.seek(SeekFrom::Start(self.sound_bytes))?;
        let written = self.file.write_all(&bytes).and_then(|()| self.file.sync_data());
        if let Err(error) = written {
            // The next writer cuts off an incomplete record; do so now if possible
            _ = self.file.set_len(self.sound_bytes);
            return Err(error.into());
        }
        self.sound_bytes += bytes.len() as u64;
        Ok(())
    }

    /// Rewrites the log with these records only. Requires the lock, after [`Self::read_new`].
    pub(super) fn replace<'a>(&mut self, records: impl Iterator<Item = &'a LogRecord>) -> Result<(), FileStoreError> {
        let path = beside(&self.path, "new");
        let mut file = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(&path)?;
        let mut bytes = head(self.generation + 1).to_vec();
        for record in records {
            bytes.extend(print_record(record));
        }
        file.write_all(&bytes)?;
        file.sync_all()?;
        std::fs::rename(&path, &self.path)?;
        sync_folder(&self.path)?;
        self.file = file;
        self.generation += 1;
        self.sound_bytes = bytes.len() as u64;
        Ok(())
    }
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(ending);
    name.into()
}

/// Syncs the folder, so that a file's name survives a crash.
fn sync_folder(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

fn head(generation: u64) -> [u8; HEAD_BYTES as usize] {
    let mut head = [0; HEAD_BYTES as usize];
    head[..8].copy_from_slice(&MAGIC);
    head[8..].copy_from_slice(&generation.to_le_bytes());
    head
}

fn read_generation(file: &mut File) -> Result<u64, FileStoreError> {
    let mut head = [0; HEAD_BYTES as usize];
    file.seek(SeekFrom::Start(0))?;
    file.read_exact(&mut head)?;
    let (magic, generation) = head.split_at(8);
    if magic != MAGIC {
        return Err(FileStoreError::Magic);
    }
    Ok(u64::from_le_bytes(generation.try_into().expect("eight bytes are left")))
}

fn print_record(record: &LogRecord) -> Vec<u8> {
    let mut bytes = vec![0; RECORD_HEAD_BYTES];
    bytes.extend(record.revision.to_le_bytes());
    bytes.extend((record.key.len() as u32).to_le_bytes());
    bytes.extend(record.key.as_bytes());
    bytes.extend(record.value.as_bytes());
    let head = record_head(&bytes[RECORD_HEAD_BYTES..]);
    bytes[..RECORD_HEAD_BYTES].copy_from_slice(&head);
    bytes
}

/// Parses a record's payload. `None`: invalid.
fn parse(payload: &[u8]) -> Option<LogRecord> {
    let (revision, payload) = payload.split_at_checked(8)?;
    let (key_bytes, payload) = payload.split_at_checked(4)?;
    let key_bytes = u32::from_le_bytes(key_bytes.try_into().ok()?) as usize;
    let (key, value) = payload.split_at_checked(key_bytes)?;
    Some(LogRecord {
        revision: u64::from_le_bytes(revision.try_into().ok()?),
        key: std::str::from_utf8(key).ok()?.to_owned(),
        value: std::str::from_utf8(value).ok()?.to_owned(),
    })
}
