//! The gain of path guiding: error × time with it over that without, including learning, by relative error and by the error of
//! the displayed image.
//!
//! Images with and without guiding are rendered alternately, each from the start, so that other load on the machine affects both.
//! Time is processor time. The reference is rendered without guiding in two halves, whose difference estimates the reference's
//! own error.

mod report;

use std::{
    io::Write,
    path::{Path, PathBuf},
    sync::Arc,
};

use bottega::{devices::processors, request::GuideChoice, settings::whole_guide};
use bottega_image::{
    Canvas, ExrOptions, Film, HalfOrFloat, Metadata, Picture, ToneMap, USUAL_TRIM, read_picture, rel_mse_trimmed,
    srgb_mse, write_picture_exr,
};
use bottega_platform::processor_time::own_seconds;
use bottega_render::{Filter, PathSettings, PrepareOptions, PreparedScene};
use clap::Args;

use self::report::{GuideReport, GuideRow, WayResult};
use crate::{
    arguments::SceneFolder,
    error::Error,
    files::{create_folder, shared_meshes},
    painting::paint_zone,
    report::{Measurement, Report, say},
};

/// The default scenes, relative to the folder of scenes.
const SCENES: [&str; 5] = [
    "coffee/pbrt/scene-v4.pbrt",
    "peers/a_cornell.xml",
    "peers/b_ala.xml",
    "peers/c_goblets.xml",
    "peers/d_interior.xml",
];

/// The seeds of a reference's halves, different from those of all images.
const REFERENCE_SEEDS: [u64; 2] = [0x7265_6665, 0x7265_6666];

/// The gain of the guide of paths: error × time of --guide ala over --guide none, learning included.
#[derive(Clone, Debug, Args)]
#[command(
    after_help = "A ratio below 1 says that the guide pays. Errors are to a picture of many samples without a guide. \
    For example:\n  bottega-bench guide --scenes ../scenes --spp 8,32 -o guide/"
)]
pub(crate) struct GuideOptions {
    /// Scenes. Default: five in the folder of scenes.
    files: Vec<PathBuf>,
    #[command(flatten)]
    folder: SceneFolder,
    /// Width of the pictures.
    #[arg(long, value_name = "PIXELS", default_value_t = 160, value_parser = clap::value_parser!(u32).range(8..=1 << 14))]
    width: u32,
    /// Height of the pictures.
    #[arg(long, value_name = "PIXELS", default_value_t = 120, value_parser = clap::value_parser!(u32).range(8..=1 << 14))]
    height: u32,
    /// Samples per pixel, one row each.
    #[arg(long, value_name = "N", value_delimiter = ',', default_values_t = [4, 8, 32, 128],
        value_parser = clap::value_parser!(u32).range(1..=1 << 16))]
    spp: Vec<u32>,
    /// Pictures of each kind; figures are of their means.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    seeds: u32,
    /// The first of their seeds.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u32,
    /// Samples per pixel of the reference.
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(2..=1 << 20))]
    reference_spp: u32,
    /// Threads of the measured renders. References use all processors.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: u16,
    /// Folder for the references, which are taken from there the next time, and for the pictures of the first seed.
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
}

/// A scene with its reference.
struct MeasuredScene {
    name: String,
    prepared: Arc<PreparedScene>,
    size: (u32, u32),
    max_depth: u32,
    reference: Picture,
    /// The error of the reference: relative, and of the displayed image.
    noise: [f64; 2],
}

impl Measurement for GuideOptions {
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        if let Some(folder) = &self.output {
            create_folder(folder)?;
        }
        let mut rows = Vec::new();
        for path in &self.scenes()? {
            let scene = MeasuredScene::open(path, self, log)?;
            for &samples in &self.spp {
                say(log, format_args!("{}, {samples} samples per pixel …", scene.name));
                let row = scene.row(samples, self)?;
                say(log, format_args!("{}", row.line()));
                rows.push(row);
            }
        }
        Ok(Box::new(GuideReport { rows, size: [self.width, self.height], seeds: self.seeds }))
    }
}

impl GuideOptions {
    /// Returns the requested scenes, or else the default ones in the folder of scenes.
    fn scenes(&self) -> Result<Vec<PathBuf>, Error> {
        if !self.files.is_empty() {
            return Ok(self.files.clone());
        }
        SCENES.iter().map(|scene| self.folder.scene(None, scene)).collect()
    }
}

