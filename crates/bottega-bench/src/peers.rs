//! Error and time of several renderers, on the same triangles, in one run.
//!
//! Error is the relative mean squared error against a reference, without the worst thousandth of the pixels and without the error
//! of the reference itself; a second measure is the mean squared error of the displayed image. For all unbiased renderers, error
//! times seconds is a constant of renderer and scene; its inverse is the efficiency, and the quotient of two efficiencies is the
//! speedup at equal error. Time is wall time, or, on a machine with other load, processor time.

mod report;

use std::{
    fs::{self, File},
    io::{Read, Write},
    path::{Path, PathBuf},
    process::{Command, Stdio},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use bottega::{devices::processors, request::GuideChoice, settings::whole_guide};
use bottega_image::{Film, Picture, USUAL_TRIM, firefly_count, read_picture, rel_mse_trimmed, srgb_mse};
use bottega_platform::processor_time::own_seconds;
use bottega_render::{Filter, PathSettings, PrepareOptions, PreparedScene};
use clap::Args;
use serde_json::Value;

use self::report::{OURS, PeerRow, PeersReport};
use crate::{
    arguments::choice,
    error::Error,
    neutral_scene::{self, NeutralScene},
    painting::paint_zone,
    report::{Measurement, Report, say},
};

/// Error and time beside other renderers on the same triangles: efficiencies, and ours over theirs.
#[derive(Clone, Debug, Args)]
pub(crate) struct PeersOptions {
    /// Folder with the scenes: SCENE.json (ours, and Cycles'), SCENE.xml (Mitsuba's), SCENE.scn (LuxCore's), the PLY meshes
    /// that they name, and reference/ref_SCENE.exr.
    folder: PathBuf,
    /// A scene by name; may be given more than once. Default: all that have a reference.
    #[arg(long = "scene", value_name = "NAME")]
    scenes: Vec<String>,
    /// Samples per pixel.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1 << 20))]
    spp: u32,
    /// Repetitions, interleaved; medians of the times and means of the errors are printed.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(1..=100))]
    repeat: u16,
    /// Only those others whose names begin so (`mitsuba`, `mitsuba llvm`, `cycles`, `luxcore`); may be given more than
    /// once.
    #[arg(long = "peer", value_name = "NAME")]
    peers: Vec<String>,
    /// Knowledge that our paths learn before the first sample; its time counts.
    #[arg(long, value_name = "GUIDE", value_parser = choice::<GuideChoice>(), default_value = "ala")]
    guide: GuideChoice,
    /// Numbers of threads to render with. Default: one, and as many as there are processors.
    #[arg(long, value_name = "N", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Vec<u16>,
    /// The Python that has the modules of the others (mitsuba, bpy, pyluxcore); a missing one is left out.
    #[arg(long, value_name = "PROGRAM", default_value = "python3")]
    python: String,
    /// Compare the time of the processors, not of the clock: for a machine that has other work as well.
    #[arg(long)]
    processor_time: bool,
    /// Time limit of a picture of another renderer, in seconds.
    #[arg(long, value_name = "SECONDS", default_value_t = 3600)]
    timeout: u64,
}

impl PeersOptions {
    /// Returns the numbers of threads to render with.
    fn threads(&self) -> Vec<usize> {
        if self.threads.is_empty() {
            return vec![1, processors()];
        }
        self.threads.iter().copied().map(usize::from).collect()
    }

    /// Returns true if a renderer was requested.
    fn includes(&self, name: &str) -> bool {
        self.peers.is_empty() || self.peers.iter().any(|wanted| name.starts_with(wanted.as_str()))
    }
}

/// A renderer that runs as a child process, because it may hang or abort.
struct PeerRenderer {
    name: &'static str,
    /// A Python script; its arguments are folder, scene, samples, seed, threads and output file.
    script: &'static str,
    /// A further argument of the script.
    variant: Option<&'static str>,
}

const PEERS: [PeerRenderer; 4] = [
    PeerRenderer {
        name: "mitsuba llvm_ad_rgb",
        script: include_str!("peers/mitsuba.py"),
        variant: Some("llvm_ad_rgb"),
    },
    PeerRenderer { name: "mitsuba scalar_rgb", script: include_str!("peers/mitsuba.py"), variant: Some("scalar_rgb") },
    PeerRenderer { name: "cycles", script: include_str!("peers/cycles.py"), variant: None },
    PeerRenderer { name: "luxcore", script: include_str!("peers/luxcore.py"), variant: None },
];

/// The interval at which a child is polled.
const POLL: Duration = Duration::from_millis(20);

/// One rendered image.
struct PeerPicture {
    picture: Picture,
    seconds: f64,
    /// Samples per pixel; some renderers take more than requested.
    samples: f64,
}

impl Measurement for PeersOptions {
    /// Renders every scene with every renderer, in turn. The log says which renderers are left out, and why.
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let known: Value = fs::read(self.folder.join("reference/ref_info.json"))
            .ok()
            .and_then(|bytes| serde_json::from_slice(&bytes).ok())
            .unwrap_or_default();
        let peers: Vec<&PeerRenderer> = PEERS.iter().filter(|peer| self.includes(peer.name)).collect();
        let mut report = PeersReport { rows: Vec::new(), missing: Vec::new() };
        for name in &scenes(self)? {
            let scene = neutral_scene::load(&self.folder.join(name).with_extension("json"))?;
            let reference = read_picture(self.folder.join(format!("reference/ref_{name}.exr")))?;
            let reference_error = known[name]["ref_relmse"].as_f64().unwrap_or(0.0);
            for threads in self.threads() {
                let all = paint_all(self, &peers, &scene, name, threads, &mut report.missing, log)?;
                for (renderer, painted) in all {
                    if painted.len() == usize::from(self.repeat) {
                        report.rows.push(row(name, threads, renderer, &painted, &reference, reference_error)?);
                    }
                }
            }
        }
        Ok(Box::new(report))
    }
}

