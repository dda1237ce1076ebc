//! The page of the manual about surfaces, lights, media and integrators: the heads of the files that implement them, with
//! pictures.

use std::{fmt::Write as _, fs, path::Path, process::Command};

use anyhow::{Context, Result, ensure};

use crate::bars::root;

/// The page, relative to the repository.
pub(super) const PAGE: &str = "docs/reference/models.md";
const SOURCES: &str = "crates/bottega-render/src";
const SCENES: &str = "scenes/models";
const PICTURES: &str = "docs/pictures/models";

/// A section of the page: its title, and its models.
type Section = (&'static str, &'static [ModelEntry]);

/// A model: its title, its source file, and its picture.
struct ModelEntry(&'static str, &'static str, Option<ModelPicture>);

/// A picture: its name, the scene's file, and options of `bottega render`.
struct ModelPicture(&'static str, &'static str, &'static [&'static str]);

impl ModelPicture {
    /// The picture of a model in its own scene, by path tracing.
    const fn of(name: &'static str, scene: &'static str) -> Option<Self> {
        Some(Self(name, scene, &[]))
    }

    /// The picture of a ball in a glTF file, below a sky.
    const fn ball(name: &'static str, scene: &'static str) -> Option<Self> {
        Some(Self(name, scene, &["--env", "0.35,0.42,0.55"]))
    }

