//! Capture of standard error, for libraries such as drivers that write to it themselves.

/// Runs `work` and captures the output of the process to standard error meanwhile. Returns the result of `work` and the captured
/// text, at most 64 KiB. If the system does not allow that, the output is written as usual and the returned text is empty. Output
/// of other threads is captured, too, so `work` should be short.
pub fn capture<R>(work: impl FnOnce() -> R) -> (R, String) {
    #[cfg(unix)]
    if let Ok(redirection) = redirection::Redirection::begin() {
        let result = work();
        return (result, redirection.end());
    }
    (work(), String::new())
}

#[cfg(unix)]
mod redirection {
    use std::{
        fs::File,
        io::{self, Read, Seek, SeekFrom},
        os::fd::{AsFd, OwnedFd},
        sync::{Mutex, MutexGuard, PoisonError},
    };

    use nix::unistd::dup2_stderr;

    /// The maximum length of the returned text, in bytes.
    const TEXT_MAX: u64 = 1 << 16;

    /// Held while standard error is redirected: a process has only one.
    static REDIRECTED: Mutex<()> = Mutex::new(());

    /// A redirection of standard error to an unnamed file, until it is dropped.
    pub(super) struct Redirection {
        before: OwnedFd,
        file: File,
        _alone: MutexGuard<'static, ()>,
    }

    impl Redirection {
        /// Redirects standard error. Blocks while another redirection lasts.
        ///
        /// # Errors
        /// The system allows no temporary file, or no redirection.
        pub(super) fn begin() -> io::Result<Self> {
            let alone = REDIRECTED.lock().unwrap_or_else(PoisonError::into_inner);
            let file = tempfile::tempfile()?;
            let before = io::stderr().as_fd().try_clone_to_owned()?;
            dup2_stderr(&file)?;
            Ok(Self { before, file, _alone: alone })
        }

        /// Restores standard error, and returns the captured text.
        pub(super) fn end(mut self) -> String {
            let mut text = Vec::new();
            // Text that cannot be read is lost.
            let _ = self.file.seek(SeekFrom::Start(0));
            let _ = self.file.by_ref().take(TEXT_MAX).read_to_end(&mut text);
            String::from_utf8_lossy(&text).into_owned()
        }
    }

    impl Drop for Redirection {
        fn drop(&mut self) {
            let _ = dup2_stderr(&self.before);
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::process::Command;

    use super::*;

    #[test]
    fn what_is_written_meanwhile_is_kept_and_what_comes_later_is_not() {
        // A child writes to the same descriptor, like a driver.
        let say = |word: &str| {
            assert!(Command::new("sh").args(["-c", &format!("echo {word} >&2")]).status().unwrap().success());
        };
        let (seven, said) = capture(|| {
            say("swallowed");
            7
        });
        assert_eq!(seven, 7);
        assert!(said.contains("swallowed"), "{said}");
        let ((), inner) = capture(|| say("later"));
        assert!(inner.contains("later") && !inner.contains("swallowed"), "{inner}");
    }
}
