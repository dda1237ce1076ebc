use std::io::Write;

use glam::{Vec2, Vec3, Vec4};
use proptest::prelude::*;

use super::*;

fn read_bytes(bytes: &[u8]) -> Result<Mesh, SceneError> {
    read(Path::new("a.ply"), bytes, &MemoryBudget::new(1 << 24))
}

/// Message of the error for a file that is refused.
fn refusal(bytes: impl AsRef<[u8]>) -> String {
    read_bytes(bytes.as_ref()).expect_err("it should be refused").to_string()
}

const SQUARE: &str = "ply\nformat ascii 1.0\ncomment four corners\nelement vertex 4\nproperty float x\nproperty float y\n\
    property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";

/// A number of a PLY type.
#[derive(Clone, Copy, Debug)]
enum Number {
    U8(u8),
    I16(i16),
    U16(u16),
    I32(i32),
    F32(f32),
    F64(f64),
}

impl Number {
    fn bytes(self, big_endian: bool) -> Vec<u8> {
        let mut bytes = match self {
            Self::U8(value) => value.to_le_bytes().to_vec(),
            Self::I16(value) => value.to_le_bytes().to_vec(),
            Self::U16(value) => value.to_le_bytes().to_vec(),
            Self::I32(value) => value.to_le_bytes().to_vec(),
            Self::F32(value) => value.to_le_bytes().to_vec(),
            Self::F64(value) => value.to_le_bytes().to_vec(),
        };
        if big_endian {
            bytes.reverse();
        }
        bytes
    }

    fn text(self) -> String {
        match self {
            Self::U8(value) => value.to_string(),
            Self::I16(value) => value.to_string(),
            Self::U16(value) => value.to_string(),
            Self::I32(value) => value.to_string(),
            Self::F32(value) => value.to_string(),
            Self::F64(value) => value.to_string(),
        }
    }
}

/// A file with this header after the format, and these rows.
fn file(format: &str, header: &str, rows: &[Vec<Number>]) -> Vec<u8> {
    let mut file = format!("ply\nformat {format} 1.0\n{header}end_header\n").into_bytes();
    for row in rows {
        if format == "ascii" {
            let words: Vec<String> = row.iter().map(|number| number.text()).collect();
            file.extend(words.join(" ").bytes());
            file.push(b'\n');
        } else {
            file.extend(row.iter().flat_map(|number| number.bytes(format == "binary_big_endian")));
        }
    }
    file
}

const FORMATS: [&str; 3] = ["ascii", "binary_little_endian", "binary_big_endian"];

#[test]
fn strips_become_triangles_in_every_format() {
    use Number::{F32, I32, U8};
    let header = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 2\nproperty list uchar int vertex_indices\n";
    let corners = |list: &[i32]| {
        [U8(list.len() as u8)].into_iter().chain(list.iter().map(|&corner| I32(corner))).collect::<Vec<_>>()
    };
    let rows = |strips: [&[i32]; 2]| {
        let mut rows = vec![vec![F32(0.0); 3], vec![F32(1.0); 3], vec![F32(2.0); 3], vec![F32(3.0); 3]];
        rows.extend(strips.map(corners));
        rows
    };
    for format in FORMATS {
        let mesh = read_bytes(&file(format, header, &rows([&[0, 1, 2, 3, -1, 3, 2, 1], &[0, 2, 1]]))).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [2, 1, 3], [3, 2, 1], [0, 2, 1]], "{format}");
        let refused = refusal(file(format, header, &rows([&[0, 1, 4], &[]])));
        assert!(refused.contains("refers to vertex 4"), "{refused}");
        let whole = file(format, header, &rows([&[0, 1, 2], &[0, 2, 1]]));
        assert!(read_bytes(&whole[..whole.len() - 4]).is_err(), "{format}");
    }
}

