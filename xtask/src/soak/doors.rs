//! The interfaces of a farm that a soak test uses: command line, HTTP, Python.

use std::{
    io::{BufRead, BufReader, Read, Write},
    net::TcpStream,
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    time::Duration,
};

use anyhow::{Context, Result, bail, ensure};
use serde_json::{Value, json};

use super::kinds::PictureKind;

/// The timeout of an answer.
const PATIENCE: Duration = Duration::from_secs(60);
const PYTHON: &str = include_str!("door.py");

/// An interface of a farm.
pub(super) enum Door {
    Cli(CommandLine),
    Api(Api),
    Python(Box<Python>),
}

/// The command line.
#[derive(Clone)]
pub(super) struct CommandLine {
    pub(super) program: PathBuf,
    pub(super) state: PathBuf,
}

/// The HTTP interface: `HOST:PORT`, and a token that can steer.
#[derive(Clone)]
pub(super) struct Api {
    pub(super) at: String,
    pub(super) token: String,
}

/// A Python process with the module.
pub(super) struct Python {
    child: Child,
    asks: ChildStdin,
    tells: BufReader<ChildStdout>,
}

impl Door {
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Cli(_) => "CLI",
            Self::Api(_) => "API",
            Self::Python(_) => "Python",
        }
    }

    /// Returns all jobs as the interface reports them.
    pub(super) fn jobs(&mut self) -> Result<Vec<Value>> {
        match self {
            Self::Cli(cli) => cli.lines(&["jobs", "list", "--json"]),
            Self::Api(api) => api.list("/api/jobs"),
            Self::Python(python) => python.list("jobs"),
        }
    }

    /// Submits a job. Returns its number.
    ///
    /// - `like`: a job whose scene the farm already has.
    pub(super) fn submit(&mut self, kind: &PictureKind, output: &Path, like: Option<u64>) -> Result<u64> {
        match self {
            Self::Cli(cli) => {
                let more = ["-o".to_owned(), output.display().to_string(), "--farm".to_owned(), "--detach".to_owned()];
                let words: Vec<String> =
                    kind.render_words().into_iter().chain(more).chain(["--json".to_owned()]).collect();
                let words: Vec<&str> = words.iter().map(String::as_str).collect();
                let submitted = cli.lines(&words)?.into_iter().find_map(|event| event["job"].as_u64());
                submitted.context("`render --detach` printed no number")
            }
            Self::Api(api) => {
                let Some(like) = like else { bail!("no job has the scene yet") };
                let mut request = kind.request.clone();
                request["output"] = json!({ "file": output.file_name().map(|name| name.to_string_lossy()) });
                request["scene"] = json!({ "file": kind.scene_name() });
                let answer = api.ask("POST", "/api/jobs", &json!({ "request": request, "files_of_job": like }))?;
                answer["job"].as_u64().context("the API returned no number")
            }
            Self::Python(python) => {
                let mut request = kind.request.clone();
                request["scene"]["file"] = json!(kind.scene);
                request["output"]["file"] = json!(output);
                python.ask("submit", 0, &request)?.as_u64().context("Python returned no number")
            }
        }
    }

    /// Pauses, resumes, cancels or removes a job.
    pub(super) fn steer(&mut self, job: u64, word: &str) -> Result<()> {
        match self {
            Self::Cli(cli) => cli.run(&["jobs", word, &job.to_string()]).map(drop),
            Self::Api(api) if word == "remove" => {
                api.ask("DELETE", &format!("/api/jobs/{job}"), &Value::Null).map(drop)
            }
            Self::Api(api) => api.ask("POST", &format!("/api/jobs/{job}/{word}"), &Value::Null).map(drop),
            Self::Python(python) => python.ask(word, job, &json!({})).map(drop),
        }
    }

    /// Writes the image of a job to a file.
    pub(super) fn fetch(&mut self, job: u64, path: &Path) -> Result<()> {
        let file = path.display().to_string();
        match self {
            Self::Cli(cli) => cli.run(&["jobs", "fetch", &job.to_string(), "-o", &file]).map(drop),
            Self::Api(api) => {
                let (status, bytes) = api.raw("GET", &format!("/api/jobs/{job}/picture"), b"")?;
                ensure!(status == 200, "the picture of job {job}: {status}: {}", String::from_utf8_lossy(&bytes));
                Ok(std::fs::write(path, bytes)?)
            }
            Self::Python(python) => python.ask("fetch", job, &json!({ "path": file })).map(drop),
        }
    }
}

