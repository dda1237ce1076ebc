//! `bottega bench peers`: error and time beside other renderers, on the same triangles, in one run.
//!
//! Error is the relative mean squared error against a reference, without the worst thousandth of the pixels and without
//! the error of the reference itself. For all who sample without bias, error times seconds is a constant of renderer and
//! scene; its inverse is the efficiency, and the quotient of two efficiencies says how many times as fast as the other
//! one comes to the same error. Time is that of the clock on the wall, or, on a machine that has other work as well, that of
//! the processors.

use std::{
    fs::{self, File},
    io::{Read, Write},
    path::PathBuf,
    process::{Command, ExitCode, Stdio},
    thread,
    time::{Duration, Instant},
};

use bottega_image::{Picture, USUAL_TRIM, firefly_count, read_picture, rel_mse_trimmed};
use serde_json::{Value, json};

use super::{
    paint_ours,
    scene::{self, NeutralScene},
};
use bottega::devices::processors;

use crate::{cli::PeersArgs, clock::processor_seconds, error::CliError};

/// A renderer that is run as a child of its own: some hang, some abort, none may take the others along.
struct Peer {
    name: &'static str,
    /// Python, told the folder, scene, samples, seed, threads and where the picture is to be.
    script: &'static str,
    /// What it is told beside that.
    variant: Option<&'static str>,
}

const PEERS: [Peer; 4] = [
    Peer { name: "mitsuba llvm_ad_rgb", script: include_str!("peers/mitsuba.py"), variant: Some("llvm_ad_rgb") },
    Peer { name: "mitsuba scalar_rgb", script: include_str!("peers/mitsuba.py"), variant: Some("scalar_rgb") },
    Peer { name: "cycles", script: include_str!("peers/cycles.py"), variant: None },
    Peer { name: "luxcore", script: include_str!("peers/luxcore.py"), variant: None },
];

const OURS: &str = "bottega";

/// How often a child is asked whether it has ended.
const POLL: Duration = Duration::from_millis(20);

/// One picture painted.
struct Painted {
    picture: Picture,
    seconds: f64,
    /// Samples a pixel, as some take more than they are told.
    samples: f64,
}

/// What a renderer reached on a scene with a number of threads.
struct Row {
    scene: String,
    threads: usize,
    renderer: &'static str,
    /// Pixels times samples, all in millions a second; medians of the repetitions.
    mpaths: f64,
    seconds: f64,
    rel_mse: f64,
    /// Pixels far brighter than what is around them, in one picture.
    fireflies: f64,
}

impl Row {
    fn efficiency(&self) -> f64 {
        1.0 / (self.rel_mse * self.seconds)
    }
}

