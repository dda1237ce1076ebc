//! A request that was not made by a command line, painted by two processes.

use super::{
    fixture::{Farm, bits},
    support::{example, servers, text},
};

#[test]
fn a_request_of_no_command_line_is_painted_by_two_processes() {
    let Some(server) = servers().pop() else { return };
    let farm = Farm::start(&server);
    let [line, _] = farm.lines();
    let mut machine = farm.join("machine");
    let picture = farm.path("example.exr");
    let mut command = example("submit");
    command.args(["goblets.glb", text(&picture), &line]).env("XDG_STATE_HOME", farm.path("state-of-example"));
    let output = command.output().expect("the example starts");
    assert!(output.status.success(), "{}\n{}", String::from_utf8_lossy(&output.stderr), farm.logs());
    let plain = farm.path("plain.exr");
    farm.succeed(&["render", "goblets.glb", "-o", text(&plain), "--size=160x120", "--spp=256", "--quiet"]);
    assert!(bits(&picture) == bits(&plain), "{}", farm.logs());
    assert_eq!(farm.job(1)["state"], "done");
    assert!(machine.end());
    assert!(farm.said("machine").contains("job 1: painting goblets.glb"), "{}", farm.logs());
}
