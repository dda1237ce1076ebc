//! Small files, made in memory.

use std::io::Write;
use std::path::{Path, PathBuf};

use bottega_scene::{LoadOptions, Loaded, SceneError, load};

/// Writes a file; creates its folder if necessary.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    std::fs::write(&path, bytes).unwrap();
    path
}

/// Loads a file of a new folder that has these files; the first one is the scene.
pub(crate) fn try_load(files: &[(&str, &[u8])], options: &LoadOptions) -> Result<Loaded, SceneError> {
    let folder = tempfile::tempdir().unwrap();
    let paths: Vec<PathBuf> = files.iter().map(|(name, bytes)| write(folder.path(), name, bytes)).collect();
    load(&paths[0], options)
}

/// As [`try_load`], for files that can be read.
pub(crate) fn load_files(files: &[(&str, &[u8])]) -> Loaded {
    try_load(files, &LoadOptions::default()).unwrap()
}

/// A picture of one texel.
pub(crate) fn png(color: [u8; 4]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    image::RgbaImage::from_pixel(1, 1, image::Rgba(color)).write_to(&mut file, image::ImageFormat::Png).unwrap();
    file.into_inner()
}

pub(crate) const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property float u\nproperty float v\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
    0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1\n3 0 1 2\n3 0 2 3\n";

/// The same square as a binary file.
pub(crate) fn binary_ply(big_endian: bool) -> Vec<u8> {
    let format = if big_endian { "binary_big_endian" } else { "binary_little_endian" };
    let header = PLY.split_inclusive("end_header\n").next().unwrap().replace("ascii", format);
    let mut file = header.into_bytes();
    let vertices =
        [[0.0f32, 0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0, 0.0], [1.0, 1.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 0.0, 1.0]];
    for value in vertices.into_iter().flatten() {
        file.extend(if big_endian { value.to_be_bytes() } else { value.to_le_bytes() });
    }
    for face in [[0u32, 1, 2], [0, 2, 3]] {
        file.push(3);
        for index in face {
            file.extend(if big_endian { index.to_be_bytes() } else { index.to_le_bytes() });
        }
    }
    file
}

pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A file of one or more squares in Mitsuba's serialized format, version 4.
pub(crate) fn serialized(count: usize) -> Vec<u8> {
    let mut data = 0x1000u32.to_le_bytes().to_vec();
    data.push(0);
    data.extend(4u64.to_le_bytes());
    data.extend(2u64.to_le_bytes());
    for value in [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0] {
        data.extend(value.to_le_bytes());
    }
    for index in [0u32, 1, 2, 0, 2, 3] {
        data.extend(index.to_le_bytes());
    }
    let (mut file, mut offsets) = (Vec::new(), Vec::new());
    for _ in 0..count {
        offsets.push(file.len() as u64);
        file.extend([0x1c, 0x04, 4, 0]);
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(&data).unwrap();
        file.extend(encoder.finish().unwrap());
    }
    offsets.iter().for_each(|offset| file.extend(offset.to_le_bytes()));
    file.extend((count as u32).to_le_bytes());
    file
}

pub(crate) const OBJ: &str = "mtllib sub/a b.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n\
    usemtl red\ns off\nf 1/1/1 2/2/1 3/3/1\nusemtl glass\nf 1//1 3//1 \\\n -1//-1\nusemtl unknown\nf 1 2 4\n";

pub(crate) const MTL: &str = "newmtl red\nKd 1 0.5 0.5\nKs 0.5 0.5 0.5\nNs 98\nillum 2\nmap_Kd -s 2 2 -o 0.25 0 wood 1.png\nmap_d wood 1.png\n\
    newmtl glass\nillum 7\nNi 1.33\nd 0.5\nTf 1 1 0.5\nKd 0 0 0\nnewmtl lamp\nKe 5 5 5\n";
