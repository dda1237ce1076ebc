//! A farm and a platform that shows it: JADE's messages over a real socket, and machines that follow orders.

use std::{cell::Cell, net::SocketAddr};

use super::jade::{Jade, Line, TAKEN, is};
use bottega_agents::{Performative as P, wire::WireMessage};
use serde_json::Value;

use super::{
    fixture::{Farm, MANY, Process, WAIT, bits},
    support::servers,
};

/// A platform that shows a farm.
struct ShownPage<'a> {
    farm: &'a Farm,
    _process: Process,
    at: SocketAddr,
    jade: Jade,
    /// The number of the last conversation.
    number: Cell<u32>,
}

impl<'a> ShownPage<'a> {
    fn start(farm: &'a Farm, more: &[&str]) -> Self {
        let arguments = ["platform", "serve", "--name", "shop", "--listen", "127.0.0.1:0", "--farm", "--json"];
        let process = farm.spawn(&[&arguments, more].concat(), "platform.log");
        farm.until_says("platform.log", "\"serving\"");
        let said = farm.said("platform.log");
        let said: Value = serde_json::from_str(said.lines().next().expect("a line")).expect("JSON");
        assert_eq!(said["farm"], "jobs@shop");
        let address = said["address"].as_str().expect("an address");
        let at = address.trim_start_matches("http://").trim_end_matches("/acc").parse().expect("an address");
        Self { farm, _process: process, at, jade: Jade::start(), number: Cell::new(0) }
    }

    fn url(&self) -> String {
        format!("http://{}/acc", self.at)
    }

    /// The answer of the white or the yellow pages.
    fn pages(&self, which: &str) -> Vec<Value> {
        let output = self.farm.succeed(&["platform", which, "--at", &self.url(), "--json"]);
        output.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }

    /// The state of an agent in the white pages.
    fn state(&self, machine: &str) -> Option<String> {
        let name = format!("{machine}@shop");
        let agents = self.pages("agents");
        let agent = agents.iter().find(|agent| agent["agent"] == *name)?;
        Some(agent["state"].as_str().expect("a state").to_owned())
    }

    fn renderers(&self) -> Vec<Value> {
        self.pages("services").into_iter().filter(|service| service["type"] == "bottega-render").collect()
    }

    /// The number of a new conversation.
    fn next(&self) -> u32 {
        self.number.set(self.number.get() + 1);
        self.number.get()
    }

    /// Sends a message as `from@jade`. `AID` in the content stands for the receiver.
    fn says(&self, number: u32, from: &str, to: &str, act: &str, ontology: &str, content: &str) {
        let text = self.jade.says_to(9, self.at, |text| {
            let begin = text.find(":content  \"").expect("a content") + 11;
            let end = text.find("\" \n :reply-with").expect("its end");
            let content = content.replace("AID", &format!("(agent-identifier :name {to}@shop)"));
            format!("{}{}{}", &text[..begin], content.replace('"', "\\\""), &text[end..])
                .replace("(REQUEST", &format!("({act}"))
                .replace("FIPA-Agent-Management", ontology)
                .replace("df@bottega", &format!("{to}@shop"))
                .replace("probe@jade", &format!("{from}@jade"))
                .replace("1795227948166-2", &format!("-{number}"))
        });
        assert_eq!(Line::to_address(self.at).ask(&text), TAKEN);
    }

    /// Sends a request. Returns the answer.
    fn asks(&self, from: &str, to: &str, function: &str) -> WireMessage {
        let number = self.next();
        self.says(number, from, to, "REQUEST", "bottega-farm", &format!("((action AID {function}))"));
        let heard = self.jade.hear().message;
        assert_eq!(heard.conversation_id, Some(format!("conv-{from}@jade-{number}")));
        heard
    }

    /// Changes an agent through the AMS, as JADE's tools do.
    fn tells_ams(&self, function: &str) {
        self.says(
            self.next(),
            "boss",
            "ams",
            "REQUEST",
            "FIPA-Agent-Management",
            &format!("((action AID {function}))"),
        );
        is(&self.jade.hear().message, P::Inform);
    }
}

/// Returns the name of the machine from its log.
pub(super) fn name_of(farm: &Farm, known: &[String]) -> String {
    let mut name = None;
    let mut look = || {
        let all = machines(farm);
        name =
            all.iter().map(|one| one["machine"].as_str().expect("a name").to_owned()).find(|one| !known.contains(one));
        name.is_some()
    };
    let begun = std::time::Instant::now();
    while !look() {
        assert!(begun.elapsed() < WAIT, "no machine comes: {}", farm.logs());
    }
    name.expect("it was found")
}

