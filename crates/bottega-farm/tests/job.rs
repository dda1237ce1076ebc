//! Whole jobs over a fake engine, in this process.

use std::{
    io::{self, Write},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU32, Ordering},
    },
    time::Duration,
};

use bottega_farm::{
    AuctionRule, BandWidth, Experience, Expert, Goal, ImportanceMap, JobError, JobReport, JobSettings, Journal,
    JournalContents, JournalWriter, Level, Observer, Optimization, Partition, Progress, StopSwitch, Subject, ZoneRow,
    ZoneState, run,
};
use bottega_image::{Aov, Film, Rect};

use crate::common::{FakeEngine, layout, tunables};

fn settings() -> JobSettings {
    JobSettings { agents: 3, processors: 2, ..JobSettings::new(97, 61, 24, tunables(), layout()) }
}

fn paint(settings: &JobSettings) -> JobReport {
    run(settings, Arc::new(FakeEngine::new(2, 0)), Arc::new(()), &StopSwitch::new(), None, None).unwrap()
}

fn bits(film: &Film) -> Vec<[u32; 4]> {
    film.rect().pixels().map(|(x, y)| film.color(x, y).map(f32::to_bits)).collect()
}

#[test]
fn the_film_has_the_same_bits_for_any_agents_level_and_auction() {
    let reference = paint(&JobSettings { agents: 1, level: Level::Whole, ..settings() });
    assert!(!reference.stopped && reference.failed.is_empty() && reference.rows.len() == 1);
    for agents in [1, 2, 7] {
        for level in Level::ALL {
            for auction in [AuctionRule::Paper, AuctionRule::FinishingTime, AuctionRule::Stealing] {
                let report = paint(&JobSettings { agents, level, auction, ..settings() });
                assert!(report.rows.iter().all(|row| row.state == ZoneState::Done));
                assert_eq!(bits(&report.film), bits(&reference.film), "{agents} agents, {level:?}, {auction:?}");
            }
        }
    }
}

#[test]
fn a_crop_window_is_that_part_of_the_whole() {
    let whole = paint(&settings());
    let crop = Rect::new(13, 7, 60, 52);
    let part = paint(&JobSettings { crop, ..settings() });
    assert_eq!(part.film.rect(), crop);
    for (x, y) in crop.pixels() {
        assert_eq!(part.film.color(x, y), whole.film.color(x, y));
    }
}

#[test]
fn profiling_throws_no_sample_away() {
    let engine = Arc::new(FakeEngine::new(2, 0));
    let settings = settings();
    run(&settings, engine.clone(), Arc::new(()), &StopSwitch::new(), None, None).unwrap();
    assert_eq!(engine.samples_painted(), 97 * 61 * 24);
}

#[test]
fn optimization_saves_samples_and_gives_the_same_picture_to_any_agents() {
    let settings = JobSettings { optimization: Optimization::VeryBig, ..settings() };
    let engine = Arc::new(FakeEngine::new(2, 0));
    let one = JobSettings { agents: 1, ..settings.clone() };
    // One agent has other zones than three, unless the number of zones is given.
    let report = run(&one, engine.clone(), Arc::new(()), &StopSwitch::new(), None, None).unwrap();
    assert!(engine.samples_painted() < 97 * 61 * 24 * 9 / 10, "{}", engine.samples_painted());
    assert!(
        report.rows.iter().any(|row| row.choice.is_some_and(|choice| choice
            .bands
            .into_array()
            .iter()
            .any(|&band| band > 0)))
    );
    let again = paint(&JobSettings { agents: 2, ..settings });
    assert_eq!(again.rows.len(), report.rows.len());
    assert_eq!(bits(&again.film), bits(&report.film));
}

fn sample_counts(film: &Film) -> Vec<u32> {
    film.rect().pixels().map(|(x, y)| film.aov(Aov::SampleCount, x, y)[0] as u32).collect()
}

