//! The tables of the MAGarRO paper, on a similar scene.
//!
//! For each partition and optimization the image is painted by one agent on one thread, which gives the time of one agent and of
//! each zone, and by two agents in two processes. More agents are replayed in the simulator, each on a machine of its own that is
//! as fast as this one. The measured pair is replayed, too, with each processor as fast as next to a busy one and the second
//! agent joining when the Master knew it; this validates replays. Measured and replayed results are marked wherever they are
//! shown.

mod equal_time;
mod options;
mod paper;
mod plot;
mod report;
mod scene;
mod second_agent;
mod tables;

use std::{io::Write, path::Path, sync::Arc, time::Duration};

use bottega_farm::{
    Level, Optimization,
    simulate::{FarmSpec, MachineSpec, Plan, Workpiece, simulate},
};
use bottega_image::{Canvas, ColorMap, FlipOptions, Picture, ToneMap, flip, rmse, srgb_from_linear};

pub(crate) use self::{options::MagarroOptions, second_agent::SecondAgentOptions};
use self::{
    options::MagarroPicture,
    paper::{AGENTS, OPTIMIZATIONS},
    report::{MagarroReport, MagarroRow, PictureError, Pictures, Ways},
    scene::MagarroScene,
    second_agent::AgentPair,
};
use crate::{
    error::Error,
    files::{create_folder, write_file},
    report::{Measurement, Report, headed, say},
};

/// The latency of a message between machines of one room.
const LATENCY: Duration = Duration::from_micros(500);

impl Measurement for MagarroOptions {
    /// Renders the scene by all methods of the paper, or compares some at equal time.
    fn measure(&self, log: &mut dyn Write) -> Result<Box<dyn Report>, Error> {
        let scene = MagarroScene::load(&self.picture)?;
        if let Some(samples) = self.equal_time {
            return Ok(Box::new(equal_time::measure(&scene, samples, log)?));
        }
        let report = scene.report(self.pair(log)?.as_ref(), log)?;
        if let Some(folder) = &self.output {
            write(folder, &report)?;
        }
        Ok(Box::new(report))
    }
}

impl MagarroOptions {
    /// Starts two agents with a server; `None`: pairs are replayed like more agents, because the options say so, or because no
    /// server was named and none can be started.
    fn pair(&self, log: &mut dyn Write) -> Result<Option<AgentPair>, Error> {
        if self.replay {
            return Ok(None);
        }
        match AgentPair::start(self.server.as_deref()) {
            Err(error) if self.server.is_none() => {
                say(log, format_args!("two agents are replayed, not measured: {error}"));
                Ok(None)
            }
            pair => pair.map(Some),
        }
    }
}