#[test]
fn polygons_become_fans() {
    let mesh = read_bytes(SQUARE.as_bytes()).unwrap();
    assert_eq!(mesh.positions, vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    assert_eq!(mesh.triangles, vec![[0, 1, 2], [0, 2, 3]]);
    assert!(mesh.normals.is_empty() && mesh.uvs[0].is_empty() && mesh.colors.is_empty());
}

/// Properties in any order and of any type, unknown ones and unknown elements between them, faces of any size.
#[test]
fn all_formats_say_the_same() {
    use Number::{F32, F64, I16, I32, U8, U16};
    let header = "element camera 1\nproperty list uchar float view\nelement vertex 5\nproperty uchar red\nproperty uchar green\n\
        property uchar blue\nproperty double z\nproperty float confidence\nproperty short x\nproperty float y\nproperty float nx\n\
        property float ny\nproperty float nz\nproperty float s\nproperty double t\nelement edge 2\nproperty int a\n\
        element face 4\nproperty uchar flags\nproperty list ushort int vertex_index\nproperty list uchar float texcoord\n";
    let vertex = |index: u8| {
        let value = f32::from(index);
        let mut row = vec![U8(255), U8(188), U8(0), F64(f64::from(value) * 0.5), F32(9.0), I16(-i16::from(index))];
        row.extend([F32(value * 0.25), F32(0.0), F32(0.0), F32(2.0), F32(value), F64(1.0)]);
        row
    };
    let mut rows = vec![vec![U8(2), F32(1.0), F32(2.0)]];
    rows.extend((0..5).map(vertex));
    rows.extend([vec![I32(1)], vec![I32(2)]]);
    for corners in [&[0, 1, 2][..], &[0, 1, 2, 3, 4], &[], &[4, 3, 2, 1]] {
        let mut row = vec![U8(7), U16(corners.len() as u16)];
        row.extend(corners.iter().map(|&corner| I32(corner)));
        row.extend([U8(1), F32(0.5)]);
        rows.push(row);
    }
    for format in FORMATS {
        let mesh = read_bytes(&file(format, header, &rows)).unwrap();
        assert_eq!(mesh.positions[3], Vec3::new(-3.0, 0.75, 1.5), "{format}");
        assert_eq!(mesh.normals, vec![Vec3::Z; 5]);
        assert_eq!(mesh.uvs[0][4], Vec2::new(4.0, 1.0));
        let linear = mesh.colors[2];
        assert!((linear - Vec4::new(1.0, 0.502_886, 0.0, 1.0)).abs().max_element() < 1e-5, "{linear}");
        let fans = [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 2], [4, 2, 1]];
        assert_eq!(mesh.triangles, fans, "{format}");
    }
}

#[test]
fn lists_among_the_properties_of_vertices_are_skipped() {
    use Number::{F32, I32, U8};
    let header = "element vertex 3\nproperty float x\nproperty list uchar uchar notes\nproperty float y\nproperty float z\n\
        element face 1\nproperty list int int vertex_indices\n";
    let vertex = |x: f32, notes: u8| {
        let mut row = vec![F32(x), U8(notes)];
        row.extend((0..notes).map(U8));
        row.extend([F32(1.0), F32(x * x)]);
        row
    };
    let rows = [vertex(0.0, 0), vertex(1.0, 3), vertex(2.0, 1), vec![I32(3), I32(0), I32(1), I32(2)]];
    for format in FORMATS {
        let mesh = read_bytes(&file(format, header, &rows)).unwrap();
        assert_eq!(mesh.positions, vec![Vec3::Y, Vec3::ONE, Vec3::new(2.0, 1.0, 4.0)], "{format}");
        assert_eq!(mesh.triangles, vec![[0, 1, 2]]);
    }
}

/// A list may have as many elements as the type of its count allows.
#[test]
fn polygons_of_many_corners() {
    use Number::{F32, I32, U8, U16};
    for (count_kind, count) in [("uchar", 255usize), ("ushort", 1000)] {
        let header = format!(
            "element vertex {count}\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n\
            property list {count_kind} int vertex_indices\n"
        );
        let mut rows: Vec<Vec<Number>> = (0..count).map(|i| vec![F32(i as f32), F32(0.0), F32(0.0)]).collect();
        let length = if count_kind == "uchar" { U8(count as u8) } else { U16(count as u16) };
        rows.push(std::iter::once(length).chain((0..count).map(|i| I32(i as i32))).collect());
        for format in FORMATS {
            let mesh = read_bytes(&file(format, &header, &rows)).unwrap();
            assert_eq!(mesh.triangles.len(), count - 2);
            assert_eq!(mesh.triangles.last(), Some(&[0, count as u32 - 2, count as u32 - 1]));
        }
    }
}