#[test]
fn with_an_error_each_cell_stops_when_its_estimate_is_below_it_and_the_picture_is_the_same_for_any_zones() {
    let wanted = 0.05;
    let settings = JobSettings { goal: Goal::Error(wanted), samples: 4096, ..settings() };
    let reference = paint(&JobSettings { agents: 1, level: Level::Whole, ..settings.clone() });
    assert!(reference.rows.iter().all(|row| row.error.is_some_and(|error| error <= wanted)));
    // The samples are uniform: the error of a mean of n is 0.450 / √n, by the definition of the measure. A cell of 32 × 32 pixels
    // knows it to some 3 %, one at the edge of the picture to 20 %.
    let counts = sample_counts(&reference.film);
    assert!(counts.iter().all(|count| (40..=160).contains(count)), "{:?}", (counts.iter().min(), counts.iter().max()));
    let enough = counts.iter().filter(|count| (80..=112).contains(*count)).count();
    assert!(10 * enough > 9 * counts.len(), "{enough} of {}", counts.len());
    for (agents, level, zones) in [
        (1, Level::Divided, None),
        (2, Level::Joined, None),
        (7, Level::Balanced, None),
        (3, Level::Balanced, Some(16)),
    ] {
        let other = paint(&JobSettings { agents, level, zones, ..settings.clone() });
        assert_eq!(bits(&other.film), bits(&reference.film), "{agents} agents, {level:?}, {zones:?} zones");
    }
    // An unreachable error ends at the maximum of samples.
    let capped = paint(&JobSettings { goal: Goal::Error(1e-6), samples: 50, ..settings });
    assert!(sample_counts(&capped.film).iter().all(|count| *count == 50));
    assert!(capped.rows.iter().all(|row| row.error > Some(1e-6) && row.state == ZoneState::Done));
}

/// Stops the job after this many samples.
struct StopAtSamples(u64, StopSwitch);

impl Observer for StopAtSamples {
    fn progress(&self, progress: &Progress) {
        if progress.samples_done >= self.0 {
            self.1.request();
        }
    }
}

#[test]
fn a_stopped_job_with_an_error_goes_on_to_the_same_bits() {
    let settings = JobSettings { goal: Goal::Error(0.05), samples: 4096, zones: Some(6), ..settings() };
    let whole = bits(&paint(&settings).film);
    for samples in [1, 16, 40] {
        let (paper, stop) = (Paper::default(), StopSwitch::new());
        let journal = JournalWriter::create(paper.clone(), "fake").unwrap();
        let observer = Arc::new(StopAtSamples(97 * 61 * samples, stop.clone()));
        let engine = Arc::new(FakeEngine::new(2, 0));
        let report = run(&settings, engine, observer, &stop, Some(Box::new(journal)), None).unwrap();
        assert!(report.stopped, "stopped at {samples}");
        let (engine, journal) = (Arc::new(FakeEngine::new(2, 0)), JournalWriter::append(paper.clone()));
        let kept = paper.kept();
        assert!(samples == 1 || kept.as_ref().is_some_and(|kept| !kept.tiles.is_empty()), "kept at {samples}");
        let other = JobSettings { agents: 2, ..settings.clone() };
        let resumed = run(&other, engine, Arc::new(()), &StopSwitch::new(), Some(Box::new(journal)), kept).unwrap();
        assert_eq!(bits(&resumed.film), whole, "stopped at {samples}");
    }
}

#[test]
fn a_time_is_filled_with_passes_over_all_zones() {
    let goal = Goal::Time(std::time::Duration::from_millis(400));
    let report = paint(&JobSettings { goal, samples: 1 << 20, ..settings() });
    assert!(!report.stopped && report.failed.is_empty());
    // However slow the machine, each pixel shows something.
    assert!(report.film.rect().pixels().all(|(x, y)| report.film.is_painted(x, y)));
}

