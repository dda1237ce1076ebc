//! A soak test: random events, from a seed, on a farm of real processes, through its three interfaces in turn. In each quiet
//! phase all interfaces must report the same and all jobs must be painted bit-identically; at no time may a job wait while a
//! machine is free.

mod doors;
mod farm;
mod kinds;
mod module;
mod watch;

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use clap::Args;
use serde_json::Value;

use self::{
    doors::{Door, Python},
    farm::SoakFarm,
    kinds::{PictureKind, bits},
    watch::IdleWatch,
};
use crate::{cargo::cargo, needs, python, run_head};

/// The number of machines, with one thread each, and of guests.
const MACHINES: usize = 2;
const GUESTS_MAX: usize = 1;
/// The number of events between quiet phases.
const STEPS_BETWEEN: u32 = 12;
/// The maximum number of jobs after a quiet phase.
const JOBS_KEPT: usize = 8;
/// The maximum number of unfinished jobs.
const JOBS_OPEN: usize = 4;
/// The time limit for all jobs in a quiet phase.
const QUIET_WITHIN: Duration = Duration::from_secs(300);
/// The time limit for interfaces to report the same, because updates reach each of them with a delay.
const SAME_WITHIN: Duration = Duration::from_secs(20);
const LOOK_EVERY: Duration = Duration::from_millis(250);
/// The time limit for a killed server, and machines that look for it, to be back.
const BACK_WITHIN: Duration = Duration::from_secs(60);
/// The messages by which the interfaces report that the server is away.
const AWAY: [&str; 4] = ["cannot reach a NATS server", "does not answer", ": 503: ", ": 504: "];

/// Options of `cargo xtask soak`.
#[derive(Args)]
pub(crate) struct SoakArgs {
    /// Number of events.
    #[arg(long, default_value_t = 500)]
    steps: u32,
    /// Seed of the random events and their targets.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The program, with the library of the Python module beside it or in `deps` there; default: those of the `dev` profile, which
    /// are built before.
    #[arg(long)]
    program: Option<PathBuf>,
    /// The NATS server; default: that of the tests, or the one that `bottega up` finds.
    #[arg(long)]
    server: Option<PathBuf>,
    /// The scene.
    #[arg(long, default_value = "scenes/goblets.glb")]
    scene: PathBuf,
    /// A Python with NumPy; default: that of the tests.
    #[arg(long)]
    python: Option<PathBuf>,
    /// Write the figures to this file, too, such as one below `bench/runs`.
    #[arg(short, long)]
    output: Option<PathBuf>,
}

/// Runs a soak test, and prints its statistics.
pub(crate) fn soak(args: &SoakArgs) -> Result<()> {
    let program = match &args.program {
        Some(program) => program.clone(),
        None => {
            cargo(&["build", "--quiet", "-p", "bottega-cli", "-p", "bottega-python"], &[])?;
            crate::cargo::target().join("debug/bottega")
        }
    };
    let head = run_head::head(&program)?;
    let mut soak = Soak::start(args, &program)?;
    let ran = soak.run(args.steps);
    if let Err(error) = ran {
        bail!("{error:#}\n\nseed {}, after {} steps:\n{}", args.seed, soak.figures.steps, soak.farm.logs());
    }
    let text = format!("{head}\n{}", soak.report());
    print!("{text}");
    args.output.as_ref().map_or(Ok(()), |path| fs::write(path, text)).context("the figures are not written")
}

/// A pseudo-random number generator.
struct Chance(u64);

impl Chance {
    /// Returns the next number, by SplitMix64 (Steele, Lea, Flood 2014).
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() % count.max(1) as u64) as usize
    }

    fn one_of<'a, T>(&mut self, all: &'a [T]) -> Option<&'a T> {
        let index = self.below(all.len());
        all.get(index)
    }
}