/// A file read in several pieces, with or without a face of another size.
#[test]
fn long_files_are_read_in_pieces() {
    use Number::{F32, I32, U8};
    let count = 40_000usize;
    let header = format!(
        "element vertex {count}\nproperty float x\nproperty float y\nproperty float z\nelement face {count}\n\
        property list uchar int vertex_indices\n"
    );
    for odd in [None, Some(30_001)] {
        let mut rows: Vec<Vec<Number>> = (0..count).map(|i| vec![F32(i as f32), F32(-1.0), F32(0.5)]).collect();
        let mut expected = Vec::new();
        for i in 0..count {
            let [a, b, c] = [i, (i * 7 + 1) % count, (i * 31 + 2) % count];
            let corners: &[usize] = if Some(i) == odd { &[a, b, c, 5] } else { &[a, b, c] };
            expected.push([a, b, c].map(|vertex| vertex as u32));
            if corners.len() == 4 {
                expected.push([a as u32, c as u32, 5]);
            }
            let corner = corners.iter().map(|&corner| I32(corner as i32));
            rows.push(std::iter::once(U8(corners.len() as u8)).chain(corner).collect());
        }
        for format in FORMATS {
            let mesh = read_bytes(&file(format, &header, &rows)).unwrap();
            assert_eq!(mesh.triangles, expected, "{format}");
            assert!(mesh.positions.iter().enumerate().all(|(i, p)| *p == Vec3::new(i as f32, -1.0, 0.5)));
        }
        // The last but one face of the last piece refers to a vertex that is not there.
        let third = count - 2;
        let column = format!("3 {third} {} ", (third * 7 + 1) % count).len() + 1;
        let row = rows.len() - 2;
        rows[row][3] = I32(-1);
        for format in FORMATS {
            let bytes = file(format, &header, &rows);
            let message = refusal(&bytes);
            let place = if format == "ascii" {
                format!("line {}, column {column}", row + 9 + 1)
            } else {
                format!("byte {}", bytes.len() - 2 * 13)
            };
            assert!(message.contains(&place) && message.contains("vertex -1"), "{format}: {message}, {place}");
        }
    }
}

#[test]
fn compressed_files_are_unfolded_to_no_more_than_the_limit() {
    let gzip = |bytes: &[u8]| {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    };
    let compressed = gzip(SQUARE.as_bytes());
    assert_eq!(read_bytes(&compressed).unwrap().triangles.len(), 2);
    assert!(refusal(&compressed[..compressed.len() - 9]).contains("gzip"));
    let mut bomb = SQUARE.as_bytes().to_vec();
    bomb.resize(1 << 25, b' ');
    assert!(refusal(gzip(&bomb)).contains("limit"));
}

#[test]
fn normals_without_direction_are_mended_and_other_lines_ends_understood() {
    let text = SQUARE
        .replace("property float z\n", "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n");
    let text = text
        .replace(" 0\n1 0 0\n", " 0 0 0 nan\n1 0 0 0 0 0\n")
        .replace("1 1 0\n0 1 0\n", "1 1 0 0 0 -2\n0 1 0 0 0 1\n");
    let mesh = read_bytes(text.replace('\n', "\r\n").as_bytes()).unwrap();
    assert_eq!(mesh.normals, vec![Vec3::Z, Vec3::Z, Vec3::NEG_Z, Vec3::Z]);
}

