//! Damaged scenes: an error or a scene, never a panic. `BOTTEGA_FUZZ` multiplies their number.

use bottega_scene::LoadOptions;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use crate::mitsuba::mutation::{Random, damage, survive};
use crate::mitsuba::support::{Folder, bare};

const CORPUS: [&str; 7] = [
    "<scene version='3.0.0'><default name='r' value='0.5'/><integrator type='path'><integer name='max_depth' value='5'/></integrator>
<sensor type='perspective'><float name='fov' value='40'/><transform name='to_world'><lookat origin='0 0 5' target='0 0 0' up='0 1 0'/></transform>
<film type='hdrfilm'><integer name='width' value='64'/><integer name='height' value='32'/><rfilter type='gaussian'/></film></sensor>
<shape type='sphere'><point name='center' x='1' y='2'/><float name='radius' value='$r'/><bsdf type='dielectric'><string name='int_ior' value='water'/></bsdf></shape></scene>",
    "<scene version='3.0.0'><bsdf type='twosided' id='a'><bsdf type='roughconductor'><string name='material' value='Cu'/><float name='alpha' value='0.2'/></bsdf></bsdf>
<shape type='shapegroup' id='g'><shape type='cube'><ref id='a'/></shape><shape type='sphere'/></shape>
<shape type='instance'><ref id='g'/><transform name='to_world'><scale x='-1' y='2'/><rotate y='1' angle='30'/><matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1'/></transform></shape>
<emitter type='constant'><spectrum name='radiance' value='400:1, 500:2'/></emitter></scene>",
    "<scene version='0.6.0'><shape type='obj'><string name='filename' value='a.obj'/><boolean name='faceNormals' value='true'/>
<bsdf type='bump'><texture type='checkerboard'><float name='uscale' value='3'/></texture><bsdf type='plastic'/></bsdf></shape>
<emitter type='spot'><float name='cutoffAngle' value='30'/><blackbody name='intensity' temperature='5000K'/></emitter></scene>",
    "<scene version='3.0.0'><include filename='b.xml'/><shape type='rectangle'><bsdf type='mask'><float name='opacity' value='0.5'/><ref id='m'/></bsdf>
<emitter type='area'><rgb name='radiance' value='1 2 3'/></emitter></shape></scene>",
    "<scene version='3.0.0'><shape type='cylinder'><point name='p0' value='0 0 0'/><point name='p1' value='0 1 0'/><bsdf type='null'/>
<medium type='homogeneous' name='interior'><rgb name='sigma_t' value='1 2 3'/><rgb name='albedo' value='0.5'/><phase type='hg'><float name='g' value='0.5'/></phase></medium></shape>
<shape type='disk'><bsdf type='principled'><float name='spec_trans' value='1'/><rgb name='base_color' value='1 0.5 0'/></bsdf></shape></scene>",
    GRIDS,
    "<scene version='3.0.0'><shape type='cube'><bsdf type='null'/><medium type='heterogeneous' name='interior'><float name='scale' value='2'/>
<volume type='gridvolume' name='sigma_s'><string name='filename' value='a.vol'/><boolean name='use_grid_bbox' value='true'/></volume><float name='sigma_a' value='0.5'/></medium></shape>
<shape type='rectangle'><bsdf type='bumpmap'><float name='scale' value='2'/><boolean name='flip_invalid_normals' value='false'/><texture type='bitmap'><string name='filename' value='a.pfm'/></texture><bsdf type='diffuse'/></bsdf></shape></scene>",
];

/// A scene whose numbers lie in a grid and in a file of a spectrum.
const GRIDS: &str = "<scene version='3.0.0'><shape type='cube'><bsdf type='null'/><medium type='heterogeneous' name='interior'>
<volume type='gridvolume' name='sigma_t'><string name='filename' value='a.vol'/><string name='filter_type' value='nearest'/>
<transform name='to_world'><scale x='2' y='3'/><translate x='-1'/></transform></volume>
<volume type='gridvolume' name='albedo'><string name='filename' value='a.vol'/></volume><float name='scale' value='4'/></medium></shape>
<emitter type='constant'><spectrum name='radiance' filename='a.spd'/></emitter></scene>";

/// A spectrum.
const SPECTRUM: &str = "# nm value\n400 0.5\n500 1.5\n\n600, 2e0\n700\t0.25\n";

/// A grid of 3 × 2 × 2 cells of three channels.
fn grid() -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    [1i32, 3, 2, 2, 3].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    [0.0f32, 0.0, 0.0, 1.0, 2.0, 3.0].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
    (0..36u8).for_each(|value| bytes.extend((f32::from(value) / 36.0).to_le_bytes()));
    bytes
}