fn machines(farm: &Farm) -> Vec<Value> {
    let output = farm.succeed(&["machines", "list", "--json"]);
    output.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

fn standing(farm: &Farm, machine: &str) -> Value {
    let all = machines(farm);
    all.into_iter().find(|one| one["machine"] == *machine).map_or(Value::Null, |one| one["state"].clone())
}

#[test]
fn machines_are_agents_that_are_suspended_resumed_and_ended_for_real() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let plain = farm.plain_by(MANY);
    let mut first = farm.join("one");
    let one = name_of(&farm, &[]);
    let mut second = farm.join("two");
    let two = name_of(&farm, std::slice::from_ref(&one));
    let shown = ShownPage::start(&farm, &["--trust", "boss@jade"]);
    farm.until("both machines are in the pages", || {
        shown.renderers().len() == 2 && shown.state(&one).is_some() && shown.state(&two).is_some()
    });
    assert!(shown.pages("services").iter().any(|service| service["type"] == "bottega-jobs"));
    assert_eq!(shown.renderers()[0]["properties"]["threads"], "1");

    // The AMS suspends one in the middle of its work: the other one paints on.
    assert!(farm.render_by("a.exr", MANY, &["--detach"]).wait(), "{}", farm.logs());
    farm.until_painted(1, 0.05);
    farm.until("both paint", || farm.job(1)["machines"] == 2);
    let modify = |state: &str| {
        format!("(modify (ams-agent-description :name (agent-identifier :name {one}@shop) :state {state}))")
    };
    shown.tells_ams(&modify("suspended"));
    farm.until("it has handed back what it had", || standing(&farm, &one) == "suspended");
    assert_eq!(shown.state(&one).as_deref(), Some("suspended"));
    farm.until("one paints", || farm.job(1)["machines"] == 1);
    farm.until_says("one", "suspended by ams@shop of the platform");
    // The farm resumes it, and the white pages show it.
    farm.succeed(&["machines", "resume", &one]);
    farm.until_says("one", "resumed by");
    farm.until("the AMS knows", || shown.state(&one).as_deref() == Some("active"));
    // The other one gets the request itself; the AMS resumes it.
    let agreed = shown.asks("boss", &two, "(suspend-machine)");
    assert!(is(&agreed, P::Agree).ends_with("(suspend-machine)) true)"), "{agreed:?}");
    let done = shown.jade.hear().message;
    assert!(is(&done, P::Inform).starts_with("((done (action"), "{done:?}");
    assert_eq!(standing(&farm, &two), "suspended");
    farm.until("the AMS knows", || shown.state(&two).as_deref() == Some("suspended"));
    shown.tells_ams(&modify("active").replace(&one, &two));
    farm.until("it paints again", || standing(&farm, &two) == "active");
    farm.until_state(1, "done");
    farm.succeed(&["jobs", "fetch", "1"]);
    assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());

    // Ended by the AMS, and killed.
    shown.tells_ams(&format!("(quit (agent-identifier :name {one}@shop))"));
    assert!(first.wait(), "{}", farm.logs());
    assert!(farm.said("one").contains("terminated by ams@shop of the platform"), "{}", farm.logs());
    second.kill();
    farm.until("nobody is there", || {
        shown.renderers().is_empty() && shown.state(&one).is_none() && shown.state(&two).is_none()
    });
}

