use glam::{Vec4, vec2, vec3};

use super::*;

fn with<T>(text: &str, check: impl FnOnce(Result<ObjFile<'_>, SceneError>) -> T) -> T {
    check(read(Path::new("a.obj"), text.as_bytes(), &MemoryBudget::new(1 << 26)))
}

fn parts(text: &str) -> Vec<ObjPart> {
    with(text, |file| file.unwrap().into_parts().unwrap())
}

fn single(text: &str) -> Mesh {
    with(text, |file| file.unwrap().into_single().unwrap())
}

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn indices_count_from_either_end() {
    let expected = single(&format!("{CORNERS}f 1 2 3 4\n"));
    assert_eq!(expected.triangles, vec![[0, 1, 2], [0, 2, 3]]);
    assert_eq!(expected.positions[2], vec3(1.0, 1.0, 0.0));
    assert_eq!(single(&format!("{CORNERS}f -4 -3 -2 -1\n")), expected);
    assert_eq!(single(&format!("{CORNERS}f 1 2 \\\n 3 \\\r\n 4\n")), expected);
    assert_eq!(single(&format!("# é\n\n{}f 1 2 3 4", CORNERS.replace('\n', "\r\n"))), expected);
    // A positive index may refer to a vertex that comes later.
    assert_eq!(single(&format!("f 1 2 3 4\n{CORNERS}")), expected);
}

#[test]
fn corners_with_the_same_indices_share_a_vertex() {
    let text = format!(
        "{CORNERS}vt 0 0\nvt 1 0.5 9\nvn 0 0 2\nvn 0 0 -1\nf 1/1/1 2/2/1 3/1/1\nf 1/1/1 3/1/1 4/2/1\nf 1/1/2 3/1/2 2/2/2\n"
    );
    let mesh = single(&text);
    assert_eq!(mesh.triangles, vec![[0, 1, 2], [0, 2, 3], [4, 5, 6]]);
    assert_eq!(mesh.uvs[0][1], vec2(1.0, 0.5));
    assert_eq!((mesh.normals[0], mesh.normals[4]), (vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, -1.0)));
}

#[test]
fn each_material_makes_a_part() {
    let text = format!(
        "mtllib my materials.mtl\n{CORNERS}g a\nf 1 2 3\nusemtl red paint\nf 1 3 4\nusemtl blue\nf 1 2 4\nusemtl red paint\n\
        f 2 3 4\nl 1 2\np 1\n"
    );
    let parts = parts(&text);
    let found: Vec<_> = parts.iter().map(|part| (part.material.as_deref(), part.mesh.triangles.len())).collect();
    assert_eq!(found, vec![(None, 1), (Some("red paint"), 2), (Some("blue"), 1)]);
    assert_eq!(parts[1].mesh.triangles, vec![[0, 1, 2], [3, 1, 2]]);
    with(&text, |file| {
        let file = file.unwrap();
        assert_eq!(file.libraries, vec![("my materials.mtl".to_owned(), 1)]);
        assert_eq!(file.skipped, vec![("l".to_owned(), 14), ("p".to_owned(), 15)]);
    });
}

#[test]
fn smoothing_groups_make_normals_of_their_own() {
    // A roof: two quads that meet at an angle, then a flat one.
    let text = "v 0 0 0\nv 0 1 0\nv 1 0 1\nv 1 1 1\nv 2 0 0\nv 2 1 0\ns 1\nf 1 3 4 2\nf 3 5 6 4\ns off\nf 1 2 6 5\n";
    let mesh = &parts(text)[0].mesh;
    assert!(mesh.normals.iter().all(|normal| normal.is_normalized()));
    let ridge = mesh.positions.iter().position(|p| *p == vec3(1.0, 0.0, 1.0)).unwrap();
    assert!(mesh.normals[ridge].z > 0.9, "{}", mesh.normals[ridge]);
    // The flat one shares no vertex with the roof.
    let shared =
        mesh.triangles[4].iter().any(|vertex| mesh.triangles[..4].iter().flatten().any(|other| other == vertex));
    assert!(!shared && mesh.positions.len() == 6 + 6);
    // Mitsuba does not know of groups.
    assert!(single(text).normals.is_empty());
    assert!(parts(&text.replace("s 1", "s 0"))[0].mesh.normals.is_empty());
}

#[test]
fn colours_of_vertices_are_linear() {
    let mesh = single("v 0 0 0\nv 1 0 0 1 0.5 0\nv 1 1 0 0 0 0 1\nv 0 1 0 7\nf 1 2 3 4\n");
    let half = 0.214_041;
    assert_eq!(mesh.colors[0], Vec4::ONE);
    assert!((mesh.colors[1] - Vec4::new(1.0, half, 0.0, 1.0)).abs().max_element() < 1e-5);
    assert_eq!(mesh.colors[2].truncate(), Vec3::ZERO);
    assert_eq!(mesh.colors[3], Vec4::ONE);
}