/// The events, with their weights.
const STEPS: [(SoakStep, usize); 14] = [
    (SoakStep::Submit, 20),
    (SoakStep::Requeue, 14),
    (SoakStep::Pause, 8),
    (SoakStep::Resume, 10),
    (SoakStep::Cancel, 4),
    (SoakStep::Priority, 6),
    (SoakStep::SuspendMachine, 5),
    (SoakStep::ResumeMachine, 8),
    (SoakStep::KillLeader, 5),
    (SoakStep::KillMachine, 5),
    (SoakStep::KillServer, 4),
    (SoakStep::KillUp, 4),
    (SoakStep::GuestComes, 4),
    (SoakStep::GuestGoes, 3),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum SoakStep {
    Submit,
    Requeue,
    Pause,
    Resume,
    Cancel,
    Priority,
    SuspendMachine,
    ResumeMachine,
    KillLeader,
    KillMachine,
    KillServer,
    KillUp,
    GuestComes,
    GuestGoes,
}

/// The statistics of a soak test.
#[derive(Default)]
struct Figures {
    steps: u32,
    happened: BTreeMap<SoakStep, u32>,
    /// Number of requests that an interface refused because of the current state.
    refused: u32,
    /// Number of requests repeated because the server was away.
    again: u32,
    by_door: BTreeMap<&'static str, u32>,
    quiet_moments: u32,
    pictures_compared: u32,
    kept_pictures: u32,
    /// Number of restarts of jobs by the farm's own watch.
    stirs: u64,
    longest_idle: Duration,
}

struct Soak {
    farm: SoakFarm,
    doors: Vec<Door>,
    kinds: Vec<PictureKind>,
    chance: Chance,
    figures: Figures,
    /// The kind of each job's image.
    submitted: BTreeMap<u64, usize>,
    watch: IdleWatch,
    begun: Instant,
}

impl Soak {
    fn start(args: &SoakArgs, program: &Path) -> Result<Self> {
        let server = args.server.clone().or_else(needs::nats_server);
        let mut farm = SoakFarm::start(program, server.as_deref())?;
        let scene = fs::canonicalize(&args.scene).with_context(|| args.scene.display().to_string())?;
        let kinds = PictureKind::all(&|words| farm.cli.run(words), &scene, &farm.path(""))?;
        for _ in 0..MACHINES {
            farm.join_machine()?;
        }
        let mut doors = vec![Door::Cli(farm.cli.clone()), Door::Api(farm.api()?)];
        let own = args.python.clone().unwrap_or_else(|| python::program("python3"));
        let module = module::assemble(program, &farm.path("python"))?;
        match Python::start(&own, &module, &farm.lines()?[0], &farm.cli.state)? {
            Some(python) => doors.push(Door::Python(Box::new(python))),
            None => eprintln!("SKIPPED the Python door: {} cannot import the module `bottega`", own.display()),
        }
        let (figures, submitted, watch) = (Figures::default(), BTreeMap::new(), IdleWatch::default());
        Ok(Self { farm, doors, kinds, chance: Chance(args.seed), figures, submitted, watch, begun: Instant::now() })
    }

    fn run(&mut self, steps: u32) -> Result<()> {
        for step in 1..=steps {
            let what = self.choose();
            let happened = self.happen_or_again(what).with_context(|| format!("step {step}, {what:?}"))?;
            self.figures.steps = step;
            if happened {
                *self.figures.happened.entry(what).or_default() += 1;
            } else {
                self.figures.refused += 1;
            }
            // Some events follow at once, others during painting.
            let pause = Duration::from_millis(50 + 40 * self.chance.below(30) as u64);
            let until = Instant::now() + pause;
            while Instant::now() < until {
                self.look().with_context(|| format!("after step {step}, {what:?}"))?;
            }
            if step % STEPS_BETWEEN == 0 || step == steps {
                self.quiet().with_context(|| format!("the quiet moment after step {step}"))?;
            }
        }
        Ok(())
    }

    fn choose(&mut self) -> SoakStep {
        let all: usize = STEPS.iter().map(|(_, weight)| weight).sum();
        let mut place = self.chance.below(all);
        for (what, weight) in STEPS {
            if place < weight {
                return what;
            }
            place -= weight;
        }
        SoakStep::Submit
    }

    /// Returns the interface whose turn it is.
    fn door(&mut self) -> &mut Door {
        let place = self.figures.steps as usize % self.doors.len();
        let door = &mut self.doors[place];
        *self.figures.by_door.entry(door.name()).or_default() += 1;
        door
    }

    fn api(&self) -> Result<doors::Api> {
        self.farm.api()
    }

    fn jobs(&mut self) -> Result<Vec<Value>> {
        self.api()?.list("/api/jobs")
    }

    /// Returns the jobs in one of these states.
    fn jobs_that_are(&mut self, states: &[&str]) -> Result<Vec<Value>> {
        Ok(self.jobs()?.into_iter().filter(|job| states.iter().any(|state| job["state"] == *state)).collect())
    }

    /// Triggers an event like [`Self::happen`]; if the server is away, repeats it until the server is back.
    fn happen_or_again(&mut self, what: SoakStep) -> Result<bool> {
        let begun = Instant::now();
        loop {
            match self.happen(what) {
                Err(error) if AWAY.iter().any(|words| format!("{error:#}").contains(words)) => {
                    ensure!(begun.elapsed() < BACK_WITHIN, "the farm is not back after {BACK_WITHIN:?}: {error:#}");
                    self.figures.again += 1;
                    thread::sleep(LOOK_EVERY);
                }
                happened => return happened,
            }
        }
    }

    /// Triggers an event. Returns `true` if it was possible.
    fn happen(&mut self, what: SoakStep) -> Result<bool> {
        match what {
            SoakStep::Submit => self.submit(),
            SoakStep::Requeue => self.requeue(),
            SoakStep::Pause => self.steer(&["active"], "pause"),
            SoakStep::Resume => self.steer(&["paused"], "resume"),
            SoakStep::Cancel => self.steer(&["active", "paused"], "cancel"),
            SoakStep::Priority => self.set_priority(),
            SoakStep::SuspendMachine => self.order(0, "suspend"),
            SoakStep::ResumeMachine => self.order(1, "resume"),
            SoakStep::KillLeader => self.kill_machine(true),
            SoakStep::KillMachine => self.kill_machine(false),
            SoakStep::KillServer => self.farm.kill_server().map(|()| true),
            SoakStep::KillUp => {
                self.farm.kill_up();
                thread::sleep(Duration::from_millis(200 * self.chance.below(8) as u64));
                self.farm.up()?;
                let api = self.farm.api()?;
                self.doors
                    .iter_mut()
                    .filter(|door| door.name() == "API")
                    .for_each(|door| *door = Door::Api(api.clone()));
                Ok(true)
            }
            SoakStep::GuestComes if self.farm.guests.len() < GUESTS_MAX => self.farm.join_guest().map(|()| true),
            SoakStep::GuestGoes if !self.farm.guests.is_empty() => self.farm.guests.remove(0).end().map(|()| true),
            SoakStep::GuestComes | SoakStep::GuestGoes => Ok(false),
        }
    }

    fn submit(&mut self) -> Result<bool> {
        if self.jobs_that_are(&["active", "paused"])?.len() >= JOBS_OPEN {
            return Ok(false);
        }
        let kind = self.chance.below(self.kinds.len());
        let output = self.farm.path(&format!("submitted-{}.exr", self.figures.steps));
        let like = self.jobs()?.last().and_then(|job| job["job"].as_u64());
        let place = self.figures.steps as usize % self.doors.len();
        let Self { doors, kinds, .. } = self;
        // The command line sends the first scene.
        let place = if like.is_none() { 0 } else { place };
        let door = &mut doors[place];
        let number = door.submit(&kinds[kind], &output, like)?;
        *self.figures.by_door.entry(door.name()).or_default() += 1;
        self.submitted.insert(number, kind);
        Ok(true)
    }

    /// Requeues a zone of a finished job: the existing image stays, and its progress starts at 0.
    fn requeue(&mut self) -> Result<bool> {
        let done: Vec<u64> = self.jobs_that_are(&["done"])?.iter().filter_map(|job| job["job"].as_u64()).collect();
        let Some(&number) = self.chance.one_of(&done) else { return Ok(false) };
        let api = self.api()?;
        let zones: Vec<u64> =
            api.list(&format!("/api/jobs/{number}/zones"))?.iter().filter_map(|zone| zone["id"].as_u64()).collect();
        let Some(&zone) = self.chance.one_of(&zones) else { return Ok(false) };
        api.ask("POST", &format!("/api/jobs/{number}/zones/{zone}/requeue"), &Value::Null)?;
        let view = api.ask("GET", &format!("/api/jobs/{number}"), &Value::Null)?;
        let begins = view["state"] == "done" || view["done"].as_f64() < Some(0.5) && view["kept"] == true;
        ensure!(begins, "job {number} is painted again, and is shown as {view}");
        self.compare(number).context("the picture of a job that is painted again")?;
        self.figures.kept_pictures += 1;
        Ok(true)
    }

    fn steer(&mut self, states: &[&str], word: &str) -> Result<bool> {
        let jobs: Vec<u64> = self.jobs_that_are(states)?.iter().filter_map(|job| job["job"].as_u64()).collect();
        let Some(&number) = self.chance.one_of(&jobs) else { return Ok(false) };
        match self.door().steer(number, word) {
            Ok(()) => Ok(true),
            // The job may have finished meanwhile.
            Err(error) if error.to_string().contains("is over") => Ok(false),
            Err(error) => Err(error),
        }
    }

    fn set_priority(&mut self) -> Result<bool> {
        let jobs: Vec<u64> =
            self.jobs_that_are(&["active", "paused"])?.iter().filter_map(|job| job["job"].as_u64()).collect();
        let Some(&number) = self.chance.one_of(&jobs) else { return Ok(false) };
        let priority = (1 + self.chance.below(50)).to_string();
        self.farm.cli.run(&["jobs", "priority", &number.to_string(), &priority])?;
        Ok(true)
    }

    /// Suspends a machine, or resumes all.
    fn order(&mut self, from: usize, word: &str) -> Result<bool> {
        let machines: Vec<String> = self.farm.machines.iter().map(|machine| machine.name.clone()).collect();
        let Some(machine) = self.chance.one_of(&machines) else { return Ok(false) };
        let over_http = (self.figures.steps as usize + from).is_multiple_of(2);
        if over_http {
            // The machine may just have been killed, and is no longer listed.
            return Ok(self.api()?.ask("POST", &format!("/api/machines/{machine}/{word}"), &Value::Null).is_ok());
        }
        match self.farm.cli.run(&["machines", word, machine]) {
            Ok(_) => Ok(true),
            // The machine is looking for the server, which was just killed.
            Err(error) if error.to_string().contains("no machine") => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// Kills a machine and starts another one.
    fn kill_machine(&mut self, is_leader: bool) -> Result<bool> {
        let leaders: Vec<String> =
            self.jobs()?.iter().filter_map(|job| job["leader"].as_str().map(str::to_owned)).collect();
        let all = 0..self.farm.machines.len();
        let which: Vec<usize> = all.filter(|&i| leaders.contains(&self.farm.machines[i].name) == is_leader).collect();
        let Some(&which) = self.chance.one_of(&which) else { return Ok(false) };
        self.farm.machines.remove(which).kill();
        self.farm.join_machine()?;
        Ok(true)
    }

    /// Checks that no job waits while a machine is free.
    fn look(&mut self) -> Result<()> {
        let api = self.api()?;
        // While the server is away the state is unknown.
        if let (Ok(jobs), Ok(machines)) = (api.list("/api/jobs"), api.list("/api/machines")) {
            self.watch.look(&jobs, &machines)?;
            self.figures.longest_idle = self.figures.longest_idle.max(self.watch.longest);
            self.figures.stirs = self.figures.stirs.max(self.watch.stirs());
        }
        thread::sleep(LOOK_EVERY);
        Ok(())
    }

    /// A quiet phase: waits until everything is painted, and compares the results.
    fn quiet(&mut self) -> Result<()> {
        let machines: Vec<String> = self.farm.machines.iter().map(|machine| machine.name.clone()).collect();
        let begun = Instant::now();
        for machine in machines {
            while let Err(error) = self.farm.cli.run(&["machines", "resume", &machine]) {
                ensure!(begun.elapsed() < BACK_WITHIN, "a machine is not back after {BACK_WITHIN:?}: {error:#}");
                thread::sleep(LOOK_EVERY);
            }
        }
        let begun = Instant::now();
        loop {
            for job in self.jobs_that_are(&["paused"])? {
                let number = job["job"].as_u64().context("a number")?;
                self.door().steer(number, "resume")?;
            }
            if self.jobs_that_are(&["active", "paused"])?.is_empty() {
                break;
            }
            ensure!(begun.elapsed() < QUIET_WITHIN, "it is not painted in {QUIET_WITHIN:?}: {:?}", self.jobs()?);
            self.look()?;
        }
        self.all_doors_tell_the_same()?;
        let jobs = self.jobs()?;
        for job in jobs.iter().filter(|job| job["kept"] == true) {
            self.compare(job["job"].as_u64().context("a number")?)?;
        }
        let failed: Vec<&Value> = jobs.iter().filter(|job| job["state"] == "failed").collect();
        ensure!(failed.is_empty(), "jobs failed: {failed:?}");
        for job in &jobs[..jobs.len().saturating_sub(JOBS_KEPT)] {
            let number = job["job"].as_u64().context("a number")?;
            self.door().steer(number, "remove")?;
            self.submitted.remove(&number);
        }
        self.figures.quiet_moments += 1;
        eprintln!(
            "step {}: quiet, {} jobs, {:.0} s",
            self.figures.steps,
            jobs.len(),
            self.begun.elapsed().as_secs_f64()
        );
        Ok(())
    }

    fn all_doors_tell_the_same(&mut self) -> Result<()> {
        const FIELDS: [&str; 10] =
            ["job", "state", "done", "zones_done", "zones", "kept", "priority", "stirs", "machines", "seconds_left"];
        let begun = Instant::now();
        loop {
            let mut lists = Vec::new();
            for door in &mut self.doors {
                let jobs: Vec<Vec<Value>> =
                    door.jobs()?.iter().map(|job| FIELDS.iter().map(|field| job[field].clone()).collect()).collect();
                lists.push((door.name(), jobs));
            }
            if lists.windows(2).all(|pair| pair[0].1 == pair[1].1) {
                return Ok(());
            }
            ensure!(begun.elapsed() < SAME_WITHIN, "doors show different jobs ({FIELDS:?}): {lists:?}");
            thread::sleep(LOOK_EVERY);
        }
    }

    /// Fetches the image of a job by the interface whose turn it is, and compares its bits.
    fn compare(&mut self, number: u64) -> Result<()> {
        let path = self.farm.path("fetched.exr");
        self.door().fetch(number, &path)?;
        let kind = *self.submitted.get(&number).with_context(|| format!("nobody submitted job {number}"))?;
        ensure!(bits(&path)? == self.kinds[kind].bits, "the picture of job {number} has other bits");
        self.figures.pictures_compared += 1;
        Ok(())
    }

    fn report(&self) -> String {
        let Figures {
            steps, happened, refused, again, by_door, quiet_moments, pictures_compared, kept_pictures, ..
        } = &self.figures;
        let happened: Vec<String> = happened.iter().map(|(what, count)| format!("{count} {what:?}")).collect();
        let doors: Vec<String> = by_door.iter().map(|(door, count)| format!("{count} {door}")).collect();
        format!(
            "{steps} steps in {:.0} s, {refused} of them could not be done just then, {again} tries failed while the server was \
             away: {}\n\
             by door: {}\n\
             {quiet_moments} quiet moments; {pictures_compared} pictures fetched and compared bit by bit, {kept_pictures} of them while painted \
             again\n\
             the longest that a job waited while a machine was free: {:.1} s; begun again by the farm's own watch: {}\n",
            self.begun.elapsed().as_secs_f64(),
            happened.join(", "),
            doors.join(", "),
            self.figures.longest_idle.as_secs_f64(),
            self.figures.stirs,
        )
    }
}