#[test]
fn a_picture_is_whole_when_its_time_is_up_amid_a_pass_and_stopped_when_the_user_says_so() {
    let goal = Goal::Time(std::time::Duration::from_millis(100));
    let settings = JobSettings { goal, samples: 1 << 20, zones: Some(6), ..settings() };
    // Half of the first pass is painted, and nothing more until the job is stopped.
    let half = || Arc::new(FakeEngine::new(2, 0).hold_from(97 * 61 / 2));
    let report = run(&settings, half(), Arc::new(()), &StopSwitch::new(), None, None).unwrap();
    assert!(!report.stopped && report.failed.is_empty());
    assert!(report.film.rect().pixels().all(|(x, y)| report.film.is_painted(x, y)));

    let (stop, hour) = (StopSwitch::new(), Goal::Time(std::time::Duration::from_secs(3600)));
    let observer = Arc::new(StopAtSamples(1, stop.clone()));
    let report = run(&JobSettings { goal: hour, ..settings }, half(), observer, &stop, None, None).unwrap();
    assert!(report.stopped);
}

#[test]
fn the_cost_of_bands_is_reported() {
    let frame = Rect::of_size(640, 480);
    let bands = |optimization| {
        let settings = JobSettings { optimization, ..JobSettings::new(640, 480, 4, tunables(), layout()) };
        paint(&settings).band_share(&frame)
    };
    assert_eq!((bands(Optimization::Off), bands(Optimization::VerySmall)), (0.0, 0.0));
    let share = bands(Optimization::Normal);
    assert!(share > 0.0 && share < 0.2, "{share}");
}

#[test]
fn the_user_says_how_wide_bands_are() {
    let with = |optimization, bands| paint(&JobSettings { optimization, bands, ..settings() });
    let widths = |optimization, bands| -> Vec<u32> {
        let rows = with(optimization, bands).rows;
        rows.iter().flat_map(|row| row.choice.expect("it is painted").bands.into_array()).collect()
    };
    assert!(widths(Optimization::VeryBig, BandWidth::Off).iter().all(|&band| band == 0));
    assert!(widths(Optimization::VeryBig, BandWidth::Pixels(3)).iter().all(|&band| band == 3));
    assert!(widths(Optimization::VeryBig, BandWidth::Rules).iter().any(|&band| band > 0));
    // Without optimization there is nothing to blend.
    assert_eq!(bits(&with(Optimization::Off, BandWidth::Pixels(3)).film), bits(&paint(&settings()).film));
}

#[test]
fn a_zone_that_fails_is_painted_by_the_next_agent() {
    let plain = bits(&paint(&settings()).film);
    let failing = |times: usize| {
        let engine = Arc::new(FakeEngine::new(2, 0).fail(times));
        let report = run(&settings(), engine, Arc::new(()), &StopSwitch::new(), None, None).unwrap();
        assert!(report.failed.is_empty());
        assert_eq!(bits(&report.film), plain);
        report.rows.iter().map(|row| row.attempt).sum::<u32>()
    };
    // Two failures exclude no agent. Failures of an excluded agent do not count against its zones.
    assert_eq!(failing(2), 2);
    assert!(failing(7) <= 7);
}

#[test]
fn zones_that_always_fail_are_given_up_and_named() {
    let engine = Arc::new(FakeEngine::new(1, 0).fail(usize::MAX));
    let report = run(&settings(), engine, Arc::new(()), &StopSwitch::new(), None, None).unwrap();
    assert_eq!(report.failed.len(), report.rows.len());
    assert!(!report.stopped);
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let refused = |settings: JobSettings| {
        run(&settings, Arc::new(FakeEngine::new(1, 0)), Arc::new(()), &StopSwitch::new(), None, None).unwrap_err()
    };
    assert!(matches!(refused(JobSettings { crop: Rect::new(5, 5, 5, 9), ..settings() }), JobError::Crop { .. }));
    assert!(matches!(refused(JobSettings { crop: Rect::of_size(98, 61), ..settings() }), JobError::Crop { .. }));
    assert!(matches!(refused(JobSettings { samples: 0, ..settings() }), JobError::Count { what: "samples", .. }));
    assert!(matches!(refused(JobSettings { agents: 0, ..settings() }), JobError::Count { what: "agents", .. }));
    assert!(matches!(refused(JobSettings { experts: Vec::new(), ..settings() }), JobError::Count { .. }));
}