impl MagarroScene<'_> {
    fn report(&self, pair: Option<&AgentPair>, log: &mut dyn Write) -> Result<MagarroReport, Error> {
        let mut said = |what: &str| say(log, format_args!("painting {what} …"));
        let speed_beside = match pair {
            None => 1.0,
            Some(_) => {
                said("twice alone and twice beside another");
                self.speed_beside()?
            }
        };
        let pair = pair.map(|pair| (pair, speed_beside));
        said("without partition and optimization");
        let (whole, _) = self.row(pair, Level::Whole, Optimization::Off, Ways::Ours, 0)?;
        said("level 3 without optimization");
        let (off, off_picture) = self.row(pair, Level::Balanced, Optimization::Off, Ways::Ours, 0)?;
        said("the same with another seed");
        let (_, other_seed) = self.row(pair, Level::Balanced, Optimization::Off, Ways::Ours, 1)?;
        let noise = error(&off_picture, &other_seed)?;
        let judged = |(row, picture): (MagarroRow, Picture)| -> Result<(MagarroRow, Picture), Error> {
            Ok((MagarroRow { error: Some(error(&off_picture, &picture)?), ..row }, picture))
        };
        let (mut levels, mut optimizations, mut very_big) = (Vec::new(), Vec::new(), None);
        for optimization in OPTIMIZATIONS {
            said(&format!("level 3, optimization {optimization}"));
            let (row, picture) = judged(self.row(pair, Level::Balanced, optimization, Ways::Ours, 0)?)?;
            optimizations.push(row);
            very_big = Some(picture);
        }
        for level in [Level::Divided, Level::Joined] {
            said(&format!("level {}, optimization n", level as u8));
            levels.push(judged(self.row(pair, level, Optimization::Normal, Ways::Ours, 0)?)?.0);
        }
        levels.extend(optimizations.iter().find(|row| row.optimization == Optimization::Normal).cloned());
        let mut papers_rules = Vec::new();
        for optimization in OPTIMIZATIONS {
            said(&format!("level 3, optimization {optimization}, with the paper's set of rules"));
            papers_rules.push(judged(self.row(pair, Level::Balanced, optimization, Ways::PapersRules, 0)?)?.0);
        }
        let mut papers_levels = Vec::new();
        for level in [Level::Divided, Level::Joined, Level::Balanced] {
            said(&format!("level {}, optimization n, all as in the paper", level as u8));
            papers_levels.push(judged(self.row(pair, level, Optimization::Normal, Ways::Papers, 0)?)?.0);
        }
        let very_big = very_big.unwrap_or_else(|| off_picture.clone());
        let MagarroPicture { spp, light_samples, max_depth, .. } = *self.options;
        Ok(MagarroReport {
            width: self.width,
            height: self.height,
            samples: spp,
            light_samples,
            max_depth,
            speed_beside,
            whole,
            off,
            noise,
            levels,
            optimizations,
            papers_rules,
            papers_levels,
            pictures: Pictures { off: off_picture, very_big },
        })
    }

    /// Returns the speed of a processor while another one renders the same, relative to its speed alone: they share caches,
    /// memory and often a core.
    fn speed_beside(&self) -> Result<f64, Error> {
        let settings = self.settings(Level::Balanced, Optimization::Normal, Ways::Ours);
        let seconds = || self.paint(&settings, 0).map(|(record, _)| record.total.as_secs_f64());
        let (mut alone, mut beside) = (0.0, 0.0);
        for _ in 0..2 {
            alone += seconds()?;
            let both = std::thread::scope(|scope| {
                let other = scope.spawn(seconds);
                // A panic of the other thread is passed on.
                [seconds(), other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))]
            });
            for one in both {
                beside += 0.5 * one?;
            }
        }
        Ok(alone / beside)
    }

    /// Paints the image with one agent on one thread, then with a pair, and replays it with more.
    ///
    /// - `pair`: the pair, and the speed of a processor while another one renders.
    fn row(
        &self,
        pair: Option<(&AgentPair, f64)>,
        level: Level,
        optimization: Optimization,
        ways: Ways,
        seed: u64,
    ) -> Result<(MagarroRow, Picture), Error> {
        let settings = self.settings(level, optimization, ways);
        let (record, picture) = self.paint(&settings, seed)?;
        let piece = Arc::new(Workpiece::recorded(&record, 1)?);
        let replay = |agents: usize, speed: f64, last_joins: Duration| -> Result<f64, Error> {
            let mut farm = FarmSpec::default();
            farm.add(agents, MachineSpec { processors: 1, speed });
            if let Some(last) = farm.agents.last_mut() {
                last.joins = last_joins;
            }
            let mut plan = Plan::calm(farm, seed);
            plan.faults.latency_min = LATENCY;
            if ways == Ways::Papers {
                plan = plan.as_in_paper();
            }
            Ok(simulate(&piece, &plan)?.makespan.as_secs_f64())
        };
        let mut replayed = [0.0; 4];
        for (time, agents) in replayed.iter_mut().zip(AGENTS) {
            *time = replay(agents, 1.0, Duration::ZERO)?;
        }
        let measured = pair.map(|(pair, _)| pair.measure(self, level, optimization, ways)).transpose()?.flatten();
        let both = pair.zip(measured);
        let replayed_pair = both.map(|((_, speed), pair)| replay(2, speed, pair.joins)).transpose()?;
        let row = MagarroRow {
            level,
            optimization,
            ways,
            measured: record.total.as_secs_f64(),
            survey: record.survey.as_secs_f64(),
            pair: measured.map(|pair| pair.seconds),
            replayed_pair,
            replayed,
            zones: record.zones.len(),
            error: None,
        };
        Ok((row, picture))
    }
}

/// Writes results and images to a folder.
fn write(folder: &Path, report: &MagarroReport) -> Result<(), Error> {
    create_folder(folder)?;
    let json = serde_json::to_string_pretty(&headed(report)).unwrap_or_default();
    write_file(&folder.join("magarro.json"), &json)?;
    write_file(&folder.join("magarro.svg"), &plot::svg(report))?;
    let Pictures { off, very_big } = &report.pictures;
    let difference = flip(off, very_big, &FlipOptions::default())?;
    Canvas::of_picture(off, 0.0, ToneMap::Agx).write_png(folder.join("off.png"))?;
    Canvas::of_picture(very_big, 0.0, ToneMap::Agx).write_png(folder.join("vb.png"))?;
    Canvas::heat_map(off.width, off.height, &difference.map, 1.0, ColorMap::Inferno)
        .write_png(folder.join("difference.png"))?;
    Ok(())
}

fn error(reference: &Picture, picture: &Picture) -> Result<PictureError, Error> {
    Ok(PictureError {
        rmse: rmse(reference, picture)?,
        percent: percent(reference, picture),
        flip: flip(reference, picture, &FlipOptions::default())?.mean,
    })
}

/// Returns the mean absolute difference of the displayed images, in percent of white. (The paper does not define its measure.)
fn percent(reference: &Picture, picture: &Picture) -> f64 {
    let shown = |value: f32| f64::from(srgb_from_linear(value.clamp(0.0, 1.0)));
    let pixels = reference.data.iter().flatten().zip(picture.data.iter().flatten());
    let sum: f64 = pixels.map(|(a, b)| (shown(*a) - shown(*b)).abs()).sum();
    100.0 * sum / (3 * reference.data.len().max(1)) as f64
}