/// Renders a scene with each renderer, ours first. Renderers alternate, so that other load on the machine affects all of them;
/// one that fails is left out from then on.
fn paint_all(
    options: &PeersOptions,
    peers: &[&PeerRenderer],
    scene: &NeutralScene,
    name: &str,
    threads: usize,
    missing: &mut Vec<(&'static str, String)>,
    log: &mut dyn Write,
) -> Result<Vec<(&'static str, Vec<PeerPicture>)>, Error> {
    let mut all: Vec<(&'static str, Vec<PeerPicture>)> = vec![(OURS, Vec::new())];
    all.extend(peers.iter().map(|peer| (peer.name, Vec::new())));
    for seed in 0..options.repeat {
        all[0].1.push(ours(scene, threads, options, seed)?);
        for (peer, (_, painted)) in peers.iter().zip(&mut all[1..]) {
            if missing.iter().any(|(name, _)| *name == peer.name) {
                continue;
            }
            match paint(peer, options, scene, name, threads, seed) {
                Ok(picture) => painted.push(picture),
                Err(reason) => {
                    say(log, format_args!("{} is left out: {reason}", peer.name));
                    missing.push((peer.name, reason));
                }
            }
        }
    }
    Ok(all)
}

/// Returns the requested scenes, or all of the folder that have a reference.
fn scenes(options: &PeersOptions) -> Result<Vec<String>, Error> {
    if !options.scenes.is_empty() {
        return Ok(options.scenes.clone());
    }
    let entries = fs::read_dir(&options.folder)
        .map_err(|source| bottega::Error::Read { path: options.folder.clone(), source })?;
    let mut scenes: Vec<String> = entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "json"))
        .filter_map(|path| Some(path.file_stem()?.to_str()?.to_owned()))
        .filter(|name| options.folder.join(format!("reference/ref_{name}.exr")).is_file())
        .collect();
    scenes.sort();
    if scenes.is_empty() {
        return Err(Error::NoScenes { folder: options.folder.clone() });
    }
    Ok(scenes)
}

fn row(
    scene: &str,
    threads: usize,
    renderer: &'static str,
    painted: &[PeerPicture],
    reference: &Picture,
    reference_error: f64,
) -> Result<PeerRow, Error> {
    let mut seconds: Vec<f64> = painted.iter().map(|painted| painted.seconds).collect();
    seconds.sort_by(f64::total_cmp);
    let seconds = seconds[seconds.len() / 2];
    let count = painted.len() as f64;
    let (mut error, mut srgb_error, mut samples, mut fireflies) = (0.0, 0.0, 0.0, 0.0);
    for painted in painted {
        error += rel_mse_trimmed(reference, &painted.picture, USUAL_TRIM)? / count;
        srgb_error += srgb_mse(reference, &painted.picture)? / count;
        samples += painted.samples / count;
        fireflies += firefly_count(&painted.picture) as f64 / count;
    }
    let mpaths = samples * reference.data.len() as f64 / seconds / 1e6;
    let rel_mse = (error - reference_error).max(1e-9);
    let srgb_mse = srgb_error.max(1e-12);
    Ok(PeerRow { scene: scene.to_owned(), threads, renderer, mpaths, seconds, rel_mse, srgb_mse, fireflies })
}

fn ours(scene: &NeutralScene, threads: usize, options: &PeersOptions, seed: u16) -> Result<PeerPicture, Error> {
    let before = own_seconds();
    let (picture, time) = paint_ours(scene, threads, options.spp, seed.into(), options.guide)?;
    let seconds = match (options.processor_time, before.zip(own_seconds())) {
        (false, _) => time.as_secs_f64(),
        (true, Some((before, after))) => after - before,
        (true, None) => return Err(Error::NoProcessorTime),
    };
    Ok(PeerPicture { picture, seconds, samples: options.spp.into() })
}

