//! Guests paint, and can do nothing else.

use std::{fs, thread, time::Duration};

use bottega_agents::driver::nats::{Login, NatsOptions, NatsUplink};
use bottega_farm::FarmCodec;
use serde_json::Value;

use super::{
    fixture::{Farm, bits, link, options, painted},
    support::{servers, text},
};

#[test]
fn a_guest_paints_and_can_do_nothing_else() {
    for server in servers() {
        let farm = Farm::start(&server);
        let plain = farm.plain();
        let [_, guest_line] = farm.lines();
        let mut guest = farm.join_by("guest", Some(&guest_line));
        farm.until_says("guest", "as a guest");
        assert!(farm.render("a.exr", &[]).wait(), "{}", farm.logs());
        assert!(bits(&farm.path("a.exr")) == plain, "{}", farm.logs());
        // Guests can read requests, which hold no word that lets machines in.
        let [line, _] = farm.lines();
        let path = farm.path("b.exr");
        let words = ["render", "goblets.glb", "--detach", "-o", text(&path), "--priority", "7"];
        farm.succeed(&[&words[..], &[&format!("--farm={line}")]].concat());
        let order = order_as_guests_read_it(&farm, 2);
        let secret = &line["bottega://t".len()..][..32];
        assert!(order.contains(r#""priority":7"#) && !order.contains(secret), "{order}");
        farm.succeed(&["jobs", "cancel", "2"]);
        let steer = farm.run(&["jobs", "cancel", "1", "--farm", &guest_line]);
        assert!(!steer.status.success());
        sees_its_own_work_alone(&farm, &guest_line);
        hostile(&farm);
        assert!(guest.end(), "{}", farm.logs());
        assert!(painted(&farm.said("guest")) > 0.1, "{server:?}: {}", farm.logs());
    }
}

/// The guest has painted a part of job 1, and another machine is there. Job 2 is not painted at all.
fn sees_its_own_work_alone(farm: &Farm, guest_line: &str) {
    let [line, _] = farm.lines();
    let words = ["join", "--threads", "1", "--name", "elsewhere", &line];
    let _other = farm.spawn_in("state-of-other", &words, "other");
    farm.until_says("other", "waiting for work");
    let lines = |words: &[&str]| -> Vec<Value> {
        let output_lines = farm.succeed(&[words, &["--json"]].concat());
        output_lines.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    };
    let as_guest = ["--farm", guest_line];
    let numbers = |jobs: Vec<Value>| jobs.into_iter().map(|job| job["job"].clone()).collect::<Vec<_>>();
    assert_eq!(numbers(lines(&["jobs", "list"])), [1, 2]);
    assert_eq!(numbers(lines(&[&["jobs", "list"], &as_guest[..]].concat())), [1]);
    assert!(farm.succeed(&[&["jobs", "show", "1"], &as_guest[..]].concat()).contains("done"));
    for words in [&["jobs", "show", "2"][..], &["jobs", "log", "2"], &["blackboard", "2"], &["jobs", "fetch", "2"]] {
        let output = farm.run(&[words, &as_guest].concat());
        let stderr = String::from_utf8_lossy(&output.stderr).replace("\n  │ ", " ");
        assert!(!output.status.success() && stderr.contains("sees its own work alone"), "{words:?}: {stderr}");
    }
    let named = |machines: Vec<Value>| {
        machines.iter().any(|it| it["machine"].as_str().is_some_and(|it| it.starts_with("elsewhere-")))
    };
    assert!(named(lines(&["machines", "list"])));
    let seen = lines(&[&["machines", "list"], &as_guest[..]].concat());
    assert!(!seen.is_empty() && !named(seen), "it is there itself");
    let platform = farm.run(&["platform", "serve", "--listen", "127.0.0.1:0", &format!("--farm={guest_line}")]);
    assert!(!platform.status.success(), "the pages of a platform show all");
}

/// The key of the guest, and its name.
fn guest_of(farm: &Farm) -> [String; 2] {
    let members = fs::read_dir(farm.path("state/bottega/members")).expect("members").flatten();
    let file = members.map(|file| file.path()).find(|path| text(path).ends_with("-guest.json")).expect("a guest");
    let guest: Value = serde_json::from_slice(&fs::read(file).expect("a membership")).expect("JSON");
    ["seed", "member"].map(|it| guest[it].as_str().expect("text").to_owned())
}

fn link_of_guest(farm: &Farm) -> NatsUplink<FarmCodec> {
    let [seed, member] = guest_of(farm);
    let own = NatsOptions { member, is_guest: true, ..options(farm, Login::NKey(seed)) };
    NatsUplink::connect(&own, FarmCodec).expect("a link")
}

fn order_as_guests_read_it(farm: &Farm, number: u32) -> String {
    let link = link_of_guest(farm);
    let job = link.notices().get(&format!("job/{number}")).expect("a job");
    let job: Value = serde_json::from_slice(&job.text).expect("JSON");
    let order = link.blobs().get(&format!("job-{}/order", job["work"]), 1 << 20).expect("a server").expect("an order");
    String::from_utf8(order).expect("text")
}

/// Attempts of a guest with its own key and a foreign program: all of them fail.
fn hostile(farm: &Farm) {
    let [seed, member] = guest_of(farm);
    let link = link(farm);
    let before = link.notices().get("job/1").expect("a job");
    let evil = link_of_guest(farm);
    // Jobs, leads, and the presences of others.
    let pages = ["page/bottega/df/agent/work-7/master@work-7", "page/bottega/ams/agent/bottega/jobs@bottega"];
    // A server that refuses to store does not answer, so each attempt waits until its timeout.
    let link_of_evil = &evil;
    thread::scope(|scope| {
        for name in ["job/1", "job/77", "lead/1", "presence/other/other.1"].into_iter().chain(pages) {
            scope.spawn(move || assert!(link_of_evil.notices().put(name, b"{}").is_err(), "{name}"));
            // It may learn that a notice exists.
            scope.spawn(move || {
                assert!(!matches!(link_of_evil.notices().update(name, b"{}", 0), Ok(Some(_))), "{name}");
            });
            scope.spawn(move || assert!(link_of_evil.notices().remove(name).is_err(), "{name}"));
        }
    });
    // Scenes, orders and pictures.
    assert!(evil.blobs().put("file/x", b"evil").is_err());
    // Its own presence, and pixels, which are believed only with their digest.
    assert!(evil.notices().put(&format!("presence/{member}/{member}.1"), b"{}").is_ok());
    assert!(evil.payloads().put("work-1/tile-x", b"pixels").is_ok());
    // It cannot overwrite pixels of others; the writer may repeat its own.
    let large = vec![7; 700_000];
    for own in [&b"own"[..], &large] {
        let name = format!("work-1/tile-{}", own.len());
        assert!(link.payloads().put(&name, own).is_ok());
        assert!(evil.payloads().put(&name, b"evil").is_err_and(|error| error.is_lasting));
        assert!(link.payloads().put(&name, own).is_ok());
        assert_eq!(link.payloads().get(&name, 1 << 20).unwrap().as_deref(), Some(own));
    }
    assert_eq!(link.notices().get("job/1").map(|job| job.revision), Some(before.revision));
    assert!(link.notices().get("job/77").is_none() && link.notices().get("presence/other/other.1").is_none());
    assert_eq!(link.blobs().has("file/x"), Ok(false));
    let (heard, refused) = forbidden_subjects(farm, &seed, &member);
    assert!(heard.is_empty(), "{heard:?}");
    assert!(refused >= 10, "only {refused} were refused");
}

/// Speaks as others, writes rows, touches streams and listens to others. Returns the effects that a member with all rights
/// saw, and the number of refusals of the server.
fn forbidden_subjects(farm: &Farm, seed: &str, member: &str) -> (Vec<String>, usize) {
    use std::sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    };
    use tokio_stream::StreamExt;
    let up = fs::read(farm.path("state/bottega/server/members.json")).expect("members");
    let up: Value = serde_json::from_slice(&up).expect("JSON");
    let address = format!("tls://127.0.0.1:{}", farm.port);
    let refused = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&refused);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
    let heard = runtime.block_on(async {
        let connect = |seed: &str| {
            let pin = options(farm, Login::Nobody).tls.pin.expect("a pin");
            async_nats::ConnectOptions::with_nkey(seed.to_owned())
                .require_tls(true)
                .tls_client_config(pin.client_config())
        };
        let witness = connect(up["seed"].as_str().expect("a seed")).connect(&address).await.expect("a link");
        let mut all = witness.subscribe("bottega.>").await.expect("a subscription");
        let mut rows = witness.subscribe("$KV.bottega-bottega.>").await.expect("a subscription");
        witness.flush().await.expect("an answer");
        let evil = connect(seed).custom_inbox_prefix(format!("_INBOX_{member}")).event_callback(move |event| {
            let count = Arc::clone(&count);
            async move {
                if event.to_string().contains("ermissions") {
                    count.fetch_add(1, Ordering::Relaxed);
                }
            }
        });
        let evil = evil.connect(&address).await.expect("a link");
        for subject in [
            "bottega.bottega.to.other.render-1=40other.from.work-1.master=40work-1",
            "bottega.bottega.to.work-1.master=40work-1.from.other.render-1=40other",
            "$KV.bottega-bottega.work.1.zone.0",
            "$KV.bottega-bottega-notices.job.1",
            "$JS.API.STREAM.DELETE.KV_bottega-bottega",
            "$JS.API.STREAM.PURGE.KV_bottega-bottega",
            "$JS.API.STREAM.UPDATE.KV_bottega-bottega",
            "$JS.API.STREAM.CREATE.evil",
            "$O.bottega-bottega.M.x",
            "bottega-enrol.trusted",
        ] {
            evil.publish(subject, "evil".into()).await.expect("sent");
        }
        for subject in ["bottega.>", "_INBOX.>", "$KV.>", "bottega-enrol.>"] {
            drop(evil.subscribe(subject).await.expect("subscribed"));
        }
        evil.flush().await.expect("an answer");
        tokio::time::sleep(Duration::from_millis(300)).await;
        let mut heard = Vec::new();
        while let Ok(Some(message)) = tokio::time::timeout(Duration::from_millis(50), all.next()).await {
            heard.push(message.subject.to_string());
        }
        while let Ok(Some(message)) = tokio::time::timeout(Duration::from_millis(50), rows.next()).await {
            heard.push(message.subject.to_string());
        }
        heard
    });
    (heard, refused.load(Ordering::Relaxed))
}
