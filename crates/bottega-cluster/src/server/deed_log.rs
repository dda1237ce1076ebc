//! The log of actions through the HTTP servers of this machine: a line for each request that may change something, with the
//! name of its token. It outlives the jobs it names.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Write},
    net::IpAddr,
    path::PathBuf,
    sync::{Mutex, PoisonError},
};

use bottega_platform::{folders::state_folder, permissions::make_private};
use jiff::Timestamp;

use crate::job::record::unix_seconds;

/// Size in bytes at which a new log file starts; one previous file is kept beside it.
const BYTES_MAX: u64 = 8 << 20;

/// A log of HTTP actions; several processes may append to it.
#[derive(Debug)]
pub struct DeedLog {
    path: PathBuf,
    file: Mutex<Option<File>>,
}

impl DeedLog {
    /// Returns the log of this user's HTTP servers on this machine: `web.log` in Bottega's state folder.
    pub fn of_user() -> Self {
        Self::at(state_folder().join("web.log"))
    }

    /// Returns a log with the given file, which is created on the first write.
    pub fn at(path: PathBuf) -> Self {
        Self { path, file: Mutex::new(None) }
    }

    /// Appends a line for a request. A failure to write is only a warning of the program.
    ///
    /// - `token`: the name of the access token.
    /// - `address`: the IP address of the client.
    /// - `method`, `path`: those of the HTTP request.
    /// - `status`: the HTTP status of its response.
    pub fn note(&self, token: &str, address: IpAddr, method: &str, path: &str, status: u16) {
        let at = Timestamp::from_second(unix_seconds() as i64).unwrap_or_default();
        if let Err(error) = self.write(&format!("{at} {token} {address} {method} {path} {status}\n")) {
            tracing::warn!("cannot write to the log {}: {error}", self.path.display());
        }
    }

    fn write(&self, line: &str) -> io::Result<()> {
        let mut file = self.file.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(open) = &*file
            && open.metadata()?.len() > BYTES_MAX
        {
            *file = None;
            fs::rename(&self.path, self.path.with_extension("log.1"))?;
        }
        let mut open = match file.take() {
            Some(open) => open,
            None => {
                let open = OpenOptions::new().create(true).append(true).open(&self.path)?;
                make_private(&self.path)?;
                open
            }
        };
        // One write per line, so that lines of other processes do not mix in.
        open.write_all(line.as_bytes())?;
        *file = Some(open);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_done_is_noted_and_the_file_is_begun_again_when_it_is_long() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("web.log");
        let log = DeedLog::at(path.clone());
        let address = IpAddr::from([10, 0, 0, 3]);
        log.note("anna", address, "POST", "/api/jobs/3/pause", 200);
        let text = fs::read_to_string(&path).unwrap();
        let (at, rest) = text.split_once(' ').unwrap();
        assert!(at.ends_with('Z') && at.parse::<Timestamp>().is_ok(), "{text}");
        assert_eq!(rest, "anna 10.0.0.3 POST /api/jobs/3/pause 200\n");
        let long = "x".repeat(BYTES_MAX as usize);
        log.note(&long, address, "POST", "/", 200);
        log.note("bert", address, "DELETE", "/api/jobs/3", 204);
        assert!(fs::read_to_string(&path).unwrap().contains(" bert ") && fs::metadata(&path).unwrap().len() < 200);
        assert!(fs::metadata(folder.path().join("web.log.1")).unwrap().len() > BYTES_MAX);
    }
}
