//! `bottega render --farm`: asks a farm for a picture, paints with the others, and has the picture in the end.

use std::{env, ffi::OsString, path::Path, sync::Arc, thread, time::Duration};

use bottega_agents::driver::nats::NatsUplink;
use bottega_farm::{FarmCodec, JobError, JobReport, StopSwitch};
use bottega_scene::SceneFile;

use super::{
    address::FarmAddress,
    job::{Job, JobState, Order, unix_seconds},
    job_board::{JobBoard, ended_badly},
    link::{FarmLink, link},
    names::fresh_number,
    part::{Leading, Member, Part, Tools, take_part},
    patience::patiently,
    scene_files::SceneFiles,
};
use crate::{
    cli::{EnvironmentArg, RenderArgs},
    engines::{self, Material},
    error::CliError,
    reporter::Reporter,
    scene::{shown, threads},
};

/// How often is looked how a job stands that this process has no part in.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// A job that this process asked for.
pub(crate) struct Asked {
    member: Member,
    pub(crate) number: u32,
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
    pub(crate) fn submit(
        farm: Option<&FarmAddress>,
        args: &RenderArgs,
        material: &Material,
        stop: &StopSwitch,
    ) -> Result<Self, CliError> {
        let FarmLink { uplink, name, .. } = link(farm, &args.login)?;
        let board = JobBoard { uplink };
        board.refuse_guests()?;
        let order = order(&board.uplink, args, material)?;
        let member = Member { board, name, threads: threads(&args.scene), stop: stop.clone() };
        let job = new_job(args, material, &member.name);
        member.board.sweep();
        let number = member.board.submit(&job, &order)?;
        Ok(Self { member, number })
    }

    /// Paints with the others until the picture is there, or the user wants to stop.
    pub(crate) fn paint(&self, mut tools: Tools, reporter: &Reporter) -> Result<Painted, CliError> {
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
        self.member.board.rise(&self.member.name);
    }
}

/// Writes a picture that another process has made. The file is there as a whole or not at all.
pub(crate) fn write_picture(path: &Path, bytes: &[u8]) -> Result<(), CliError> {
    super::scene_files::write_whole(path, bytes)
}

/// A job that is asked for now.
pub(super) fn new_job(args: &RenderArgs, material: &Material, from: &str) -> Job {
    let mut job = Job {
        version: env!("CARGO_PKG_VERSION").to_owned(),
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

/// What is asked for, in words that other machines understand.
pub(super) fn order(
    uplink: &Arc<NatsUplink<FarmCodec>>,
    args: &RenderArgs,
    material: &Material,
) -> Result<Order, CliError> {
    let files = send_files(uplink, args, &material.files)?;
    Ok(Order {
        words: public(env::args_os().skip(1))?,
        files,
        rules: engines::rules(args)?,
        choice: engines::choice(args)?,
        frame: None,
        engine: material.engine.clone(),
    })
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

/// Has the farm keep the files of a scene.
fn send_files(
    uplink: &Arc<NatsUplink<FarmCodec>>,
    args: &RenderArgs,
    files: &[SceneFile],
) -> Result<SceneFiles, CliError> {
    let environment = match &args.scene.env {
        Some(EnvironmentArg::Picture(path)) => Some(path.as_path()),
        _ => None,
    };
    SceneFiles::send(&args.scene.file.scene, files, environment, uplink.blobs())
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