impl CommandLine {
    pub(super) fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(&self.program);
        command.args(words).env("XDG_STATE_HOME", &self.state).env_remove("BOTTEGA_FARM").stdin(Stdio::null());
        command
    }

    pub(super) fn run(&self, words: &[&str]) -> Result<String> {
        let output = self.command(words).output()?;
        let stderr = String::from_utf8_lossy(&output.stderr);
        ensure!(output.status.success(), "bottega {}: {stderr}", words.join(" "));
        Ok(String::from_utf8(output.stdout)?)
    }

    fn lines(&self, words: &[&str]) -> Result<Vec<Value>> {
        self.run(words)?.lines().map(|line| Ok(serde_json::from_str(line)?)).collect()
    }
}

impl Api {
    pub(super) fn raw(&self, method: &str, path: &str, body: &[u8]) -> Result<(u16, Vec<u8>)> {
        let Self { at, token } = self;
        let mut stream = TcpStream::connect(at)?;
        stream.set_read_timeout(Some(PATIENCE))?;
        let head = format!(
            "{method} {path} HTTP/1.0\r\nHost: {at}\r\nAuthorization: Bearer {token}\r\nContent-Type: application/json\r\n\
             Content-Length: {}\r\n\r\n",
            body.len()
        );
        stream.write_all(&[head.as_bytes(), body].concat())?;
        let (mut reader, mut line, mut status) = (BufReader::new(stream), String::new(), None);
        while reader.read_line(&mut line)? > 2 {
            status = status.or_else(|| line.split(' ').nth(1)?.parse().ok());
            line.clear();
        }
        let mut body = Vec::new();
        reader.read_to_end(&mut body)?;
        Ok((status.context("no answer over HTTP")?, body))
    }

    pub(super) fn ask(&self, method: &str, path: &str, body: &Value) -> Result<Value> {
        let body = if body.is_null() { Vec::new() } else { body.to_string().into_bytes() };
        let (status, body) = self.raw(method, path, &body)?;
        ensure!((200..300).contains(&status), "{method} {path}: {status}: {}", String::from_utf8_lossy(&body));
        Ok(serde_json::from_slice(&body).unwrap_or_default())
    }

    pub(super) fn list(&self, path: &str) -> Result<Vec<Value>> {
        let rows = self.ask("GET", path, &Value::Null)?;
        rows.as_array().cloned().with_context(|| format!("{path} is not a list"))
    }
}

impl Python {
    /// Opens the Python interface. `None`: this Python cannot import the module.
    ///
    /// - `module`: the folder that Python searches first.
    pub(super) fn start(python: &Path, module: &Path, address: &str, state: &Path) -> Result<Option<Self>> {
        let command = |words: &[&str]| {
            let mut command = Command::new(python);
            command.args(words).env("PYTHONPATH", module).env("XDG_STATE_HOME", state);
            command
        };
        let has_module = command(&["-c", "import bottega"]).stderr(Stdio::null()).status();
        if !has_module.is_ok_and(|status| status.success()) {
            return Ok(None);
        }
        let mut command = command(&["-c", PYTHON, address]);
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn()?;
        let asks = child.stdin.take().context("a pipe")?;
        let mut python = Self { tells: BufReader::new(child.stdout.take().context("a pipe")?), asks, child };
        python.answer().context("the Python door does not open")?;
        Ok(Some(python))
    }

    fn answer(&mut self) -> Result<Value> {
        let mut line = String::new();
        self.tells.read_line(&mut line)?;
        serde_json::from_str(&line).with_context(|| format!("Python says `{line}`"))
    }

    fn ask(&mut self, word: &str, job: u64, more: &Value) -> Result<Value> {
        writeln!(self.asks, "{}", json!({ "word": word, "job": job, "more": more }))?;
        let answer = self.answer()?;
        if let Some(wrong) = answer["wrong"].as_str() {
            bail!("Python, {word} {job}: {wrong}");
        }
        Ok(answer["result"].clone())
    }

    fn list(&mut self, word: &str) -> Result<Vec<Value>> {
        self.ask(word, 0, &json!({}))?.as_array().cloned().context("Python returned no list")
    }
}

impl Drop for Python {
    fn drop(&mut self) {
        // The process may have ended already.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}