#[test]
fn long_files_are_read_in_pieces() {
    // Each quad refers to its own four vertices, backwards; every thousandth quad has another material.
    let mut text = String::new();
    let count = 60_000u32;
    for i in 0..count {
        for (x, y) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
            text += &format!("v {} {y} {i}\n", x + 2 * i);
        }
        text += &format!("usemtl m{}\nf -4 -3 -2 -1\n", i / 1000 % 3);
    }
    assert!(text.len() > 3 << 20);
    let parts = parts(&text);
    assert_eq!(parts.len(), 3);
    for (number, part) in parts.iter().enumerate() {
        assert_eq!(part.material, Some(format!("m{number}")));
        assert_eq!((part.mesh.triangles.len(), part.mesh.positions.len()), (40_000, 80_000));
        for pair in part.mesh.triangles.chunks(2) {
            let heights = pair.iter().flatten().map(|&vertex| part.mesh.positions[vertex as usize].z);
            assert!(heights.clone().all(|z| Some(z) == heights.clone().next()));
        }
    }
    // The last quad refers to a vertex that does not exist. Only that quad is dropped.
    let bad = format!("{text}f 1 2 3 240001\nusemtl m0\nf 1 2 3\n");
    with(&bad, |file| {
        let mut file = file.unwrap();
        let notes = file.take_notes();
        let [(line, message)] = &notes[..] else { panic!("{notes:?}") };
        assert!(
            *line == 6 * count as usize + 1 && message.starts_with("column 9: refers to vertex 240001"),
            "{notes:?}"
        );
        let lengths: Vec<usize> = file.into_parts().unwrap().iter().map(|part| part.mesh.triangles.len()).collect();
        assert_eq!(lengths, [40_001, 40_000, 40_000]);
    });
}

#[test]
fn wrong_statements_are_left_out_and_named() {
    // Line, column, problem, and number of triangles left of this line and the quad after it.
    for (line, column, problem, left) in [
        ("f 0 1 2", 3, "count from 1", 2),
        ("f 1 2 5", 7, "refers to vertex 5", 2),
        ("f 1 2 3 1 2 5 3", 13, "refers to vertex 5", 2),
        ("  f  1 2 -5", 10, "counts back to before the first vertex", 2),
        ("f 1/1 2/1 3/1", 3, "refers to texture coordinates 1", 2),
        ("f 1//1 2//1 3//1", 3, "refers to normal 1", 2),
        ("f 1 2", 3, "three corners", 2),
        ("f 1 2 x", 7, "is not a number", 2),
        ("f 1 2 3 x", 9, "is not a number", 2),
        ("f 1/2/3/4 2 3", 3, "is not a number", 2),
        ("f 1 2/0 3", 7, "count from 1", 2),
        ("f 1 2 99999999999999999999", 7, "is not a number", 2),
        ("f 1 2 4294967297", 7, "out of reach", 2),
        ("f 1 1 1", 3, "no area", 2),
        ("f 1 2 2 3", 3, "no area", 3),
        ("v 1 2", 3, "three coordinates", 2),
        ("v 1 2 nan", 3, "the position", 2),
        ("v 1 2 1e30", 3, "the position", 2),
        ("v -1.#IND 0 0", 3, "is not a number", 2),
        ("v 1 2 nan\nf 1 2 5\nf 1 2 3 5", 3, "the position", 2),
        ("vn 1 2", 4, "three numbers", 2),
        ("vt", 3, "without number", 2),
        ("vt a", 4, "is not a number", 2),
    ] {
        let text = format!("{CORNERS}{line}\nf 1 2 3 4\n");
        with(&text, |file| {
            let mut file = file.unwrap();
            let notes = file.take_notes();
            let [(number, message)] = &notes[..] else { panic!("{line}: {notes:?}") };
            assert!(*number == 5 && message.starts_with(&format!("column {column}: ")), "{line}: {message}");
            assert!(message.contains(problem), "{line}: {message}");
            let mesh = file.into_single().unwrap();
            assert_eq!(mesh.triangles.len(), left, "{line}");
            assert!(mesh.positions.iter().all(|position| position.abs().max_element() <= 1.0), "{line}");
        });
    }
    let text = format!("{CORNERS}f 1 2 7\nf 1 2 8\nf 0\nf 1 2 3\n");
    with(&text, |file| assert!(file.unwrap().take_notes()[0].1.ends_with("(and so are 2 others)")));
}

#[test]
fn a_comment_ends_with_its_line() {
    let expected = single(&format!("{CORNERS}f 1 2 3 4\n"));
    assert_eq!(single(&format!("# head \\\n{CORNERS}# tail\\\nf 1 2 \\\n3 4 # note \\\n")), expected);
    let text = CORNERS.replace("v 1 1 0", "v 1 1 0 # far\\");
    assert_eq!(single(&format!("{text}f 1 2 3 4 #done")), expected);
    // In names, `#` starts no comment.
    assert_eq!(parts(&format!("{CORNERS}usemtl Material #25\nf 1 2 3 4"))[0].material.as_deref(), Some("Material #25"));
}

#[test]
fn memory_is_bounded() {
    // Two bytes of text for each triangle of 36 bytes.
    let text = format!("{CORNERS}f{}\n", " 1".repeat(1_000_000));
    assert!(with(&text, |file| file.err().unwrap().to_string()).contains("limit"));
}
