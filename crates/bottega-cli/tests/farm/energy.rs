//! Energy and cost of a job; notifications of `bottega up`.

use std::{
    fs,
    path::Path,
    process::Stdio,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use serde_json::Value;

use super::{
    fixture::{Farm, PICTURE, Process},
    support::{servers, text},
};

/// Starts a machine whose energy counters are in a folder.
fn join(farm: &Farm, name: &str, counters: &Path, more: &[&str]) -> Process {
    let cache = farm.path(&format!("cache-{name}"));
    let words = ["join", "--threads", "1", "--cache", text(&cache)];
    let mut command = farm.command(&[&words, more].concat());
    let log = fs::File::create(farm.path(name)).expect("a log");
    command.env("BOTTEGA_POWERCAP", counters).stdout(log.try_clone().expect("a log")).stderr(log).stdin(Stdio::null());
    let machine = Process(command.spawn().expect("the program starts"));
    farm.until_says(name, "waiting for work");
    machine
}

fn detach(farm: &Farm, output: &str, samples: &str) {
    let path = farm.path(output);
    let words = ["render", "goblets.glb", "-o", text(&path), "--farm", "--detach", samples];
    farm.succeed(&[&words, &PICTURE[..]].concat());
}

#[test]
fn energy_and_cost_are_shown_as_far_as_they_are_known() {
    let Some(server) = servers().pop() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let zone = folder.path().join("counters/intel-rapl:0");
    fs::create_dir_all(&zone).expect("a folder");
    fs::write(zone.join("name"), "package-0\n").expect("a file");
    fs::write(zone.join("max_energy_range_uj"), "100000000\n").expect("a file");
    fs::write(zone.join("energy_uj"), "95000000\n").expect("a file");
    // 50 W, and a counter that soon begins again.
    let is_over = Arc::new(AtomicBool::new(false));
    let counting = {
        let (file, is_over) = (zone.join("energy_uj"), Arc::clone(&is_over));
        thread::spawn(move || {
            let mut count = 95_000_000u64;
            while !is_over.load(Ordering::Relaxed) {
                count = (count + 1_000_000) % 100_000_000;
                let next = file.with_extension("next");
                fs::write(&next, format!("{count}\n")).and_then(|()| fs::rename(&next, &file)).expect("a counter");
                thread::sleep(Duration::from_millis(20));
            }
        })
    };
    let notifications = folder.path().join("notifications");
    let on = format!("done,failed=cat >> {}", text(&notifications));
    let farm =
        Farm::start_with(&server, &["--price-per-kwh", "0.5", "--currency", "EUR", "--store-size", "1", "--on", &on]);

    let mut machine = join(&farm, "one", &folder.path().join("counters"), &[]);
    detach(&farm, "a.exr", "--spp=384");
    farm.until_state(1, "done");
    farm.until("its energy is known", || farm.job(1)["energy"]["kwh"].is_number());
    let energy = farm.job(1)["energy"].clone();
    let number = |value: &Value| value.as_f64().expect("a number");
    let kwh = number(&energy["kwh"]);
    assert!(kwh > 0.0 && number(&energy["processor_seconds"]) > 0.1, "{energy}");
    assert!((number(&energy["cost"]) - 0.5 * kwh).abs() < 1e-12 && energy["currency"] == "EUR", "{energy}");
    assert_eq!((&energy["machines"][0]["source"], &energy["is_partial"]), (&"counters".into(), &false.into()));
    // 50 W for its processor seconds is the most that it can have: other processes have a share, too.
    assert!(kwh < 75.0 * number(&energy["processor_seconds"]) / 3.6e6, "{energy}");
    let zones = energy["zones"].as_array().expect("zones");
    let sum: f64 = zones.iter().map(|zone| number(&zone["kwh"])).sum();
    assert!(zones.len() > 4 && (sum - kwh).abs() < 1e-9, "{energy}");
    let said = farm.succeed(&["jobs", "show", "1"]);
    assert!(said.contains("Wh (") && said.contains("EUR") && said.contains("by its counters"), "{said}");
    assert!(machine.end());
    is_over.store(true, Ordering::Relaxed);
    counting.join().expect("it counts");

    // A machine with watts from its owner, and one without any figures.
    let mut machine = join(&farm, "two", Path::new("nowhere"), &["--watts", "120"]);
    detach(&farm, "b.exr", "--spp=64");
    farm.until_state(2, "done");
    farm.until("its energy is known", || farm.job(2)["energy"]["kwh"].is_number());
    assert_eq!(farm.job(2)["energy"]["machines"][0]["source"], "watts");
    assert!(machine.end());
    let _machine = join(&farm, "three", Path::new("nowhere"), &[]);
    detach(&farm, "c.exr", "--spp=64");
    farm.until_state(3, "done");
    farm.until("its time is known", || {
        farm.job(3)["energy"]["processor_seconds"].as_f64().is_some_and(|time| time > 0.0)
    });
    let energy = farm.job(3)["energy"].clone();
    assert!(energy.get("kwh").is_none() && energy.get("cost").is_none() && energy["is_partial"] == true, "{energy}");
    let said = farm.succeed(&["jobs", "show", "3"]);
    assert!(said.contains("processor time") && !said.contains("Wh") && !said.contains("EUR"), "{said}");

    // The process of `bottega up` reports each job once.
    farm.until("all three are reported", || {
        fs::read_to_string(&notifications).unwrap_or_default().matches("\"done\"").count() >= 3
    });
    let notifications = fs::read_to_string(&notifications).expect("it was reported");
    let events: Vec<Value> =
        serde_json::Deserializer::from_str(&notifications).into_iter().collect::<Result<_, _>>().expect("JSON");
    let jobs: Vec<(u64, &str)> =
        events.iter().map(|it| (it["job"].as_u64().expect("a job"), it["event"].as_str().expect("an event"))).collect();
    assert_eq!(jobs, [(1, "done"), (2, "done"), (3, "done")]);
    assert!(events[0]["scene"].as_str().is_some_and(|scene| scene.ends_with("goblets.glb")), "{notifications}");
}

#[test]
fn a_job_that_nobody_paints_is_reported_as_stalled_by_its_submitter_and_by_the_host() {
    let Some(server) = servers().pop() else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let notifications = folder.path().join("notifications");
    let on = format!("stalled=cat >> {}", text(&notifications));
    let farm = Farm::start_with(&server, &["--on", &on, "--stalled-after", "1", "--store-size", "1"]);
    detach(&farm, "a.exr", "--spp=64");
    farm.until("it is reported", || {
        notifications.is_file() && fs::read_to_string(&notifications).is_ok_and(|text| !text.is_empty())
    });
    let event: Value =
        serde_json::from_str(&fs::read_to_string(&notifications).expect("it was reported")).expect("JSON");
    assert_eq!((&event["event"], &event["job"]), (&"stalled".into(), &1.into()));
    assert!(event["reason"].as_str().is_some_and(|why| why.contains("no machine paints it")), "{event}");
    // The submitter reports only its own job.
    let own = folder.path().join("own");
    let on = format!("stalled,done=cat >> {}", text(&own));
    let mut asker = farm.render("b.exr", &["--on", &on, "--stalled-after", "0.1"]);
    farm.until("it is painted", || {
        own.is_file() && fs::read_to_string(&own).is_ok_and(|text| text.contains("\"done\""))
    });
    assert!(asker.wait());
    let notifications = fs::read_to_string(&own).expect("it was reported");
    let events: Vec<Value> =
        serde_json::Deserializer::from_str(&notifications).into_iter().collect::<Result<_, _>>().expect("JSON");
    assert!(events.iter().all(|it| it["job"] == 2), "{notifications}");
    assert!(
        events.len() > 1 && events[0]["event"] == "stalled" && events.last().expect("one")["event"] == "done",
        "{notifications}"
    );
}
