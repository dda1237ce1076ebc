//! Pictures in KTX2 and WebP.

use std::path::Path;

use bottega_scene::{Image, Loaded};
use serde_json::{Value, json};

use crate::gltf::sample_scenes::scenes;
use crate::gltf::support::{File, warns};

/// A scene of one triangle with a picture of numbers, whose codes are not converted.
fn with_picture(picture: &[u8], texture: impl Fn(usize) -> Value) -> File {
    let mut file = File::textured(&json!({"pbrMetallicRoughness": {"metallicRoughnessTexture": {"index": 0}}}));
    let view = file.view(picture);
    let image = file.push("images", json!({"bufferView": view}));
    file.push("textures", texture(image));
    file
}

fn basisu(image: usize) -> Value {
    json!({"extensions": {"KHR_texture_basisu": {"source": image}}})
}

fn picture_of(loaded: &Loaded) -> &Image {
    assert!(!warns(loaded, &["magenta"]), "{:?}", loaded.warnings);
    &loaded.scene.images[0]
}

/// A KTX2 file of one level of 8-bit RGBA, which may claim the number of another format.
pub(crate) fn ktx2(format: u32, width: u32, height: u32, level: &[u8]) -> Vec<u8> {
    let mut file = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    let words = |file: &mut Vec<u8>, words: &[u32]| words.iter().for_each(|word| file.extend(word.to_le_bytes()));
    words(&mut file, &[format, 1, width, height, 0, 0, 1, 1, 0]);
    // The description of the format (its basic block alone), no keys, no global data, one level.
    let description = 80 + 24;
    let data = description + 28;
    words(&mut file, &[description, 28, 0, 0, 0, 0, 0, 0]);
    words(&mut file, &[data, 0, level.len() as u32, 0, level.len() as u32, 0]);
    words(&mut file, &[28, 0, 2 | 24 << 16, 1 | 1 << 8 | 1 << 16, 0, 4, 0]);
    file.extend(level);
    file
}

/// The 8-bit codes of all texels.
fn codes(image: &Image) -> Vec<[u8; 4]> {
    let (width, height) = image.size();
    let texel = |i: u32| (image.texel(i % width, i / width) * 255.0 + 0.5).to_array().map(|code| code as u8);
    (0..width * height).map(texel).collect()
}

/// Mean difference of the codes of two pictures.
fn distance(a: &[[u8; 4]], b: &[[u8; 4]]) -> f32 {
    let (a, b) = (a.as_flattened(), b.as_flattened());
    a.iter().zip(b).map(|(a, b)| f32::from(a.abs_diff(*b))).sum::<f32>() / a.len() as f32
}

#[test]
fn plain_ktx2_pictures_are_read() {
    let texels: Vec<u8> = (0..3 * 2 * 4).map(|i| i * 10).collect();
    for (format, order) in [(37, [0, 1, 2, 3]), (43, [0, 1, 2, 3]), (44, [2, 1, 0, 3])] {
        let loaded = with_picture(&ktx2(format, 3, 2, &texels), basisu).load();
        let image = picture_of(&loaded);
        assert_eq!(image.size(), (3, 2));
        let plain: Vec<[u8; 4]> = texels.chunks(4).map(|t| order.map(|k| t[k])).collect();
        assert_eq!(image, &Image::from_rgba8(image.name.clone(), 3, 2, plain, false));
    }
    let error = with_picture(&ktx2(37, 3, 2, &texels[1..]), basisu).load();
    assert!(warns(&error, &["images[0]", "3 × 2 pixels", "magenta"]), "{:?}", error.warnings);
    let error = with_picture(&ktx2(157, 3, 2, &texels), basisu).load();
    assert!(warns(&error, &["images[0]", "format 157", "magenta"]), "{:?}", error.warnings);
    let too_large = with_picture(&ktx2(37, 1 << 20, 1 << 20, &texels), basisu);
    assert!(!warns(&too_large.load(), &["panic"]));
}

