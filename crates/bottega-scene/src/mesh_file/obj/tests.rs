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
    // An index may refer to what comes later, unless it is negative.
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
        assert_eq!(file.left_out, vec![("l".to_owned(), 14), ("p".to_owned(), 15)]);
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
    // The last quad refers to what is not there.
    let bad = format!("{text}f 1 2 240001\n");
    let message = with(&bad, |file| file.err().unwrap().to_string());
    assert!(
        message.contains(&format!("line {}, column 7", 6 * count + 1)) && message.contains("vertex 240001"),
        "{message}"
    );
}

#[test]
fn the_line_and_column_of_what_is_wrong_are_named() {
    for (line, column, problem) in [
        ("f 0 1 2", 3, "count from 1"),
        ("f 1 2 5", 7, "refers to vertex 5"),
        ("f 1 2 3 1 2 5 3", 13, "refers to vertex 5"),
        ("  f  1 2 -5", 10, "counts back to before the first vertex"),
        ("f 1/1 2/1 3/1", 3, "refers to texture coordinates 1"),
        ("f 1//1 2//1 3//1", 3, "refers to normal 1"),
        ("f 1 2", 3, "three corners"),
        ("f 1 2 x", 7, "is not a number"),
        ("f 1/2/3/4 2 3", 3, "is not a number"),
        ("f 1 2/0 3", 7, "count from 1"),
        ("f 1 2 99999999999999999999", 7, "is not a number"),
        ("f 1 2 4294967297", 7, "out of reach"),
        ("v 1 2", 3, "three coordinates"),
        ("v 1 2 nan", 3, "the position"),
        ("v 1 2 1e30", 3, "the position"),
        ("vn 1 2", 4, "three numbers"),
        ("vt", 3, "without number"),
        ("vt a", 4, "is not a number"),
    ] {
        let text = format!("{CORNERS}{line}\nf 1 2 3\n");
        let message = with(&text, |file| file.err().map(|error| error.to_string())).unwrap_or_default();
        let place = format!("line 5, column {column}: ");
        assert!(message.contains(&place) && message.contains(problem), "{line}: {message}");
    }
}

#[test]
fn memory_is_bounded() {
    // Two bytes of text for each triangle of 36 bytes.
    let text = format!("{CORNERS}f{}\n", " 1".repeat(1_000_000));
    assert!(with(&text, |file| file.err().unwrap().to_string()).contains("limit"));
}