#[test]
fn errors_name_the_place_of_the_fault() {
    let with = |from: &str, to: &str| refusal(SQUARE.replace(from, to));
    for (from, to, place) in [
        ("4 0 1 2 3", "4 0 1 2 4", "line 15, column 9, refers to vertex 4, but there are 4"),
        ("4 0 1 2 3", "4 0 1 2 -1", "line 15, column 9"),
        ("4 0 1 2 3", "4 0 1 2", "line 15, column 8, a face has fewer corners"),
        ("4 0 1 2 3", " 4 0 1 2 1e0", "line 15, column 10, `1e0` is not a number"),
        ("4 0 1 2 3", "99999999999 0 1", "line 15, column 16"),
        ("4 0 1 2 3", "", "before row 0 of the 1 of `face`"),
        ("1 1 0", "1 nan 0", "line 13, column 1, the position is not a number"),
        ("1 1 0", "1 1e19 0", "line 13, column 1, the position is not a number, or out of reach"),
        ("1 1 0", "1 x 0", "line 13, column 3, `x`"),
        ("1 1 0", "1 1", "line 13, column 4, a row of `vertex` has fewer numbers"),
        ("vertex 4", "vertex 400000000000", "line 4, column 1"),
        ("vertex 4", "vertex -4", "line 4, column 16"),
        ("face 1", "face 18446744073709551615", "line 8, column 14"),
        ("property float y\n", "", "line 4, column 1, vertices need the properties x, y and z"),
        ("uchar int", "uchar float", "line 8, column 1"),
        ("list uchar", "list float", "line 9, column 15"),
        ("vertex_indices", "corners", "line 8, column 1"),
        ("float z", "number z", "line 7, column 10"),
        ("ascii", "binary", "line 2, column 8"),
        ("ply\n", "pls\n", "line 1, column 1"),
        ("comment", "commend", "line 3, column 1"),
        ("face", "vertex", "line 8, column 9"),
        ("end_header", "", "line 11, column 1"),
    ] {
        let message = with(from, to).replace(": ", ", ");
        assert!(message.contains(place), "{from} to {to}: {message}");
    }
    assert!(refusal("ply\nformat ascii 1.0\n").contains("end_header"));
    assert!(refusal("ply\nformat ascii 1.0\nend_header\n").contains("vertex"));
}

#[test]
fn truncated_binary_files_are_refused_wherever_they_are_cut() {
    use Number::{F32, I32, U8};
    let header = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n\
        property list uchar int vertex_indices\n";
    let mut rows = vec![vec![F32(1.0), F32(2.0), F32(3.0)]; 3];
    rows.push(vec![U8(3), I32(0), I32(1), I32(2)]);
    rows.push(vec![U8(4), I32(0), I32(1), I32(2), I32(0)]);
    let whole = file("binary_little_endian", header, &rows);
    assert_eq!(read_bytes(&whole).unwrap().triangles.len(), 3);
    for length in 0..whole.len() {
        assert!(read_bytes(&whole[..length]).is_err(), "{length}");
    }
}

proptest! {
    /// Text and both binary forms of the same numbers give the same mesh.
    #[test]
    fn formats_agree(positions in prop::collection::vec(prop::array::uniform3(-1e6f32..1e6), 3..40), seed in any::<u64>()) {
        use Number::{F32, I32, U8};
        let count = positions.len() as u64;
        let mut rows: Vec<Vec<Number>> = positions.iter().map(|p| p.map(F32).to_vec()).collect();
        let faces = (seed % 9) as usize;
        for face in 0..faces as u64 {
            let corners = (seed >> (face + 3)) % 6;
            let corner = |i: u64| I32(((seed >> (i + face)) % count) as i32);
            rows.push(std::iter::once(U8(corners as u8)).chain((0..corners).map(corner)).collect());
        }
        let header = format!("element vertex {count}\nproperty float x\nproperty float y\nproperty float z\n\
            element face {faces}\nproperty list uchar int vertex_indices\n");
        let meshes = FORMATS.map(|format| read_bytes(&file(format, &header, &rows)).unwrap());
        prop_assert_eq!(&meshes[0], &meshes[1]);
        prop_assert_eq!(&meshes[0], &meshes[2]);
    }
}
