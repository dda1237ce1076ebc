//! For any bytes the importer returns: it does not abort, hang, or exceed its memory limit.

use std::path::Path;

use bottega_scene::{LoadOptions, load};

use super::composition::zip;
use super::support::{Folder, TRIANGLE, scenes};
use crate::mutation::{Random, damage, survive};

/// A stage that uses most features of the importer.
fn rich() -> String {
    format!(
        "#usda 1.0\n(\n upAxis = \"Z\"\n defaultPrim = \"a\"\n)\n\
         def Material \"M\" {{ token outputs:surface.connect = </M/s.outputs:surface>\n\
         def Shader \"t\" {{ uniform token info:id = \"UsdUVTexture\"\nasset inputs:file = @a.png@\nfloat3 outputs:rgb }}\n\
         def Shader \"s\" {{ uniform token info:id = \"UsdPreviewSurface\"\ncolor3f inputs:diffuseColor.connect = </M/t.outputs:rgb> }} }}\n\
         def Mesh \"a\" {{ rel material:binding = </M>\n{TRIANGLE}\ndef GeomSubset \"g\" {{ int[] indices = [0] }} }}\n\
         def Mesh \"s\" {{ int[] faceVertexCounts = [4, 4, 3]\nint[] faceVertexIndices = [0, 1, 3, 2, 1, 5, 4, 3, 2, 3, 4]\n\
         point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (2, 2, 1), (2, 0, 1)]\nint[] holeIndices = [2]\n\
         int[] creaseIndices = [1, 3, 2]\nint[] creaseLengths = [3]\nfloat[] creaseSharpnesses = [2.5]\nint[] cornerIndices = [5]\n\
         float[] cornerSharpnesses = [10]\nuniform token interpolateBoundary = \"edgeOnly\"\n\
         color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0)] ( interpolation = \"faceVarying\" )\n\
         int[] primvars:displayColor:indices = [0, 1, 1, 0, 0, 0, 1, 1, 0, 1, 0] }}\n\
         def PointInstancer \"p\" {{ int[] protoIndices = [0, 0]\npoint3f[] positions = [(0, 0, 0), (1, 0, 0)]\nrel prototypes = </p/c>\ndef Cube \"c\" {{}} }}\n\
         def BasisCurves \"b\" {{ int[] curveVertexCounts = [4]\nfloat[] widths = [0.1]\npoint3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)] }}\n\
         def RectLight \"l\" {{ float inputs:intensity = .5\nbool inputs:normalize = 1 }}\ndef Camera \"e\" {{ float fStop = 2 }}\n\
         def Xform \"x\" ( references = </a> ) {{ double3 xformOp:translate.timeSamples = {{ 0: (0, 0, 0), 1: (1, 1, 1) }}\n\
         uniform token[] xformOpOrder = [\"xformOp:translate\"] }}\n"
    )
}

fn mutate(file: &[u8], random: &mut Random) -> Vec<u8> {
    let mut file = file.to_vec();
    for _ in 0..=random.below(3) {
        if !file.is_empty() {
            let at = random.below(file.len());
            damage(&mut file, at, random);
        }
    }
    file
}

fn check(folder: &Path, name: &str, count: u64, file: &[u8]) {
    let options = LoadOptions { max_memory_bytes: 64 << 20, max_image_pixels: 1 << 20, ..LoadOptions::default() };
    let path = folder.join(name);
    survive(
        name,
        count,
        |random| mutate(file, random),
        |bytes| {
            std::fs::write(&path, bytes).unwrap();
            load(&path, &options).is_ok()
        },
    );
}

#[test]
fn damaged_text_and_packages_are_survived() {
    let folder = Folder::new(&[]);
    check(&folder.path(""), "scene.usda", 300, rich().as_bytes());
    let package = zip(&[("root.usda", rich().as_bytes()), ("a.png", &crate::gltf::support::png(1, 1, &[[9; 4]]))]);
    check(&folder.path(""), "scene.usdz", 150, &package);
}

#[test]
fn damaged_binary_layers_are_survived() {
    let Some(scenes) = scenes("usd/tinyusdz") else { return };
    let folder = Folder::new(&[]);
    for (name, count) in [("cube-previewsurface.usdc", 300), ("blendshape.usdc", 100)] {
        check(&folder.path(""), name, count, &std::fs::read(scenes.join(name)).unwrap());
    }
}
