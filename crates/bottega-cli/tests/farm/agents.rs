//! The agents of a job in the directories of the farm, in processes of their own: they register, find their Master, are suspended
//! and resumed one by one, and are gone from the pages when their machine is lost or the job is cancelled.

use serde_json::Value;

use super::{
    fixture::{Farm, Process},
    platform::name_of,
    support::servers,
};

const JOB: u32 = 1;

/// The entries in the directories of the job: name, state, services.
fn listed(farm: &Farm) -> Vec<(String, String, Vec<String>)> {
    let job = farm.job(JOB);
    let words = |value: &Value| value.as_array().into_iter().flatten().map(word).collect();
    let agents = job["agents"].as_array().cloned().unwrap_or_default();
    agents.iter().map(|agent| (word(&agent["agent"]), word(&agent["state"]), words(&agent["services"]))).collect()
}

fn word(value: &Value) -> String {
    value.as_str().expect("text").to_owned()
}

fn state(farm: &Farm, agent: &str) -> Option<String> {
    listed(farm).into_iter().find(|(name, ..)| name == agent).map(|(_, state, _)| state)
}

fn offers(farm: &Farm, kind: &str) -> Vec<String> {
    let kind = format!("bottega-job-{kind}");
    listed(farm).into_iter().filter(|(.., services)| services.contains(&kind)).map(|(name, ..)| name).collect()
}

/// Returns the zones that an agent holds by the Blackboard.
fn in_hand(farm: &Farm, agent: &str) -> usize {
    let rows = farm.succeed(&["blackboard", &JOB.to_string(), "--json"]);
    let rows = rows.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON"));
    let is_its = |row: &Value| row["agent"] == *agent && ["profiling", "awarded"].iter().any(|it| row["state"] == **it);
    rows.filter(is_its).count()
}

/// The platform of `bottega up`, as strangers query it.
fn services_of_platform(farm: &Farm, kind: &str) -> Vec<Value> {
    let said = farm.said("up.log");
    let url = said.split("platform at ").nth(1).and_then(|rest| rest.split(": ").next()).expect("an address");
    let services = farm.succeed(&["platform", "services", "--at", url, "--type", kind, "--json"]);
    services.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn agents_of_a_job_are_in_the_directories_and_one_of_them_is_suspended_for_real() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let first = farm.join("one");
    let one = name_of(&farm, &[]);
    let [_, guest] = farm.lines();
    // A guest enters its own agents, and finds the Master like the others.
    let second = farm.join_by("two", Some(&guest));
    let two = name_of(&farm, std::slice::from_ref(&one));
    let third = farm.join("three");
    let three = name_of(&farm, &[one.clone(), two.clone()]);
    // More work than any processor does before the job is cancelled below.
    assert!(farm.render_by("a.exr", "--spp=200000", &["--detach"]).wait(), "{}", farm.logs());
    let render = |process: &str| format!("render-1@{process}");
    farm.until("all are in the directories", || {
        let there = listed(&farm);
        [&one, &two, &three]
            .iter()
            .all(|it| there.iter().any(|(name, state, _)| *name == render(it) && state == "active"))
    });
    for kind in ["master", "analyst", "blackboard", "model-repository"] {
        assert_eq!(offers(&farm, kind).len(), 1, "{kind}: {:?}", listed(&farm));
    }
    let masters = services_of_platform(&farm, "bottega-job-master");
    assert!(word(&masters[0]["addresses"][0]).starts_with("nats:bottega.bottega.to.work-"), "{masters:?}");
    assert_eq!((&masters[0]["properties"]["job"], &masters[0]["ontologies"][0]), (&"1".into(), &"bottega-farm".into()));
    assert_eq!(services_of_platform(&farm, "bottega-job-render-agent").len(), 3);

    // The AMS suspends one agent: others get its zones, and its machine stays as it was.
    let its = render(&two);
    farm.until("it paints", || in_hand(&farm, &its) > 0);
    farm.succeed(&["platform", "suspend", &its]);
    farm.until("it has handed back what it had", || in_hand(&farm, &its) == 0);
    assert_eq!(state(&farm, &its).as_deref(), Some("suspended"));
    assert_eq!(farm.job(JOB)["machines"], 3, "its machine is still there");
    let samples = || farm.job(JOB)["done"].as_f64().expect("a share");
    let done = samples();
    farm.until("the others go on", || samples() > done);
    assert_eq!(in_hand(&farm, &its), 0, "it stays away");
    farm.succeed(&["platform", "resume", &its]);
    farm.until("it paints again", || in_hand(&farm, &its) > 0);
    assert_eq!(state(&farm, &its).as_deref(), Some("active"));
    for (agent, words) in
        [("nobody@nowhere", "no agent `nobody@nowhere`"), ("ams@bottega", "the command is impossible in this state")]
    {
        let output = farm.run(&["platform", "suspend", agent]);
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(output.status.code() == Some(1) && stderr.contains(words), "{agent}: {stderr}");
    }

    // The one that leads is killed: its agents go from the pages, and the entry of the Master is that of another one.
    let leader = word(&farm.job(JOB)["leader"]);
    assert_ne!(leader, two, "a guest does not lead");
    let mut machines: Vec<(String, Process)> = vec![(one, first), (two, second), (three, third)];
    for (name, process) in &mut machines {
        if *name == leader {
            process.kill();
        }
    }
    farm.until("its agents are gone", || !listed(&farm).iter().any(|(name, ..)| name.ends_with(&leader)));
    farm.until("another one leads", || farm.job(JOB)["leader"].as_str().is_some_and(|name| name != leader));
    farm.until("its Master is found", || {
        offers(&farm, "master").len() == 1 && offers(&farm, "render-agent").len() == 2
    });
    farm.succeed(&["jobs", "cancel", "1"]);
    farm.until("no agent of the job is left", || listed(&farm).is_empty());
    assert!(services_of_platform(&farm, "bottega-job-render-agent").is_empty());
}
