//! Cryptomattes: files are read back by another reader, and hashes are those of other programs.

use std::{collections::HashMap, fs, path::PathBuf};

use bottega_image::{
    Aov, AovSet, ExrOptions, Film, HalfOrFloat, Layout, Metadata, ReadLimits, Rect, SampleValues, SurfaceValues, Tile,
    identity, manifest, read_image, set_matte, write_exr,
};
use exr::prelude::*;

/// Reads all channels and texts of a file by the reader of the `exr` crate.
fn read(path: &PathBuf) -> (HashMap<String, Vec<f32>>, HashMap<String, String>) {
    let image = read_first_flat_layer_from_file(path).unwrap();
    let channels = image.layer_data.channel_data.list.iter();
    let channels = channels.map(|channel| (channel.name.to_string(), channel.sample_data.values_as_f32().collect()));
    let texts = image.layer_data.attributes.other.iter().filter_map(|(name, value)| match value {
        attribute::AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
        _ => None,
    });
    (channels.collect(), texts.collect())
}

/// Returns names and hashes of a manifest without escapes other than of slashes.
fn entries(manifest: &str) -> Vec<(String, u32)> {
    let inner = manifest.trim().trim_start_matches('{').trim_end_matches('}');
    let mut words = inner.split('"').skip(1).step_by(2);
    let mut found = Vec::new();
    while let (Some(name), Some(hash)) = (words.next(), words.next()) {
        found.push((name.replace("\\/", "/"), u32::from_str_radix(hash, 16).unwrap()));
    }
    found
}

#[test]
fn ranks_and_manifest_are_read_back_by_another_reader() {
    let rect = Rect::of_size(3, 2);
    let layout = Layout::new(AovSet::NONE.with(Aov::CryptoObject).with(Aov::CryptoAsset));
    let mut tile = Tile::new(rect, layout.clone());
    let names = ["ball", "floor", "wall"];
    for (x, y) in rect.pixels() {
        // The pixel (x, y) shows the ball in x of four samples, the floor in one, and nothing in the others
        for sample in 0..4 {
            tile.add(x, y, &SampleValues::default());
            let name = if sample < x { "ball" } else { "floor" };
            let object = if sample <= x { identity(name) } else { 0.0 };
            let identities = [object, 0.0, identity("wall")];
            tile.add_surface(x, y, &SurfaceValues { identities, weight: 1.0, ..SurfaceValues::default() });
        }
    }
    let mut film = Film::new(rect, layout);
    film.add_tile(&tile, |_, _| 1.0);
    let mut metadata = Metadata::new();
    set_matte(&mut metadata, Aov::CryptoObject, manifest(names));
    set_matte(&mut metadata, Aov::CryptoAsset, manifest(["wall"]));
    let folder = tempfile::tempdir().unwrap();
    for (number, depth) in [HalfOrFloat::Half, HalfOrFloat::Float].into_iter().enumerate() {
        let path = folder.path().join(format!("{number}.exr"));
        write_exr(&path, &film, &metadata, ExrOptions { depth, ..ExrOptions::default() }).unwrap();
        let (channels, texts) = read(&path);
        // Find the mattes by the metadata alone
        let mut layers: Vec<&String> =
            texts.iter().filter(|(key, _)| key.ends_with("/name")).map(|(_, name)| name).collect();
        layers.sort_unstable();
        assert_eq!(layers, ["CryptoAsset", "CryptoObject"]);
        let key = texts.iter().find(|(_, name)| *name == "CryptoObject").unwrap().0.trim_end_matches("name");
        assert_eq!(key.len(), "cryptomatte/1234567/".len());
        assert_eq!(texts[&format!("{key}hash")], "MurmurHash3_32");
        assert_eq!(texts[&format!("{key}conversion")], "uint32_to_float32");
        let hashes: HashMap<String, u32> = entries(&texts[&format!("{key}manifest")]).into_iter().collect();
        assert_eq!(hashes.len(), 3);
        // Decode the mask of each object
        let mask = |name: &str, pixel: usize| -> f32 {
            let pairs =
                ["00", "01", "02"].into_iter().flat_map(|layer| [("R", "G"), ("B", "A")].map(|pair| (layer, pair)));
            pairs
                .map(|(layer, (id, coverage))| {
                    let value = |channel: &str| channels[&format!("CryptoObject{layer}.{channel}")][pixel];
                    if value(id).to_bits() == hashes[name] { value(coverage) } else { 0.0 }
                })
                .sum()
        };
        for (pixel, (x, _)) in rect.pixels().enumerate() {
            assert_eq!(mask("ball", pixel), x as f32 / 4.0);
            assert_eq!(mask("floor", pixel), 0.25);
            assert_eq!(mask("wall", pixel), 0.0);
        }
        let back = read_image(&path, ReadLimits::default()).unwrap();
        assert_eq!(back.metadata.get(&format!("{key}name")), Some("CryptoObject"));
    }
}

#[test]
fn hashes_are_those_of_other_programs() {
    let Some(folder) = std::env::var_os("BOTTEGA_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from) else {
        eprintln!("skipped: set BOTTEGA_SCENES to the folder of files of other programs");
        return;
    };
    let folder = folder.join("exr");
    let mut manifests =
        vec![fs::read_to_string(folder.join("cryptomatte/sidecar_manifest.crypto_asset.json")).unwrap()];
    let (_, texts) = read(&folder.join("cryptomatte.exr"));
    for (key, text) in &texts {
        if key.ends_with("/manifest") {
            manifests.push(text.clone());
        }
        // The key of a layer is the first seven digits of its name's hash
        if key.starts_with("cryptomatte/") && key.ends_with("/name") {
            let hash = format!("{:08x}", identity(text).to_bits());
            assert_eq!(key.split('/').nth(1), Some(&hash[..7]), "{text}");
        }
    }
    let known: Vec<(String, u32)> = manifests.iter().flat_map(|manifest| entries(manifest)).collect();
    assert!(known.len() > 20, "{known:?}");
    for (name, hash) in known {
        assert_eq!(identity(&name).to_bits(), hash, "{name}");
    }
}