#[test]
fn a_picture_of_one_pixel_is_a_picture() {
    let settings = JobSettings { agents: 5, ..JobSettings::new(1, 1, 1, tunables(), layout()) };
    assert!(paint(&settings).film.is_painted(0, 0));
}

/// A journal in memory.
#[derive(Clone, Default)]
struct Paper(Arc<Mutex<Vec<u8>>>);

impl Write for Paper {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Paper {
    fn kept(&self) -> Option<JournalContents> {
        Journal::read(&self.0.lock().unwrap()[..]).unwrap().kept
    }
}

/// Stops the job after this many zones.
struct StopAfter(usize, StopSwitch);

impl Observer for StopAfter {
    fn progress(&self, progress: &Progress) {
        if progress.zones_done >= self.0 {
            self.1.request();
        }
    }
}

#[test]
fn a_stopped_job_goes_on_to_the_same_bits() {
    let settings = settings();
    let whole = run(&settings, Arc::new(FakeEngine::new(2, 40)), Arc::new(()), &StopSwitch::new(), None, None);
    let whole = bits(&whole.unwrap().film);
    // The tasks under way at the stop may be all that was left.
    let mut has_left_some = false;
    for after in [0, 1, 3] {
        let paper = Paper::default();
        let stop = StopSwitch::new();
        let journal = JournalWriter::create(paper.clone(), "fake").unwrap();
        let observer = Arc::new(StopAfter(after, stop.clone()));
        let all = 97 * 61 * 24;
        // All but the last task is enough for three zones; without the hold the job could be done before it is stopped.
        let engine = Arc::new(FakeEngine::new(2, 40).hold_from(all));
        let report = run(&settings, engine, observer, &stop, Some(Box::new(journal)), None).unwrap();
        assert!(report.stopped, "stopped after {after}");
        let kept = paper.kept();
        let done_before = kept.iter().flat_map(|kept| &kept.rows).filter(|row| row.state == ZoneState::Done).count();
        assert!(done_before >= after, "{done_before} {after}");
        has_left_some |= done_before < report.rows.len().max(1);
        let (engine, journal) = (Arc::new(FakeEngine::new(2, 40)), JournalWriter::append(paper.clone()));
        let resumed =
            run(&settings, engine.clone(), Arc::new(()), &StopSwitch::new(), Some(Box::new(journal)), kept).unwrap();
        assert!(!resumed.stopped);
        assert!(after == 0 || engine.samples_painted() < all, "what was done is not done again");
        assert_eq!(bits(&resumed.film), whole);
        // The journal of a complete picture restores it without painting.
        let engine = Arc::new(FakeEngine::new(1, 40));
        let again = run(&settings, engine.clone(), Arc::new(()), &StopSwitch::new(), None, paper.kept()).unwrap();
        assert_eq!(engine.samples_painted(), 0);
        assert_eq!(bits(&again.film), whole);
    }
    assert!(has_left_some, "nothing was interrupted");
}

#[test]
fn what_was_kept_of_other_settings_is_refused() {
    let paper = Paper::default();
    let journal = JournalWriter::create(paper.clone(), "fake").unwrap();
    let engine = Arc::new(FakeEngine::new(1, 0));
    run(&settings(), engine.clone(), Arc::new(()), &StopSwitch::new(), Some(Box::new(journal)), None).unwrap();
    let other = JobSettings { samples: 25, ..settings() };
    let refused = run(&other, engine, Arc::new(()), &StopSwitch::new(), None, paper.kept());
    assert!(matches!(refused, Err(JobError::OtherWork)));
}

/// An observer that records all events.
#[derive(Default)]
struct Witness {
    analyzed: Mutex<Option<(Arc<ImportanceMap>, usize)>>,
    progress: Mutex<Vec<Progress>>,
    rows: Mutex<Vec<ZoneRow>>,
}

impl Observer for Witness {
    fn analyzed(&self, map: &Arc<ImportanceMap>, partition: &Arc<Partition>) {
        *self.analyzed.lock().unwrap() = Some((Arc::clone(map), partition.zones().len()));
    }

