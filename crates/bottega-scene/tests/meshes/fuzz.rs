//! For any bytes the readers return: they do not panic, hang, or exceed their memory limit.

use std::path::Path;

use bottega_scene::{LoadOptions, load};

use crate::meshes::mutation::{Random, damage, survive};
use crate::meshes::scenes::real_scenes;
use crate::meshes::support::{MTL, OBJ, PLY, binary_ply, gzip, png, serialized, write};

/// Words at the limits of types and counts.
const WORDS: [&str; 20] = [
    "0",
    "1",
    "-1",
    "2",
    "255",
    "65536",
    "2147483648",
    "4294967295",
    "18446744073709551616",
    "1e39",
    "nan",
    "inf",
    "",
    "\\\n",
    "double",
    "uchar",
    "list int int",
    "vertex 3000000000",
    "../a",
    "f 1 2 3",
];

fn mutate(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.below(3) {
        if file.is_empty() {
            break;
        }
        // Most mutations hit the header: it is short and decides most.
        let reach = if random.below(2) == 0 { file.len().min(300) } else { file.len() };
        let at = random.below(reach);
        if random.below(8) < 5 {
            damage(&mut file, at, random);
            continue;
        }
        // A word becomes another one.
        let Some(start) = (at..file.len()).find(|&i| file[i].is_ascii_graphic()) else { continue };
        let end = (start..file.len()).find(|&i| !file[i].is_ascii_graphic()).unwrap_or(file.len());
        file.splice(start..end, WORDS[random.below(WORDS.len())].bytes());
    }
    file
}

/// Loads `scene` of a folder while another file of it, or the scene itself, is mutated.
fn check(folder: &Path, scene: &str, mutated: &str, count: u64, change: impl Fn(&mut Random) -> Vec<u8>) {
    let options =
        LoadOptions { add_sky: false, max_memory_bytes: 64 << 20, max_image_pixels: 1 << 20, ..LoadOptions::default() };
    let good = survive(mutated, count, change, |bytes| {
        write(folder, mutated, bytes);
        load(&folder.join(scene), &options).is_ok()
    });
    assert!(good > 0.0, "no mutation of {mutated} was a scene: too much is refused, or too much is broken");
}

#[test]
fn mutated_files_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let files = [
        ("ascii.ply", PLY.as_bytes().to_vec()),
        ("little.ply", binary_ply(false)),
        ("big.ply", binary_ply(true)),
        ("a.ply.gz", gzip(&binary_ply(false))),
        ("a.serialized", serialized(2)),
    ];
    for (name, file) in &files {
        check(folder, name, name, 600, |random| mutate(file, random));
    }
    // Mutations of the data inside the compression.
    check(folder, "b.ply.gz", "b.ply.gz", 300, |random| gzip(&mutate(&files[1].1, random)));
    write(folder, "sub/wood 1.png", &png([1, 2, 3, 4]));
    write(folder, "sub/a b.mtl", MTL.as_bytes());
    check(folder, "a.obj", "a.obj", 800, |random| mutate(OBJ.as_bytes(), random));
    write(folder, "a.obj", OBJ.as_bytes());
    check(folder, "a.obj", "sub/a b.mtl", 400, |random| mutate(MTL.as_bytes(), random));
}

#[test]
fn mutated_meshes_of_others_never_panic() {
    let Some(scenes) = real_scenes() else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in ["meshes/spot.ply", "meshes/teapot.obj"] {
        let file = std::fs::read(scenes.join(name)).unwrap();
        let name = name.rsplit('/').next().unwrap();
        check(folder.path(), name, name, 60, |random| mutate(&file, random));
    }
}

#[test]
fn mutated_pictures_never_panic() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "scene.ply", PLY.as_bytes());
    let picture =
        image::DynamicImage::ImageRgb8(image::RgbImage::from_fn(16, 9, |x, y| image::Rgb([x as u8 * 9, y as u8, 5])));
    let mut pictures = vec![("a.pfm".to_owned(), [b"PF\n2 1\n-1\n".to_vec(), vec![63; 24]].concat())];
    for format in ["tga", "bmp", "pnm", "tiff", "webp"] {
        let mut file = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut file, image::ImageFormat::from_extension(format).unwrap()).unwrap();
        pictures.push((format!("a.{format}"), file.into_inner()));
    }
    let options =
        LoadOptions { add_sky: false, max_memory_bytes: 64 << 20, max_image_pixels: 1 << 20, ..LoadOptions::default() };
    for (name, file) in pictures {
        let path = write(folder.path(), &name, &file);
        let options = LoadOptions { environment: Some(path.clone()), ..options.clone() };
        assert!(load(&scene, &options).is_ok(), "{name}: {:?}", load(&scene, &options).err());
        survive(
            &name,
            200,
            |random| mutate(&file, random),
            |bytes| {
                std::fs::write(&path, bytes).unwrap();
                load(&scene, &options).is_ok()
            },
        );
    }
}
