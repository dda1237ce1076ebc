//! The bars for external engines: an image that an engine renders in zones for bottega must equal the one that it renders of the
//! whole frame by itself, without our workers.

mod compare;

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, bail, ensure};
use bottega_image::{Picture, Rect, read_picture};
use bottega_platform::run_head::RunHead;
use serde_json::{Map, Value, json};
use tempfile::TempDir;

use compare::{FrameDifference, compare};

use crate::python;

/// The approximate number of zones per image.
const ZONES: u32 = 12;
/// The number of images per method, if noise differs.
const SEEDS: u32 = 6;
/// The maximum relative difference between the means of all images.
const MEAN_OFF_MAX: f64 = 0.003;
/// The maximum share of differing pixels at a significance of 1 %, of which chance explains 1 %.
const DIFFERING_MAX: f64 = 0.015;
/// The minimum probability that there are no seams.
const NO_SEAMS_MIN: f64 = 1e-3;

/// A scene, and the bar for an engine on it.
struct Bar {
    engine: &'static str,
    scene: ScenePlace,
    size: &'static str,
    samples: u32,
    /// `true`: zones must be bit-identical to the frame.
    has_bits: bool,
}

/// The location of a scene.
enum ScenePlace {
    /// A scene made for the checks, in the repository.
    Checks(&'static str),
    /// The same as a `.blend` file, which Blender creates.
    Made(&'static str),
    /// A scene of the repository.
    Own(&'static str),
    /// A scene in the folder that `BOTTEGA_SCENES` names.
    Large(&'static str),
}

const BARS: &[Bar] = &[
    Bar { engine: "mitsuba", scene: ScenePlace::Checks("room.xml"), size: "192x144", samples: 32, has_bits: false },
    Bar {
        engine: "mitsuba",
        scene: ScenePlace::Large("peers/c_goblets.xml"),
        size: "192x144",
        samples: 64,
        has_bits: false,
    },
    Bar { engine: "cycles", scene: ScenePlace::Made("room.blend"), size: "192x144", samples: 32, has_bits: true },
    Bar { engine: "cycles", scene: ScenePlace::Own("goblets.glb"), size: "192x144", samples: 32, has_bits: true },
    Bar { engine: "luxcore", scene: ScenePlace::Checks("room.cfg"), size: "192x144", samples: 32, has_bits: false },
    Bar {
        engine: "luxcore",
        scene: ScenePlace::Large("peers/c_goblets.scn"),
        size: "192x144",
        samples: 64,
        has_bits: false,
    },
    Bar { engine: "povray", scene: ScenePlace::Checks("room.pov"), size: "192x144", samples: 9, has_bits: true },
    Bar {
        engine: "povray",
        scene: ScenePlace::Large("external/povray/glassthing.pov"),
        size: "192x144",
        samples: 4,
        has_bits: true,
    },
];

/// The result of a check or a bar.
pub(crate) struct BarRow {
    engine: String,
    what: String,
    /// For a bar: the difference found, and the number of zones.
    found: Option<(FrameDifference, usize)>,
    /// The problem; `None`: passed.
    problem: Option<String>,
}

impl BarRow {
    pub(crate) fn passes(&self) -> bool {
        self.problem.is_none()
    }

    /// Returns the row of a check that passed or failed.
    pub(crate) fn check(engine: &str, what: &str, outcome: Result<()>) -> Self {
        let problem = outcome.err().map(|error| format!("{error:#}"));
        Self { engine: engine.to_owned(), what: what.to_owned(), found: None, problem }
    }

    fn as_json(&self) -> Value {
        let mut row =
            json!({"engine": self.engine, "what": self.what, "passes": self.passes(), "problem": self.problem});
        if let Some((found, zones)) = &self.found {
            row["zones"] = json!(zones);
            row["equal_share"] = json!(found.equal);
            row["mean_off"] = json!(found.mean_off);
            row["mean_error"] = json!(found.mean_error);
            row["differing_share"] = json!(found.differing);
            row["flip"] = json!(found.flip);
            row["flip_of_seeds"] = json!(found.flip_of_seeds);
            row["no_seams_p"] = json!(found.no_seams);
        }
        row
    }
}

/// Prints the rows below their header, as text or JSON.
pub(crate) fn print(head: &RunHead, rows: &[BarRow], json: bool) {
    if json {
        let head: Map<_, _> = head.fields().iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
        println!("{}", json!({"head": head, "rows": rows.iter().map(BarRow::as_json).collect::<Vec<_>>()}));
        return;
    }
    println!("{head}");
    println!(
        "{:<8} {:<48} {:>5} {:>8} {:>16} {:>8} {:>15} {:>7}",
        "engine", "what", "zones", "bits", "mean off", "differ", "FLIP (of seeds)", "seams p"
    );
    for row in rows {
        let figures = row.found.as_ref().map_or_else(
            || " ".repeat(64),
            |(found, zones)| {
                let mean = format!("{:+.3} ± {:.3} %", 100.0 * found.mean_off, 100.0 * found.mean_error);
                let flip = format!("{:.4} ({:.4})", found.flip, found.flip_of_seeds);
                format!(
                    "{zones:>5} {:>6.1} % {mean:>16} {:>6.2} % {flip:>15} {:>7.3}",
                    100.0 * found.equal,
                    100.0 * found.differing,
                    found.no_seams
                )
            },
        );
        let verdict = row.problem.as_ref().map_or_else(|| "passes".to_owned(), |problem| format!("FAILS: {problem}"));
        println!("{:<8} {:<48} {figures}  {verdict}", row.engine, row.what);
    }
}

/// Compares an engine with its bars.
///
/// - `must`: `true` if a missing scene is a failure; else it is only reported.
pub(crate) fn hold(program: &Path, engine: &str, must: bool) -> Vec<BarRow> {
    let mut rows = Vec::new();
    for bar in BARS.iter().filter(|bar| bar.engine == engine) {
        let name = bar.scene.name();
        match bar.paint_and_compare(program) {
            Ok(None) if must => {
                let problem = format!("there is no {name}: BOTTEGA_SCENES must name the folder that has it");
                rows.push(BarRow::check(engine, name, Err(anyhow::anyhow!(problem))));
            }
            Ok(None) => eprintln!("LEFT OUT: {engine} on {name}, which BOTTEGA_SCENES does not have"),
            Ok(Some((found, zones))) => rows.push(BarRow {
                engine: engine.to_owned(),
                what: format!("{name}, {}, {} samples", bar.size, bar.samples),
                problem: bar.problem(&found),
                found: Some((found, zones)),
            }),
            Err(error) => rows.push(BarRow::check(engine, name, Err(error))),
        }
    }
    rows
}

impl ScenePlace {
    fn name(&self) -> &'static str {
        match self {
            Self::Checks(name) | Self::Made(name) | Self::Own(name) | Self::Large(name) => name,
        }
    }

    /// Returns the file, if it exists or can be created.
    fn file(&self, scratch: &Path) -> Result<Option<PathBuf>> {
        let root = root();
        let file = match self {
            Self::Checks(name) => root.join("engines/tests/scenes").join(name),
            Self::Own(name) => root.join("scenes").join(name),
            Self::Large(name) => match env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()) {
                Some(folder) => Path::new(&folder).join(name),
                None => return Ok(None),
            },
            Self::Made(name) => {
                let file = scratch.join(name);
                python(&[&root.join("engines/tests/make_scenes.py"), &file])?;
                file
            }
        };
        Ok(file.is_file().then_some(file))
    }
}

impl Bar {
    fn paint_and_compare(&self, program: &Path) -> Result<Option<(FrameDifference, usize)>> {
        let scratch = TempDir::new()?;
        let Some(scene) = self.scene.file(scratch.path())? else { return Ok(None) };
        let seeds: Vec<u32> = (1..=if self.has_bits { 1 } else { SEEDS }).collect();
        let frames = self.full_frames(&scene, &seeds, scratch.path())?;
        let (mut zoned, mut rects) = (Vec::new(), Vec::new());
        for seed in seeds {
            let (picture, zones) = self.in_zones(program, &scene, seed, scratch.path())?;
            ensure!(zones.len() > 1, "the picture was not cut into zones");
            zoned.push(picture);
            rects.push(zones);
        }
        let zones = rects[0].len();
        Ok(Some((compare(&frames, &zoned, &rects)?, zones)))
    }

    /// Renders full frames with the engine's own interface.
    fn full_frames(&self, scene: &Path, seeds: &[u32], scratch: &Path) -> Result<Vec<Picture>> {
        let folder = scratch.join("frames");
        let listed = seeds.iter().map(u32::to_string).collect::<Vec<_>>().join(",");
        let samples = self.samples.to_string();
        let script = root().join("engines/tests/full_frame.py");
        let words: Vec<&Path> = vec![
            &script,
            Path::new(self.engine),
            scene,
            Path::new("--size"),
            Path::new(self.size),
            Path::new("--samples"),
            Path::new(&samples),
            Path::new("--seeds"),
            Path::new(&listed),
            Path::new("-o"),
            &folder,
        ];
        python(&words)?;
        let read = |seed: &u32| Ok(read_picture(folder.join(format!("{seed}.exr")))?);
        seeds.iter().map(read).collect()
    }

    /// Renders with bottega in zones; returns the zones, too.
    fn in_zones(&self, program: &Path, scene: &Path, seed: u32, scratch: &Path) -> Result<(Picture, Vec<Rect>)> {
        let output = scratch.join(format!("zones-{seed}.exr"));
        let mut command = Command::new(program);
        command.envs(python::engine_variable());
        command.arg("render").arg(scene).arg("-o").arg(&output).args([
            "--engine",
            self.engine,
            "--set",
            "work.level=3",
            "--json",
        ]);
        command.args(["--size", self.size, "--set", &format!("work.zones={ZONES}")]);
        command.args(["--spp", &self.samples.to_string(), "--seed", &seed.to_string()]);
        command.env("XDG_STATE_HOME", scratch).stdin(Stdio::null()).stderr(Stdio::piped());
        let done = command.output().with_context(|| format!("cannot start {}", program.display()))?;
        if !done.status.success() {
            bail!("bottega fails: {}", String::from_utf8_lossy(&done.stderr).trim());
        }
        let events = String::from_utf8_lossy(&done.stdout).into_owned();
        let events = events.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let analyzed = events.into_iter().find(|event| event["event"] == "analyzed");
        let analyzed = analyzed.context("bottega does not tell its zones")?;
        let number = |value: &Value| value.as_u64().unwrap_or_default() as u32;
        let rects = analyzed["zones"].as_array().into_iter().flatten().map(|zone| {
            let rect = &zone["rect"];
            Rect::new(number(&rect[0]), number(&rect[1]), number(&rect[2]), number(&rect[3]))
        });
        Ok((read_picture(output)?, rects.collect()))
    }

    /// Returns the reason why a difference exceeds the bars.
    fn problem(&self, found: &FrameDifference) -> Option<String> {
        let mut problems = Vec::new();
        if self.has_bits && found.equal < 1.0 {
            problems.push(format!("{:.2} % of the pixels have other bits", 100.0 * (1.0 - found.equal)));
        }
        if found.mean_off.abs() > MEAN_OFF_MAX {
            problems.push("the means differ".to_owned());
        }
        if found.differing > DIFFERING_MAX {
            problems.push("more pixels differ than by chance".to_owned());
        }
        if found.no_seams < NO_SEAMS_MIN {
            problems.push("edges of zones can be seen".to_owned());
        }
        (!problems.is_empty()).then(|| problems.join(", "))
    }
}

/// Returns the root of the repository.
pub(crate) fn root() -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    root.canonicalize().unwrap_or(root)
}

/// Runs a script; prints its output if it fails.
fn python(words: &[&Path]) -> Result<()> {
    let done = Command::new(python::interpreter())
        .args(words)
        .stdin(Stdio::null())
        .output()
        .context("cannot start python3")?;
    let said = [done.stdout, done.stderr].concat();
    let said = String::from_utf8_lossy(&said).into_owned();
    let last: Vec<&str> = said.lines().rev().take(5).collect();
    let name = words[0].file_name().unwrap_or_default().display();
    ensure!(done.status.success(), "{name} fails: {}", last.into_iter().rev().collect::<Vec<_>>().join(" "));
    Ok(())
}

/// Checks that an engine can be used here; the error contains the reason, and how to install it.
pub(crate) fn is_here(program: &Path, engine: &str) -> Result<()> {
    let state = TempDir::new()?;
    let mut command = Command::new(program);
    command.envs(python::engine_variable());
    command.args(["engines", "check", engine]).env("XDG_STATE_HOME", state.path()).env("NO_COLOR", "1");
    let done = command.stdin(Stdio::null()).output().with_context(|| format!("cannot start {}", program.display()))?;
    let said = String::from_utf8_lossy(&done.stderr).replace(['│', '×', '╰', '├', '─', '▶'], " ");
    ensure!(done.status.success(), "{}", said.split_whitespace().collect::<Vec<_>>().join(" "));
    Ok(())
}

/// Runs the checks of a worker.
///
/// - `log`: the file for their output.
pub(crate) fn check_worker(engine: &str, log: &Path) -> Result<()> {
    let file = fs::File::create(log)?;
    let mut command = Command::new(python::interpreter());
    command.arg(root().join("engines/tests/check_worker.py")).arg(engine).stdin(Stdio::null());
    let status = command.stdout(file.try_clone()?).stderr(file).status().context("cannot start python3")?;
    let said = fs::read_to_string(log).unwrap_or_default();
    let wrong: Vec<&str> = said.lines().filter(|line| line.contains("WRONG")).map(str::trim).collect();
    let why = if wrong.is_empty() { said.trim().to_owned() } else { wrong.join("; ") };
    ensure!(status.success(), "{why}");
    Ok(())
}
