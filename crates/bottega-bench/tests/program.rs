//! The refusals of the program, and the head of its figures.

use super::bench;

#[test]
fn what_cannot_be_measured_is_refused_with_a_reason() {
    for (arguments, code, reason) in [
        (&["farm", "--agents", "0"][..], 2, "--agents"),
        (&["farm", "--zone-time", "soon"], 2, "--zone-time"),
        (&["farm", "--server", "/nowhere/nats-server"], 1, "/nowhere/nats-server"),
        (&["farm", "--farm", "nowhere"], 2, "--farm"),
        (&["farm-part", "--share", "1:2:3"], 2, "no farm is named"),
        (&["engines", "povray", "room.pov", "--program", "/nowhere/bottega"], 2, "cargo build --release"),
        (&["learning", "scene.glb"], 2, "two scenes for each pair"),
        (&["peers", "/nowhere"], 1, "/nowhere"),
    ] {
        let output = bench(arguments);
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {stderr}");
        assert!(stderr.contains(reason), "{arguments:?}: {stderr}");
    }
}

#[test]
fn the_head_stands_above_the_figures_of_people() {
    let output = bench(&["rays", "--only", "noisy", "--side", "16", "--repeat", "1"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).expect("text");
    let (head, figures) = text.split_once("\n\n").expect("a head");
    let names: Vec<&str> = head.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(names, ["commit", "build", "command", "processors", "system", "date"], "{text}");
    assert!(head.contains("bottega-bench rays --only noisy --side 16 --repeat 1"), "{text}");
    assert!(figures.contains("noisy sphere (69168 triangles)") && !figures.contains("hall"), "{text}");
}
