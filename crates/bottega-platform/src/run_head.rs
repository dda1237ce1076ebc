//! The header of measurements: sources, command, machine and date.

use std::{
    env,
    fmt::{self, Display},
    path::Path,
    thread,
};

/// The prefix of environment variables that belong to a command.
const VARIABLES: &str = "BOTTEGA_";

/// The header of measurements. As text it has one line per field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunHead {
    /// The commit of the measured program, with `-dirty` if its sources differ from it; or `unknown`.
    pub commit: String,
    /// The build of the measured program.
    pub build: String,
    /// The command line of this process, preceded by the environment variables `BOTTEGA_…`; secrets in addresses are left out.
    pub command: String,
    /// The number of processors that this process may use, and their name.
    pub processors: String,
    /// The operating system.
    pub system: String,
    /// The start time of the process, as RFC 3339.
    pub date: String,
}

impl RunHead {
    /// Returns the header for measurements by this process.
    ///
    /// - `commit`: the commit of the measured program, with `-dirty` if its sources differ from it; or `unknown`.
    /// - `build`: the build of the measured program.
    /// - `date`: the start time of the process, as RFC 3339.
    pub fn new(commit: impl Into<String>, build: impl Into<String>, date: impl Display) -> Self {
        let count = thread::available_parallelism().map_or(1, usize::from);
        Self {
            commit: commit.into(),
            build: build.into(),
            command: command(),
            processors: format!("{count} × {}", processor()),
            system: system(),
            date: date.to_string(),
        }
    }

    /// Returns the name and the value of each field, in the order of the header's lines.
    pub fn fields(&self) -> [(&'static str, &str); 6] {
        [
            ("commit", &self.commit),
            ("build", &self.build),
            ("command", &self.command),
            ("processors", &self.processors),
            ("system", &self.system),
            ("date", &self.date),
        ]
    }
}

impl Display for RunHead {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.fields().iter().try_for_each(|(name, value)| writeln!(f, "{name:<11}{value}"))
    }
}

/// Returns the command line of this process.
fn command() -> String {
    let mut variables: Vec<(String, String)> = env::vars_os()
        .filter_map(|(name, value)| Some((name.into_string().ok()?, value.to_string_lossy().into_owned())))
        .filter(|(name, _)| name.starts_with(VARIABLES))
        .collect();
    variables.sort();
    let variables = variables.iter().map(|(name, value)| format!("{name}={}", word(value)));
    let mut words = env::args_os();
    let program = words.next().unwrap_or_default();
    let program = Path::new(&program).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let words = words.map(|it| word(&it.to_string_lossy()));
    variables.chain([program]).chain(words).collect::<Vec<_>>().join(" ")
}

/// Quotes a word for a shell, without the secret in a farm's address between `://` and `@`.
fn word(text: &str) -> String {
    let secret = text.find("://").and_then(|from| Some((from + 3, text[from..].find('@')? + from)));
    let text = secret.map_or_else(|| text.to_owned(), |(from, to)| format!("{}…{}", &text[..from], &text[to..]));
    let is_plain = |c: char| c.is_alphanumeric() || "-_./=:,@+%…".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

/// Returns the name of the processors, or their architecture if the system does not report it.
fn processor() -> String {
    named_processor().filter(|name| !name.is_empty()).unwrap_or_else(|| env::consts::ARCH.to_owned())
}

#[cfg(target_os = "linux")]
fn named_processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

#[cfg(not(target_os = "linux"))]
fn named_processor() -> Option<String> {
    let mut system = sysinfo::System::new().ok()?;
    system.refresh_cpu_list(sysinfo::CpuRefreshKind::nothing());
    Some(system.cpus().first()?.brand().trim().to_owned())
}

/// Returns the operating system with its release.
#[cfg(target_os = "linux")]
fn system() -> String {
    let read = |path: &str| std::fs::read_to_string(path).unwrap_or_default();
    let release = read("/etc/os-release");
    let name = release.lines().find_map(|line| line.strip_prefix("PRETTY_NAME="));
    let name = name.map(|name| format!("{}, ", name.trim_matches('"'))).unwrap_or_default();
    format!("{name}Linux {}", read("/proc/sys/kernel/osrelease").trim())
}

/// Returns the operating system with its release.
#[cfg(not(target_os = "linux"))]
fn system() -> String {
    sysinfo::System::long_os_version().unwrap_or_else(|_| env::consts::OS.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_says_a_line_for_each_field() {
        let head = RunHead::new("0123456789ab-dirty", "release", "2026-01-02T03:04:05Z");
        let text = head.to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), head.fields().len());
        assert_eq!((lines[0], lines[5]), ("commit     0123456789ab-dirty", "date       2026-01-02T03:04:05Z"));
        assert!(lines[2].contains("bottega_platform"), "the program of this test: {text}");
        let count = thread::available_parallelism().unwrap().to_string();
        assert!(lines[3].starts_with(&format!("processors {count} × ")) && lines[3].len() > 15, "{text}");
        assert!(head.fields().iter().all(|(_, value)| !value.is_empty()), "{text}");
    }

    #[test]
    fn words_are_quoted_as_shells_read_them_and_secrets_are_left_out() {
        for (text, written) in [
            ("--scale=0.5", "--scale=0.5"),
            ("--zones 4", "'--zones 4'"),
            ("it's", r"'it'\''s'"),
            ("", "''"),
            ("bottega://word@10.0.0.7:4222", "bottega://…@10.0.0.7:4222"),
            ("--farm=nats://user:word@host", "--farm=nats://…@host"),
            ("tcp://10.0.0.7:7070", "tcp://10.0.0.7:7070"),
            ("a@b://c", "a@b://c"),
        ] {
            assert_eq!(word(text), written, "{text}");
        }
    }
}
