//! Foreign names do not affect a terminal: whatever they contain, a line stays a line, and nothing is coloured.
#![cfg(unix)]

use std::{fs, path::Path, process::Output};

use serde_json::Value;

use crate::program::support::{run, scenes, text};

/// Clears the screen, turns red, goes back to the start of the line, begins another one, writes from right to left.
const NAME: &str = "a\u{1b}[2J\u{9b}31mALERT\rb\nc\u{202e}d";
const SHOWN: &str = "a\\u001b[2J\\u009b31mALERT\\rb\\nc\\u202ed";

/// Checks the output of a command. Returns all of it.
fn said(output: &Output) -> String {
    let all =
        [&output.stdout[..], &output.stderr].map(|bytes| String::from_utf8(bytes.to_vec()).expect("text")).concat();
    let acts = |c: char| (c.is_control() && c != '\n' && c != '\t') || c == '\u{202e}';
    assert!(!all.contains(acts), "{all:?}");
    assert!(!all.contains("\nc\\u202e"), "the name began a line: {all}");
    all
}

/// A copy of a scene under another name.
fn copy(folder: &Path, name: &str) -> String {
    let path = folder.join(name);
    fs::copy(scenes().join("cornell-box.glb"), &path).expect("a copy");
    text(&path).to_owned()
}

#[test]
fn names_of_files_are_escaped() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = copy(folder.path(), &format!("{NAME}.glb"));
    let missing = text(&folder.path().join(format!("{NAME}.missing.glb"))).to_owned();
    let picture = text(&folder.path().join(format!("{NAME}.png"))).to_owned();
    let small = ["render", scene.as_str(), "-o", &picture, "--size", "8x8", "--spp", "1", "--agents", "1"];
    let commands: [&[&str]; 6] = [
        &small,
        &["render", &scene, "-o", &picture, "--camera", NAME],
        &["render", &missing, "-o", &picture],
        &["info", &missing],
        &["diff", &missing, &picture],
        &["rules", "check", &missing],
    ];
    for arguments in commands {
        let output = run(arguments);
        let all = said(&output);
        assert!(all.contains("\\u001b[2J"), "{arguments:?}: {all}");
    }
    assert!(fs::exists(&picture).expect("a folder"), "the picture has its own name");
}

#[test]
fn names_within_scenes_are_escaped() {
    let folder = tempfile::tempdir().expect("a folder");
    let escaped = serde_json::to_string(NAME).expect("JSON");
    let gltf = format!(
        r#"{{"asset": {{"version": "2.0", "generator": {escaped}}}, "scene": 0, "scenes": [{{"nodes": [0, 1]}}],
        "extensionsUsed": [{escaped}], "cameras": [{{"name": {escaped}, "type": "orthographic",
        "orthographic": {{"xmag": 1, "ymag": 1, "znear": 0, "zfar": 9}}}}],
        "nodes": [{{"camera": 0}}, {{"mesh": 0}}], "materials": [{{"name": {escaped}, "alphaMode": {escaped},
        "pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
        "textures": [{{"source": 0}}], "images": [{{"name": {escaped}, "uri": "none.png"}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "material": 0}}]}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}},
        {{"bufferView": 0, "componentType": 5126, "type": "VEC2", "count": 3}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]}}"#
    );
    let line = NAME.replace(['\r', '\n'], "");
    let pbrt = format!("Camera \"{line}\" WorldBegin\nMaterial \"{line}\"\nShape \"sphere\" \"float {line}\" 1\n");
    let xml = "<scene version='3.0.0'><integrator type='a&#x9b;31m&#x202e;'/><shape type='sphere' id='b'><bsdf type='a&#x9b;31m&#x202e;'/></shape>\
        <sensor type='perspective' id='c&#x9b;&#13;&#10;c'/></scene>";
    let obj =
        format!("mtllib {0}.mtl\nusemtl {0}\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", NAME.replace(['\r', '\n'], ""));
    let files = [("a.gltf", gltf, true), ("a.pbrt", pbrt, true), ("a.xml", xml.to_owned(), true), ("a.obj", obj, true)];
    for (name, content, shows_name) in files {
        let path = folder.path().join(name);
        fs::write(&path, content).expect("a scene");
        let picture = folder.path().join("a.png");
        for arguments in [
            &["info", text(&path)][..],
            &["render", text(&path), "-o", text(&picture), "--strict"],
            &["render", text(&path), "-o", text(&picture), "--size", "8x8", "--spp", "1", "--agents", "1"],
            &["render", text(&path), "-o", text(&picture), "--camera", "nobody"],
        ] {
            let all = said(&run(arguments));
            // Cameras of the other formats have no names.
            let shows_name = shows_name && (name == "a.gltf" || !arguments.contains(&"nobody"));
            assert!(!shows_name || all.contains("31m"), "{arguments:?}: {all}");
        }
    }
    // Output for programs stays JSON, with the name.
    let output = run(&["info", text(&folder.path().join("a.gltf")), "--json"]);
    let summary: Value = serde_json::from_str(&said(&output)).expect("JSON");
    assert_eq!(summary["generator"], NAME);
    let output = run(&["info", text(&folder.path().join("a.gltf"))]);
    assert!(said(&output).contains(SHOWN), "{}", said(&output));
}
