//! A small farm: its figures make sense, whatever they are on this machine.
//!
//! The servers are those that `BOTTEGA_NATS_SERVERS` names, or the system's. Without one its test says that it is skipped.

use serde_json::Value;

use super::{bench, servers::servers};

fn number(value: &Value, field: &str) -> f64 {
    value[field].as_f64().unwrap_or_else(|| panic!("no number `{field}` in {value}"))
}

#[test]
fn agents_in_several_processes_are_awarded_each_zone_and_paint_it_once() {
    for server in servers() {
        let server = server.to_str().expect("a path in Unicode");
        let arguments = ["--agents", "20", "--zones", "200", "--zone-time", "30ms", "--processes", "2", "--json"];
        let output = bench(&[&["farm", "--server", server], &arguments[..]].concat());
        // It fails where a pixel is not painted, or not once.
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).expect("one JSON object");
        let command = report["head"]["command"].as_str().unwrap_or_default();
        assert!(
            command.ends_with(&format!("bottega-bench farm --server {server} {}", arguments.join(" "))),
            "{report}"
        );
        assert_eq!((number(&report, "agents"), number(&report, "processes")), (20.0, 3.0));
        let zones = number(&report, "zones");
        assert!((100.0..=400.0).contains(&zones), "{report}");
        // One that was taken back or taken over is awarded again.
        assert!((zones..2.0 * zones).contains(&number(&report, "awards")), "{report}");
        let wanted = number(&report, "wanted_per_second");
        assert!((wanted - 20.0 / 0.03).abs() < 1e-6, "{report}");
        // Nobody paints faster than time goes by: 1.5 for the zones that happen to be cheap.
        assert!((1.0..1.5 * wanted).contains(&number(&report, "awards_per_second")), "{report}");
        let wait = &report["award_wait_ms"];
        for times in [wait, &report["award_ms"]] {
            let [median, p99, longest] = ["p50", "p99", "max"].map(|it| number(times, it));
            assert!(0.0 < median && median <= p99 && p99 <= longest, "{report}");
            assert!(longest < 1e3 * number(&report, "seconds"), "{report}");
        }
        assert!(number(wait, "count") <= number(&report, "awards"), "{report}");
        assert!(number(&report, "messages_per_zone") > 20.0, "{report}");
        assert!(number(&report, "bytes_per_zone") > 1000.0, "{report}");
    }
}
