//! `bottega render --farm`: asks a farm for a picture, paints with the others, and has the picture in the end.

use std::{env, ffi::OsString, path::Path, thread, time::Duration};

use bottega_farm::{JobError, JobReport, StopSwitch};

use super::{
    address::FarmAddress,
    job::{Job, JobState, Order, unix_seconds},
    job_board::{JobBoard, ended_badly},
    link::{FarmLink, link},
    names::fresh_number,
    part::{Leading, Member, Part, Tools, take_part},
    patience::{meanwhile, patiently},
    refusals::{RefusalWatch, Refusals},
    scene_files::SceneFiles,
    transfer::{self, Sent},
};
use crate::{
    cli::{EnvironmentArg, RenderArgs},
    engines::{self, Material},
    error::CliError,
    identity::{commit, identity},
    parting,
    reporter::Reporter,
    scene::{shown, threads},
};

/// How often is looked how a job stands that this process has no part in.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// A job that this process asked for.
pub(crate) struct Asked {
    member: Member,
    pub(crate) number: u32,
    work: u64,
}

/// A picture that a farm has painted.
pub(crate) enum Painted {
    /// With this process as leader, which has the pixels.
    Here(Box<JobReport>, Option<Leading>),
    /// With another one: the bytes of the file.
    Elsewhere(Vec<u8>),
}

impl Asked {
    /// Sends the scene and asks for the picture.
    ///
    /// - `journal`: how the picture is called in the journal beside it, where there is one.
    pub(crate) fn submit(
        farm: Option<&FarmAddress>,
        args: &RenderArgs,
        material: &Material,
        journal: Option<&str>,
        stop: &StopSwitch,
        reporter: &Reporter,
    ) -> Result<Self, CliError> {
        let FarmLink { uplink, name, .. } = link(farm, &args.login)?;
        let board = JobBoard { uplink };
        board.refuse_guests()?;
        board.sweep();
        let (order, sent) = order(&board, &name, args, material, stop, reporter)?;
        let order = Order { journal: journal.map(str::to_owned), ..order };
        let job = new_job(args, material, &name);
        let number = board.submit(&job, &order)?;
        sent.keep();
        parting::say_if_ended_at_once(format!(
            "job {number} stays with the farm: `bottega jobs fetch {number}` has its picture when it is done, \
             `bottega jobs cancel {number}` calls it off"
        ));
        let (threads, stop, refusals) = (threads(&args.scene), stop.clone(), Refusals::default());
        let member = Member { board, name, threads, stop, refusals };
        Ok(Self { member, number, work: job.work })
    }

    /// Paints with the others until the picture is there, or the user wants to stop. Tells the user which machines have left
    /// the job out.
    pub(crate) fn paint(&self, tools: Tools, reporter: &Reporter) -> Result<Painted, CliError> {
        let mut watch = RefusalWatch::default();
        let tell = || {
            let seats = self.member.board.seats();
            for (seat, refusal) in watch.news(&seats, |work| work == self.work) {
                reporter.warn(format!("{} is left out: {}", seat.name, refusal.reason));
            }
        };
        meanwhile(LOOK_EVERY, tell, || self.paint_with_others(tools, reporter))
    }

    fn paint_with_others(&self, mut tools: Tools, reporter: &Reporter) -> Result<Painted, CliError> {
        let Member { board, stop, .. } = &self.member;
        let say = |line: &str| reporter.say(line);
        let mut said_paused = false;
        let mut helped = false;
        loop {
            let job = board.get(self.number).ok_or_else(|| {
                CliError::failed(format!("job {} is gone", self.number), "somebody has removed it; ask again")
            })?;
            if let Some(error) = ended_badly(self.number, &job.state) {
                return Err(error);
            }
            if let JobState::Done { .. } = job.state {
                let picture = patiently(stop, say, || board.picture(&job))?;
                return picture.map(Painted::Elsewhere).ok_or_else(|| {
                    CliError::failed("the job is done, and its picture is nowhere", "see `bottega jobs log`")
                });
            }
            let is_led = board.lead(self.number).is_some_and(|lead| lead.leader.is_some());
            if job.state == JobState::Paused || helped && is_led {
                if job.state == JobState::Paused && !std::mem::replace(&mut said_paused, true) {
                    reporter.say(&format!("paused; go on with `bottega jobs resume {}`", self.number));
                }
                if stop.is_requested() {
                    return Err(self.called_off());
                }
                thread::sleep(LOOK_EVERY);
                continue;
            }
            said_paused = false;
            helped = false;
            let part = || take_part(&self.member, self.number, &job, &mut tools, || false);
            match patiently(stop, say, part) {
                Ok(Part::Led(report, leading)) => return Ok(Painted::Here(report, Some(leading))),
                Ok(Part::Left(Some(report))) if stop.is_requested() => {
                    self.call_off();
                    return Ok(Painted::Here(report, None));
                }
                Ok(Part::Left(None)) if stop.is_requested() => return Err(self.called_off()),
                Ok(Part::Left(_)) => {}
                Ok(Part::Helped) => helped = true,
                // Those who were not left out go on.
                Err(CliError::Job(JobError::LeftOut { reason })) => {
                    reporter.warn(format!("this machine is left out: {reason}"));
                    helped = true;
                }
                Err(error) if error.may_pass() => return Err(self.called_off()),
                Err(error) => return Err(error),
            }
        }
    }