impl MeasuredScene {
    fn open(path: &Path, options: &GuideOptions, log: &mut dyn Write) -> Result<Self, Error> {
        let loaded = bottega_scene::load(path, &shared_meshes())?;
        let prepare = PrepareOptions { threads: options.threads.into(), ..PrepareOptions::default() };
        let GuideOptions { width, height, .. } = *options;
        let mut scene = Self {
            name: name_of(path),
            prepared: Arc::new(PreparedScene::new(Arc::new(loaded.scene), &prepare)?),
            size: (width, height),
            max_depth: loaded.hints.max_depth.unwrap_or(16),
            reference: Picture::new(width, height),
            noise: [0.0; 2],
        };
        let halves = [scene.half(0, options, log)?, scene.half(1, options, log)?];
        // The error of the halves' mean is a quarter of their squared difference.
        scene.noise = scene.errors(&halves[0], &halves[1])?.map(|difference| 0.25 * difference);
        let mean = |(a, b): (&[f32; 3], &[f32; 3])| std::array::from_fn(|i| 0.5 * (a[i] + b[i]));
        scene.reference.data = halves[0].data.iter().zip(&halves[1].data).map(mean).collect();
        Ok(scene)
    }

    /// Returns half of the reference: read from a file, or rendered now.
    fn half(&self, which: usize, options: &GuideOptions, log: &mut dyn Write) -> Result<Picture, Error> {
        let samples = options.reference_spp.div_ceil(2);
        let (width, height) = self.size;
        let file = |folder: &PathBuf| {
            folder.join(format!("{}-{width}x{height}-{samples}-half-{which}.exr", self.name.replace('/', "-")))
        };
        let file = options.output.as_ref().map(file);
        if let Some(file) = file.as_ref().filter(|file| file.is_file()) {
            let picture = read_picture(file)?;
            if picture.size() == self.reference.size() {
                return Ok(picture);
            }
        }
        say(log, format_args!("{}, half of the reference, {samples} samples per pixel …", self.name));
        let picture = self.paint(GuideChoice::None, samples, REFERENCE_SEEDS[which], processors())?.picture;
        if let Some(file) = &file {
            let exr = ExrOptions { depth: HalfOrFloat::Float, ..ExrOptions::default() };
            write_picture_exr(file, &picture, &Metadata::new(), exr)?;
        }
        Ok(picture)
    }

    fn row(&self, samples: u32, options: &GuideOptions) -> Result<GuideRow, Error> {
        let mut ways = [Vec::new(), Vec::new()];
        let first = u64::from(options.seed);
        for seed in first..first + u64::from(options.seeds) {
            for (way, (guide, word)) in [(GuideChoice::None, "none"), (GuideChoice::Ala, "ala")].into_iter().enumerate()
            {
                let painted = self.paint(guide, samples, seed, options.threads.into())?;
                if let Some(folder) = options.output.as_ref().filter(|_| seed == first) {
                    let name = format!("{}-{samples}-{word}.png", self.name.replace('/', "-"));
                    Canvas::of_picture(&painted.picture, 0.0, ToneMap::Linear).write_png(folder.join(name))?;
                }
                let errors = self.errors(&self.reference, &painted.picture)?;
                let [rel_mse, srgb_mse] = [0, 1].map(|measure| (errors[measure] - self.noise[measure]).max(1e-12));
                ways[way].push(WayResult { seconds: painted.seconds, rel_mse, srgb_mse });
            }
        }
        let [without, with] = ways;
        Ok(GuideRow { scene: self.name.clone(), samples, without, with })
    }

    fn errors(&self, reference: &Picture, picture: &Picture) -> Result<[f64; 2], Error> {
        Ok([rel_mse_trimmed(reference, picture, USUAL_TRIM)?, srgb_mse(reference, picture)?])
    }

    fn paint(&self, guide: GuideChoice, samples: u32, seed: u64, threads: usize) -> Result<TimedPicture, Error> {
        let (guiding, agents) = whole_guide(guide);
        let settings = PathSettings {
            seed,
            max_depth: self.max_depth,
            filter: Filter::PIXEL,
            planned_samples: samples,
            guiding,
            agents,
            ..PathSettings::default()
        };
        let before = own_seconds().ok_or(Error::NoProcessorTime)?;
        let (tile, _) = paint_zone((&self.prepared, &Arc::default()), self.size, settings, threads, samples)?;
        let after = own_seconds().ok_or(Error::NoProcessorTime)?;
        let mut film = Film::new(tile.rect(), tile.layout().clone());
        film.add_tile(&tile, |_, _| 1.0);
        Ok(TimedPicture { picture: film.to_picture(), seconds: after - before })
    }
}

/// An image, and the processor time that it took.
struct TimedPicture {
    picture: Picture,
    seconds: f64,
}

/// Returns the last parts of a scene's path, without uninformative ones.
fn name_of(path: &Path) -> String {
    let stem = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let above = path.ancestors().skip(1).filter_map(|above| above.file_name());
    match above.map(|name| name.to_string_lossy()).find(|name| !matches!(&**name, "pbrt" | "mitsuba" | "tungsten")) {
        Some(folder) if stem.starts_with("scene") => folder.into_owned(),
        _ => stem,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_are_named_by_what_tells_them_apart() {
        assert_eq!(name_of(Path::new("a/coffee/pbrt/scene-v4.pbrt")), "coffee");
        assert_eq!(name_of(Path::new("peers/a_cornell.xml")), "a_cornell");
        assert_eq!(name_of(Path::new("scene.glb")), "scene");
    }
}