#[test]
fn strangers_list_and_follow_jobs_and_trusted_ones_change_them() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let shown = ShownPage::start(&farm, &["--trust", "boss@jade"]);
    assert!(farm.render("a.exr", &["--detach"]).wait(), "{}", farm.logs());
    farm.until("the platform knows of it", || {
        is(&shown.asks("probe", "jobs", "(list-jobs)"), P::Inform).contains(":number 1 :state active")
    });
    for (from, function, act, end) in [
        ("probe", "(pause-job :job 1)", P::Refuse, "(unauthorised))"),
        ("boss", "(pause-job :job 9)", P::Refuse, "(unrecognised-parameter-value pause-job job))"),
        (
            "boss",
            "(set-priority :job 1 :priority 0)",
            P::Refuse,
            "(unrecognised-parameter-value set-priority priority))",
        ),
        ("boss", "(burn-job :job 1)", P::Refuse, "(unsupported-function burn-job))"),
        ("boss", "1)) ((", P::NotUnderstood, "(unrecognised-value content))"),
    ] {
        let heard = shown.asks(from, "jobs", function);
        assert!(is(&heard, act).ends_with(end), "{function}: {heard:?}");
        assert_eq!(heard.ontology.as_deref(), Some("bottega-farm"));
    }
    for (function, key, value) in [
        ("(pause-job :job 1)", "state", Value::from("paused")),
        ("(set-priority :job 1 :priority 30)", "priority", Value::from(30)),
        ("(resume-job :job 1)", "state", Value::from("active")),
    ] {
        is(&shown.asks("boss", "jobs", function), P::Agree);
        assert!(is(&shown.jade.hear().message, P::Inform).starts_with("((done (action"), "{function}");
        assert_eq!(farm.job(1)[key], value, "{function}");
    }

    let subscribe = |number, act: &str, job: u32| {
        let wish = format!("((iota ?x (result (action AID (describe-job :job {job})) ?x)))");
        shown.says(number, "probe", "jobs", act, "bottega-farm", &wish);
        shown.jade.hear().message
    };
    is(&subscribe(shown.next(), "SUBSCRIBE", 7), P::Refuse);
    let conversation = shown.next();
    is(&subscribe(conversation, "SUBSCRIBE", 1), P::Agree);
    assert!(is(&shown.jade.hear().message, P::Inform).contains(":done 0 "));
    let _one = farm.join("one");
    let (mut times, mut last) = (Vec::new(), String::new());
    while !last.starts_with("((done (iota") {
        let heard = shown.jade.hear().message;
        assert_eq!(heard.conversation_id.as_deref(), Some(&*format!("conv-probe@jade-{conversation}")));
        times.push(std::time::Instant::now());
        let before = std::mem::replace(&mut last, is(&heard, P::Inform).to_owned());
        assert!(last.starts_with("((= (iota") || before.contains(":state done :done 1 "), "{before}\n{last}");
    }
    // The end of the conversation comes with the last report.
    times.pop();
    let (all, span) = (times.len() as f64, times[times.len() - 1].duration_since(times[0]).as_secs_f64());
    assert!(times.len() >= 2 && (all - 2.0) <= span * 2.0, "{all} in {span} s");

    assert!(farm.render("b.exr", &["--detach"]).wait(), "{}", farm.logs());
    farm.until("the platform knows of it", || {
        is(&shown.asks("probe", "jobs", "(list-jobs)"), P::Inform).contains(":number 2 ")
    });
    let conversation = shown.next();
    is(&subscribe(conversation, "SUBSCRIBE", 2), P::Agree);
    let mut heard = subscribe(conversation, "CANCEL", 2);
    while !is(&heard, P::Inform).starts_with("((done (iota") {
        heard = shown.jade.hear().message;
    }
    is(&shown.asks("boss", "jobs", "(cancel-job :job 2)"), P::Agree);
    is(&shown.jade.hear().message, P::Inform);
    assert_eq!(farm.job(2)["state"], "cancelled");
    assert!(shown.jade.hears_nothing(), "the subscription is cancelled");
}

#[test]
fn machines_are_steered_without_a_platform_and_impossible_commands_are_refused() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let mut first = farm.join("one");
    let one = name_of(&farm, &[]);
    farm.succeed(&["machines", "suspend", &one]);
    farm.until("it rests", || standing(&farm, &one) == "suspended");
    let mut render = farm.render_by("a.exr", "--spp=200000", &[]);
    farm.until_painted(1, 0.02);
    assert_eq!(farm.job(1)["machines"], 1);
    let asker = machines(&farm).into_iter().find(|one| one["takes_orders"] == false).expect("the submitter");
    for (arguments, code, words) in [
        (vec!["machines", "suspend", "nobody"], 1, "there is no machine `nobody`"),
        (
            vec!["machines", "suspend", asker["machine"].as_str().expect("a name")],
            1,
            "it is the process that submitted",
        ),
        (vec!["machines", "suspend"], 2, "<NAME>"),
        (vec!["platform", "serve", "--trust", "boss"], 2, "boss@jade"),
        (vec!["platform", "serve", "--farm=nats://127.0.0.1:1"], 1, "bottega up"),
    ] {
        let output = farm.run(&arguments);
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(output.status.code() == Some(code) && stderr.contains(words), "{arguments:?}: {stderr}");
    }
    farm.succeed(&["machines", "resume", &one]);
    farm.until("both paint", || farm.job(1)["machines"] == 2);
    let output = farm.succeed(&["machines", "terminate", &one, "--json"]);
    assert_eq!(serde_json::from_str::<Value>(&output).expect("JSON")["ordered"], "terminated");
    assert!(first.wait(), "{}", farm.logs());
    assert!(farm.said("one").contains("terminated by `bottega machines` on "), "{}", farm.logs());
    render.kill();
}