/// Renders a scene with the same settings as the other renderers. Returns the image and the time that it took.
fn paint_ours(
    scene: &NeutralScene,
    threads: usize,
    spp: u32,
    seed: u64,
    guide: GuideChoice,
) -> Result<(Picture, Duration), Error> {
    let (guiding, agents) = whole_guide(guide);
    // Prepare again each time: learning the light distribution is part of an image's time.
    let options = PrepareOptions { threads, ..PrepareOptions::default() };
    let prepared = Arc::new(PreparedScene::new(Arc::new(scene.scene.clone()), &options)?);
    let size = (scene.width, scene.height);
    let settings = PathSettings {
        seed,
        max_depth: scene.max_bounces + 1,
        filter: Filter::PIXEL,
        planned_samples: spp,
        guiding,
        agents,
        ..PathSettings::default()
    };
    let (tile, time) = paint_zone((&prepared, &Arc::default()), size, settings, threads, spp)?;
    let mut film = Film::new(tile.rect(), tile.layout().clone());
    film.add_tile(&tile, |_, _| 1.0);
    Ok((film.to_picture(), time))
}

/// Runs another renderer. The error says why there is no image.
fn paint(
    peer: &PeerRenderer,
    options: &PeersOptions,
    scene: &NeutralScene,
    name: &str,
    threads: usize,
    seed: u16,
) -> Result<PeerPicture, String> {
    let failure = |what: &str, error: std::io::Error| format!("{what}: {error}");
    let folder = std::env::temp_dir().join(format!("bottega-peers-{}", std::process::id()));
    fs::create_dir_all(&folder).map_err(|error| failure("no temporary folder", error))?;
    let (out, log) = (folder.join("picture.raw"), folder.join("log.txt"));
    let log_file = File::create(&log).map_err(|error| failure("no log", error))?;
    let mut child = Command::new(&options.python)
        .arg("-")
        .arg(&options.folder)
        .args([name, &options.spp.to_string(), &seed.to_string(), &threads.to_string()])
        .arg(&out)
        .args(peer.variant)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(log_file)
        .spawn()
        .map_err(|error| failure(&options.python, error))?;
    if let Some(mut input) = child.stdin.take() {
        // A child that ends at once says why in its log.
        drop(input.write_all(peer.script.as_bytes()));
    }
    let deadline = Instant::now() + Duration::from_secs(options.timeout);
    let status = loop {
        match child.try_wait().map_err(|error| failure("lost", error))? {
            Some(status) => break status,
            None if Instant::now() < deadline => thread::sleep(POLL),
            None => {
                drop(child.kill());
                drop(child.wait());
                return Err(format!("it did not end within {} s", options.timeout));
            }
        }
    };
    let mut answer = String::new();
    if let Some(mut output) = child.stdout.take() {
        output.read_to_string(&mut answer).map_err(|error| failure("no answer", error))?;
    }
    let spent: Option<Value> = answer.lines().last().and_then(|line| serde_json::from_str(line).ok());
    let result = match spent {
        Some(spent) if status.success() => read_raw(&out, scene).and_then(|picture| {
            let number = |key: &str| spent[key].as_f64().ok_or_else(|| format!("its answer lacks `{key}`"));
            let time = if options.processor_time { "processor_seconds" } else { "seconds" };
            Ok(PeerPicture { picture, seconds: number(time)?, samples: number("samples")? })
        }),
        _ => {
            let log = fs::read_to_string(&log).unwrap_or_default();
            Err(log.lines().last().unwrap_or("it ended without an answer").to_owned())
        }
    };
    drop(fs::remove_dir_all(&folder));
    result
}

fn read_raw(path: &Path, scene: &NeutralScene) -> Result<Picture, String> {
    let bytes = fs::read(path).map_err(|error| error.to_string())?;
    let floats: Vec<f32> = bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let data: Vec<[f32; 3]> = floats.chunks_exact(3).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    if data.len() != scene.width as usize * scene.height as usize {
        return Err(format!("its picture has {} pixels", data.len()));
    }
    Ok(Picture { data, ..Picture::new(scene.width, scene.height) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_peer_that_cannot_run_is_reported_with_the_reason() {
        let options = PeersOptions {
            folder: "nowhere".into(),
            scenes: Vec::new(),
            spp: 1,
            repeat: 1,
            peers: vec!["mitsuba".to_owned()],
            guide: GuideChoice::Ala,
            threads: vec![1],
            python: "no such python".to_owned(),
            processor_time: true,
            timeout: 5,
        };
        let scene = NeutralScene { scene: bottega_scene::Scene::default(), width: 2, height: 2, max_bounces: 1 };
        let reason = paint(&PEERS[0], &options, &scene, "a", 1, 0).err().unwrap_or_default();
        assert!(reason.starts_with("no such python"), "{reason}");
        assert!(own_seconds().is_none_or(|seconds| seconds >= 0.0));
        assert!(scenes(&options).is_err());
        assert!(options.includes("mitsuba scalar_rgb") && !options.includes("cycles"));
    }
}
