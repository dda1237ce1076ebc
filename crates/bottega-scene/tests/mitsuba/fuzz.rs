//! Damaged scenes: an error or a scene, never a panic. `BOTTEGA_FUZZ` multiplies their number.

use bottega_scene::LoadOptions;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};

use crate::support::Folder;

const CORPUS: [&str; 5] = [
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
];

/// Words that hurt: in place of others, or between them.
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
    /// The value between two quotes.
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
    let folder = Folder::new()
        .with("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        .with("b.xml", "<scene version='3.0.0'><bsdf type='diffuse' id='m'/></scene>");
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
    let folder = Folder::new()
        .with("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        .with("b.xml", "<scene version='3.0.0'><bsdf type='diffuse' id='m'/></scene>");
    for text in CORPUS {
        std::fs::write(folder.path(), text).expect("the file of the test");
        folder.load(&LoadOptions::default()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    }
}