/// The files that the scenes of the corpus refer to.
fn folder() -> Folder {
    Folder::new()
        .with("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        .with("b.xml", "<scene version='3.0.0'><bsdf type='diffuse' id='m'/></scene>")
        .with("a.pfm", [&b"Pf\n2 1\n-1\n"[..], &0.5f32.to_le_bytes(), &0.75f32.to_le_bytes()].concat())
        .with("a.spd", SPECTRUM)
        .with("a.vol", grid())
}

/// Harmful words, put in place of others or between them.
const WORDS: [&str; 16] = [
    "nan",
    "-1",
    "1e400",
    "0",
    "99999999999999999999",
    "$r",
    "a",
    "",
    "&a;",
    "'",
    "/>",
    "<shape type='merge'>",
    "</shape>",
    "<ref id='g'/>",
    "1e30",
    "-inf",
];

#[derive(Clone, Debug)]
enum Change {
    Cut(prop::sample::Index),
    Byte(prop::sample::Index, u8),
    Insert(prop::sample::Index, prop::sample::Index),
    /// Replaces the value between two quotes.
    Value(prop::sample::Index, prop::sample::Index),
    Repeat(prop::sample::Index, prop::sample::Index),
}

fn change() -> impl Strategy<Value = Change> {
    let index = any::<prop::sample::Index>;
    prop_oneof![
        1 => index().prop_map(Change::Cut),
        3 => (index(), any::<u8>()).prop_map(|(at, byte)| Change::Byte(at, byte)),
        2 => (index(), index()).prop_map(|(at, word)| Change::Insert(at, word)),
        6 => (index(), index()).prop_map(|(at, word)| Change::Value(at, word)),
        2 => (index(), index()).prop_map(|(from, to)| Change::Repeat(from, to)),
    ]
}

fn apply(text: &mut Vec<u8>, change: &Change) {
    if text.is_empty() {
        return;
    }
    match change {
        Change::Cut(at) => text.truncate(at.index(text.len())),
        Change::Byte(at, byte) => {
            let at = at.index(text.len());
            text[at] = *byte;
        }
        Change::Insert(at, word) => {
            let at = at.index(text.len());
            text.splice(at..at, WORDS[word.index(WORDS.len())].bytes());
        }
        Change::Value(at, word) => {
            let quotes: Vec<usize> = (0..text.len()).filter(|&index| text[index] == b'\'').collect();
            let pairs: Vec<(usize, usize)> = quotes.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
            if !pairs.is_empty() {
                let (start, end) = pairs[at.index(pairs.len())];
                text.splice(start + 1..end, WORDS[word.index(WORDS.len())].bytes());
            }
        }
        Change::Repeat(from, to) => {
            let (a, b) = (from.index(text.len()), to.index(text.len()));
            let piece = text[a.min(b)..a.max(b)].to_vec();
            let at = a.max(b);
            text.splice(at..at, piece);
        }
    }
}

#[test]
fn damaged_scenes_never_panic() {
    let options = LoadOptions { max_memory_bytes: 256 << 20, add_sky: false, ..LoadOptions::default() };
    let factor = std::env::var("BOTTEGA_FUZZ").ok().and_then(|text| text.parse().ok()).unwrap_or(1);
    let mut runner = TestRunner::new(Config { cases: 1500 * factor, failure_persistence: None, ..Config::default() });
    let strategy = (0..CORPUS.len(), prop::collection::vec(change(), 1..4));
    let folder = folder();
    let result = runner.run(&strategy, |(index, changes)| {
        let mut text = CORPUS[index].as_bytes().to_vec();
        changes.iter().for_each(|change| apply(&mut text, change));
        std::fs::write(folder.path(), &text).expect("the file of the test");
        if let Ok(loaded) = folder.load(&options) {
            prop_assert!(loaded.scene.validate().is_ok());
        }
        Ok(())
    });
    result.unwrap_or_else(|error| panic!("{error}"));
}

#[test]
fn the_corpus_itself_is_sound() {
    let folder = folder();
    for text in CORPUS {
        std::fs::write(folder.path(), text).expect("the file of the test");
        folder.load(&LoadOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    }
}

/// Returns true if the scene of grids and spectra is read with this content of one of its files.
fn reads_with(folder: &Folder, name: &str, bytes: &[u8]) -> bool {
    std::fs::write(folder.path().with_file_name(name), bytes).expect("the file of the test");
    let options = LoadOptions { max_memory_bytes: 16 << 20, ..bare() };
    folder.load(&options).is_ok_and(|loaded| loaded.scene.validate().is_ok())
}

#[test]
fn damaged_grids_and_spectra_never_panic() {
    let folder = folder().with("scene.xml", GRIDS);
    let grid = grid();
    let damaged_grid = |random: &mut Random| {
        let mut bytes = grid.clone();
        for _ in 0..=random.below(2) {
            // A word of the header, or of the values: a count, a box, a number.
            let at = 4 * random.below(bytes.len().min(64) / 4);
            let odd =
                [i32::MIN, -1, 0, 1, 2, 6, 65536, i32::MAX, f32::NAN.to_bits() as i32, f32::INFINITY.to_bits() as i32];
            if random.below(2) == 0 && bytes.len() >= at + 4 {
                bytes[at..at + 4].copy_from_slice(&odd[random.below(odd.len())].to_le_bytes());
            } else if !bytes.is_empty() {
                let at = random.below(bytes.len());
                damage(&mut bytes, at, random);
            }
        }
        bytes
    };
    let good = survive("a.vol", 300, damaged_grid, |bytes| reads_with(&folder, "a.vol", bytes));
    assert!((0.05..0.95).contains(&good), "{good} of the grids were grids");
    assert!(reads_with(&folder, "a.vol", &grid));
    let damaged_spectrum = |random: &mut Random| {
        let mut lines: Vec<&str> = SPECTRUM.lines().collect();
        match random.below(4) {
            // Out of order, or twice the same.
            0 => lines.swap(1 + random.below(2), 4),
            1 => lines.insert(random.below(lines.len()), "500 1"),
            2 => lines[1] = ["nan 1", "400 nan", "1e400 1", "-1 0", "400 -1", "400", "400 1 2"][random.below(7)],
            _ => {}
        }
        let mut bytes = lines.join("\n").into_bytes();
        let at = random.below(bytes.len());
        damage(&mut bytes, at, random);
        bytes
    };
    let good = survive("a.spd", 300, damaged_spectrum, |bytes| reads_with(&folder, "a.spd", bytes));
    assert!((0.05..0.95).contains(&good), "{good} of the spectra were spectra");
}

#[test]
fn headers_of_grids_that_cannot_be_true_are_refused() {
    let folder = folder().with("scene.xml", GRIDS);
    let with = |at: usize, word: [u8; 4]| {
        let mut bytes = grid();
        bytes[at..at + 4].copy_from_slice(&word);
        std::fs::write(folder.path().with_file_name("a.vol"), &bytes).expect("the file of the test");
        match folder.load(&bare()) {
            Ok(_) => panic!("it was read: {word:?} at {at}"),
            Err(error) => error.to_string(),
        }
    };
    for (at, word, problem) in [
        (0, *b"VOL\x02", "version 3"),
        (0, *b"VDB\x03", "version 3"),
        (4, 2i32.to_le_bytes(), "not floats"),
        (8, 0i32.to_le_bytes(), "the 0 × 2"),
        (8, (-3i32).to_le_bytes(), "the -3 × 2"),
        (8, i32::MAX.to_le_bytes(), "2147483647 × 2"),
        (20, 2i32.to_le_bytes(), "2 channels"),
        (20, i32::MAX.to_le_bytes(), "2147483647 channels"),
        (52, f32::NAN.to_le_bytes(), "not a finite number"),
        (188, f32::INFINITY.to_le_bytes(), "not a finite number"),
    ] {
        let error = with(at, word);
        let place = format!("byte {at}");
        assert!(error.contains("a.vol") && error.contains(&place), "{at}, {word:?}: {error}");
        assert!(error.contains(problem), "{at}, {word:?}: {error}");
    }
}

/// Damaged files of curves, by bytes and by harmful numbers: an error or a sound scene.
#[test]
fn damaged_curves_do_no_harm() {
    const FILE: &str = "-1 0 0 0.1\n1 0 0 0.2\n2 1e-3 0 0.2\n3 0 1 0\n\n0 -2 0 0.2\n0 -1 0 0.2\n0 0 0 0.2\n0 1 0 0.2\n";
    const NUMBERS: [&str; 8] = ["nan", "1e17", "-1e17", "1e-38", "0", "-0", "inf", "9e9"];
    for plugin in ["bsplinecurve", "linearcurve"] {
        let content = format!("<shape type='{plugin}'><string name='filename' value='hair.txt'/></shape>");
        let folder = Folder::new().scene(&content);
        let path = folder.path().with_file_name("hair.txt");
        let options = LoadOptions { max_memory_bytes: 64 << 20, ..bare() };
        let mutated = |random: &mut Random| {
            let mut words: Vec<String> = FILE.split_inclusive(char::is_whitespace).map(String::from).collect();
            for _ in 0..random.below(4) {
                let at = random.below(words.len());
                let end = words[at].chars().last().unwrap_or(' ');
                words[at] = format!("{}{end}", NUMBERS[random.below(NUMBERS.len())]);
            }
            let mut file = words.concat().into_bytes();
            if random.below(2) == 0 {
                let at = random.below(file.len());
                damage(&mut file, at, random);
            }
            file
        };
        let load = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            let loaded = folder.load(&options);
            loaded.map(|loaded| loaded.scene.validate().unwrap()).is_ok()
        };
        let share = survive(plugin, 1500, mutated, load);
        assert!(share > 0.1 && share < 0.9, "{plugin}: {share}");
    }
}