    /// The goblets by an integrator, with few samples.
    const fn goblets(name: &'static str, integrator: &'static [&'static str]) -> Option<Self> {
        Some(Self(name, "../goblets.glb", integrator))
    }
}

const SECTIONS: &[Section] = &[
    (
        "Surfaces",
        &[
            ModelEntry("Matte", "bsdf/matte.rs", ModelPicture::of("matte", "matte.xml")),
            ModelEntry("Metal", "bsdf/conductor.rs", ModelPicture::of("conductor", "conductor.xml")),
            ModelEntry("Glass", "bsdf/dielectric.rs", ModelPicture::of("dielectric", "dielectric.xml")),
            ModelEntry("Plastic", "bsdf/plastic.rs", ModelPicture::of("plastic", "plastic.xml")),
            ModelEntry("Coated", "bsdf/coated.rs", ModelPicture::of("coated", "coated.pbrt")),
            ModelEntry("Varnish", "bsdf/varnish.rs", ModelPicture::of("varnish", "varnish.xml")),
            ModelEntry("Highlights of Phong and Ward", "bsdf/gloss.rs", ModelPicture::of("gloss", "gloss.xml")),
            ModelEntry("Measured materials", "bsdf/measured.rs", ModelPicture::of("measured", "measured.xml")),
            ModelEntry("Principled", "bsdf/principled.rs", ModelPicture::of("principled", "principled.xml")),
            ModelEntry("Hair", "bsdf/hair.rs", ModelPicture::of("hair", "hair.pbrt")),
            ModelEntry("The layered material of glTF", "bsdf/layered.rs", None),
            ModelEntry("Clear coat", "bsdf/coat.rs", ModelPicture::ball("coat", "coat.glb")),
            ModelEntry("Sheen", "bsdf/sheen.rs", ModelPicture::ball("sheen", "sheen.glb")),
            ModelEntry("Thin film", "bsdf/film.rs", ModelPicture::ball("film", "film.glb")),
        ],
    ),
    (
        "Lights",
        &[
            ModelEntry("Lights without extent", "lights/punctual.rs", ModelPicture::of("punctual", "punctual.xml")),
            ModelEntry("Light from infinity", "lights/sun.rs", None),
            ModelEntry("Emitting surfaces", "lights/surface.rs", ModelPicture::of("surface", "surface.xml")),
            ModelEntry("Emitting spheres", "lights/sphere.rs", ModelPicture::of("sphere", "sphere.xml")),
            ModelEntry("Environment", "lights/environment.rs", ModelPicture::of("environment", "environment.xml")),
        ],
    ),
    (
        "Media",
        &[
            ModelEntry("Participating media", "media.rs", ModelPicture::of("medium", "medium.xml")),
            ModelEntry("Media that vary in space", "media/varying.rs", None),
            ModelEntry("Phase function", "media/phase.rs", None),
        ],
    ),
    (
        "Integrators",
        &[
            ModelEntry("Path tracing", "integrator/path.rs", ModelPicture::goblets("path", &["--integrator", "path"])),
            ModelEntry("Path tracing through media", "integrator/volume.rs", None),
            ModelEntry(
                "Photon mapping",
                "integrator/photon.rs",
                ModelPicture::goblets("photon", &["--integrator", "photon"]),
            ),
            ModelEntry("Lighting agents", "ala/mod.rs", ModelPicture::goblets("ala", &["--integrator", "ala"])),
        ],
    ),
];

/// Returns the page's text, from the heads of the source files.
///
/// # Errors
/// A source file cannot be read.
pub(super) fn page() -> Result<String> {
    let mut page = String::from(
        "# Surfaces, lights, media, integrators\n\n\
         Each model with its parameters, units and source. This page is made from the heads of the source files by `cargo xtask manual`,\n\
         its pictures from `scenes/models` by `cargo xtask manual --pictures`: 128 × 112 pixels with 256 samples each, those of\n\
         integrators with 32. How files name these models: [Scenes and formats](../guides/scenes.md).\n",
    );
    for (title, models) in SECTIONS {
        write!(page, "\n## {title}\n")?;
        for ModelEntry(title, file, picture) in *models {
            let source =
                fs::read_to_string(root().join(SOURCES).join(file)).with_context(|| format!("cannot read {file}"))?;
            write!(page, "\n### {title}\n\n")?;
            if let Some(ModelPicture(name, ..)) = picture {
                write!(page, "![{title}](../pictures/models/{name}.png)\n\n")?;
            }
            writeln!(page, "{}\n\n[`{file}`](../../{SOURCES}/{file})", head(&source))?;
        }
    }
    Ok(page)
}

/// Returns the documentation at the head of a source file as Markdown: links to items become their names.
fn head(source: &str) -> String {
    let lines =
        source.lines().map_while(|line| line.strip_prefix("//!")).map(|line| line.strip_prefix(' ').unwrap_or(line));
    let mut text = lines.collect::<Vec<_>>().join("\n");
    // `[`Name`]` and `[`Name`](path)`: names are links in Rust's documentation alone.
    while let Some(at) = text.find("[`") {
        let Some(end) = text[at..].find("`]").map(|end| at + end) else { break };
        let name = text[at + 2..end].rsplit("::").next().unwrap_or_default().to_owned();
        let rest = end + 2;
        let target = text[rest..].starts_with('(').then(|| text[rest..].find(')')).flatten();
        text.replace_range(at..target.map_or(rest, |end| rest + end + 1), &format!("`{name}`"));
    }
    text
}

/// Renders the page's pictures with a program.
///
/// # Errors
/// A scene cannot be rendered.
pub(super) fn render_pictures(program: &Path) -> Result<()> {
    let folder = root().join(PICTURES);
    fs::create_dir_all(&folder)?;
    for ModelEntry(_, _, picture) in SECTIONS.iter().flat_map(|(_, models)| *models) {
        let Some(ModelPicture(name, scene, options)) = picture else { continue };
        let is_integrator = scene.starts_with("..");
        let (samples, more): (_, &[&str]) =
            if is_integrator { ("32", &["--env", "0.25,0.3,0.38"]) } else { ("256", &[]) };
        let mut render = Command::new(program);
        render.arg("render").arg(root().join(SCENES).join(scene)).arg("-o").arg(folder.join(format!("{name}.png")));
        render.args(["--size", "128x112", "--spp", samples, "--quiet"]).args(more).args(*options);
        ensure!(render.status().context("cannot start the program")?.success(), "{scene} cannot be rendered");
        println!("{PICTURES}/{name}.png");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_of_models_is_that_of_the_sources_and_its_pictures_are_there() {
        let page = page().expect("a page");
        assert!(fs::read_to_string(root().join(PAGE)).is_ok_and(|kept| kept == page), "run `cargo xtask manual`");
        for ModelEntry(title, _, picture) in SECTIONS.iter().flat_map(|(_, models)| *models) {
            let Some(ModelPicture(name, ..)) = picture else { continue };
            let path = root().join(PICTURES).join(format!("{name}.png"));
            assert!(path.is_file(), "{title} has no picture: run `cargo xtask manual --pictures`");
        }
    }

    #[test]
    fn a_model_says_its_parameters_or_its_source() {
        for ModelEntry(title, file, _) in SECTIONS.iter().flat_map(|(_, models)| *models) {
            let head = head(&fs::read_to_string(root().join(SOURCES).join(file)).expect("a source"));
            assert!(head.contains("Source"), "{title}: {head}");
        }
    }

    #[test]
    fn links_to_items_become_names() {
        assert_eq!(
            head("//! A [`Bsdf`](super::Bsdf) of\n//! [`bottega_scene::Scene`].\n\nuse x;"),
            "A `Bsdf` of\n`Scene`."
        );
    }
}