pub(super) fn run(args: &PeersArgs) -> Result<ExitCode, CliError> {
    let scenes = scenes(args)?;
    let known: Value = fs::read(args.folder.join("reference/ref_info.json"))
        .ok()
        .and_then(|bytes| serde_json::from_slice(&bytes).ok())
        .unwrap_or_default();
    let threads = if args.threads.is_empty() { vec![1, processors()] } else { args.threads.clone() };
    let mut missing: Vec<(&str, String)> = Vec::new();
    let mut rows = Vec::new();
    for name in &scenes {
        let scene = scene::load(&args.folder.join(name).with_extension("json"))?;
        let reference = read_picture(args.folder.join(format!("reference/ref_{name}.exr")))?;
        let peers: Vec<&Peer> = PEERS.iter().filter(|peer| args.includes(peer.name)).collect();
        let reference_error = known[name]["ref_relmse"].as_f64().unwrap_or(0.0);
        for &threads in &threads {
            let mut all: Vec<(&'static str, Vec<Painted>)> = vec![(OURS, Vec::new())];
            all.extend(peers.iter().map(|peer| (peer.name, Vec::new())));
            // In turn, so that whatever else the machine does meanwhile meets all of them.
            for seed in 0..args.repeat {
                all[0].1.push(ours(&scene, threads, args, seed)?);
                for (peer, (_, painted)) in peers.iter().zip(&mut all[1..]) {
                    if missing.iter().any(|(name, _)| *name == peer.name) {
                        continue;
                    }
                    match paint(peer, args, &scene, name, threads, seed) {
                        Ok(picture) => painted.push(picture),
                        Err(reason) => {
                            eprintln!("{} is left out: {reason}", peer.name);
                            missing.push((peer.name, reason));
                        }
                    }
                }
            }
            for (renderer, painted) in all {
                if painted.len() == usize::from(args.repeat) {
                    rows.push(row(name, threads, renderer, &painted, &reference, reference_error)?);
                }
            }
        }
    }
    if args.json {
        println!("{}", as_json(&rows, &missing));
    } else {
        print!("{}", as_text(&rows));
    }
    Ok(ExitCode::SUCCESS)
}

/// The scenes to paint: those asked for, or all of the folder that have a reference.
fn scenes(args: &PeersArgs) -> Result<Vec<String>, CliError> {
    if !args.scene.is_empty() {
        return Ok(args.scene.clone());
    }
    let entries = fs::read_dir(&args.folder).map_err(|source| CliError::read(args.folder.clone(), source))?;
    let mut scenes: Vec<String> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
        .filter(|name| args.folder.join(format!("reference/ref_{name}.exr")).is_file())
        .collect();
    scenes.sort();
    if scenes.is_empty() {
        return Err(CliError::usage(
            format!("there is no scene in `{}`", args.folder.display()),
            "it must hold SCENE.json, SCENE.xml, SCENE.scn, their meshes, and reference/ref_SCENE.exr",
        ));
    }
    Ok(scenes)
}

fn row(
    scene: &str,
    threads: usize,
    renderer: &'static str,
    painted: &[Painted],
    reference: &Picture,
    reference_error: f64,
) -> Result<Row, CliError> {
    let mut seconds: Vec<f64> = painted.iter().map(|painted| painted.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let seconds = seconds[seconds.len() / 2];
    let count = painted.len() as f64;
    let (mut error, mut samples, mut fireflies) = (0.0, 0.0, 0.0);
    for painted in painted {
        error += rel_mse_trimmed(reference, &painted.picture, USUAL_TRIM)? / count;
        samples += painted.samples / count;
        fireflies += firefly_count(&painted.picture) as f64 / count;
    }
    let mpaths = samples * reference.data.len() as f64 / seconds / 1e6;
    let rel_mse = (error - reference_error).max(1e-9);
    Ok(Row { scene: scene.to_owned(), threads, renderer, mpaths, seconds, rel_mse, fireflies })
}

fn ours(scene: &NeutralScene, threads: usize, args: &PeersArgs, seed: u16) -> Result<Painted, CliError> {
    let before = processor_seconds();
    let (picture, time) = paint_ours(scene, threads, args.spp, seed.into(), args.guide)?;
    let seconds = match (args.processor_time, before.zip(processor_seconds())) {
        (false, _) => time.as_secs_f64(),
        (true, Some((before, after))) => after - before,
        (true, None) => {
            return Err(CliError::usage(
                "this system does not tell processor times",
                "leave out --processor-time, and let the machine do nothing else meanwhile",
            ));
        }
    };
    Ok(Painted { picture, seconds, samples: args.spp.into() })
}

/// Runs a peer. The error says why there is no picture of it.
fn paint(
    peer: &Peer,
    args: &PeersArgs,
    scene: &NeutralScene,
    name: &str,
    threads: usize,
    seed: u16,
) -> Result<Painted, String> {
    let told = |what: &str, error: std::io::Error| format!("{what}: {error}");
    let folder = std::env::temp_dir().join(format!("bottega-peers-{}", std::process::id()));
    fs::create_dir_all(&folder).map_err(|error| told("no temporary folder", error))?;
    let (out, log) = (folder.join("picture.raw"), folder.join("log.txt"));
    let log_file = File::create(&log).map_err(|error| told("no log", error))?;
    let mut child = Command::new(&args.python)
        .arg("-")
        .arg(&args.folder)
        .args([name, &args.spp.to_string(), &seed.to_string(), &threads.to_string()])
        .arg(&out)
        .args(peer.variant)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(log_file)
        .spawn()
        .map_err(|error| told(&args.python, error))?;
    if let Some(mut input) = child.stdin.take() {
        // A child that ends at once tells why in its log.
        drop(input.write_all(peer.script.as_bytes()));
    }
    let deadline = Instant::now() + Duration::from_secs(args.timeout);
    let status = loop {
        match child.try_wait().map_err(|error| told("lost", error))? {
            Some(status) => break status,
            None if Instant::now() < deadline => thread::sleep(POLL),
            None => {
                drop(child.kill());
                drop(child.wait());
                return Err(format!("it did not end within {} s", args.timeout));
            }
        }
    };
    let mut answer = String::new();
    if let Some(mut output) = child.stdout.take() {
        output.read_to_string(&mut answer).map_err(|error| told("no answer", error))?;
    }
    let spent: Option<Value> = answer.lines().last().and_then(|line| serde_json::from_str(line).ok());
    let result = match spent {
        Some(spent) if status.success() => read_raw(&out, scene).and_then(|picture| {
            let number = |key: &str| spent[key].as_f64().ok_or_else(|| format!("its answer lacks `{key}`"));
            let time = if args.processor_time { "processor_seconds" } else { "seconds" };
            Ok(Painted { picture, seconds: number(time)?, samples: number("samples")? })
        }),
        _ => {
            let log = fs::read_to_string(&log).unwrap_or_default();
            Err(log.lines().last().unwrap_or("it ended without an answer").to_owned())
        }
    };
    drop(fs::remove_dir_all(&folder));
    result
}

fn read_raw(path: &PathBuf, scene: &NeutralScene) -> Result<Picture, String> {
    let bytes = fs::read(path).map_err(|error| error.to_string())?;
    let floats: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let data: Vec<[f32; 3]> = floats.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    if data.len() != scene.width as usize * scene.height as usize {
        return Err(format!("its picture has {} pixels", data.len()));
    }
    Ok(Picture { data, ..Picture::new(scene.width, scene.height) })
}

/// Ratios of our efficiency to the best of the others: number of threads, one ratio for each scene, and their geometric
/// mean.
type Ratios = (usize, Vec<(String, f64)>, f64);

/// The ratios by number of threads.
fn ratios(rows: &[Row]) -> Vec<Ratios> {
    let mut threads: Vec<usize> = rows.iter().map(|row| row.threads).collect();
    threads.sort_unstable();
    threads.dedup();
    let of = |threads: usize| {
        let ours = rows.iter().filter(|row| row.threads == threads && row.renderer == OURS);
        let ratios: Vec<(String, f64)> = ours
            .filter_map(|ours| {
                let others =
                    rows.iter().filter(|row| row.threads == threads && row.scene == ours.scene && row.renderer != OURS);
                let best = others.map(Row::efficiency).max_by(f64::total_cmp)?;
                Some((ours.scene.clone(), ours.efficiency() / best))
            })
            .collect();
        let mean = ratios.iter().map(|(_, ratio)| ratio.ln()).sum::<f64>() / ratios.len().max(1) as f64;
        (threads, ratios, mean.exp())
    };
    threads.into_iter().map(of).collect()
}

/// Our efficiency over that of a row on the same scene with as many threads.
fn ratio(rows: &[Row], other: &Row) -> Option<f64> {
    let ours =
        rows.iter().find(|row| row.renderer == OURS && row.scene == other.scene && row.threads == other.threads)?;
    Some(ours.efficiency() / other.efficiency())
}

fn as_text(rows: &[Row]) -> String {
    let mut out = format!(
        "{:<12} {:>7}  {:<20} {:>9} {:>9} {:>9} {:>12} {:>9}  {}\n",
        "scene", "threads", "renderer", "Mpaths/s", "seconds", "relMSE", "efficiency", "fireflies", "ours over it"
    );
    for row in rows {
        let ratio = ratio(rows, row).map_or_else(String::new, |ratio| format!("{ratio:.2}"));
        out += &format!(
            "{:<12} {:>7}  {:<20} {:>9.3} {:>9.2} {:>9.5} {:>12.3} {:>9.1}  {ratio}\n",
            row.scene,
            row.threads,
            row.renderer,
            row.mpaths,
            row.seconds,
            row.rel_mse,
            row.efficiency(),
            row.fireflies
        );
    }
    for (threads, ratios, mean) in ratios(rows) {
        let each: Vec<String> = ratios.iter().map(|(scene, ratio)| format!("{scene} {ratio:.2}")).collect();
        if !each.is_empty() {
            out +=
                &format!("\nover the best of them, {threads} threads: {}; geometric mean {mean:.2}\n", each.join(", "));
        }
    }
    out
}

fn as_json(rows: &[Row], missing: &[(&str, String)]) -> Value {
    let rows_json: Vec<Value> = rows
        .iter()
        .map(|row| {
            json!({
                "scene": row.scene, "threads": row.threads, "renderer": row.renderer, "mpaths_per_second": row.mpaths,
                "seconds": row.seconds, "rel_mse": row.rel_mse, "efficiency": row.efficiency(), "fireflies": row.fireflies,
                "ours_over_it": ratio(rows, row),
            })
        })
        .collect();
    let best: Vec<Value> = ratios(rows)
        .into_iter()
        .map(|(threads, ratios, mean)| {
            let scenes: serde_json::Map<String, Value> =
                ratios.into_iter().map(|(scene, ratio)| (scene, json!(ratio))).collect();
            json!({"threads": threads, "scenes": scenes, "geometric_mean": mean})
        })
        .collect();
    let missing: serde_json::Map<String, Value> =
        missing.iter().map(|(name, reason)| ((*name).to_owned(), json!(reason))).collect();
    json!({"rows": rows_json, "over_the_best": best, "left_out": missing})
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(renderer: &'static str, scene: &str, seconds: f64, rel_mse: f64) -> Row {
        Row { scene: scene.to_owned(), threads: 1, renderer, mpaths: 1.0, seconds, rel_mse, fireflies: 0.0 }
    }

    #[test]
    fn ratios_are_to_the_best_of_each_scene() {
        let rows = [
            row(OURS, "a", 1.0, 0.1),
            row("mitsuba scalar_rgb", "a", 4.0, 0.2),
            row("cycles", "a", 2.0, 0.1),
            row(OURS, "b", 1.0, 0.1),
            row("cycles", "b", 1.0, 0.8),
            row(OURS, "c", 1.0, 0.1),
        ];
        let all = ratios(&rows);
        let (threads, each, mean) = &all[0];
        assert_eq!((*threads, each.len()), (1, 2), "nobody else painted c");
        assert!((each[0].1 - 2.0).abs() < 1e-9 && (each[1].1 - 8.0).abs() < 1e-9 && (mean - 4.0).abs() < 1e-9);
        assert_eq!(as_json(&rows, &[])["over_the_best"][0]["scenes"]["b"], json!(8.0));
        assert!(as_text(&rows).contains("geometric mean 4.00"));
    }

    #[test]
    fn who_cannot_be_run_is_told_why() {
        let args = PeersArgs {
            folder: "nowhere".into(),
            scene: Vec::new(),
            spp: 1,
            repeat: 1,
            peer: vec!["mitsuba".to_owned()],
            guide: bottega::request::GuideChoice::Ala,
            threads: vec![1],
            python: "no such python".to_owned(),
            processor_time: true,
            timeout: 5,
            json: false,
        };
        let scene = NeutralScene { scene: bottega_scene::Scene::default(), width: 2, height: 2, max_bounces: 1 };
        let reason = paint(&PEERS[0], &args, &scene, "a", 1, 0).err().unwrap_or_default();
        assert!(reason.starts_with("no such python"), "{reason}");
        assert!(processor_seconds().is_none_or(|seconds| seconds >= 0.0));
        assert!(scenes(&args).is_err());
        assert!(args.includes("mitsuba scalar_rgb") && !args.includes("cycles"));
    }
}