    /// The picture is written here: the job is over.
    pub(crate) fn finish(&self, leading: &Leading, failed: usize, reporter: &Reporter) -> Result<(), CliError> {
        let state = match failed {
            0 => JobState::Done { kept: false },
            failed => JobState::Failed { reason: format!("{failed} zones could not be painted") },
        };
        let Member { board, stop, .. } = &self.member;
        patiently(stop, |line| reporter.say(line), || leading.finish(board, self.number, &state))
    }

    /// The picture of another process could not be written here; the farm has it.
    pub(crate) fn unfetched(&self, error: &CliError) -> CliError {
        unfetched(self.number, error)
    }

    /// The picture could not be written here. Whoever leads the job next will have the farm keep it.
    pub(crate) fn unwritten(&self, error: &CliError) -> CliError {
        let number = self.number;
        CliError::failed(
            error.told(),
            format!(
                "the farm has all that is painted: the next machine that leads job {number} has it keep the picture, and \
                 `bottega jobs fetch {number} -o FILE` writes it, where there is room; `bottega jobs cancel {number}` calls it off"
            ),
        )
    }

    fn called_off(&self) -> CliError {
        self.call_off();
        CliError::failed("stopped before there was a picture", "ask again")
    }

    /// Who asked wants it no more.
    fn call_off(&self) {
        let off = self.member.board.change(self.number, |job| {
            let is_over = job.state.is_over();
            if !is_over {
                job.say("called off by the one who asked");
                job.state = JobState::Cancelled;
            }
            !is_over
        });
        if let Err(error) = off {
            tracing::warn!(%error, "the job could not be called off");
        }
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        parting::say_nothing();
        self.member.board.rise(&self.member.name);
    }
}

/// A picture that the farm has and that could not be written here.
pub(super) fn unfetched(number: u32, error: &CliError) -> CliError {
    let remedy =
        format!("the farm has the picture: `bottega jobs fetch {number} -o FILE` writes it, where there is room");
    CliError::failed(error.told(), remedy)
}

/// Writes a picture that another process has made. The file is there as a whole or not at all.
pub(crate) fn write_picture(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|source| CliError::Write { path: path.to_owned(), source })?;
    Ok(bottega_image::write_whole(path, bytes)?)
}

/// A job that is asked for now.
pub(super) fn new_job(args: &RenderArgs, material: &Material, from: &str) -> Job {
    let mut job = Job {
        version: identity().to_owned(),
        commit: commit(),
        work: fresh_number(),
        scene: shown(&args.scene.file.scene),
        output: shown(&args.output),
        from: from.to_owned(),
        submitted: unix_seconds(),
        priority: args.priority,
        state: JobState::Active,
        log: Vec::new(),
    };
    job.say(format!("asked for by {from}"));
    material.method.iter().for_each(|method| job.say(method.clone()));
    job
}

/// What is asked for, in words that other machines understand. The scene is sent, and is taken back unless a job comes of it.
///
/// - `me`: the process that asks.
pub(super) fn order<'a>(
    board: &'a JobBoard,
    me: &'a str,
    args: &RenderArgs,
    material: &Material,
    stop: &StopSwitch,
    reporter: &Reporter,
) -> Result<(Order, Sent<'a>), CliError> {
    let environment = match &args.scene.env {
        Some(EnvironmentArg::Picture(path)) => Some(path.as_path()),
        _ => None,
    };
    let (files, transfer) = SceneFiles::read(&args.scene.file.scene, &material.files, environment)?;
    let sent = transfer::send(&transfer, board, me, stop, reporter)?;
    let order = Order {
        words: public(env::args_os().skip(1))?,
        files,
        rules: engines::rules(args)?,
        choice: engines::choice(args)?,
        frame: None,
        engine: material.engine.clone(),
        journal: None,
    };
    Ok((order, sent))
}

/// What the user wrote, from `render` on, but for the secret that an address holds: who may only paint reads it too.
fn public(words: impl Iterator<Item = OsString>) -> Result<Vec<String>, CliError> {
    let words = words.map(|word| match word.into_string() {
        Ok(word) if word.starts_with("--farm=") => Ok("--farm".to_owned()),
        Ok(word) => Ok(word),
        Err(_) => {
            Err(CliError::usage("an argument is no UTF-8 text", "other machines cannot be told of it: rename the file"))
        }
    });
    words.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_word_of_a_farm_is_not_among_what_all_may_read() {
        let words = ["render", "a.glb", "--farm=bottega://tSECRET@h:1", "-o", "b.exr"].map(OsString::from);
        assert_eq!(public(words.into_iter()).unwrap(), ["render", "a.glb", "--farm", "-o", "b.exr"]);
    }
}