    fn zone_changed(&self, row: &ZoneRow) {
        self.rows.lock().unwrap().push(row.clone());
    }

    fn progress(&self, progress: &Progress) {
        self.progress.lock().unwrap().push(*progress);
    }
}

#[test]
fn an_observer_sees_map_rows_and_honest_progress() {
    let witness = Arc::new(Witness::default());
    let engine = Arc::new(FakeEngine::new(2, 0));
    let report = run(&settings(), engine, witness.clone(), &StopSwitch::new(), None, None).unwrap();
    let zones = witness.analyzed.lock().unwrap().as_ref().map(|(_, zones)| *zones);
    assert_eq!(zones, Some(report.rows.len()));
    let progress = witness.progress.lock().unwrap();
    let last = progress.last().unwrap();
    assert_eq!((last.zones_done, last.samples_done, last.cost_done), (report.rows.len(), 97 * 61 * 24, 1.0));
    assert!(progress.is_sorted_by_key(|progress| progress.samples_done));
    let profiled = witness.rows.lock().unwrap().iter().filter(|row| row.state == ZoneState::Profiled).count();
    assert_eq!(profiled, report.rows.len());
    let per_zone = report.messages as f64 / report.rows.len() as f64;
    assert!(per_zone < 20.0, "{per_zone} messages a zone");
}

#[derive(Default)]
struct Teller(Mutex<String>);

impl Observer for Teller {
    fn message(&self, now: bottega_agents::Time, message: &bottega_farm::FarmMessage) {
        use std::fmt::Write;
        let (from, word, content) = (&message.sender, message.performative, &message.content);
        let to: Vec<String> = message.receivers.iter().map(ToString::to_string).collect();
        _ = writeln!(self.0.lock().unwrap(), "{:?} {from} -> {to:?} {word} {content:?}", now.elapsed());
    }
}

#[test]
#[ignore = "prints the conversation of the slowest of many jobs"]
fn the_slowest_conversation() {
    let jobs = (0..60).map(|i| {
        let teller = Arc::new(Teller::default());
        let settings = JobSettings { agents: 1 + i % 7, level: Level::ALL[i % 4], ..settings() };
        let report = run(&settings, Arc::new(FakeEngine::new(2, 0)), teller.clone(), &StopSwitch::new(), None, None);
        (report.unwrap().times, teller)
    });
    let (times, teller) = jobs.max_by_key(|(times, _)| times.total).unwrap();
    eprintln!("{}{times:?}", teller.0.lock().unwrap());
}

/// Rules that ask for this share of the light samples, whatever the zone.
fn rules(share: f64) -> Expert {
    let text = format!(
        "FUNCTION_BLOCK f VAR_INPUT size : REAL; END_VAR VAR_OUTPUT samples : REAL; END_VAR \
         FUZZIFY size TERM any := (0, 1) (1e9, 1); END_FUZZIFY \
         DEFUZZIFY samples TERM some := {share}; METHOD : COGS; DEFAULT := 1; END_DEFUZZIFY \
         RULEBLOCK r RULE 1 : IF size IS any THEN samples IS some; END_RULEBLOCK END_FUNCTION_BLOCK"
    );
    Expert::parse(&text).expect("rules")
}

#[test]
fn the_rules_of_the_agent_that_wins_a_zone_decide_what_it_is_painted_with() {
    let experts = vec![rules(0.25), rules(0.75)];
    let settings = JobSettings {
        agents: 2,
        zones: Some(24),
        optimization: Optimization::Normal,
        experts,
        samples: 64,
        ..settings()
    };
    let engine = Arc::new(FakeEngine::new(2, 0));
    let report = run(&settings, engine.clone(), Arc::new(()), &StopSwitch::new(), None, None).unwrap();
    let mut painted = [0; 2];
    for row in &report.rows {
        let name = row.agent.as_ref().expect("somebody painted it").to_string();
        let agent = usize::from(name.starts_with("render-2@"));
        painted[agent] += 1;
        let samples = [16, 48][agent];
        assert_eq!(row.choice.map(|choice| choice.samples), Some(samples), "{name}");
        assert_eq!(row.samples_done(), samples);
    }
    assert!(painted.iter().all(|&count| count > 0), "{painted:?}");
    // Each pixel has the samples of its zone in the film, and no zone is painted twice but for its first samples.
    let counts = sample_counts(&report.film);
    assert!(counts.iter().all(|count| [16, 48].contains(count)));
    let taken: u64 = counts.iter().map(|&count| u64::from(count)).sum();
    assert!((taken..taken * 12 / 10).contains(&engine.samples_painted()), "{} {taken}", engine.samples_painted());
}

#[test]
fn what_was_learnt_changes_what_is_expected_and_no_pixel() {
    let settings = JobSettings { optimization: Optimization::VeryBig, agents: 1, ..settings() };
    let first = paint(&settings);
    let mut experience = Experience::default();
    // A job of a millisecond teaches almost nothing, so its time is multiplied by a thousand.
    for mut lesson in first.lessons.into_values() {
        lesson.zones.iter_mut().for_each(|zone| zone.time *= 1000);
        experience.learn(&lesson, None);
    }
    assert_eq!(experience.jobs(), 1);
    let second = paint(&JobSettings { experience: Arc::new(experience), ..settings });
    let (before, after) = (first.forecast.unwrap(), second.forecast.unwrap());
    assert!((after.total_ratio / 1000.0 - 1.0).abs() < 0.1, "{after:?}");
    assert!((before.total_ratio - 1.0).abs() > 0.5, "{before:?}");
    assert_eq!((first.jobs_learnt, second.jobs_learnt), (0, 1));
    assert_eq!(bits(&second.film), bits(&first.film));
    let chosen = |rows: &[ZoneRow]| rows.iter().map(|row| (row.rect, row.choice)).collect::<Vec<_>>();
    assert_eq!(chosen(&second.rows), chosen(&first.rows));
}

#[test]
fn zones_of_a_picture_that_was_painted_before_need_no_profile_and_have_the_same_bits() {
    /// Counts the zones that are profiled.
    #[derive(Default)]
    struct Profiles(AtomicU32);
    impl Observer for Profiles {
        fn zone_changed(&self, row: &ZoneRow) {
            self.0.fetch_add(u32::from(row.state == ZoneState::Profiling), Ordering::Relaxed);
        }
    }
    let paint = |settings: &JobSettings| {
        let (engine, profiles) = (Arc::new(FakeEngine::new(2, 0)), Arc::new(Profiles::default()));
        let report = run(settings, engine, Arc::clone(&profiles) as _, &StopSwitch::new(), None, None).unwrap();
        (report, profiles.0.load(Ordering::Relaxed))
    };
    let subject = Subject { scene: "spheres".into(), view: "front".into() };
    let settings = JobSettings { subject, agents: 1, ..settings() };
    let (first, profiled) = paint(&settings);
    assert_eq!(profiled as usize, first.rows.len());
    // The times of a fake engine are too short to teach: they are replaced by the survey's prediction, in thousands
    let mut experience = Experience::default();
    for mut lesson in first.lessons.into_values() {
        for zone in &mut lesson.zones {
            zone.time = Duration::from_secs_f64(1e3 * zone.outlook.sample_time * f64::from(zone.samples));
        }
        experience.learn(&lesson, None);
    }
    let learnt = JobSettings { experience: Arc::new(experience), ..settings };
    for auction in [AuctionRule::FinishingTime, AuctionRule::Stealing] {
        let (second, profiled) = paint(&JobSettings { auction, ..learnt.clone() });
        assert_eq!((profiled, bits(&second.film)), (0, bits(&first.film)));
    }
    // The paper's rules profile every zone
    let (paper, profiled) = paint(&JobSettings { auction: AuctionRule::Paper, ..learnt });
    assert_eq!(profiled as usize, paper.rows.len());
}
