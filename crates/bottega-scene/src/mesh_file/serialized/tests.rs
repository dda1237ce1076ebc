use std::io::Write;

use super::*;

struct MeshContents {
    flags: u32,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

fn square(flags: u32) -> MeshContents {
    let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    MeshContents { flags, vertices, triangles: vec![[0, 1, 2], [0, 2, 3]] }
}

impl MeshContents {
    /// The data before compression.
    fn data(&self, version: u16) -> Vec<u8> {
        let mut data = self.flags.to_le_bytes().to_vec();
        if version == 4 {
            data.extend(b"my shape\0");
        }
        data.extend((self.vertices.len() as u64).to_le_bytes());
        data.extend((self.triangles.len() as u64).to_le_bytes());
        let mut push = |value: f64| {
            if self.flags & IS_DOUBLE != 0 {
                data.extend(value.to_le_bytes());
            } else {
                data.extend((value as f32).to_le_bytes());
            }
        };
        self.vertices.iter().flatten().for_each(|&value| push(value));
        for _ in self.vertices.iter().filter(|_| self.flags & HAS_NORMALS != 0) {
            [0.0, 0.0, 2.0].into_iter().for_each(&mut push);
        }
        for vertex in self.vertices.iter().filter(|_| self.flags & HAS_UVS != 0) {
            [vertex[0], 0.25].into_iter().for_each(&mut push);
        }
        for _ in self.vertices.iter().filter(|_| self.flags & HAS_COLORS != 0) {
            [1.0, 0.5, 0.0].into_iter().for_each(&mut push);
        }
        data.extend(self.triangles.iter().flatten().flat_map(|vertex| vertex.to_le_bytes()));
        data
    }
}

fn file(version: u16, data: &[Vec<u8>]) -> Vec<u8> {
    let (mut file, mut offsets) = (Vec::new(), Vec::new());
    for data in data {
        offsets.push(file.len() as u64);
        file.extend(MAGIC.to_le_bytes());
        file.extend(version.to_le_bytes());
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(data).unwrap();
        file.extend(encoder.finish().unwrap());
    }
    for offset in &offsets {
        if version == 4 {
            file.extend(offset.to_le_bytes());
        } else {
            file.extend((*offset as u32).to_le_bytes());
        }
    }
    file.extend((offsets.len() as u32).to_le_bytes());
    file
}

fn read_bytes(bytes: &[u8], shape: u32) -> Result<Mesh, SceneError> {
    read(Path::new("a.serialized"), bytes, shape, &MemoryBudget::new(1 << 20))
}

#[test]
fn every_kind_of_shape_is_read() {
    for version in [3, 4] {
        for precision in [0x1000, IS_DOUBLE] {
            let all = precision | HAS_NORMALS | HAS_UVS | HAS_COLORS;
            let data =
                [square(precision).data(version), square(all).data(version), square(all | IS_FACETED).data(version)];
            let bytes = file(version, &data);
            assert_eq!(count(Path::new(""), &bytes).unwrap(), 3);
            let plain = read_bytes(&bytes, 0).unwrap();
            assert_eq!(plain.triangles, vec![[0, 1, 2], [0, 2, 3]]);
            assert_eq!((plain.positions[2], plain.normals.len()), (Vec3::new(1.0, 1.0, 0.0), 0));
            assert_eq!(plain.name, if version == 4 { "my shape" } else { "" });
            let full = read_bytes(&bytes, 1).unwrap();
            assert_eq!((full.normals[0], full.uvs[0][1]), (Vec3::Z, Vec2::new(1.0, 0.25)));
            assert_eq!(full.colors[3], Vec4::new(1.0, 0.5, 0.0, 1.0));
            assert!(read_bytes(&bytes, 2).unwrap().normals.is_empty());
            assert!(read_bytes(&bytes, 3).unwrap_err().to_string().contains("there is no shape 3, it has 3"));
        }
    }
}

#[test]
fn truncated_and_lying_files_are_refused() {
    let whole = file(4, &[square(HAS_NORMALS).data(4)]);
    for length in 0..whole.len() {
        assert!(read_bytes(&whole[..length], 0).is_err(), "{length}");
    }
    let refusal = |shape: &MeshContents, change: &dyn Fn(&mut Vec<u8>)| {
        let mut data = shape.data(4);
        change(&mut data);
        read_bytes(&file(4, &[data]), 0).unwrap_err().to_string()
    };
    // Behind the flags, a name and half of the first count.
    let cut = refusal(&square(0), &|data| data.truncate(17));
    assert!(cut.contains("shape 0 at byte 0") && cut.contains("beyond their byte 13"), "{cut}");
    let counts = 4 + "my shape\0".len();
    let many = |data: &mut Vec<u8>| data[counts..counts + 8].copy_from_slice(&u64::MAX.to_le_bytes());
    let many = refusal(&square(0), &many);
    assert!(many.contains("more than can be indexed") && many.contains("byte 29"), "{many}");
    let million = |data: &mut Vec<u8>| data[counts..counts + 8].copy_from_slice(&1_000_000u64.to_le_bytes());
    assert!(refusal(&square(0), &million).contains("more than its data can unfold to"));
    assert!(refusal(&square(0), &|data| data.truncate(40)).contains("unfold"));
    let mut bad = square(0);
    bad.triangles[1][2] = 4;
    assert!(refusal(&bad, &|_| {}).contains("triangle 1"));
    let mut bad = square(IS_DOUBLE);
    bad.vertices[3][1] = 1e200;
    assert!(refusal(&bad, &|_| {}).contains("vertex 3"));
    let endless = |data: &mut Vec<u8>| {
        data.truncate(4);
        data.resize(10_000, b'a');
    };
    assert!(refusal(&square(0), &endless).contains("name"));
}