#[test]
fn webp_pictures_are_read_and_come_before_their_replacement() {
    let mut webp = std::io::Cursor::new(Vec::new());
    let pixels = image::RgbaImage::from_fn(5, 3, |x, y| image::Rgba([x as u8 * 50, y as u8 * 80, 7, 200]));
    pixels.write_to(&mut webp, image::ImageFormat::WebP).unwrap();
    let texture = |image| json!({"source": 99, "extensions": {"EXT_texture_webp": {"source": image}}});
    let mut file = with_picture(webp.get_ref(), texture);
    file.json["extensionsRequired"] = json!(["EXT_texture_webp"]);
    let loaded = file.load();
    let expected = pixels.pixels().map(|pixel| pixel.0).collect();
    let image = picture_of(&loaded);
    assert_eq!(image, &Image::from_rgba8(image.name.clone(), 5, 3, expected, false));
}

#[test]
fn compressed_textures_have_their_texels() {
    let Some(folder) = scenes() else { return };
    let read = |name: &str| std::fs::read(folder.join("gltf/compressed").join(name)).unwrap();
    let load = |bytes: &[u8]| codes(picture_of(&with_picture(bytes, basisu).load()));
    // The same letters on four grounds. The sums are those of another decoder of BC7, which leaves no choice.
    let plain = load(&read("2d_rgba8.ktx2"));
    assert_eq!((plain.len(), plain[0]), (1600, [77, 175, 74, 255]));
    let bc7 = load(&read("2d_bc7.ktx2"));
    let sums: [u32; 4] = std::array::from_fn(|k| bc7.iter().map(|texel| u32::from(texel[k])).sum());
    assert_eq!((sums, bc7[0]), ([408_000, 209_344, 12_492, 408_000], [255, 127, 0, 255]));
    // The two codecs of Basis Universal have the same picture but for one of two words, one at a fifth of the size.
    let (uastc, etc1s) = (load(&read("2d_uastc.ktx2")), load(&read("2d_etc1s.ktx2")));
    let difference = distance(&uastc, &etc1s);
    eprintln!("codes of UASTC and ETC1S differ by {difference} in the mean");
    assert!(difference < 10.0 && uastc.iter().any(|texel| texel[2] > 200), "{difference}");
    for pack in [zstd, zlib] {
        assert_eq!(uastc, load(&packed(&read("2d_uastc.ktx2"), pack)));
        assert_eq!(plain, load(&packed(&read("2d_rgba8.ktx2"), pack)));
    }
}

/// The number of a supercompression scheme, and the compressed bytes.
type Packed = (u32, Vec<u8>);

fn zstd(level: &[u8]) -> Packed {
    (2, ruzstd::encoding::compress_to_vec(level, ruzstd::encoding::CompressionLevel::Fastest))
}

fn zlib(level: &[u8]) -> Packed {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    std::io::Write::write_all(&mut encoder, level).unwrap();
    (3, encoder.finish().unwrap())
}

/// A KTX2 file whose finest level is supercompressed.
fn packed(file: &[u8], pack: fn(&[u8]) -> Packed) -> Vec<u8> {
    let word = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
    let (offset, length) = (word(80), word(88));
    let (scheme, packed) = pack(&file[offset..offset + length]);
    let description = u32::from_le_bytes(file[48..52].try_into().unwrap()) as usize;
    let description_length = u32::from_le_bytes(file[52..56].try_into().unwrap()) as usize;
    let mut out = file[..80].to_vec();
    out[40..44].copy_from_slice(&1u32.to_le_bytes());
    out[44..48].copy_from_slice(&scheme.to_le_bytes());
    out[48..52].copy_from_slice(&104u32.to_le_bytes());
    out[56..80].fill(0);
    out.extend(((104 + description_length) as u64).to_le_bytes());
    out.extend((packed.len() as u64).to_le_bytes());
    out.extend((length as u64).to_le_bytes());
    out.extend(&file[description..description + description_length]);
    out.extend(packed);
    out
}

/// Names of the sample pictures, for mutation.
pub(crate) fn sample_pictures(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let folder = folder.join("gltf/compressed");
    let names = ["2d_rgba8.ktx2", "2d_bc7.ktx2", "2d_uastc.ktx2", "2d_etc1s.ktx2"];
    let mut pictures: Vec<(String, Vec<u8>)> =
        names.into_iter().map(|name| (name.into(), std::fs::read(folder.join(name)).unwrap())).collect();
    pictures.push(("zstd.ktx2".into(), packed(&pictures[2].1, zstd)));
    pictures.push(("zlib.ktx2".into(), packed(&pictures[2].1, zlib)));
    pictures
}
